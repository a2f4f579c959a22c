"""Operating points apart from a cycle: gear, speed and torque at the wheels, each a row of a control table.

Who decides while driving looks up the row nearest to where the car is. The rows stand where a cycle's do: for each
of its gears an even grid over the speeds and torques that it asks for there, and a little beyond. A row's
acceleration is that of a level road, its switching that of its own mean speed, and no gear is changed in it.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from hevopt.car.architecture import Architecture
from hevopt.car.vehicle import tractive_force_n
from hevopt.display.facts import Shown
from hevopt.driving.demand import Demand
from hevopt.powertrain.powertrain import TORQUE_LEVELS, build_table
from hevopt.problem.arrays import Array
from hevopt.problem.dwell import with_dwell
from hevopt.problem.problem import Problem
from hevopt.problem.table import Signals

SPEED_STEP_MPS, TORQUE_STEP_NM = 1.0, 30.0
# Cells of the grid beyond what the cycle asks for in a gear.
_BEYOND = 2
_BROADEST = 400


class GearGrid(NamedTuple):
    """The rows of a gear: first one that stands, then speeds, the lowest first, each with all torques."""

    first: int
    speed_mps: float
    speeds: int
    torque_nm: float
    torques: int


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class OperatingPoints(Shown):
    """A problem whose steps are operating points, in no order; by_gear: gear -> its rows."""

    problem: Problem
    by_gear: dict[int, GearGrid]

    def row(self, gear: int, speed_mps: float, wheel_nm: float) -> int:
        """The row nearest to a gear, a speed and a torque; of the nearest gear where there is none of that gear."""
        grid = self.by_gear.get(gear)
        if grid is None:
            grid = self.by_gear[min(self.by_gear, key=lambda known: (abs(known - gear), known))]
        if speed_mps <= 0.0:
            return grid.first
        i = round((speed_mps - grid.speed_mps) / SPEED_STEP_MPS)
        j = round((wheel_nm - grid.torque_nm) / TORQUE_STEP_NM)
        i, j = min(max(i, 0), grid.speeds - 1), min(max(j, 0), grid.torques - 1)
        return grid.first + 1 + i * grid.torques + j


def points_of(car: Architecture, problem: Problem, levels: int = TORQUE_LEVELS) -> OperatingPoints:
    """Operating points where a problem of `build_problem` has its steps; each lasts as long as a step of that."""
    signals = problem.table.signals
    assert signals is not None  # build_problem gives them
    step_s = float(np.median(problem.table.step_s))
    grids, demand = _grids(car, signals, step_s)
    table = build_table(car, demand, levels=levels, allow_shortfall=True, apart=True)
    rows = Problem(
        table, problem.battery, problem.soc_start, problem.soc_end_min, 0, problem.nox_weight
    )
    return OperatingPoints(with_dwell(rows, car.engine.least_on_s, car.engine.least_off_s), grids)


def _grids(
    car: Architecture, signals: Signals, step_s: float
) -> tuple[dict[int, GearGrid], Demand]:
    moving = signals.speed_mps > 0
    gears = np.where(signals.gear > 0, signals.gear, 1) if car.gear == "cycle" else 1
    listed = np.broadcast_to(gears, signals.speed_mps.shape)
    radius = car.vehicle.tyre_radius_m
    wheel_nm = np.zeros_like(signals.speed_mps)
    np.divide(signals.wheel_power_w, signals.speed_mps / radius, out=wheel_nm, where=moving)
    grids: dict[int, GearGrid] = {}
    parts: list[tuple[Array, Array, int]] = []
    first = 0
    for gear in np.unique(listed[moving]) if moving.any() else [1]:
        here = moving & (listed == gear)
        speeds = _even(signals.speed_mps[here], SPEED_STEP_MPS)
        speeds = speeds[speeds > 0]
        torques = _even(wheel_nm[here], TORQUE_STEP_NM)
        grids[int(gear)] = GearGrid(
            first, float(speeds[0]), len(speeds), float(torques[0]), len(torques)
        )
        parts.append((speeds, torques, int(gear)))
        first += 1 + len(speeds) * len(torques)
    speed: Array = np.concatenate([np.append(0.0, np.repeat(s, len(t))) for s, t, _ in parts])
    torque: Array = np.concatenate([np.append(0.0, np.tile(t, len(s))) for s, t, _ in parts])
    gear = np.concatenate([np.append(0, np.full(len(s) * len(t), g)) for s, t, g in parts])
    force = torque / radius - tractive_force_n(
        car.vehicle, speed, np.zeros_like(speed), np.zeros_like(speed)
    )
    accel = np.where(speed > 0, force / car.vehicle.equivalent_mass_kg, 0.0)
    begins: Array = np.asarray(step_s * np.arange(len(speed)), dtype=np.float64)
    return grids, Demand(
        begins, np.full(len(speed), step_s), speed, torque, speed / radius, accel / radius,
        gear, np.zeros(len(speed), dtype=bool),
    )  # fmt: skip


def _even(values: Array, step: float) -> Array:
    """Multiples of a step from a little below the values to a little above them."""
    if not len(values):
        values = np.zeros(1)
    low, high = np.floor(values.min() / step) - _BEYOND, np.ceil(values.max() / step) + _BEYOND
    count = min(high - low, _BROADEST)
    grid: Array = step * (low + np.arange(count + 1))
    return grid
