"""Fuel against NOx of a sweep: the front of what was found, and a boundary that nothing can cross.

A design's certificate at a weight w is a half plane, fuel + w NOx >= bound, in which all its plans lie. A car that
was certified at several weights is confined to what its half planes share. A plan of the sweep is one of some car,
so the boundary is the least, over the cars, of the edges of these regions: exact, piecewise linear, not convex.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# Sums of rounded figures: the boundary is lowered by what rounding could have added.
_ROUNDING = 1e-12


class Edge(NamedTuple):
    """A piecewise linear function: least fuel over NOx, by ascending NOx."""

    nox: Array
    fuel: Array

    def at(self, nox: Array) -> Array:
        return np.interp(nox, self.nox, self.fuel)


@dataclass(frozen=True, slots=True, eq=False)
class Boundary:
    """Where no plan of a car with a bound can lie below; lowered: most by which a bound was lowered to a point."""

    edge: Edge
    lowered: float


def pareto(fuel: Array, nox: Array) -> NDArray[np.intp]:
    """Indices of the points that no other one beats in both, from least fuel to least NOx; NaN is no point."""
    order = np.lexsort((nox, fuel))
    order = order[np.isfinite(fuel[order]) & np.isfinite(nox[order])]
    if not len(order):
        return order
    least = np.minimum.accumulate(nox[order])
    return order[np.r_[True, least[1:] < least[:-1]]]


def boundary(
    slopes: Array, bounds: Array, fuel: Array, nox: Array, ends: tuple[float, float]
) -> Boundary | None:
    """The boundary for NOx between `ends`; None where no car has a bound.

    slopes: (weight,) fuel that a unit of NOx counts; bounds, fuel, nox: (car, weight), NaN where there is none.
    A plan found under one weight may leave a little more or less charge than the bound at another weight supposes;
    that bound is lowered to the plan's point.
    """
    points = fuel[:, :, None] + nox[:, :, None] * slopes
    reached = np.fmin.reduce(points, axis=1)
    held = np.fmin(bounds, np.where(np.isnan(bounds), np.nan, reached))
    lowered = float(np.nanmax(bounds - held, initial=0.0))
    held = held[~np.isnan(held).all(axis=1)]
    if not len(held):
        return None
    weakest = _undominated(np.where(np.isnan(held), -np.inf, held))
    return Boundary(_lowest([_edge(slopes, row, ends) for row in weakest]), lowered)


def lines_boundary(slopes: Array, bounds: Array, ends: tuple[float, float]) -> Boundary | None:
    """The boundary where every design has a weight of its own: the least of their lines. Both are (design,)."""
    known = np.isfinite(bounds)
    if not known.any():
        return None
    kept = _lower_hull(slopes[known], bounds[known])
    nox = np.array(ends)
    return Boundary(_lowest([Edge(nox, bound - slope * nox) for slope, bound in kept]), 0.0)


def _undominated(held: Array) -> Array:
    """Rows without those that are nowhere below another: a car whose bounds all are higher adds nothing."""
    left = np.unique(held, axis=0)
    kept = []
    while len(left):
        first, left = left[0], left[1:]
        kept.append(first)
        left = left[(left < first).any(axis=1)]
    return np.array(kept)


def _lower_hull(slopes: Array, bounds: Array) -> list[tuple[float, float]]:
    """(slope, bound) of the lines that can be the least for some NOx."""
    hull: list[tuple[float, float]] = []
    for slope, bound in sorted(zip(slopes.tolist(), bounds.tolist(), strict=True)):
        if hull and hull[-1][0] == slope:
            continue
        while len(hull) > 1 and _turns_right(*hull[-2:], (slope, bound)):
            hull.pop()
        hull.append((slope, bound))
    return hull


def _turns_right(a: tuple[float, float], b: tuple[float, float], c: tuple[float, float]) -> bool:
    return (b[0] - a[0]) * (c[1] - a[1]) <= (b[1] - a[1]) * (c[0] - a[0])


def _edge(slopes: Array, bounds: Array, ends: tuple[float, float]) -> Edge:
    """The edge of what a car's half planes share."""
    known = np.isfinite(bounds)
    slopes, bounds = slopes[known], bounds[known]
    crossings = [
        (bounds[j] - bounds[i]) / (slopes[j] - slopes[i])
        for i, j in combinations(range(len(slopes)), 2)
    ]
    inside = [nox for nox in crossings if ends[0] < nox < ends[1]]
    nox = np.unique([*ends, *inside])
    return Edge(nox, (bounds[:, None] - slopes[:, None] * nox).max(axis=0))


def _lowest(edges: Sequence[Edge]) -> Edge:
    """The least of some functions at every NOx, lowered by what rounding could add."""
    while len(edges) > 1:
        pairs = [_lower(a, b) for a, b in zip(edges[::2], edges[1::2], strict=False)]
        edges = pairs + list(edges[len(edges) // 2 * 2 :])
    whole = edges[0]
    few = _with_corners_alone(whole)
    above = float((few.at(whole.nox) - whole.fuel).max())
    return Edge(few.nox, few.fuel - max(above, 0.0) - _ROUNDING * np.abs(few.fuel))


def _lower(a: Edge, b: Edge) -> Edge:
    nox = np.union1d(a.nox, b.nox)
    apart = a.at(nox) - b.at(nox)
    k = np.flatnonzero(apart[:-1] * apart[1:] < 0)
    crossings = nox[k] + (nox[k + 1] - nox[k]) * apart[k] / (apart[k] - apart[k + 1])
    nox = np.union1d(nox, crossings)
    return Edge(nox, np.minimum(a.at(nox), b.at(nox)))


def _with_corners_alone(edge: Edge) -> Edge:
    """Without the points that lie on the line from the one kept before to the next, but for rounding."""
    nox, fuel = edge.nox.tolist(), edge.fuel.tolist()
    kept = [0]
    for n in range(1, len(nox) - 1):
        last = kept[-1]
        share = (nox[n] - nox[last]) / (nox[n + 1] - nox[last])
        line = fuel[last] + share * (fuel[n + 1] - fuel[last])
        if abs(line - fuel[n]) > _ROUNDING * abs(fuel[n]):
            kept.append(n)
    kept.append(len(nox) - 1)
    return Edge(edge.nox[kept], edge.fuel[kept])
