"""What the figures of a sweep are drawn from; of too many designs some, by rules that the page states."""

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hevopt.car_files.meanings import MEANINGS
from hevopt.pages.sweep.data import Array, DesignFigures
from hevopt.pages.sweep.effects import ParameterEffect, is_log, is_numeric
from hevopt.pages.sweep.front import Boundary, boundary, lines_boundary, pareto
from hevopt.pages.sweep.verdict import Group, shown_value
from hevopt.sweeps.plan.jobs import NOX_WEIGHT
from hevopt.sweeps.plan.prune import Pruned

BEST_LISTED = 20
# Of more designs than LINES_MAX, BEST_LINES are drawn as lines and of the others every so many-th.
LINES_MAX, BEST_LINES = 1000, 300
# Of more designs than POINTS_MAX, those are drawn as points that are the best in a cell of CELLS x CELLS.
POINTS_MAX, CELLS = 4000, 100
EFFECTS_DRAWN = 12
# Beyond the points, the boundary is drawn for this share of their span.
_MARGIN = 0.08

Indices = NDArray[np.intp]


def drawn(
    figures: DesignFigures,
    groups: Sequence[Group],
    effects: Sequence[Sequence[ParameterEffect]],
    plane: dict[str, Any] | None,
) -> dict[str, Any]:
    """Everything that the page's script draws. effects: of each group, the largest first"""
    return {
        "merit": merit_name(figures),
        "parameters": [_parameter(key, figures) for key in figures.values],
        "groups": [
            {"label": group.label, "lines": _lines(figures, group), "effects": _drawn(found)}
            for group, found in zip(groups, effects, strict=True)
        ],
        "plane": plane,
    }


def unit_of(key: str) -> str:
    """The unit of a parameter; "" where it has none, or several keys of that name differ."""
    if key == NOX_WEIGHT:
        return "kg/kg"
    name = next((part for part in reversed(key.split(".")) if not part.isdecimal()), key)
    units = {keys[name][0] for keys in MEANINGS.values() if name in keys}
    return next(iter(units)).replace("-", "") if len(units) == 1 else ""


def merit_name(figures: DesignFigures) -> str:
    return "objective" if np.isfinite(figures.objective).any() else "bound"


def plane_of(
    figures: DesignFigures, groups: Sequence[Group], pruned: Sequence[Pruned] = ()
) -> tuple[dict[str, Any] | None, list[str]]:
    """Fuel against NOx: points of each group, the front found and the certified boundary; and what they say.

    Designs that do not follow the cycle are points, but neither of the front nor of the boundary.
    """
    solved = np.flatnonzero(np.isfinite(figures.objective) & np.isfinite(figures.nox))
    if not len(solved):
        return None, []
    front = pareto(_following(figures, figures.fuel), figures.nox)
    kept = _points(figures, groups, front)
    edge = _boundary(figures, float(figures.nox[solved].min()), float(figures.nox[solved].max()))
    following = kept[~figures.short[kept]]
    plane = {
        "groups": [
            {"label": group.label} | _places(figures, np.intersect1d(following, group.members))
            for group in groups
        ],
        "short": _places(figures, kept[figures.short[kept]]),
        "pruned": _pruned_places(figures, pruned),
        "front": _places(figures, front),
        "edge": None if edge is None else {"nox": edge.edge.nox.tolist(), "fuel": edge.edge.fuel.tolist()},
    }  # fmt: skip
    words = _plane_words(figures, edge, len(kept), len(solved))
    return plane, [*words, *_unproven_words(figures, len(pruned))]


def _following(figures: DesignFigures, values: Array) -> Array:
    return np.where(figures.short, np.nan, values)


def _pruned_places(figures: DesignFigures, pruned: Sequence[Pruned]) -> dict[str, Any]:
    """Points of the edges of pruned designs' half planes, at the NOx of the designs that they lost to."""
    first = sorted(pruned, key=lambda p: (p.excess, p.design))[:POINTS_MAX]
    place = {int(number): n for n, number in enumerate(figures.number)}
    own = np.array([place[p.design] for p in first], dtype=np.intp)
    nox = figures.nox[[place[p.incumbent] for p in first]] if first else np.empty(0)
    bound = np.array([p.bound for p in first])
    fuel = bound - figures.weight[own] * (figures.fuel_per_nox or 0.0) * nox
    return {
        "design": figures.number[own].tolist(),
        "weight": figures.weight[own].tolist(),
        "fuel": _rounded(fuel),
        "nox": _rounded(nox),
        "merit": _rounded(bound),
    }


def _unproven_words(figures: DesignFigures, pruned: int) -> list[str]:
    """What designs that do not follow the cycle, and those pruned, do to the picture."""
    words = []
    if figures.short.any():
        words.append(
            "Crosses: designs that do not follow the cycle; neither the front nor the line is about them."
        )
    if pruned:
        shown = "" if pruned <= POINTS_MAX else f" (the {POINTS_MAX} closest calls of {pruned})"
        words.append(
            f"Hollow marks: pruned designs{shown}, by their bound alone: the least fuel of such a design, had it "
            "the NOx of the design it lost to. Designs were pruned on the objective alone, so the front is "
            "incomplete: a pruned design could lie on it with other NOx."
        )
    return words


def _plane_words(
    figures: DesignFigures, edge: Boundary | None, shown: int, solved: int
) -> list[str]:
    """What is proven about fuel and NOx, and what is not; which points are drawn."""
    bounded = np.isfinite(_following(figures, figures.bound))
    weights = np.unique(figures.weight[bounded])
    words = [f"No design {'that follows the cycle ' if figures.short.any() else ''}has a bound."]
    if edge is not None:
        whose = "has a bound and follows the cycle" if figures.short.any() else "has a bound"
        words = [
            f"The thick line is proven: no plan of a design that {whose} lies left of it or below."
        ]
        if len(weights) > 1:
            words.append(
                "A bound at a weight is a half plane, fuel + weight × NOx ≥ bound: all plans of a car lie in what "
                "the half planes of its weights share, and the line is the least of these edges over all cars."
            )
        elif weights[0] > 0:
            words.append(
                "With one weight a design is confined by one straight line only, and the least of them is drawn: "
                "it bounds the sum, neither fuel nor NOx alone."
            )
        else:
            words.append("It is the least fuel of any design, and says nothing about NOx.")
        words.append(
            "It holds for plans that leave at least the charge that the cases left, charge-corrected as they are."
        )
        if edge.lowered > 0:
            words.append(
                "Where a plan found under one weight leaves less charge than the bound at another supposes, that "
                f"bound was lowered to it, by {edge.lowered:.2g} l/100 km at most."
            )
    unbounded = int(np.isnan(figures.bound).sum())
    if edge is not None and unbounded:
        words.append(
            f"Nothing is proven about {unbounded} design{'s' if unbounded > 1 else ''} without a bound."
        )
    if shown < solved:
        words.append(
            f"{shown} of {solved} points are drawn: the best of each weight in every cell of a grid of {CELLS} × "
            f"{CELLS}, all of the front, and the designs of the table of the best."
        )
    return words


def _rounded(values: NDArray[np.float64]) -> list[float | None]:
    """Seven digits, None for NaN."""
    return [None if np.isnan(value) else float(f"{value:.7g}") for value in values.tolist()]


def _drawn(effects: Sequence[ParameterEffect]) -> list[dict[str, Any]]:
    return [asdict(found) | {"unit": unit_of(found.key)} for found in effects[:EFFECTS_DRAWN]]


def _parameter(key: str, figures: DesignFigures) -> dict[str, Any]:
    """What an axis needs to know of a parameter; texts stand in the order in which they first appear."""
    values = figures.values[key]
    numeric = is_numeric(values)
    distinct = sorted(set(values)) if numeric else list(dict.fromkeys(values))
    return {
        "key": key,
        "unit": unit_of(key),
        "numeric": numeric,
        "log": numeric and is_log(values),
        "low": distinct[0] if numeric else 0,
        "high": distinct[-1] if numeric else len(distinct) - 1,
        "names": None if numeric else [shown_value(value) for value in distinct],
    }


def _lines(figures: DesignFigures, group: Group) -> dict[str, Any]:
    """The designs drawn as lines: all, or the best and of the others every so many-th by rank; the best last."""
    ranked = group.ranked[~figures.short[group.ranked]]
    if len(ranked) > LINES_MAX:
        rest = np.linspace(BEST_LINES, len(ranked) - 1, LINES_MAX - BEST_LINES)
        ranked = ranked[np.r_[np.arange(BEST_LINES), rest.round().astype(int)]]
    ranked = ranked[::-1]
    return {
        "design": figures.number[ranked].tolist(),
        "values": [_column(key, figures, ranked) for key in figures.values],
        "fuel": _rounded(figures.fuel[ranked]),
        "nox": _rounded(figures.nox[ranked]),
        "merit": _rounded(figures.merit[ranked]),
        "all": int((~figures.short[group.ranked]).sum()),
    }


def _column(key: str, figures: DesignFigures, chosen: Indices) -> list[float]:
    """Numbers of a parameter, or places of its texts among all of them."""
    values = figures.values[key]
    if is_numeric(values):
        return [values[n] for n in chosen.tolist()]
    place = {value: n for n, value in enumerate(dict.fromkeys(values))}
    return [place[values[n]] for n in chosen.tolist()]


def _places(figures: DesignFigures, chosen: Indices) -> dict[str, Any]:
    return {
        "design": figures.number[chosen].tolist(),
        "weight": figures.weight[chosen].tolist(),
        "fuel": figures.fuel[chosen].tolist(),
        "nox": figures.nox[chosen].tolist(),
        "merit": _rounded(figures.objective[chosen]),
    }


def _points(figures: DesignFigures, groups: Sequence[Group], front: Indices) -> Indices:
    """The designs drawn as points: all, or the best of each group in every cell, the listed and the front."""
    solved = np.flatnonzero(np.isfinite(figures.objective) & np.isfinite(figures.nox))
    if len(solved) <= POINTS_MAX:
        return solved
    cells = np.zeros(len(figures.number), dtype=np.int64)
    for values in (figures.fuel, figures.nox):
        low, high = np.nanmin(values), np.nanmax(values)
        share = (values[solved] - low) / ((high - low) or 1.0)
        cells[solved] = CELLS * cells[solved] + np.minimum(CELLS * share, CELLS - 1).astype(int)
    kept = [front]
    for group in groups:
        # `ranked` has the best first, and unique finds first places.
        first = np.unique(cells[group.ranked], return_index=True)[1]
        kept += [group.ranked[first], group.ranked[:BEST_LISTED]]
    return np.unique(np.concatenate(kept))


def _boundary(figures: DesignFigures, least: float, most: float) -> Boundary | None:
    """The certified boundary a little beyond the points' NOx, none of a car without a bound."""
    margin = _MARGIN * ((most - least) or most or 1.0)
    ends = (max(least - margin, 0.0), most + margin)
    per_nox = figures.fuel_per_nox
    bounds = _following(figures, figures.bound)
    if per_nox is None:
        bounds = np.where(figures.weight > 0, np.nan, bounds)
    weights, column = np.unique(figures.weight, return_inverse=True)
    if len(weights) > len(figures.number) // 4 and len(weights) > 1:
        return lines_boundary(figures.weight * (per_nox or 0.0), bounds, ends)
    keys = [key for key in figures.values if key != NOX_WEIGHT]
    cars: dict[tuple[Any, ...], int] = {}
    texts = zip(*(figures.values[key] for key in keys), strict=True)
    row = [cars.setdefault(text, len(cars)) for text in texts] or list(range(len(column)))
    matrices = np.full((3, max(row) + 1, len(weights)), np.nan)
    for matrix, values in zip(
        matrices, (bounds, _following(figures, figures.fuel), figures.nox), strict=True
    ):
        matrix[row, column] = values
    return boundary(weights * (per_nox or 0.0), *matrices, ends)
