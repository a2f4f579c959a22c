"""Measured points put on a rectangular grid of speed and torque, without extrapolation.

Rule. Where the speed lines (map_lines.py) share their torques, lines and torques are the grid, every value stays as
it is, and the cells that are missing are holes: three quarters of all torques between their lowest and highest are
measured, and no line ends at a torque that most of the others lack. Other points are joined by triangles (Delaunay,
both axes scaled to equal length) and interpolated linearly on them; what lies outside their hull, or beyond the
outermost torques measured around that speed, is not a number. Round torques of their own at every speed are none,
nor is a table laid out as one that is mostly empty: the points decide, not the form in which they come.
"""

from dataclasses import dataclass
from math import ceil, floor, log10

import numpy as np
from numpy.typing import NDArray

from hevopt.car.grid import interpolated
from hevopt.display.facts import Shown
from hevopt.errors import DataError
from hevopt.measured.maps.lines import Lines, envelope_nm

Array = NDArray[np.float64]

_SAME = 1e-6
# Of a grid's cells, how many are measured at least.
_FILLED = 0.75
_STEPS = 60
_TORQUE_STEPS = 80
# A rectangle of points has two ways to cut it in triangles; this decides, where rounding would otherwise.
_SHEAR = 1e-3
_AXIS_MAX = 400


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class MapGrid(Shown):
    """A quantity on axes; values: (speed, torque), NaN where not measured."""

    speed_radps: Array
    torque_nm: Array
    values: Array

    def at(self, torque_nm: Array, speed_radps: Array) -> Array:
        """Interpolated as the car will use it; NaN outside."""
        return interpolated(self.speed_radps, self.torque_nm, self.values, torque_nm, speed_radps)


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Axes(Shown):
    """Where a grid's values stand. lattice: the points stand there already; rule: how it came about, in words."""

    speed_radps: Array
    torque_nm: Array
    lattice: bool
    rule: str


def axes_of(lines: Lines) -> Axes:
    """The axes of the grid for the points."""
    torque = np.unique(lines.points.torque_nm)
    if lines.regular and _share_torques(lines, torque):
        _check_axes(lines.speed_radps, torque)
        return Axes(
            lines.speed_radps, torque, True, "measured on a rectangular grid, used as it is"
        )
    low, high = lines.speed_radps[0], lines.speed_radps[-1]
    speed = np.linspace(low, high, _STEPS + 1)
    if lines.regular:
        step = (high - low) / _STEPS
        pieces = [
            np.linspace(a, b, max(ceil((b - a) / step - _SAME), 1), endpoint=False)
            for a, b in zip(lines.speed_radps[:-1], lines.speed_radps[1:], strict=True)
        ]
        speed = np.append(np.concatenate(pieces), high)
    torque = torque_axis(torque[0], torque[-1])
    _check_axes(speed, torque)
    how = "speed lines" if lines.regular else "irregular points"
    rule = f"{how} put on a grid: linear on the triangles between measured points"
    return Axes(speed, torque, False, rule)


def _share_torques(lines: Lines, torque: Array) -> bool:
    """Whether speed lines and the torques of their points are a grid, of which some cells may be missing.

    A torque at which a line ends, such as full load, and which most of the lines around it lack, is its own.
    """
    low, high = (envelope_nm(lines, sign)[1] for sign in (-1.0, 1.0))
    between = (torque >= low[:, None]) & (torque <= high[:, None])
    measured = np.zeros(between.shape, dtype=bool)
    measured[lines.line, np.searchsorted(torque, lines.points.torque_nm)] = True
    rare = 2 * measured.sum(axis=0) <= between.sum(axis=0)
    own = rare & np.isin(torque, np.concatenate([low, high]))
    return bool(measured.sum() >= _FILLED * between.sum() and not own.any())


def torque_axis(low: float, high: float) -> Array:
    """Round torques between the ends, and the ends themselves."""
    span = high - low
    if span <= 0:
        raise DataError("all points have one torque; a map needs points at several torques")
    decade = 10.0 ** floor(log10(span / _TORQUE_STEPS))
    step = next(f * decade for f in (1, 2, 2.5, 5, 10) if span / (f * decade) <= _TORQUE_STEPS)
    inner = step * np.arange(ceil(low / step), floor(high / step) + 1)
    close = _SAME * span
    inner = inner[(inner > low + close) & (inner < high - close)]
    return np.concatenate([[low], inner, [high]])


def on_axes(lines: Lines, speed_radps: Array, torque_nm: Array) -> MapGrid:
    """The points on the axes: interpolated as the grid that they are, on whatever axes, else on triangles."""
    own = np.unique(lines.points.torque_nm)
    several = min(len(own), len(lines.speed_radps)) > 1
    if lines.regular and several and _share_torques(lines, own):
        values = np.full((len(lines.speed_radps), len(own)), np.nan)
        values[lines.line, np.searchsorted(own, lines.points.torque_nm)] = lines.points.value
        grid = MapGrid(lines.speed_radps, own, values)
        return MapGrid(speed_radps, torque_nm, grid.at(torque_nm, speed_radps[:, None]))
    return MapGrid(speed_radps, torque_nm, _on_triangles(lines, speed_radps, torque_nm))


def _on_triangles(lines: Lines, speed_radps: Array, torque_nm: Array) -> Array:
    from scipy.interpolate import LinearNDInterpolator
    from scipy.spatial import QhullError

    points, speed = lines.points, lines.speed_radps[lines.line]
    span = np.array([max(np.ptp(speed), _SAME), max(np.ptp(points.torque_nm), _SAME)])
    places = np.column_stack([speed, points.torque_nm]) / span
    places[:, 1] += _SHEAR * places[:, 0]
    try:
        surface = LinearNDInterpolator(places, points.value)
    except QhullError:
        raise DataError(
            "all points lie on one line; a map needs several speeds and torques"
        ) from None
    x, y = np.meshgrid(speed_radps / span[0], torque_nm / span[1], indexing="ij")
    values = surface(np.stack([x, y + _SHEAR * x], axis=-1))
    low, high = (np.interp(speed_radps, *envelope_nm(lines, sign))[:, None] for sign in (-1, 1))
    inside = (torque_nm >= low - _SAME * span[1]) & (torque_nm <= high + _SAME * span[1])
    return np.where(inside, values, np.nan)


def _check_axes(speed_radps: Array, torque_nm: Array) -> None:
    for name, axis in (("speeds", speed_radps), ("torques", torque_nm)):
        if not 2 <= len(axis) <= _AXIS_MAX:
            raise DataError(f"{len(axis)} {name}; a map needs 2 to {_AXIS_MAX} of them")
