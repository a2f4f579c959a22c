"""Whether decisions are causal: the future is changed, and they must stay.

The rows of the table that a strategy must not know are replaced by its hardest row, the one that asks most of the
battery, and once more by its gentlest. A policy is driven through a table of such rows, in which each true row
appears when it may be known and not before: every decision is checked. A function that plans the whole problem is
asked again with all rows after a step replaced, for a few steps. Whoever passes has shown nothing of the future; a
plan made for this very cycle and written into a policy cannot be told from a rule by any such check.
"""

from collections.abc import Callable, Iterator
from dataclasses import fields
from typing import Any, NamedTuple

import numpy as np

from hevopt.errors import comes_from_interrupt
from hevopt.problem.arrays import Indices
from hevopt.problem.problem import Problem
from hevopt.problem.rows import with_rows
from hevopt.strategies.policy import Declared, asked_of, asking
from hevopt.strategies.stepper import driven
from hevopt.strategies.stepwise import AskedRule

_CUTS = 8


def peeks(problem: Problem, control: Indices, function: Callable[..., Any]) -> str | None:
    """Why decisions, (time,), of a policy or a function from Problem are not causal; None for no sign of it."""
    asked = asked_of(function)
    if asked is None:
        return _whole_plan_peeks(problem, control, function)
    if asked.preview and asked.preview >= len(control) - 1:
        return f"its preview of {asked.preview} steps shows the whole drive of {len(control)}"
    for row in _strange_rows(problem):
        found = _policy_peeks(problem, control, function, asked, row)
        if found is not None:
            return found
    return None


class _Otherwise(Exception):
    """A decision is another than before; step: which one."""

    def __init__(self, step: int) -> None:
        self.step = step


class _Unfolding(NamedTuple):
    """A problem whose rows appear one by one. hidden: array that the problem shows -> the true one"""

    problem: Problem
    hidden: list[tuple[Any, Any]]

    def show(self, k: int) -> None:
        """Make row k the true one."""
        for shown, true in self.hidden:
            shown[k] = true[k]


def _unfolding(problem: Problem, row: int) -> _Unfolding:
    """A problem of one row over and over, ready to show the others."""
    folded = with_rows(problem, np.full(len(problem.table.time_s), row))
    hidden = []
    places: list[tuple[Any, Any]] = [(folded.table, problem.table), (folded, problem)]
    if problem.table.signals is not None:
        places.append((folded.table.signals, problem.table.signals))
    for place, true in places:
        for part in fields(place):
            values = getattr(place, part.name)
            if isinstance(values, np.ndarray) and part.name not in ("time_s", "step_s", "mode"):
                if values.ndim > 2 or not part.name.startswith("switch_"):
                    own = values.copy()
                    seen = own.view()
                    seen.flags.writeable = False
                    object.__setattr__(place, part.name, seen)
                    hidden.append((own, getattr(true, part.name)))
    return _Unfolding(folded, hidden)


class _Shown:
    """A policy as a stepper that is shown the table row by row, and must decide as before."""

    def __init__(self, folded: _Unfolding, rule: AskedRule, control: Indices) -> None:
        self.folded, self.rule, self.control = folded, rule, control
        for k in range(rule.preview):
            folded.show(k)

    def decide(self, k: int, energy_j: float, mode: int) -> int:
        self.folded.show(k + self.rule.preview)
        chosen = self.rule.decide(k, energy_j, mode)
        if chosen != self.control[k]:
            raise _Otherwise(k)
        return chosen


def _policy_peeks(
    problem: Problem, control: Indices, function: Callable[..., Any], asked: Declared, row: int
) -> str | None:
    """What shows that a policy knows the rows after its preview: one row of the table takes the place of these."""
    folded, steps = _unfolding(problem, row), len(control) - 1 - asked.preview
    try:
        rule = asking(folded.problem, function, asked)
        driven(folded.problem, _Shown(folded, rule, control), steps)
    except _Otherwise as other:
        step = other.step
        return _said(
            problem, control, step, asked.preview, lambda: _again(problem, function, asked, step)
        )
    except Exception as error:
        if comes_from_interrupt(error):
            raise
        return f"it raises {type(error).__name__} once what it may not know is changed"
    return None


def _again(problem: Problem, function: Callable[..., Any], asked: Declared, step: int) -> Indices:
    return driven(problem, asking(problem, function, asked), step + 1)[0]


def _whole_plan_peeks(
    problem: Problem, control: Indices, function: Callable[..., Any]
) -> str | None:
    failures = []
    for k, row in _cuts(problem):
        order = np.arange(len(control))
        order[k + 1 :] = row
        try:
            decided = _plan(function, with_rows(problem, order))
        except Exception as error:
            if comes_from_interrupt(error):
                raise
            failures.append(type(error).__name__)
            continue
        if decided.shape == control.shape and (decided[: k + 1] != control[: k + 1]).any():
            step = int(np.argmax(decided != control))
            return _said(problem, control, step, k - step, lambda: _plan(function, problem))
    if len(failures) == 2 * _CUTS:
        return f"it could not be checked: it fails wherever the future is changed ({failures[0]})"
    return None


def _plan(function: Callable[..., Any], problem: Problem) -> Indices:
    found = function(problem)
    return np.asarray(getattr(found, "control", found))


def _said(
    problem: Problem, control: Indices, step: int, ahead: int, again: Callable[[], Indices]
) -> str:
    """What a decision that changed shows, told apart from one that is another at every turn."""
    where = f"at step {step} (t = {problem.table.time_s[step]:g} s) it decides otherwise"
    try:
        same = np.array_equal(again()[: step + 1], control[: step + 1])
    except Exception as error:
        if comes_from_interrupt(error):
            raise
        same = False
    if not same:
        return f"{where} when it is asked the same again"
    return f"{where} once what comes after step {step + ahead} is changed"


def _cuts(problem: Problem) -> Iterator[tuple[int, int]]:
    """Steps, the one of each part of the drive where there is most to choose from, with either strange row."""
    choices = problem.table.feasible.sum(axis=1)
    for part in np.array_split(np.arange(len(choices) - 1), _CUTS):
        for row in _strange_rows(problem) if len(part) else ():
            yield int(part[np.argmax(choices[part])]), row


def _strange_rows(problem: Problem) -> tuple[int, int]:
    """The rows of most and of least battery power, on average over their usable controls."""
    table = problem.table
    power_w = np.where(table.feasible, table.battery_power_w, 0.0).sum(axis=1)
    power_w = power_w / np.maximum(table.feasible.sum(axis=1), 1)
    return int(np.argmax(power_w)), int(np.argmin(power_w))
