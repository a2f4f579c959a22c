"""Operating points apart from a cycle: gear, speed and torque at the wheels, each a row of a control table.

Who decides while driving looks up the row nearest to where the car is. The rows stand where a cycle's do: for each
of its gears every point that it asks for, so that a cruise is met exactly, and an even grid around these. A row's
acceleration is that of a level road, its switching that of its own mean speed, and no gear is changed in it.
"""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from hevopt.car.architecture import Architecture
from hevopt.car.vehicle import tractive_force_n
from hevopt.display.facts import Shown
from hevopt.driving.demand import Demand
from hevopt.errors import InfeasibleError
from hevopt.powertrain._points_kernels import nearest
from hevopt.powertrain.branches import branches
from hevopt.powertrain.powertrain import TORQUE_LEVELS, build_table, lowered, stuck_steps
from hevopt.problem.arrays import Array
from hevopt.problem.dwell import with_dwell
from hevopt.problem.problem import Problem
from hevopt.problem.table import Signals

SPEED_STEP_MPS, TORQUE_STEP_NM = 1.0, 30.0
# Cells of the grid beyond what the cycle asks for in a gear.
_BEYOND = 2
_BROADEST = 400
_OF_A_ROW = (
    "step_s", "speed_mps", "wheel_torque_nm", "wheel_speed_radps", "wheel_accel_radps2", "gear", "clutch_open",
)  # fmt: skip


class GearRows(NamedTuple):
    """The rows of a gear: the first stands, the others are at these speeds and torques at the wheels, (row,)."""

    first: int
    speed_mps: Array
    wheel_nm: Array


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class OperatingPoints(Shown):
    """A problem whose steps are operating points, in no order; by_gear: gear -> its rows."""

    problem: Problem
    by_gear: dict[int, GearRows]

    def row(self, gear: int, speed_mps: float, wheel_nm: float) -> int:
        """The row nearest to a gear, a speed and a torque; of the nearest gear where there is none of that gear."""
        rows = self.by_gear.get(gear)
        if rows is None:
            rows = self.by_gear[min(self.by_gear, key=lambda known: (abs(known - gear), known))]
        if speed_mps <= 0.0:
            return rows.first
        cell = SPEED_STEP_MPS, TORQUE_STEP_NM
        return rows.first + 1 + nearest(rows.speed_mps, rows.wheel_nm, (speed_mps, wheel_nm), cell)


def points_of(car: Architecture, problem: Problem, levels: int = TORQUE_LEVELS) -> OperatingPoints:
    """Operating points where a problem of `build_problem` has its steps; each lasts as long as a step of that."""
    signals = problem.table.signals
    assert signals is not None  # build_problem gives them
    step_s = float(np.median(problem.table.step_s))
    by_gear, demand = _rows(car, signals, step_s)
    try:
        table = build_table(car, demand, levels=levels, allow_shortfall=True, apart=True)
    except InfeasibleError:
        by_gear, demand = _known(car, by_gear, demand, levels)
        table = build_table(car, demand, levels=levels, allow_shortfall=True, apart=True)
    rows = Problem(
        table, problem.battery, problem.soc_start, problem.soc_end_min, 0, problem.nox_weight
    )
    return OperatingPoints(with_dwell(rows, car.engine.least_on_s, car.engine.least_off_s), by_gear)


def _rows(car: Architecture, signals: Signals, step_s: float) -> tuple[dict[int, GearRows], Demand]:
    moving = signals.speed_mps > 0
    gears = np.where(signals.gear > 0, signals.gear, 1) if car.gear == "cycle" else 1
    listed = np.broadcast_to(gears, signals.speed_mps.shape)
    radius = car.vehicle.tyre_radius_m
    wheel_nm = np.zeros_like(signals.speed_mps)
    np.divide(signals.wheel_power_w, signals.speed_mps / radius, out=wheel_nm, where=moving)
    found: dict[int, GearRows] = {}
    first = 0
    for gear in np.unique(listed[moving]).tolist() if moving.any() else [1]:
        here = moving & (listed == gear)
        found[gear] = _of_gear(first, signals.speed_mps[here], wheel_nm[here])
        first += 1 + len(found[gear].speed_mps)
    speed: Array = np.concatenate([np.append(0.0, rows.speed_mps) for rows in found.values()])
    torque: Array = np.concatenate([np.append(0.0, rows.wheel_nm) for rows in found.values()])
    gear_of = [np.append(0, np.full(len(rows.speed_mps), g)) for g, rows in found.items()]
    level = np.zeros_like(speed)
    force = torque / radius - tractive_force_n(car.vehicle, speed, level, level)
    accel = np.where(speed > 0, force / car.vehicle.equivalent_mass_kg, 0.0)
    begins: Array = np.asarray(step_s * np.arange(len(speed)), dtype=np.float64)
    return found, Demand(
        begins, np.full(len(speed), step_s), speed, torque, speed / radius, accel / radius,
        np.concatenate(gear_of), np.zeros(len(speed), dtype=bool),
    )  # fmt: skip


def _known(
    car: Architecture, by_gear: dict[int, GearRows], demand: Demand, levels: int
) -> tuple[dict[int, GearRows], Demand]:
    """The rows that have a control: a grid's end may be faster than a part turns."""
    _, found, _ = lowered(car, demand, branches(car, demand, levels, None), levels)
    stuck = stuck_steps(found)
    rows, kept, first = {}, [], 0
    for gear, of in by_gear.items():
        moving = of.first + 1 + np.arange(len(of.speed_mps))
        known = ~stuck[moving]
        rows[gear] = GearRows(first, of.speed_mps[known], of.wheel_nm[known])
        kept.append(np.append(of.first, moving[known]))
        first += len(kept[-1])
    left = np.concatenate(kept)
    begins = demand.time_s[: len(left)]
    arrays = {name: getattr(demand, name)[left] for name in _OF_A_ROW}
    return rows, replace(demand, time_s=begins, **arrays)


def _of_gear(first: int, speed_mps: Array, wheel_nm: Array) -> GearRows:
    """Each point of a cycle in a gear once, then the grid around them."""
    own = np.unique(np.round(np.stack([speed_mps, wheel_nm]), 6), axis=1)
    speeds, torques = _even(speed_mps, SPEED_STEP_MPS), _even(wheel_nm, TORQUE_STEP_NM)
    speeds = speeds[speeds > 0]
    return GearRows(
        first,
        np.concatenate([own[0], np.repeat(speeds, len(torques))]),
        np.concatenate([own[1], np.tile(torques, len(speeds))]),
    )


def _even(values: Array, step: float) -> Array:
    """Multiples of a step from a little below the values to a little above them."""
    if not len(values):
        values = np.zeros(1)
    low, high = np.floor(values.min() / step) - _BEYOND, np.ceil(values.max() / step) + _BEYOND
    count = min(high - low, _BROADEST)
    grid: Array = step * (low + np.arange(count + 1))
    return grid
