"""One figure of each car set on one cycle, and its other cycles judged with it.

The figure is a factor of all the fuel that the car's engine burns: its map, what a start and a change of gear cost.
Every plan burns so many times more, one against the other nothing changes, so that each strategy decides as before
and what it burns is what it burnt times the factor. The cycle that sets it is not judged.
"""

from collections.abc import Sequence
from statistics import median
from typing import NamedTuple

from hevopt.reproduction.validation.cases import Held
from hevopt.reproduction.verdicts import markdown, signed

# Every car was measured on it, it begins warm, and there is little to decide on it.
SETS = "hwfet"


class Judged(NamedTuple):
    """A car on a cycle that did not set its factor.

    off_percent: the best causal strategy against the warm car, fuel times the factor
    """

    held: Held
    factor: float
    off_percent: float


def judged(held: Sequence[Held]) -> list[Judged]:
    """Cars and cycles with a warm figure, whose car has one on the cycle that sets the factor, the worst first."""
    factors = {
        h.laboratory.car: 1 / (1 + h.off_percent / 100)
        for h in held
        if h.laboratory.cycle == SETS and h.off_percent is not None
    }
    found = [
        Judged(h, factor, 100 * ((1 + h.off_percent / 100) * factor - 1))
        for h in held
        if h.laboratory.cycle != SETS
        and h.off_percent is not None
        and (factor := factors.get(h.laboratory.car)) is not None
    ]
    return sorted(found, key=lambda one: -abs(one.off_percent))


def medians(found: Sequence[Judged]) -> tuple[float, float]:
    """Median of how far causal strategies are from warm cars, with the factors and without; of one or more."""
    without = median(abs(one.held.off_percent or 0.0) for one in found)
    return median(abs(one.off_percent) for one in found), without


def verdict(found: Sequence[Judged]) -> str:
    """What the factors make of it, in a sentence; "" where no cycle is left to judge."""
    if not found:
        return ""
    with_factor, without = medians(found)
    return f"""

With one factor of each engine's fuel set on the HWFET, which is then not judged: median {with_factor:.1f} % off
over the other {len(found)} cars and cycles, {without:.1f} % without the factors (the second table)."""


def section(held: Sequence[Held]) -> str:
    """The section of the page."""
    head = "## One factor set on the HWFET, the other cycles judged"
    found = judged(held)
    if not found:
        return f"{head}\n\nNothing: of these cars no HWFET, or no other cycle, has a warm figure."
    rows = [
        [
            f"`{one.held.laboratory.car}`",
            one.held.laboratory.cycle,
            f"{one.factor:.3f}",
            f"{one.held.causal_l_per_100km:.3f}",
            f"{one.held.causal_l_per_100km * one.factor:.3f}",
            signed(one.held.off_percent or 0.0),
            signed(one.off_percent),
        ]
        for one in found
    ]
    heads = ["car", "cycle", "factor", "causal, l/100 km", "with the factor", "against warm, %",
             "with the factor, %"]  # fmt: skip
    text = """Not used anywhere else on this page. The factor, one for a car, is of all the fuel that the
engine burns, such that the best causal strategy agrees with the warm car on the HWFET; that cycle is not judged.
Every plan burns so many times more, so that no strategy decides otherwise. Where a car is as far off on another
cycle as before, or further, its fault is not one of the engine's efficiency alone."""
    return f"{head}\n\n{text}\n\n" + markdown(heads, "llrrrrr", rows)
