"""The feasible controls of a problem as flat lists, the form that compiled loops read.

Entry i of a list is one control at one step. The entries of step k that lead to mode m are
first[k, m] <= i < first[k, m + 1].
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hevopt.errors import InfeasibleError
from hevopt.problem._choices_kernels import undominated
from hevopt.problem.arrays import Array, Flags, Indices
from hevopt.problem.once import once
from hevopt.problem.problem import Problem
from hevopt.problem.switching import Number, Switching, switching_of


class State(NamedTuple):
    """Mode and stored energy before a step."""

    mode: int
    energy_j: float


class Choices(NamedTuple):
    """Feasible controls, by step and mode.

    first: (time, mode + 1) start of each block; its last column ends the step's block
    control: (entry,) column of the control table
    cost_kg, power_w: (entry,) cost without switching, battery power
    step_s: (time,)
    """

    first: Indices
    control: Indices
    cost_kg: Array
    power_w: Array
    step_s: Array
    switching: Switching

    @property
    def steps(self) -> int:
        """Number of steps."""
        return len(self.step_s)

    def spread(self, per_step: NDArray[Number]) -> NDArray[Number]:
        """(entry,) a value per step, repeated for each of the step's entries."""
        return np.repeat(per_step, self.first[:, -1] - self.first[:, 0])

    def part(self, begin: int, end: int) -> "Choices":
        """Those of the steps begin <= k < end."""
        low, high = self.first[begin, 0], self.first[end - 1, -1]
        return self._replace(
            first=self.first[begin:end] - low,
            control=self.control[low:high],
            cost_kg=self.cost_kg[low:high],
            power_w=self.power_w[low:high],
            step_s=self.step_s[begin:end],
            switching=self.switching.part(begin, end),
        )

    @property
    def modes(self) -> int:
        """Number of modes."""
        return int(self.switching.kg.shape[1])


@once
def choices_of(problem: Problem) -> Choices:
    """All feasible controls of a problem, by step, mode and column; all who ask share them."""
    if problem.origin is not problem:
        shared = choices_of(problem.origin)
        step = shared.spread(np.arange(shared.steps))
        return shared._replace(cost_kg=problem.cost_kg[step, shared.control])
    table = problem.table
    modes = table.modes
    columns = np.argsort(table.mode, kind="stable")
    step, position = np.nonzero(table.feasible[:, columns])
    control = columns[position]
    block = step * modes + table.mode[control]
    counts = np.bincount(block, minlength=len(table.time_s) * modes)
    ends = np.cumsum(counts).reshape(-1, modes)
    first = np.column_stack([ends[:, 0] - counts.reshape(-1, modes)[:, 0], ends])
    return Choices(
        first,
        control,
        problem.cost_kg[step, control],
        table.battery_power_w[step, control],
        table.step_s,
        switching_of(table),
    )


def require_choices(problem: Problem, choices: Choices, strategy: str) -> None:
    """InfeasibleError at the first step that has no usable control, for strategies that do not look ahead."""
    empty = choices.first[:, 0] == choices.first[:, -1]
    if empty.any():
        k = int(np.argmax(empty))
        raise InfeasibleError(
            f"{strategy}: at step {k} (t = {problem.table.time_s[k]:g} s) every control is rejected; see reject of "
            "the table"
        )


def require_entry(problem: Problem, entry: int, k: int, strategy: str) -> None:
    """InfeasibleError where a strategy that does not look ahead has no entry at step k, -1."""
    if entry < 0:
        raise InfeasibleError(
            f"{strategy}: at step {k} (t = {problem.table.time_s[k]:g} s) every usable control needs a forbidden "
            "switch, or more than the battery can deliver beyond its window; see switch_allowed of the table, or "
            "use dp, which plans for it"
        )


def kept(choices: Choices, mask: Flags) -> Choices:
    """The choices where an (entry,) mask holds."""
    before = np.concatenate([[0], np.cumsum(mask)])
    return choices._replace(
        first=before[choices.first],
        control=choices.control[mask],
        cost_kg=choices.cost_kg[mask],
        power_w=choices.power_w[mask],
    )


def by_power(choices: Choices) -> Choices:
    """The choices by rising battery power within each block; those that are so already as they are."""
    block = np.repeat(
        np.arange(choices.steps * choices.modes), np.diff(choices.first, axis=1).ravel()
    )
    falls = (np.diff(choices.power_w) < 0.0) & (np.diff(block) == 0)
    if not falls.any():
        return choices
    order = np.lexsort((choices.power_w, block))
    return choices._replace(
        control=choices.control[order],
        cost_kg=choices.cost_kg[order],
        power_w=choices.power_w[order],
    )


def without_dominated(choices: Choices) -> Choices:
    """The choices that no other of the same step and mode beats in both cost and battery power.

    Nothing is lost as long as more stored energy is never worse: true of every bound here, which lets charge
    be thrown away, and of a strategy except where a full battery forces it to charge less than it could.
    Of two powers the higher drains more at every state of charge, so power alone decides; a step need not leave
    the fuller of two charges the fuller, nothing rests on that.
    """
    best, first = undominated(choices.first, choices.cost_kg, choices.power_w)
    return choices._replace(
        first=first,
        control=choices.control[best],
        cost_kg=choices.cost_kg[best],
        power_w=choices.power_w[best],
    )


@once
def undominated_choices(problem: Problem) -> Choices:
    """Those of all feasible controls of a problem; all who ask share them."""
    return without_dominated(choices_of(problem))
