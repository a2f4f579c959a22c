"""A problem of other rows: the next ones alone, or some rows in the place of others."""

from dataclasses import fields, replace

import numpy as np

from hevopt.problem import battery as battery_model
from hevopt.problem.arrays import Indices
from hevopt.problem.problem import Problem
from hevopt.problem.table import ControlTable, Signals


def rows_ahead(problem: Problem, begin: int, end: int, energy_j: float, mode: int) -> Problem:
    """The steps begin <= k < end as a problem of their own, from a stored energy and a mode before them.

    Its table has no flows. What is left at its end is free within the window, so that any plan may end there.
    """
    pack = problem.battery
    soc = float(np.clip(battery_model.soc(pack, energy_j), pack.soc_min, pack.soc_max))
    steps = np.arange(begin, end)
    return replace(
        problem,
        table=_rows(problem.table, steps, steps),
        soc_start=soc,
        soc_end_min=pack.soc_min,
        start_mode=mode,
    )


def with_rows(problem: Problem, order: Indices) -> Problem:
    """The problem with row order[k] of its table at step k, times as they are; (time,). Its table has no flows."""
    steps = np.arange(len(problem.table.time_s))
    return replace(problem, table=_rows(problem.table, order, steps))


def _rows(table: ControlTable, order: Indices, steps: Indices) -> ControlTable:
    """Rows of a table in an order, at the times of some steps."""
    signals = table.signals
    if signals is not None:
        signals = Signals(*(getattr(signals, part.name)[order] for part in fields(signals)))
    missing = table.missing_torque_nm
    per_step = ("switch_fuel_kg", "switch_allowed", "switch_energy_j")
    switching = {name: getattr(table, name) for name in per_step}
    return replace(
        table,
        time_s=table.time_s[steps],
        step_s=table.step_s[steps],
        fuel_kg=table.fuel_kg[order],
        nox_kg=table.nox_kg[order],
        battery_power_w=table.battery_power_w[order],
        reject=table.reject[order],
        **{name: m if m.ndim == 2 else m[order] for name, m in switching.items()},
        signals=signals,
        flows={},
        missing_torque_nm=None if missing is None else missing[order],
    )
