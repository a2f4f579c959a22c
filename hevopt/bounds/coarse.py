"""What may be missed between the controls of a table of which nothing else is known.

The bound of every second control, less that of all, at one price: where the table misses a kink, such as a limit or
an engine at rest, an error that falls with the distance of the controls, it is about what is missed still; where
cost is smooth, an error that falls with its square, about three times that. No estimate of which of both it is can
be trusted, so the difference is told undivided. It is a warning, no proof.
"""

import numpy as np

from hevopt.bounds.bounded import undominated_bounded
from hevopt.bounds.prices import one_price_dual, one_price_lines
from hevopt.errors import InfeasibleError
from hevopt.problem.choices import Choices, kept
from hevopt.problem.flows import GivenFlows
from hevopt.problem.problem import Problem

# Share of the bound from which on it is worth a warning.
COARSE = 5e-4


def coarseness_kg(problem: Problem) -> float | None:
    """How much higher the bound of every second control lies; None where something is known of what lies between,
    as of a car, or where no plan is left of them."""
    if problem.table.between or not isinstance(problem.table.flows, GivenFlows):
        return None
    choices = undominated_bounded(problem)
    thinned = _every_second(choices)
    if len(thinned.cost_kg) == len(choices.cost_kg):
        return None
    try:
        half_kg = max(line.value_kg for line in one_price_lines(problem, thinned))
    except InfeasibleError:
        return None
    return max(half_kg - max(line.value_kg for line in one_price_dual(problem)), 0.0)


def coarseness_text(coarse_kg: float, bound_kg: float) -> str:
    """What a coarse table may mean, in words."""
    return (
        "the bound speaks of the table's controls alone, and they may be too few: with every second one left out "
        f"it is {coarse_kg:.3g} kg above its {bound_kg:.6g} kg, and about as much may be missed between them; give "
        "more controls, or say with between='convex' or 'linear' in ControlTable.from_arrays what lies between"
    )


def _every_second(choices: Choices) -> Choices:
    """Every second choice of each step and mode by power, and both ends."""
    begins, ends = choices.first[:, :-1].ravel(), choices.first[:, 1:].ravel()
    count = ends - begins
    place = np.arange(len(choices.cost_kg)) - np.repeat(begins, count)
    last = place == np.repeat(count, count) - 1
    return kept(choices, (place % 2 == 0) | last)
