"""The fuel that it takes a car's own engine to store a joule, before any cycle is known.

An engine of free speed that is to give more runs more often at its best: a joule at the battery takes
1 / (heating value x best efficiency x efficiency on the way). Where the engine reaches the wheels by way of its
generator alone, both count together, at the best point of the two; else the machine has the usual one.
"""

import numpy as np

from hevopt.car.architecture import Architecture
from hevopt.car.machine import Machine
from hevopt.problem.problem import MACHINE_EFFICIENCY

_SPEEDS, _TORQUES = 101, 100


def storing_kgpj(car: Architecture) -> float | None:
    """kg of fuel per joule at the battery's terminals; None without an engine of free speed."""
    line, engine = car.driveline, car.engine
    if not line.free_engine_speed:
        return None
    placed = zip(line.machines, car.machines, strict=True)
    generators = [machine for (_, shaft), machine in placed if shaft == line.engine]
    if generators and not line.engine_reaches_wheels:
        efficiency = max(_generating(car, machine) for machine in generators)
    else:
        efficiency = _usual(car)
    return 1.0 / (engine.heating_value_jpkg * efficiency)


def _usual(car: Architecture) -> float:
    converted = 1.0 if car.converter is None else float(car.converter.efficiency.max())
    return car.engine.best_efficiency * MACHINE_EFFICIENCY * converted


def _generating(car: Architecture, machine: Machine) -> float:
    """The highest efficiency from fuel to the battery by way of a machine on the engine's shaft, from a grid."""
    engine = car.engine
    highest = min(engine.speed_max_radps, machine.speed_max_radps)
    speed = np.linspace(engine.full_load_speed_radps[0], highest, _SPEEDS)[:, None]
    torque = engine.full_load_nm(speed) * np.linspace(1 / _TORQUES, 1.0, _TORQUES)
    fuel_w = engine.heating_value_jpkg * engine.fuel_kgps(torque, speed)
    made_w = -car.terminal_w(machine.loss_w(-torque, speed) - torque * speed)
    known = (fuel_w > 0) & (made_w > 0) & (torque <= machine.limit_nm(speed))
    shares = np.where(known, made_w, 0.0) / np.where(known, fuel_w, 1.0)
    # Where the generator is too small for any of these points, the engine's best, as of other cars.
    return float(shares.max()) or _usual(car)
