"""The rule-based fuel strategy of the study.

Above a state of charge the car is driven electrically until a power threshold; it recovers what braking gives;
otherwise the engine runs and shifts its load point to keep the charge neutral; it rests at standstill. The
threshold is calibrated: of the whole family, the member of least charge-corrected cost.
"""

from collections.abc import Sequence

import numpy as np

from hevopt.problem.problem import Plan, Problem
from hevopt.strategies._rules import (
    Calibrated,
    calibrated,
    engine_entries,
    neutral_outcome,
    rules_of,
)
from hevopt.strategies._rules_driven import DrivenRule

_THRESHOLDS = 24


def start(problem: Problem, *, thresholds_w: Sequence[float] | None = None) -> Calibrated:
    """The family's member that suits the problem best; see `solve`."""
    rules = rules_of(problem)
    if thresholds_w is None:
        electric = ~rules.standing & ~rules.braking & (rules.electric >= 0)
        top_w = float(np.max(rules.power_w[electric], initial=0.0))
        thresholds_w = np.linspace(0.0, top_w, _THRESHOLDS).tolist()
    engine = engine_entries(rules)
    members = [
        ({"threshold_w": threshold}, neutral_outcome(rules, threshold, engine))
        for threshold in thresholds_w
    ]
    return calibrated(rules, members, lambda member: member["corrected_kg"])


def start_on(problem: Problem, points: Problem, interval_s: float) -> DrivenRule:
    """The member that suits the problem best, on operating points: any of them, however often."""
    return DrivenRule(start(problem), points, interval_s)


def solve(problem: Problem, *, thresholds_w: Sequence[float] | None = None) -> Plan:
    """The family's best member; notes["calibration"] holds the curve over the threshold.

    thresholds_w: members to choose from, by default evenly up to the highest power driven electrically
    """
    return start(problem, thresholds_w=thresholds_w).plan
