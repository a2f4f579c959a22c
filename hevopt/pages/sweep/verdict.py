"""Which designs compete, and what a sweep says of them in two sentences."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hevopt.display.facts import Shown
from hevopt.pages.sweep.data import DesignFigures, Scalar, Sweep
from hevopt.sweeps.plan.jobs import NOX_WEIGHT, Ending

# More weights than this are not compared one by one.
GROUPS_MAX = 20
_TIGHT_PERCENT = 0.001
_IN_SENTENCE = 3


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Group(Shown):
    """Designs that compete. weight: theirs, None where there are too many weights to tell them apart.

    ranked: indices of those with an objective (a bound, where nothing else was asked for), the best first, those
    that do not follow a cycle last; of different weights they do not compare
    """

    weight: float | None
    members: NDArray[np.intp]
    ranked: NDArray[np.intp]

    @property
    def label(self) -> str:
        return "all" if self.weight is None else f"{self.weight:g}"


def groups_of(figures: DesignFigures) -> list[Group]:
    """The designs of each NOx weight, by ascending weight; all as one where there are more than GROUPS_MAX."""
    weights = np.unique(figures.weight).tolist()
    merit = figures.merit

    def group(weight: float | None) -> Group:
        chosen = figures.weight == weight if weight is not None else figures.weight >= 0
        members = np.flatnonzero(chosen)
        known = members[np.isfinite(merit[members])]
        return Group(weight, members, known[np.lexsort((merit[known], figures.short[known]))])

    return [group(weight) for weight in (weights if len(weights) <= GROUPS_MAX else [None])]


def shown_value(value: Scalar) -> str:
    """A parameter's value as tables show it."""
    if isinstance(value, float):
        return f"{value:.6g}"
    return str(value).lower() if isinstance(value, bool) else str(value)


def verdict(sweep: Sweep, groups: Sequence[Group]) -> list[str]:
    """What is the best design under each NOx weight; how many designs and cases there are."""
    figures, counts = sweep.figures, sweep.tally.counts
    found = [group for group in groups if len(group.ranked)]
    between = []
    if len(found) > _IN_SENTENCE:
        found, between = [found[0], found[-1]], found[1:-1]
    parts = [_best(figures, group) for group in found]
    if between:
        firsts = [(group.label, int(group.ranked[0])) for group in between]
        named = [
            f"{label}: {'none that follows' if figures.short[n] else f'design {figures.number[n]}'}"
            for label, n in firsts
        ]
        parts.append(f"at the weights between, the best are {', '.join(named)}")
    order = (Ending.OK, Ending.FAILED, Ending.INFEASIBLE, Ending.MISSING, Ending.PRUNED)
    ended = ", ".join(f"{counts[e]} {'done' if e is Ending.OK else e}" for e in order)
    designs = len(figures.number)
    best = "; ".join(parts) if parts else "no design is solved"
    return [
        f"{best[0].upper()}{best[1:]}.",
        f"{designs} design{'s' if designs != 1 else ''}, {counts.total()} cases: {ended}.",
    ]


def _best(figures: DesignFigures, group: Group) -> str:
    n = group.ranked[0]
    if group.weight is None:
        return (
            f"objectives of {len(np.unique(figures.weight))} NOx weights do not compare, so no design is called "
            "the best: see the front of fuel and NOx"
        )
    where = f"at NOx weight {group.label}, " if figures.weight.any() else ""
    named = f"design {figures.number[n]}{_described(figures, n)}"
    if figures.short[n]:
        return (
            f"{where}no solved design follows the cycle, so none is the best; the first of those that fall short "
            f"is {named}"
        )
    if np.isnan(figures.objective[n]):
        return (
            f"{where}{named} has the least bound: no plan of a design with a bound can go below "
            f"{figures.bound[n]:.4f} l/100 km"
        )
    text = f"{where}{named} is the best: {figures.objective[n]:.4f} l/100 km"
    if group.weight != 0:
        text += " of fuel and weighted NOx"
    if np.isnan(figures.gap_percent[n]):
        return f"{text}, with no bound to hold it against"
    gap = figures.gap_percent[n]
    above = f"{gap:.3f} %" if gap >= _TIGHT_PERCENT else f"less than {_TIGHT_PERCENT:g} %"
    return f"{text}, {above} above its proven bound"


def _described(figures: DesignFigures, n: int) -> str:
    values = [
        f"{key} {shown_value(of[n])}" for key, of in figures.values.items() if key != NOX_WEIGHT
    ]
    more = [f"and {len(values) - 4} more"] if len(values) > 4 else []
    return f" ({', '.join(values[:4] + more)})" if values else ""
