"""The rule-based NOx strategy of the study: the machine assists to cut the power peaks that make NOx.

The engine drives under a cap on its NOx flow, the machine giving the rest, even in moderate acceleration; the
energy comes back from braking and, within the cap, from load-point shift. Cap and electric threshold are
calibrated: of the whole family, the member of least NOx.
"""

import numpy as np

from hevopt.problem.problem import Plan, Problem
from hevopt.strategies._rules import (
    Calibrated,
    calibrated,
    engine_entries,
    rules_of,
    tried,
    usual_limits,
)
from hevopt.strategies._rules_driven import DrivenRule

_CAPS = 10
_THRESHOLDS = 4
_ELECTRIC_SHARE_MAX = 0.3


def start(problem: Problem) -> Calibrated:
    """The family's member that suits the problem best; see `solve`."""
    rules = rules_of(problem)
    driving = ~rules.steps.standing & ~rules.steps.braking
    top_w = float(np.max(rules.steps.power_w[rules.electric], initial=0.0))
    nox_kgps = problem.table.nox_kg / problem.table.step_s[:, None]
    peak = float(np.max(nox_kgps[driving], initial=0.0))
    given_w, usual = problem.thresholds.electric_power_w, usual_limits(rules)
    powers = np.linspace(0.0, _ELECTRIC_SHARE_MAX * top_w, _THRESHOLDS).tolist()
    limits = [usual._replace(power_w=power) for power in powers] if given_w is None else [usual]
    members = [
        member
        for cap in (peak * np.geomspace(0.03, 1.0, _CAPS)).tolist()
        for member in tried(rules, limits, engine_entries(rules, cap), nox_cap_kgps=cap)
    ]
    return calibrated(rules, members, lambda member: member["nox_kg"])


def start_on(problem: Problem, points: Problem, interval_s: float) -> DrivenRule:
    """The member that suits the problem best, on operating points: any of them, however often."""
    return DrivenRule(start(problem), points, interval_s)


def solve(problem: Problem) -> Plan:
    """The family's member of least NOx; notes["calibration"] holds it all."""
    return start(problem).plan
