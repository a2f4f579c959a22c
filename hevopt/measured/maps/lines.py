"""Measured points on lines of one speed, as a bench holds it.

Rule. Speeds closer than 12 rpm or 0.5 % are one speed line, or, where that gives no lines and the gaps between
them are clear, 30 rpm or 1 %, then 60 rpm or 2 %; flows move to its mean in proportion to speed. Several points at
one place are averaged.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hevopt.display.facts import Shown
from hevopt.errors import DataError
from hevopt.measured.clusters import clusters
from hevopt.measured.maps.points import Points
from hevopt.measured.tables.rows import runs
from hevopt.units import RPM_PER_RADPS

Array = NDArray[np.float64]

_LINE_RPM = 12.0
_LINE_SHARE = 0.005
# Wider lines, of speeds held less well: taken where they stand this many of their widths apart.
_WIDER = ((30.0, 0.01), (60.0, 0.02))
_APART = 2.0
_PER_LINE = 3
_SAME = 1e-6
# A bench's or a program's rounding of idle speed, such as rad/s with two decimals.
_IDLE_SHARE = 5e-4
_POINTS_MIN = 4
# Two measurements of one point, share of their average, that a bench repeats.
_REPEATS = 0.02
_TINY = 1e-12


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Lines(Shown):
    """Points by speed line. line: (point,) which; speed_radps: (line,); regular: whether there are such lines."""

    points: Points
    line: NDArray[np.int64]
    speed_radps: Array
    regular: bool
    notes: tuple[str, ...]


def in_lines(points: Points, *, proportional: bool, idle_radps: float = 0.0) -> Lines:
    """The points moved onto speed lines, several at one place averaged.

    proportional: the quantity is a flow, which moves in proportion to speed; idle_radps: a line this close to
    idle speed is the one at idle.
    """
    if len(points.value) < _POINTS_MIN:
        raise DataError(f"{len(points.value)} points; a map needs {_POINTS_MIN} or more")
    line, mean, regular = _speed_lines(points, idle_radps)
    moved = np.abs(points.speed_radps - mean[line])
    if points.rectangular or not regular:
        line, mean = clusters(points.speed_radps, 0.0, _SAME)
        moved = np.zeros(len(line))
    mean = _tidy(mean * RPM_PER_RADPS) / RPM_PER_RADPS
    mean = np.where(is_idle(mean, idle_radps), idle_radps, mean)
    notes = []
    if moved.max() > _SAME * mean.max():
        rpm = moved.max() * RPM_PER_RADPS
        notes.append(f"{len(mean)} speed lines; points moved to them by up to {rpm:.3g} rpm")
    value = points.value
    if proportional:
        before = np.where(points.speed_radps > 0, points.speed_radps, 1.0)
        value = np.where(moved > _SAME * before, value * mean[line] / before, value)
    merged, line, repeats = _averaged(points, line, mean, value)
    return Lines(merged, line, mean, regular or points.rectangular, (*notes, *repeats))


def is_idle(speed_radps: Array, idle_radps: float) -> NDArray[np.bool_]:
    """Whether a speed is idle speed but for rounding."""
    return np.abs(speed_radps - idle_radps) <= _IDLE_SHARE * idle_radps


def _speed_lines(points: Points, idle_radps: float) -> tuple[NDArray[np.int64], Array, bool]:
    """Line of each point, the lines' speeds, and whether the points stand on such lines."""
    speed = points.speed_radps
    for rpm, share in ((_LINE_RPM, _LINE_SHARE), *_WIDER):
        line, mean = clusters(speed, rpm / RPM_PER_RADPS, share)
        clear = rpm == _LINE_RPM or _clear(speed, line)
        idle = np.abs(mean - idle_radps) <= _LINE_RPM / RPM_PER_RADPS
        mean = np.where(idle & (idle.sum() == 1), idle_radps, mean)
        reach = np.maximum(rpm / RPM_PER_RADPS, share * mean[line])
        held = (np.abs(speed - mean[line]) <= reach).all()
        if 1 < len(mean) <= len(line) / 2 and held and clear:
            return line, mean, True
    return line, mean, False


def _clear(speed_radps: Array, line: NDArray[np.int64]) -> bool:
    """Whether lines of enough points stand well apart."""
    count = line.max() + 1
    low, high = np.full(count, np.inf), np.full(count, -np.inf)
    np.minimum.at(low, line, speed_radps)
    np.maximum.at(high, line, speed_radps)
    apart = (low[1:] - high[:-1]).min(initial=np.inf)
    return len(line) >= _PER_LINE * count and apart >= _APART * (high - low).max()


def groups(lines: Lines) -> tuple[NDArray[np.int64], Array]:
    """Group of each point and the groups' speeds: the speed lines, else twentieths of the speed range."""
    line, speed = lines.line, lines.speed_radps
    if lines.regular:
        return line, speed
    edges = np.linspace(speed[0], speed[-1], 21)
    line = np.clip(np.searchsorted(edges, speed[line], "right") - 1, 0, 19)
    used, line = np.unique(line, return_inverse=True)
    speed = ((edges[1:] + edges[:-1]) / 2)[used]
    speed[0], speed[-1] = edges[0], edges[-1]
    return line, speed


def envelope_nm(lines: Lines, sign: float = 1.0) -> tuple[Array, Array]:
    """Speeds, and the outermost torque measured around each: highest with sign 1, lowest with -1."""
    line, speed = groups(lines)
    outermost = np.full(len(speed), -np.inf)
    np.maximum.at(outermost, line, sign * lines.points.torque_nm)
    return speed, sign * outermost


def _averaged(points: Points, line: NDArray[np.int64], mean: Array, value: Array):
    """Points with one at each place, their lines, and what is to be said of places that had several."""
    of_torque, torque = clusters(points.torque_nm, 0.0, _SAME)
    key = np.column_stack([line, of_torque])
    places, first, which, count = np.unique(
        key, axis=0, return_index=True, return_inverse=True, return_counts=True
    )
    which = which.ravel()
    average = np.bincount(which, value) / count
    kept = Points(
        mean[places[:, 0]], torque[places[:, 1]], average, points.lines[first],
        points.rectangular, points.roles, points.notes,
    )  # fmt: skip
    return kept, places[:, 0], _said_of_repeats(points, value, which, average, count)


def _said_of_repeats(points: Points, value: Array, which: Array, average: Array, count: Array):
    """How many places were measured more than once, and the lines of those that disagree."""
    if not (count > 1).any():
        return []
    low, high = np.full(len(count), np.inf), np.full(len(count), -np.inf)
    np.minimum.at(low, which, value)
    np.maximum.at(high, which, value)
    spread = (high - low) / np.maximum(average, _TINY)
    said = [f"{(count > 1).sum()} points measured more than once, averaged"]
    if (spread > _REPEATS).any():
        lines = sorted(set(points.lines[spread[which] > _REPEATS].tolist()))
        said.append(
            f"WARNING: repeats differ by up to {spread.max():.0%} of their average, {runs(lines)}; correct or "
            "remove the wrong one"
        )
    return said


def _tidy(values: Array) -> Array:
    """Values without what a change of units left behind the tenth digit."""
    return np.array([float(f"{value:.9g}") for value in values])
