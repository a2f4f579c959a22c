"""The front of fuel against NOx, with proof: plans on its inside, half planes on its outside.

A weight w makes one cost of fuel and NOx, fuel + w NOx. The plan of least cost is a point that can be reached; its
certificate says that no plan which leaves at least the asked end charge costs less than a bound,

    fuel + w NOx >= bound(w),

a half plane in which every such plan lies, whatever its own weight. The points' lower left hull is the inner front,
the edge of what all half planes share the outer one. The supported front, all that some weight makes optimal, lies
between the two; no plan at all lies beyond the outer one.

The gap says how far they are apart: for any weight from the least to the largest one solved, the best point costs
at most so much more than the least that the half planes leave open. Both costs are concave and piecewise linear in
w, so their ratio is largest at a weight of a half plane or at one where two neighbouring points cost the same. The
next weight is taken where it is (the sandwich method for convex fronts).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from math import isfinite

from hevopt.bounds.certificate import certify
from hevopt.bounds.claim import Claim
from hevopt.display.facts import Shown
from hevopt.errors import DataError
from hevopt.problem.problem import Plan, Problem
from hevopt.problem.simulation import simulate
from hevopt.strategies import dp

POINTS_MAX = 30
# Weights are added until inner and outer front are this close.
GAP_ENOUGH = 1e-3
# The largest weight makes NOx count this many times the fuel of the least-fuel plan.
_NOX_OVER_FUEL = 10.0
# Weights closer than this share, and points closer than this share of fuel and NOx, are one.
SAME = 1e-6
WEIGHT_MAX = 1e6


@dataclass(frozen=True, slots=True)
class HalfPlane:
    """fuel + nox_weight x NOx >= bound_kg for every plan with the asked end charge or more."""

    nox_weight: float
    bound_kg: float
    proof: Claim


@dataclass(frozen=True, slots=True)
class Point:
    """A plan that was driven. nox_weights: those solved for which no plan found costs less."""

    nox_weights: tuple[float, ...]
    fuel_kg: float
    nox_kg: float

    def cost_kg(self, nox_weight: float) -> float:
        """Fuel and weighted NOx."""
        return self.fuel_kg + nox_weight * self.nox_kg


@dataclass(frozen=True, slots=True, repr=False)
class Front(Shown):
    """points: from least fuel to least NOx; half_planes: by weight, one for each that was solved.

    corners: (nox_kg, fuel_kg) of the outer front, from most NOx to least; the edge before the first has the slope
    of the least weight, the one after the last that of the largest
    gap: largest share by which the best point costs more than the outer front, over the weights that were solved
    and all between
    """

    points: tuple[Point, ...]
    half_planes: tuple[HalfPlane, ...]
    corners: tuple[tuple[float, float], ...]
    gap: float


def front(
    problem: Problem,
    weights: Sequence[float] | None = None,
    *,
    points_max: int = POINTS_MAX,
    gap_enough: float = GAP_ENOUGH,
    solve: Callable[[Problem], Plan] = dp.solve,
    progress: Callable[[str, int, int], None] = lambda text, done, total: None,
) -> Front:
    """The front of a problem: at the given weights, or at up to `points_max` chosen ones.

    solve: the strategy whose plans are the points; the half planes are those of dynamic programming's certificate
    progress: called with the weight that comes next, and how many of how many are done
    """
    _check(weights, points_max)
    solved: list[tuple[Point, HalfPlane]] = []

    def add(weight: float, total: int) -> None:
        progress(f"weight {weight:.4g}", len(solved), total)
        solved.append(_solved(problem.with_nox_weight(weight), solve))

    if weights is not None:
        for weight in sorted(set(weights)):
            add(weight, len(set(weights)))
        return _front(solved)
    add(0.0, points_max)
    least_fuel = solved[0][0]
    if points_max > 1 and least_fuel.nox_kg > 0:
        highest = _NOX_OVER_FUEL * max(least_fuel.fuel_kg, SAME) / least_fuel.nox_kg
        add(min(highest, WEIGHT_MAX), points_max)
    found = _front(solved)
    while len(solved) < points_max and found.gap > gap_enough:
        following = _next_weight(found, gap_enough)
        if following is None:
            break
        add(following, points_max)
        found = _front(solved)
    return found


def _check(weights: Sequence[float] | None, points_max: int) -> None:
    if points_max < 1:
        raise DataError(f"{points_max} points; allowed: 1 or more")
    if weights is not None and not weights:
        raise DataError("no weight given; name at least one, or leave the list out")
    for weight in weights or ():
        if not (isfinite(weight) and 0 <= weight <= WEIGHT_MAX):
            raise DataError(
                f"weight {weight:g}; allowed: 0 to {WEIGHT_MAX:g} kg of fuel per kg of NOx"
            )


def _solved(problem: Problem, solve: Callable[[Problem], Plan]) -> tuple[Point, HalfPlane]:
    plan = solve(problem)
    trajectory = simulate(problem, plan.control)
    optimum = trajectory
    if solve is not dp.solve:
        optimum = simulate(problem, dp.solve(problem).control)
    certificate = certify(problem, optimum)
    certificate.bound_of(trajectory)
    bound_kg, proof = certificate.bound_kg(problem.end_min_j)
    weight = problem.nox_weight
    point = Point((weight,), trajectory.total_fuel_kg, trajectory.total_nox_kg)
    return point, HalfPlane(weight, float(bound_kg), certificate.claim(proof))


def _front(solved: Sequence[tuple[Point, HalfPlane]]) -> Front:
    half_planes = tuple(sorted((h for _, h in solved), key=lambda h: h.nox_weight))
    points = _supported([point for point, _ in solved], [h.nox_weight for h in half_planes])
    corners = _corners(half_planes)
    gap = max(
        _gap(points, corners, half_planes, weight)
        for weight in [h.nox_weight for h in half_planes] + _ties(points)
    )
    return Front(points, half_planes, corners, max(gap, 0.0))


def _supported(plans: Sequence[Point], weights: Sequence[float]) -> tuple[Point, ...]:
    """For each weight the best of all plans; weights with one best plan share a point."""
    best: list[Point] = []
    for weight in weights:
        point = min(plans, key=lambda p: (p.cost_kg(weight), p.nox_kg))
        if best and _alike(point, best[-1]):
            best[-1] = replace(best[-1], nox_weights=(*best[-1].nox_weights, weight))
        else:
            best.append(replace(point, nox_weights=(weight,)))
    return tuple(best)


def _alike(a: Point, b: Point) -> bool:
    fuel, nox = abs(a.fuel_kg - b.fuel_kg), abs(a.nox_kg - b.nox_kg)
    return fuel <= SAME * abs(a.fuel_kg) and nox <= SAME * abs(a.nox_kg)


def _corners(half_planes: Sequence[HalfPlane]) -> tuple[tuple[float, float], ...]:
    """Corners of what the half planes share; by weight, those that touch nothing are left out."""
    edge: list[HalfPlane] = []
    for plane in half_planes:
        while edge and _needless(edge, plane):
            edge.pop()
        edge.append(plane)
    return tuple(_crossing(a, b) for a, b in pairwise(edge))


def _needless(edge: Sequence[HalfPlane], following: HalfPlane) -> bool:
    """Whether the last plane of an edge lies wholly behind its neighbours.

    Over weights: whether its bound is no higher than the line between its neighbours' bounds.
    """
    if len(edge) < 2:
        return False
    before, last = edge[-2:]
    share = (last.nox_weight - before.nox_weight) / (following.nox_weight - before.nox_weight)
    return last.bound_kg <= before.bound_kg + share * (following.bound_kg - before.bound_kg)


def _crossing(a: HalfPlane, b: HalfPlane) -> tuple[float, float]:
    nox_kg = (b.bound_kg - a.bound_kg) / (b.nox_weight - a.nox_weight)
    return nox_kg, a.bound_kg - a.nox_weight * nox_kg


def _gap(
    points: Sequence[Point],
    corners: Sequence[tuple[float, float]],
    half_planes: Sequence[HalfPlane],
    weight: float,
) -> float:
    """Share by which the best point costs more at a weight than the least that the half planes leave open."""
    at_corners = [fuel_kg + weight * nox_kg for nox_kg, fuel_kg in corners]
    least = [plane.bound_kg for plane in half_planes if plane.nox_weight == weight]
    if at_corners:
        least.append(min(at_corners))
    bound_kg = max(least)
    return (min(p.cost_kg(weight) for p in points) - bound_kg) / max(abs(bound_kg), 1e-300)


def _ties(points: Sequence[Point]) -> list[float]:
    """The weights at which neighbouring points cost the same."""
    return [(b.fuel_kg - a.fuel_kg) / (a.nox_kg - b.nox_kg) for a, b in pairwise(points)]


def _next_weight(found: Front, gap_enough: float) -> float | None:
    """The tie of largest gap that was not solved yet; None where no such gap is left."""
    weights = [h.nox_weight for h in found.half_planes]
    open_ties = [
        (_gap(found.points, found.corners, found.half_planes, tie), tie)
        for tie in _ties(found.points)
        if all(abs(tie - weight) > SAME * max(tie, weight) for weight in weights)
    ]
    gap, tie = max(open_ties, default=(0.0, 0.0))
    return tie if gap > gap_enough else None
