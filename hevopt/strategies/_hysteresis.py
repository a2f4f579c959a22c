"""What rules share that start the engine above a power and stop it below another: calibration, and the stepper."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from hevopt.errors import InfeasibleError
from hevopt.problem.arrays import Array
from hevopt.problem.problem import Plan, Problem
from hevopt.strategies import _hysteresis_kernels as kernels
from hevopt.strategies._rule_kernels import at_rest
from hevopt.strategies._rules import Rules, corrected_kg, eligible, rules_of


class HysteresisStepper:
    """A rule on its way: whether it holds the engine on is all that it remembers.

    rules: of the problem that it drives; limits: (4,) see `entry_asked`; notes: what its plan tells
    """

    def __init__(
        self, rules: Rules, rule: kernels.HysteresisRule, limits: Array, notes: Mapping[str, Any]
    ) -> None:
        self.rules, self.rule, self.limits, self.notes = rules, rule, limits, notes
        self._on = False

    def decide(self, k: int, energy_j: float, mode: int) -> int:
        """Index of the control that the rule takes at step k."""
        choices = self.rules.choices
        entry, self._on = kernels.entry_asked(
            self.rule, self.limits, k, energy_j, mode, self._on, choices
        )
        return int(choices.control[entry])

    def on(
        self, points: Problem, rule_of: Callable[[Rules], kernels.HysteresisRule]
    ) -> "HysteresisStepper":
        """The same limits on operating points, whose rule is made anew: any of them, however often."""
        rules = rules_of(points, self.rules)
        return HysteresisStepper(rules, rule_of(rules), self.limits, self.notes)

    def plan(self) -> Plan:
        """What it does on its own problem from start to end."""
        rules, battery = self.rules, self.rules.problem.battery.arrays
        driven = at_rest(rules.choices.steps, rules.span.start)
        kernels.drive(self.rule, self.limits, rules.choices, battery, driven)
        return Plan(rules.choices.control[driven.entry], self.notes)


def best_limits(rules: Rules, rule: kernels.HysteresisRule, limits: Array) -> tuple[Array, int]:
    """The limits of the eligible member of least corrected cost, and how many kept the window.

    limits: (member, 4), a reference that is to be settled NaN. Where the end charge of none is near the asked one,
    the best of those that keep the window; InfeasibleError where none does.
    """
    battery = rules.problem.battery.arrays
    results = kernels.hysteresis_results(
        rule, limits, rules.steps.nox_kg, rules.choices, rules.span, battery
    )
    inside = results[:, 3] > 0
    if not inside.any():
        raise InfeasibleError(
            "no member of the rule family keeps the SOC window; widen it or use dp or ecms"
        )
    able = eligible(rules, results)
    figure = np.where(able if able.any() else inside, corrected_kg(rules, results), np.inf)
    return limits[int(np.argmin(figure))], int(inside.sum())
