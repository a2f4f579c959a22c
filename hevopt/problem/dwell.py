"""Dwell: the engine stays on, once started, and off, once stopped, for some time at least.

How long it has been so becomes part of the mode: a mode m becomes the modes (m, 1), (m, 2) ... (m, A), the last one
standing for A steps or more, by when it may be left. Going on leads from (m, a) to (n, min(a + 1, A)), starting
and stopping to (n, 1); nothing else is allowed. Every control stands once for each age, at the same cost: whoever
keeps to the table's switches keeps the dwell, be it a strategy, a bound or `simulate`, and nobody needs to know.
"""

from collections.abc import Iterator, Mapping
from dataclasses import replace

import numpy as np

from hevopt.errors import DataError
from hevopt.problem.arrays import Array, Flags, Indices
from hevopt.problem.cells import SplitCells, TableFigures
from hevopt.problem.flows import Flows
from hevopt.problem.given import MODES_MAX
from hevopt.problem.problem import Problem
from hevopt.problem.table import ControlTable

# A dwell is over when no more than this share of it is missing.
_ROUNDING = 1e-9


class RepeatedFlows(Flows):
    """Flows of controls that stand several times; columns: (control,) the one that each repeats."""

    __slots__ = ("columns", "flows")

    def __init__(self, flows: Flows, columns: Indices) -> None:
        self.flows, self.columns = flows, columns

    def __getitem__(self, name: str) -> Array:
        return self.flows[name][:, self.columns]

    def __iter__(self) -> Iterator[str]:
        return iter(self.flows)

    def __len__(self) -> int:
        return len(self.flows)

    def along(self, control: Indices) -> dict[str, Array]:
        return self.flows.along(self.columns[control])

    def cells(self, figures: TableFigures, *, nox: bool = True) -> SplitCells | None:
        times = np.bincount(self.columns)
        first = np.cumsum(times) - times
        found = self.flows.cells(figures.columns(first), nox=nox)
        return None if found is None else found.repeated(first, times)


def with_dwell(problem: Problem, least_on_s: float, least_off_s: float) -> Problem:
    """The problem under a least time on and off of the engine; before the first step no dwell is under way.

    Its table has a control for each control of the problem's and each age of its mode. A start mode that no control
    leads to counts as off. Raises DataError where a mode has controls with the engine on and off.
    """
    for name, asked_s in (("least_on_s", least_on_s), ("least_off_s", least_off_s)):
        if not 0 <= asked_s < np.inf:
            raise DataError(f"{name} {asked_s:g}; allowed: 0 s or more")
    table = problem.table
    turning = _turning(table)
    ages = np.where(turning, _ages(table, least_on_s), _ages(table, least_off_s))
    if ages.max() == 1:
        return problem
    if ages.sum() > MODES_MAX:
        raise DataError(
            f"a dwell of {least_on_s:g} s on and {least_off_s:g} s off makes {ages.sum()} modes of {table.modes}; "
            f"allowed: {MODES_MAX}; ask for less, or for longer steps"
        )
    first = np.cumsum(ages) - ages
    base = np.repeat(np.arange(table.modes), ages)
    columns = np.repeat(np.arange(len(table.mode)), ages[table.mode])
    repeats = np.arange(len(columns)) - np.searchsorted(columns, columns)
    least_s = np.where(turning, least_on_s, least_off_s)
    allowed = table.switch_allowed[..., base[:, None], base] & _kept(
        table, least_s[base], np.arange(len(base)) - first[base] + 1, ages[base], turning[base]
    )
    dwelling = replace(
        table,
        fuel_kg=table.fuel_kg[:, columns],
        nox_kg=table.nox_kg[:, columns],
        battery_power_w=table.battery_power_w[:, columns],
        reject=table.reject[:, columns],
        mode=first[table.mode[columns]] + repeats,
        switch_fuel_kg=table.switch_fuel_kg[..., base[:, None], base],
        switch_energy_j=table.switch_energy_j[..., base[:, None], base],
        switch_allowed=allowed,
        controls=tuple(table.controls[c] for c in columns),
        flows=_repeated(table.flows, columns),
    )
    start_mode = int(first[problem.start_mode] + ages[problem.start_mode] - 1)
    return replace(problem, table=dwelling, start_mode=start_mode)


def _repeated(flows: Mapping[str, Array], columns: Indices) -> Mapping[str, Array]:
    return RepeatedFlows(flows, columns) if isinstance(flows, Flows) else flows


def _turning(table: ControlTable) -> Flags:
    """(mode,) whether the engine turns; a mode that no control leads to counts as at rest."""
    on = np.array([control.engine_on for control in table.controls])
    turning = np.zeros(table.modes, dtype=bool)
    turning[table.mode[on]] = True
    if turning[table.mode[~on]].any():
        mixed = table.mode[~on][turning[table.mode[~on]]][0]
        raise DataError(
            f"dwell: mode {mixed} has controls with the engine on and off; give them modes of their own"
        )
    return turning


def _ages(table: ControlTable, least_s: float) -> int:
    """Steps, as few as possible, of which any as many in a row last long enough; at most all of them."""
    ends = np.append(table.time_s, table.time_s[-1] + table.step_s[-1])
    steps = len(table.step_s)
    low, high = 1, steps
    while low < high:
        middle = (low + high) // 2
        lasted = (ends[middle:] - ends[:-middle]).min() >= least_s * (1 - _ROUNDING)
        low, high = (low, middle) if lasted else (middle + 1, high)
    return low


def _kept(
    table: ControlTable, least_s: Array, age: Indices, ages: Indices, turning: Flags
) -> Flags:
    """(mode, mode) or (time, mode, mode) switches that keep the dwell, of modes by their ages, all (mode,)."""
    begun = np.arange(len(table.time_s))[:, None] - age
    lasted = table.time_s[:, None] - table.time_s[np.maximum(begun, 0)]
    over = (age == ages) | ((begun >= 0) & (lasted >= least_s * (1 - _ROUNDING)))
    going_on = age == np.minimum(age + 1, ages)[:, None]
    same = turning == turning[:, None]
    if (over == over[0]).all():
        over = over[:1]
    allowed: Flags = np.where(same, going_on, over[:, :, None] & (age == 1))
    return allowed if len(over) > 1 else allowed[0]
