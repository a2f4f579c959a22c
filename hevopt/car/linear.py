"""Small linear systems whose coefficients may be arrays: one elimination for all steps at once.

A row says  sum of coefficient x unknown  =  sum of coefficient x input.  Coefficients are numbers or arrays of one
shape, such as a ratio per step; which unknown is solved from which row is the same for all of them.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hevopt.display.facts import Shown

Coefficient = float | NDArray[np.float64]
Terms = dict[str, Coefficient]
# Ratios are between 0.01 and 50; a coefficient below this is what rounding leaves of nothing.
_NOTHING = 1e-9


@dataclass(frozen=True, slots=True, repr=False)
class Row(Shown):
    """One equation, by name: left x unknowns = right x inputs."""

    name: str
    left: Mapping[str, Coefficient]
    right: Mapping[str, Coefficient]


class SingularError(Exception):
    """Rows that do not determine the unknowns: those left without an unknown, and unknowns without a row."""

    def __init__(self, redundant: Sequence[str], undetermined: Sequence[str]) -> None:
        super().__init__(f"redundant rows {redundant}, undetermined {undetermined}")
        self.redundant = tuple(redundant)
        self.undetermined = tuple(undetermined)


def solved(rows: Sequence[Row]) -> dict[str, Terms]:
    """Every unknown as terms in the inputs; SingularError where rows and unknowns do not match."""
    waiting = [(row.name, (_something(row.left), dict(row.right))) for row in rows]
    unknowns = dict.fromkeys(name for row in rows for name in row.left)
    found: list[tuple[str, Terms, Terms]] = []
    redundant = []
    while waiting:
        place = min(range(len(waiting)), key=lambda n: len(waiting[n][1][0]))
        name, (left, right) = waiting.pop(place)
        # By order, not by size: the same rows are solved alike for all steps and for some of them.
        pivot = next((u for u, c in left.items() if _least(c) > _NOTHING), None)
        if pivot is None:
            redundant.append(name)
            continue
        divisor = left.pop(pivot)
        left = {u: -c / divisor for u, c in left.items()}
        right = {i: c / divisor for i, c in right.items()}
        for _, (other, known) in waiting:
            if pivot in other:
                factor = other.pop(pivot)
                _add(other, left, factor)
                _add(known, right, -factor)
                for u in [u for u in left if u in other and _most(other[u]) <= _NOTHING]:
                    del other[u]
        found.append((pivot, left, right))
    missing = [name for name in unknowns if name not in {pivot for pivot, _, _ in found}]
    if redundant or missing:
        raise SingularError(redundant, missing)
    result: dict[str, Terms] = {}
    for unknown, others, terms in reversed(found):
        for name, factor in others.items():
            _add(terms, result[name], factor)
        result[unknown] = terms
    return result


def _something(terms: Mapping[str, Coefficient]) -> Terms:
    return {u: c for u, c in terms.items() if _most(c) > _NOTHING}


def _add(terms: Terms, others: Terms, factor: Coefficient) -> None:
    for name, coefficient in others.items():
        term = coefficient * factor
        terms[name] = terms[name] + term if name in terms else term


def _least(coefficient: Coefficient) -> float:
    return (
        float(np.min(np.abs(coefficient)))
        if isinstance(coefficient, np.ndarray)
        else abs(coefficient)
    )


def _most(coefficient: Coefficient) -> float:
    return (
        float(np.max(np.abs(coefficient)))
        if isinstance(coefficient, np.ndarray)
        else abs(coefficient)
    )
