"""Start&stop: the engine rests while the car stands, unless a gear is being engaged before moving off.

What the electric load took meanwhile is charged back while driving; see _rules.py for the charging power.
"""

from hevopt.problem.problem import Plan, Problem
from hevopt.strategies._rules import (
    Calibrated,
    calibrated,
    engine_entries,
    rules_of,
    tried,
    usual_limits,
)

_NEVER_ELECTRIC_W = -1.0


def start(problem: Problem) -> Calibrated:
    """The rule with the charging power that keeps the charge; see `solve`."""
    rules = rules_of(problem)
    never = usual_limits(rules)._replace(power_w=_NEVER_ELECTRIC_W)
    members = tried(rules, [never], engine_entries(rules))
    return calibrated(rules, members, lambda member: member["corrected_kg"])


def solve(problem: Problem) -> Plan:
    """The plan of the rule, with the charging power that keeps the charge."""
    return start(problem).plan
