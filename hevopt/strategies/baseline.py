"""The conventional car: engine always turning, the machine covers the electric load and nothing else."""

import numpy as np

from hevopt.errors import InfeasibleError
from hevopt.problem.problem import Plan, Problem
from hevopt.strategies.stepper import Prescribed


def start(problem: Problem) -> Prescribed:
    """At every step the control with engine on whose battery power is nearest to zero, then the cheapest."""
    table = problem.table
    engine_on = np.array([control.engine_on for control in table.controls])
    usable = table.feasible & engine_on
    if not usable.any(axis=1).all():
        k = int(np.argmin(usable.any(axis=1)))
        raise InfeasibleError(
            f"baseline: no control with the engine on at step {k} (t = {table.time_s[k]:g} s); "
            "use another strategy"
        )
    idle = np.where(usable, np.abs(table.battery_power_w), np.inf)
    nearest = idle <= idle.min(axis=1, keepdims=True) + 1e-6
    return Prescribed(np.argmin(np.where(nearest, problem.cost_kg, np.inf), axis=1))


def solve(problem: Problem) -> Plan:
    """The plan of those controls."""
    return Plan(start(problem).control)
