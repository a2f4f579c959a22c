"""What dp finds on a problem, and what is proven of it."""

import warnings
from typing import NamedTuple

from hevopt.bounds.certificate import certify
from hevopt.errors import CoarseTableWarning
from hevopt.problem.problem import Problem, Trajectory
from hevopt.problem.simulation import simulate
from hevopt.strategies import dp


class Score(NamedTuple):
    """What dp burns on a problem, and what is proven of it. coarse: share of the bound that may be missed between
    controls; None where it is known what lies there"""

    fuel_kg: float
    bound_kg: float
    scope: str
    coarse: float | None


def found(problem: Problem) -> Score:
    """What dp and the certificate find; where modes are switched, a price alone proves too little, and it may use
    the plan."""
    plan = simulate(problem, dp.solve(problem).control)
    return Score(plan.total_fuel_kg, *bound(problem, plan if problem.table.modes > 1 else None))


def bound(problem: Problem, plan: Trajectory | None = None) -> tuple[float, str, float | None]:
    """The bound at the charge asked, what it speaks of, and the share that may be missed between controls."""
    with warnings.catch_warnings():
        # The page tells it.
        warnings.simplefilter("ignore", CoarseTableWarning)
        certificate = certify(problem, plan)
    bound_kg, proof = certificate.bound_kg(problem.end_min_j)
    coarse = None if certificate.coarse_kg is None else certificate.coarse_kg / bound_kg
    return bound_kg, str(certificate.claim(proof).scope), coarse
