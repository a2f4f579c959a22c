"""The feasible controls of a problem as flat lists, the form that compiled loops read.

Entry i of a list is one control at one step. The entries of step k that lead to mode m are
first[k, m] <= i < first[k, m + 1].
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hevopt._choices_kernels import undominated
from hevopt.problem import Problem

Array = NDArray[np.float64]


class Choices(NamedTuple):
    """Feasible controls, by step and mode.

    first: (time, mode + 1) start of each block; its last column ends the step's block
    control: (entry,) column of the control table
    cost_kg, power_w: (entry,) cost without switching, battery power
    step_s: (time,); switch_kg, switch_allowed: (mode, mode) [from, to]
    """

    first: NDArray[np.int64]
    control: NDArray[np.int64]
    cost_kg: Array
    power_w: Array
    step_s: Array
    switch_kg: Array
    switch_allowed: NDArray[np.bool_]

    @property
    def steps(self) -> int:
        """Number of steps."""
        return len(self.step_s)

    def spread(self, per_step: NDArray) -> NDArray:
        """(entry,) a value per step, repeated for each of the step's entries."""
        return np.repeat(per_step, self.first[:, -1] - self.first[:, 0])

    @property
    def modes(self) -> int:
        """Number of modes."""
        return len(self.switch_kg)


def choices_of(problem: Problem) -> Choices:
    """All feasible controls of a problem, by step, mode and column."""
    table = problem.table
    modes = len(table.switch_fuel_kg)
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
        table.switch_fuel_kg,
        table.switch_allowed,
    )


def without_dominated(choices: Choices) -> Choices:
    """The choices that no other of the same step and mode beats in both cost and battery power.

    Nothing is lost as long as more stored energy is never worse: true of every bound here, which lets charge
    be thrown away, and of a strategy except where a full battery forces it to charge less than it could.
    Stored energy falls with battery power at every state of charge, so power alone decides.
    """
    kept, first = undominated(choices.first, choices.cost_kg, choices.power_w)
    return choices._replace(
        first=first,
        control=choices.control[kept],
        cost_kg=choices.cost_kg[kept],
        power_w=choices.power_w[kept],
    )
