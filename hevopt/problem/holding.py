"""Rows that keep the engine as it is: every step of a problem once more, its engine neither started nor stopped.

Who decides faster than an engine is to start and stop asks for row k where it may choose freely, and for row
steps + k while the engine has to stay on, or off: starting and stopping are forbidden switches there.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from hevopt.problem.arrays import Array, Flags
from hevopt.problem.problem import Problem
from hevopt.problem.switching import Number
from hevopt.problem.table import Signals


def turning_modes(problem: Problem) -> Flags:
    """(mode,) whether the engine turns in a mode."""
    table = problem.table
    turning = np.zeros(table.modes, dtype=bool)
    turning[table.mode[np.array([control.engine_on for control in table.controls])]] = True
    return turning


def with_holding(problem: Problem) -> Problem:
    """The problem with every step twice, in the second half without starts and stops; its table has no flows."""
    table, turning = problem.table, turning_modes(problem)
    steps = len(table.step_s)
    allowed = np.broadcast_to(table.switch_allowed, (steps, table.modes, table.modes))
    same = turning[:, None] == turning
    held = replace(
        table,
        time_s=np.concatenate([[0.0], np.cumsum(_twice(table.step_s))[:-1]]),
        step_s=_twice(table.step_s),
        fuel_kg=_twice(table.fuel_kg),
        nox_kg=_twice(table.nox_kg),
        battery_power_w=_twice(table.battery_power_w),
        reject=_twice(table.reject),
        switch_fuel_kg=_switches_twice(table.switch_fuel_kg),
        switch_energy_j=_switches_twice(table.switch_energy_j),
        switch_allowed=np.concatenate([allowed, allowed & same]),
        signals=None if table.signals is None else _signals_twice(table.signals),
        flows={},
        missing_torque_nm=None,
    )
    return replace(problem, table=held)


def _twice(values: NDArray[Number]) -> NDArray[Number]:
    return np.concatenate([values, values])


def _switches_twice(matrix: Array) -> Array:
    return matrix if matrix.ndim == 2 else _twice(matrix)


def _signals_twice(signals: Signals) -> Signals:
    return Signals(
        _twice(signals.speed_mps),
        _twice(signals.wheel_power_w),
        _twice(signals.gear),
        _twice(signals.clutch_open),
    )
