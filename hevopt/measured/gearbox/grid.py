"""Measured losses of a gearbox on a grid of input speed and torque for each gear, linear between the points."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hevopt.car.gear_loss import LossInGear, too_steep
from hevopt.display.facts import Shown
from hevopt.errors import DataError
from hevopt.measured.clusters import clusters
from hevopt.measured.gearbox.points import GearPoints
from hevopt.units import RPM_PER_RADPS

Array = NDArray[np.float64]

# Speeds closer than this share are one.
_SPEED_SHARE = 0.01
# Share of the largest torque by which a speed's last point may fall short of it and still be the map's end.
_SHORT = 0.15
_ROUNDING, _SAME = 1e-9, 1e-6


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class MeasuredGear(Shown):
    """One gear: its grid, and by how much measured points lie from it, (point,) Nm at the input."""

    number: int
    data: LossInGear
    points: NDArray[np.int64]
    off_nm: Array


def gear_grids(points: GearPoints, gears: int, place: str) -> tuple[MeasuredGear, ...]:
    """The grid of every gear; DataError where a gear has too few points."""
    return tuple(_grid(points, number, place) for number in range(1, gears + 1))


def _grid(points: GearPoints, number: int, place: str) -> MeasuredGear:
    own = np.flatnonzero(points.gear == number)
    if not len(own):
        raise DataError(f"{place}: no point with a loss in gear {number}; add some")
    torque, loss = points.torque_nm[own], points.loss_nm[own]
    line, speed = clusters(points.speed_radps[own], 0.0, _SPEED_SHARE)
    thin = [k for k in range(len(speed)) if len(np.unique(torque[line == k])) < 2]
    if len(speed) < 2 or len(speed) - len(thin) < 2:
        raise DataError(
            f"{place}: gear {number} has {len(speed) - len(thin)} speeds with two torques or more; allowed: 2 or "
            "more; add points"
        )
    axis = _torques(torque, line, len(speed))
    kept = [k for k in range(len(speed)) if k not in thin]
    rows = [_row(torque[line == k], loss[line == k], axis) for k in kept]
    values = np.array(rows)
    inside = ~np.isnan(values).all(axis=0)
    data = LossInGear(_tidy(speed[kept]), axis[inside], values[:, inside])
    _check_slope(data, number, place)
    return MeasuredGear(number, data, own, _off(data, points, own))


def _torques(torque: Array, line: NDArray[np.int64], lines: int) -> Array:
    """(torque,) rising: those of the speed with most points, 0, and ends that all speeds reach but shorter ones."""
    counts = np.bincount(line, minlength=lines)
    fullest = np.flatnonzero(counts == counts.max())
    own = np.unique(torque[line == fullest[len(fullest) // 2]])
    low, high = (
        -_reached([-torque[line == k].min() for k in range(lines)]),
        _reached([torque[line == k].max() for k in range(lines)]),
    )
    inner = own[(own > low) & (own < high)]
    ends = [low, high, *([0.0] if low < 0 < high else [])]
    every = np.unique(_tidy(np.concatenate([inner, ends])))
    # What lies next to another by rounding only goes; the ends stay.
    apart = np.diff(every, prepend=-np.inf) > _SAME * np.abs(every).max()
    apart[-1] = True
    kept: Array = every[apart]
    return kept


def _reached(ends: list[float]) -> float:
    """The least of those ends that come near the largest: a speed measured less far does not cut the others."""
    far = max(ends)
    return min(end for end in ends if end >= far - _SHORT * abs(far))


def _row(torque: Array, loss: Array, axis: Array) -> Array:
    """(torque,) losses at one speed, NaN beyond its points; those at one torque as their mean."""
    at, group = np.unique(torque, return_inverse=True)
    mean = np.bincount(group, loss) / np.bincount(group)
    slack = _ROUNDING * max(float(np.abs(axis).max()), 1e-9) + 1e-6 * np.abs(at).max()
    beyond = (axis < at[0] - slack) | (axis > at[-1] + slack)
    return np.where(beyond, np.nan, np.interp(axis, at, mean))


def _check_slope(data: LossInGear, number: int, place: str) -> None:
    steep = too_steep(data.torque_nm, data.loss_nm)
    if steep is not None:
        raise DataError(
            f"{place}: gear {number} at {data.speed_radps[steep.row] * RPM_PER_RADPS:.4g} rpm (input): between "
            f"{steep.low_nm:.4g} and {steep.high_nm:.4g} Nm the loss rises by more than the torque itself; correct "
            "these points"
        )


def _off(data: LossInGear, points: GearPoints, own: NDArray[np.int64]) -> Array:
    """(point,) measured less mapped loss, NaN where the map does not reach."""
    from hevopt.car.grid import interpolated

    found = interpolated(
        data.speed_radps,
        data.torque_nm,
        data.loss_nm,
        points.torque_nm[own],
        points.speed_radps[own],
    )
    return points.loss_nm[own] - found


def _tidy(values: Array) -> Array:
    return np.array([float(f"{value:.7g}") for value in values])
