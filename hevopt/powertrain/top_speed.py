"""How fast a car's parts let it go: the highest speed at which it has a control at all, with whatever torque."""

import numpy as np

from hevopt.car.architecture import Architecture
from hevopt.car.vehicle import tractive_force_n
from hevopt.driving.demand import Demand
from hevopt.powertrain.branches import branches
from hevopt.powertrain.powertrain import lowered, stuck_steps
from hevopt.problem.arrays import Array, Flags

_STEP_MPS = 0.25
_LEVELS = 3


def top_speed_mps(car: Architecture, up_to_mps: float) -> float:
    """Highest speed, no more than one asked about, at which engine and machines turn within their limits.

    In the highest gear, on a level road, with what torque there is: more speed is no question of power. An engine
    turns, as a battery alone does not last. 0 where no speed has a control.
    """
    if _turns(car, np.array([up_to_mps])).all():
        return up_to_mps
    count = max(int(np.ceil(up_to_mps / _STEP_MPS)), 1)
    speed = up_to_mps * np.arange(1, count + 1) / count
    driven = np.flatnonzero(_turns(car, speed))
    return float(speed[driven[-1]]) if len(driven) else 0.0


def _turns(car: Architecture, speed_mps: Array) -> Flags:
    """(speed,) whether the car has a control there."""
    count = len(speed_mps)
    level, radius = np.zeros(count), car.vehicle.tyre_radius_m
    gear = 0 if car.gearbox is None else len(car.gearbox.ratios) - 1
    demand = Demand(
        np.arange(count, dtype=np.float64), np.ones(count), speed_mps,
        tractive_force_n(car.vehicle, speed_mps, level, level) * radius, speed_mps / radius, level,
        np.full(count, gear), np.zeros(count, dtype=bool),
    )  # fmt: skip
    found = branches(car, demand, _LEVELS, None)
    if stuck_steps(found).any():
        _, found, _ = lowered(car, demand, found, _LEVELS)
    turning = [branch for branch in found if branch.driven.state.engine_on or car.electric]
    return ~stuck_steps(turning)
