"""A causal strategy as a stepper, asked for one control after the other; and the one loop that drives it.

Whoever drives it tells it what is stored: the loop below by the problem's battery, another simulation by its own.
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from hevopt.display.facts import Shown
from hevopt.problem.arrays import Indices
from hevopt.problem.problem import Problem
from hevopt.problem.switching import at_step


class Stepper(Protocol):
    """A strategy on its way through a problem, remembering what it has seen; `start` of a `Strategy` makes one."""

    def decide(self, k: int, energy_j: float, mode: int) -> int:
        """Index of the control that step k takes; steps are asked for once each, in order.

        energy_j, mode: stored energy and mode before the step. Raises InfeasibleError where no control is left.
        """


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Prescribed(Shown):
    """A stepper whose control depends on the step alone, each found from its own row; control: (time,)."""

    control: Indices

    def decide(self, k: int, energy_j: float, mode: int) -> int:
        """Index of the control at step k, whatever is stored."""
        return int(self.control[k])


def driven(problem: Problem, stepper: Stepper, steps: int | None = None) -> tuple[Indices, float]:
    """(time,) controls of a stepper that drives the problem, or its first steps, and the stored energy left."""
    table = problem.table
    control = np.empty(len(table.time_s) if steps is None else steps, dtype=np.int64)
    energy_j, mode = problem.start_j, problem.start_mode
    for k in range(len(control)):
        control[k] = stepper.decide(k, energy_j, mode)
        energy_j, mode = stepped(problem, k, energy_j, mode, int(control[k]))
    return control, energy_j


def stepped(
    problem: Problem, k: int, energy_j: float, mode: int, control: int
) -> tuple[float, int]:
    """Stored energy and mode after a control at step k; energy_j, mode: those before it."""
    from hevopt.problem._battery_kernels import chemical_power_at

    table, battery = problem.table, problem.battery.arrays
    after = int(table.mode[control])
    between_j = energy_j - float(at_step(table.switch_energy_j, k)[mode, after])
    power_w, step_s = float(table.battery_power_w[k, control]), float(table.step_s[k])
    return between_j - step_s * chemical_power_at(power_w, between_j, battery), after
