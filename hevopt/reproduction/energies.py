"""Where the energy of a car goes over the cycle, from the wheels to the fuel, starts and end charge included."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hevopt.bounds.prices import one_price_dual
from hevopt.problem.simulation import simulate
from hevopt.reproduction.variations import Varied, signals_of
from hevopt.strategies import strategy_named
from hevopt.studies.case import litres


class Balance(NamedTuple):
    """Energies of a car over the cycle, kJ/km; the engine's mean efficiency while it burns; fuel as elsewhere.

    recovered: taken by the battery at its terminals while the wheels brake; idle_fuel: burnt while the car stands
    running_fuel: all that the engine burns once it turns, idling included; start_fuel: of its starts
    end_charge: what the end charge above the start's is worth in fuel
    fuel_l_per_100km: running and start fuel less that, the charge-corrected fuel of the rows
    """

    traction: float
    braking: float
    recovered: float
    engine_work: float
    engine_drag: float
    idle_fuel: float
    running_fuel: float
    start_fuel: float
    end_charge: float
    engine_efficiency_percent: float
    fuel_l_per_100km: float


def balance(shipped: Varied, rule: str) -> Balance:
    """The energies of a car under a rule."""
    car, cycle, problem, _ = shipped
    trajectory = simulate(problem, strategy_named(rule).solve(problem).control)
    flows, table = trajectory.flows, problem.table
    wheel_w, fuel_w = flows["wheel_power_w"], flows["fuel_power_w"]
    engine_w = flows["engine_torque_nm"] * flows["engine_speed_radps"]
    fired, standing = fuel_w > 0, signals_of(problem).speed_mps == 0

    def sum_of(power_w: NDArray[np.float64]) -> float:
        return float(np.sum(power_w * table.step_s)) / cycle.distance_m

    def burnt(fuel_kg: float) -> float:
        return fuel_kg * car.engine.heating_value_jpkg / cycle.distance_m

    work, running = sum_of(np.where(fired, np.maximum(engine_w, 0), 0)), sum_of(fuel_w)
    worth_kg = one_price_dual(problem)[-1].price_kgpj * (trajectory.end_j - problem.end_min_j)
    fuel_kg = trajectory.total_fuel_kg - worth_kg
    return Balance(
        traction=sum_of(np.maximum(wheel_w, 0)),
        braking=sum_of(np.maximum(-wheel_w, 0)),
        recovered=sum_of(np.where(wheel_w < 0, np.maximum(-trajectory.battery_power_w, 0), 0)),
        engine_work=work,
        engine_drag=sum_of(np.where(fired, 0, -engine_w)),
        idle_fuel=sum_of(np.where(standing, fuel_w, 0)),
        running_fuel=running,
        start_fuel=burnt(trajectory.total_fuel_kg) - running,
        end_charge=burnt(worth_kg),
        engine_efficiency_percent=100 * work / running,
        fuel_l_per_100km=litres(car, cycle, fuel_kg),
    )
