"""A rule that was calibrated on a cycle, on operating points: with its figures, whatever comes."""

import numpy as np

from hevopt.problem.arrays import Indices
from hevopt.problem.problem import Problem
from hevopt.strategies import _rule_kernels as kernels
from hevopt.strategies._rules import Calibrated, Rules, engine_entries, rule_for, rules_of


class DrivenRule:
    """The rule's electric thresholds, cap on NOx and charging power on operating points.

    The charging power falls by one level at the time at which it did in the calibration.
    """

    def __init__(self, of: Calibrated, points: Problem, interval_s: float) -> None:
        rules = rules_of(points, of.rules)
        level, until = of.level
        ends_s = np.append(0.0, np.cumsum(of.rules.problem.table.step_s))
        self.rules, self.rule = rules, rule_for(rules, of.member.limits)
        self.engine = self._entries(rules, of, level), self._entries(rules, of, max(level - 1, 0))
        self.until_s, self.interval_s, self.asked = float(ends_s[until]), interval_s, 0

    @staticmethod
    def _entries(rules: Rules, of: Calibrated, level: int) -> Indices:
        cap = float(of.member.settings.get("nox_cap_kgps", np.inf))
        entries: Indices = engine_entries(rules, cap)[level]
        return entries

    def decide(self, k: int, energy_j: float, mode: int) -> int:
        """Index of the control that the rule takes at point k."""
        later = self.asked * self.interval_s >= self.until_s
        self.asked += 1
        entry = kernels.entry_at(
            self.rule, self.engine[later], k, energy_j, mode, self.rules.choices
        )
        return int(self.rules.choices.control[entry])
