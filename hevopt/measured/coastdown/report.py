"""What a coast-down says, in words: coefficients with intervals, forces, slope and wind, doubts."""

from collections.abc import Sequence

import numpy as np

from hevopt.measured.coastdown.fit import RoadLoad, Run
from hevopt.units import KMH_PER_MPS, STANDARD_GRAVITY_MPS2

_UNITS = ("N", "N/(m/s)", "N/(m/s)²")
_WIDE = 0.25
_FEW_RUNS = 6
_FAR_RUN = 0.1
# Intervals below this share of a value have no digits of their own; measured runs never agree so well.
_FINEST = 1e-4
_TINY = 1e-9


def results(runs: Sequence[Run], fit: RoadLoad, mass_kg: float, rotating_kg: float) -> list[str]:
    """Lines of text; mass_kg: of the car as tested, rotating_kg: what its wheels add to the inertia."""
    half = fit.half_width()
    ways = [sum(run.direction == d for run in runs) for d in (1, -1)]
    said = [
        f"{len(runs)} runs, {ways[0]} and {ways[1]} per direction; mass {mass_kg:g} kg, rotating parts "
        f"{rotating_kg:.4g} kg",
        "F = C0 + C1 v + C2 v², mean of both directions, v in m/s; ± is half the 95 % confidence interval",
    ]
    for name, value, width, unit in zip(
        ("C0", "C1", "C2"), fit.coefficients, half, _UNITS, strict=True
    ):
        known = max(width, abs(value) * _FINEST, _TINY)
        places = max(0, 1 - int(np.floor(np.log10(known))))
        said.append(f"  {name} = {value:9.{places}f} ± {_width(width, places)} {unit}")
    low, high = _range_mps(runs)
    speeds = np.arange(20.0, 300.0, 20.0) / KMH_PER_MPS
    speeds = speeds[(speeds >= low) & (speeds <= high)]
    force, width = fit.force_n(speeds)
    said += [
        f"  at {v * KMH_PER_MPS:3.0f} km/h: {f:7.1f} ± {_width(w, 1)} N"
        for v, f, w in zip(speeds, force, width, strict=True)
    ]
    grade = fit.slope_n / (mass_kg * STANDARD_GRAVITY_MPS2)
    wind = "not to be told" if fit.wind_mps is None else f"{fit.wind_mps:+.2f} m/s"
    said.append(
        f"in direction +1: slope {grade:+.3%}, head wind {wind}; what a steady wind adds to C0 is taken out"
    )
    offsets = ", ".join(
        f"{run.label} ({run.direction:+d}) {off:+.1f}"
        for run, off in zip(runs, fit.offset_n, strict=True)
    )
    said.append(f"mean force of each run beyond the fit, N: {offsets}")
    return said + [f"WARNING: {doubt}" for doubt in _doubts(runs, fit)]


def _width(width: float, places: int) -> str:
    """Half an interval with that many decimals, never as 0."""
    unit = 10.0**-places
    return f"{width:.{places}f}" if width >= unit / 2 else f"<{unit:.{places}f}"


def _range_mps(runs: Sequence[Run]) -> tuple[float, float]:
    return min(r.speed_mps.min() for r in runs), max(r.speed_mps.max() for r in runs)


def _doubts(runs: Sequence[Run], fit: RoadLoad) -> list[str]:
    half, doubts = fit.half_width(), []
    low, high = (v * KMH_PER_MPS for v in _range_mps(runs))
    if len(runs) < _FEW_RUNS:
        doubts.append(
            f"{len(runs)} runs only; with {_FEW_RUNS} or more the intervals become narrower"
        )
    loose = [
        name
        for name, value, width in zip(("C0", "C2"), fit.coefficients[::2], half[::2], strict=True)
        if width > _WIDE * abs(value)
    ]
    if loose:
        doubts.append(
            f"{' and '.join(loose)} known to worse than ±{_WIDE:.0%}: runs from {low:.0f} to {high:.0f} km/h do "
            f"not separate the coefficients (condition number {fit.condition:.0f}); the force within that range is "
            "known better, see above; do not use it outside, or add runs over a wider range"
        )
    middle = np.array([(low + high) / 2 / KMH_PER_MPS])
    force, width = (values[0] for values in fit.force_n(middle))
    if width < _FINEST * force:
        doubts.append(
            "the runs of a direction agree better than measured ones can; copies, or computed? the intervals then "
            "say nothing"
        )
    for run, off in zip(runs, fit.offset_n, strict=True):
        if abs(off) > _FAR_RUN * force:
            doubts.append(
                f"run {run.label} ({run.place}) has {off:+.0f} N beyond the fit, {abs(off) / force:.0%} of the "
                "force: wind, a dragging brake, or another state of the car?"
            )
    return doubts
