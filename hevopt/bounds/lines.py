"""Supporting lines of a dual over the scale of its prices, and its top, found where lines from both sides meet."""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from hevopt.display.facts import Shown
from hevopt.problem.arrays import Array

_LINES_MAX = 200
_QUADRUPLINGS_MAX = 16
# Two lines meet within rounding of the best value known: the top is found.
_RELATIVE_TOLERANCE = 1e-13


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Line(Shown):
    """A supporting line of a dual, and a bound for every end charge.

    scale, value_kg, slope_kg: where it touches, the bound there less its rounding, its derivative by the scale
    price_kgpj: price at the end, which is what a joule more of end charge adds to the bound
    rounding_kg: what the bound was lowered by
    shape: (time,) prices of stored energy after each step, at scale 1
    """

    scale: float
    value_kg: float
    slope_kg: float
    price_kgpj: float
    rounding_kg: float = 0.0
    shape: Array = field(default_factory=lambda: np.zeros(0))


def maximise(
    evaluate: Callable[[float], Line], guess: float, steepest: Callable[[], tuple[float, float]]
) -> list[Line]:
    """Supporting lines of a concave piecewise-linear function of a scale >= 0, the highest last.

    steepest: intercept and slope of its line at a scale without end, asked for where it still rises at 4^16
    guesses; raises an error where the function has no maximum. Where the search is cut short the lines found so
    far are what is known: each of them is a bound.
    """
    line = evaluate(0.0)
    lines, scale, right = [line], guess, None
    left = _Touch.of(line)
    for _ in range(_QUADRUPLINGS_MAX if line.slope_kg > 0 else 0):
        line = evaluate(scale)
        lines.append(line)
        if line.slope_kg <= 0:
            right = _Touch.of(line)
            break
        left = _Touch.of(line)
        scale *= 4.0
    if left.slope_kg > 0 and right is None:
        right = _Touch(np.inf, *steepest())
    for _ in range(_LINES_MAX):
        if right is None:
            break
        best = max(line.value_kg for line in lines)
        crossing, top = _crossing(left, right)
        inside = left.scale < crossing < right.scale
        if not inside or top - best <= _RELATIVE_TOLERANCE * abs(top):
            break
        line = evaluate(crossing)
        lines.append(line)
        left, right = (_Touch.of(line), right) if line.slope_kg > 0 else (left, _Touch.of(line))
    return sorted(lines, key=lambda line: line.value_kg)


def crossing_of(one: Line, other: Line) -> float:
    """The scale between two lines where they meet; that of the one where they meet nowhere there."""
    left, right = sorted((one, other), key=lambda line: line.scale)
    scale, _ = _crossing(_Touch.of(left), _Touch.of(right))
    return scale if left.scale < scale < right.scale else one.scale


@dataclass(frozen=True, slots=True)
class _Touch:
    """A supporting line by where it touches and its value at scale 0."""

    scale: float
    intercept_kg: float
    slope_kg: float

    @classmethod
    def of(cls, line: Line) -> "_Touch":
        return cls(line.scale, line.value_kg - line.slope_kg * line.scale, line.slope_kg)


def _crossing(left: _Touch, right: _Touch) -> tuple[float, float]:
    """Scale and value where two supporting lines meet; the left line's own point where they do not."""
    if left.slope_kg <= right.slope_kg:
        return left.scale, left.intercept_kg + left.slope_kg * left.scale
    crossing = (right.intercept_kg - left.intercept_kg) / (left.slope_kg - right.slope_kg)
    return crossing, left.intercept_kg + left.slope_kg * crossing
