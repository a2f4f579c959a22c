"""Grade from a measured altitude: over a baseline long enough that the altimeter's noise makes no hills.

Altitude is averaged over every 20 m of road (a quarter of a drive shorter than 80 m); the grade at a point is the
slope of a straight line fitted by least squares to these means within half a baseline L on either side. With
independent noise σ of the means, 20 m = d apart, the slope has the standard error σ (12 d / L³)^1/2; L is chosen so
that it is 0.3 %, from 100 to 500 m. σ is the robust scatter of the means about the line between their neighbours,
which hills of usual length hardly touch. A hill of wavelength λ keeps 3 (sin x - x cos x) / x³ of its climb,
x = π L / λ: 99 % where λ is 10 L, 96 % where it is 5 L.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hevopt.display.facts import Shown
from hevopt.errors import DataError

Array = NDArray[np.float64]

_SPACING_M = 20.0
_SLOPE_ERROR = 0.003
_BASELINE_MIN_M, _BASELINE_MAX_M = 100.0, 500.0
_BASELINE_ALLOWED_M = (20.0, 5000.0)
_NORMAL_PER_MAD = 1.4826
_STEEPEST = 0.99  # steeper than any road; the reader of cycles refuses it
# Climb that is undone within such a distance, where it is most of all and more than this share of the distance.
_UNDONE_M, _UNDONE_SHARE, _UNDONE_GRADE = 300.0, 0.5, 0.002


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class RoadGrade(Shown):
    """grade: (row,) over the step to the next row; rule: how it was made; hint: why it may be no road, or empty."""

    grade: Array
    rule: str
    hint: str


def grade_from_altitude(
    distance_m: Array, altitude_m: Array, baseline_m: float | None
) -> RoadGrade:
    """The road's grade; distance_m, altitude_m: (row,) along the road; baseline_m: None for the rule above."""
    low, high = _BASELINE_ALLOWED_M
    if baseline_m is not None and not low <= baseline_m <= high:
        raise DataError(f"--altitude-baseline {baseline_m:g}; allowed: {low:g} to {high:g} m")
    along_m, mean_m = _means(distance_m, altitude_m)
    noise_m = _noise(along_m, mean_m)
    chosen_m = np.cbrt(12 * _SPACING_M * (noise_m / _SLOPE_ERROR) ** 2)
    length_m = baseline_m or float(np.clip(chosen_m, _BASELINE_MIN_M, _BASELINE_MAX_M))
    sine = np.clip(_slopes(along_m, mean_m, length_m), -_STEEPEST, _STEEPEST)
    middle_m = np.append((distance_m[1:] + distance_m[:-1]) / 2, distance_m[-1])
    at_rows = np.interp(middle_m, along_m, sine)
    rule = (
        f"grade from altitude: slope of a straight line through {length_m:.0f} m of road around each point "
        f"({'--altitude-baseline' if baseline_m else 'chosen'}; noise of the altitude about {noise_m:.2g} m)"
    )
    return RoadGrade(at_rows / np.sqrt(1 - at_rows**2), rule, _hint(distance_m, at_rows))


def _means(distance_m: Array, altitude_m: Array) -> tuple[Array, Array]:
    """Mean place and mean altitude of the rows in every 20 m of road that has any."""
    driven_m = distance_m[-1] - distance_m[0]
    spacing_m = min(_SPACING_M, driven_m / 4) or _SPACING_M
    place = ((distance_m - distance_m[0]) // spacing_m).astype(np.int64)
    _, of_row, count = np.unique(place, return_inverse=True, return_counts=True)
    return tuple(np.bincount(of_row, values) / count for values in (distance_m, altitude_m))


def _noise(along_m: Array, mean_m: Array) -> float:
    if len(along_m) < 3:
        return 0.0
    share = (along_m[1:-1] - along_m[:-2]) / (along_m[2:] - along_m[:-2])
    off = mean_m[1:-1] - mean_m[:-2] * (1 - share) - mean_m[2:] * share
    return float(
        _NORMAL_PER_MAD * np.median(np.abs(off) / np.sqrt(1 + share**2 + (1 - share) ** 2))
    )


def _slopes(along_m: Array, mean_m: Array, length_m: float) -> Array:
    """(point,) least-squares slope within half a length of each point, of its neighbours at least."""
    count = len(along_m)
    if count < 2:
        return np.zeros(count)
    first = np.searchsorted(along_m, along_m - length_m / 2, side="left")
    end = np.searchsorted(along_m, along_m + length_m / 2, side="right")
    here = np.arange(count)
    first, end = (
        np.minimum(first, np.maximum(here - 1, 0)),
        np.maximum(end, np.minimum(here + 2, count)),
    )
    # Sums within each window from running ones, of values near 0 so that no digits are lost.
    x, y = along_m - along_m.mean(), mean_m - mean_m.mean()
    n = end - first
    sx, sy, sxx, sxy = (
        np.concatenate([[0.0], np.cumsum(values)])[end]
        - np.concatenate([[0.0], np.cumsum(values)])[first]
        for values in (x, y, x * x, x * y)
    )
    return (sxy - sx * sy / n) / (sxx - sx * sx / n)


def _hint(distance_m: Array, sine: Array) -> str:
    """A text where most of the climb is undone within a few hundred metres."""
    driven_m = distance_m[-1] - distance_m[0]
    height_m = np.concatenate([[0.0], np.cumsum(sine[:-1] * np.diff(distance_m))])
    climb_m = float(np.maximum(np.diff(height_m), 0).sum())
    coarse_m = np.arange(distance_m[0], distance_m[-1] + _UNDONE_M, _UNDONE_M)
    kept_m = float(np.maximum(np.diff(np.interp(coarse_m, distance_m, height_m)), 0).sum())
    if climb_m <= _UNDONE_GRADE * driven_m or kept_m >= (1 - _UNDONE_SHARE) * climb_m:
        return ""
    return (
        f"NOTE: {climb_m - kept_m:.3g} m of the {climb_m:.3g} m climb are undone within {_UNDONE_M:g} m, as an "
        "altimeter's or GPS's noise is and few roads are; look at the altitude, smooth it with "
        "--altitude-baseline 500, or leave it out"
    )
