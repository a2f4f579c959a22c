"""A grid's cells and a curve that cuts them: which of its corners the car needs to be used up to the curve."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from hevopt.measured.maps.lines import Lines, envelope_nm
from hevopt.measured.maps.points import Curve
from hevopt.units import RPM_PER_RADPS

Array = NDArray[np.float64]

_SAMPLES = 21
_ROUNDING = 1e-6
# Two runs of one engine on one bench repeat full load to about this share of it.
_REPEATS = 0.02


def near(speed_radps: Array, i: int) -> Array:
    """Speeds from the grid line before the i-th to the one after it: all whose cells lean on that line."""
    first, last = max(i - 1, 0), min(i + 1, len(speed_radps) - 1)
    return np.linspace(speed_radps[first], speed_radps[last], _SAMPLES)


def cell_at(torque_nm: Array, most_nm: float) -> int:
    """Index of the lowest grid torque that is not below a limit; that of the highest where all are."""
    reached = int(np.searchsorted(torque_nm, most_nm - _ROUNDING * abs(most_nm)))
    return min(reached, len(torque_nm) - 1)


def measured_top_nm(lines: Lines, speed_radps: Array) -> Array:
    """Highest torque measured around each speed; minus infinity beyond the measured speeds."""
    speed, top = envelope_nm(lines)
    rounding = _ROUNDING * speed[-1]
    outside = (speed_radps < speed[0] - rounding) | (speed_radps > speed[-1] + rounding)
    return np.where(outside, -np.inf, np.interp(speed_radps, speed, top))


def encloses(lines: Lines, limit_nm: Array, speed_radps: Array) -> bool:
    """Whether the points were measured up to a limit at all these speeds but those beyond theirs."""
    top = measured_top_nm(lines, speed_radps)
    below = limit_nm <= top + _ROUNDING * np.abs(limit_nm)
    return bool((below | ~np.isfinite(top)).all())


def lowered(full: Curve, flows: list[Lines]) -> tuple[Curve, list[str]]:
    """The full-load curve without the little by which it lies above the points of any flow, and what was done.

    Else every cell that the curve cuts would have to be given up: nothing is used that the points do not enclose.
    """
    notes = []
    for lines in flows:
        speed = _nodes(full, lines)
        torque = np.interp(speed, full.speed_radps, full.torque_nm)
        above = torque - measured_top_nm(lines, speed)
        little = (above > _ROUNDING * torque) & (above <= _REPEATS * torque) & lines.regular
        if not little.any():
            continue
        most = int(np.argmax(np.where(little, above, 0.0)))
        notes.append(
            f"full load: up to {above[most]:.2g} Nm ({above[most] / torque[most]:.2%}, at "
            f"{speed[most] * RPM_PER_RADPS:.0f} rpm) above the highest measured torque; lowered to that torque "
            f"where it is at most {_REPEATS:.0%} above, as two runs of one engine differ by as much"
        )
        full = replace(full, speed_radps=speed, torque_nm=torque - np.where(little, above, 0.0))
    return full, notes


def _nodes(full: Curve, lines: Lines) -> Array:
    """Speeds between which both the curve and the highest measured torque are straight, and do not cross."""
    nodes = _joined(full.speed_radps, envelope_nm(lines)[0])
    above = np.interp(nodes, full.speed_radps, full.torque_nm) - measured_top_nm(lines, nodes)
    a, b = above[:-1], above[1:]
    crosses = np.isfinite(a) & np.isfinite(b) & (np.sign(a) == -np.sign(b)) & (a != 0)
    share = a[crosses] / (a[crosses] - b[crosses])
    return _joined(nodes, nodes[:-1][crosses] + share * np.diff(nodes)[crosses])


def _joined(speed_radps: Array, others: Array) -> Array:
    """Speeds, and those of others within their ends that are none of them but for rounding."""
    away = np.abs(others[:, None] - speed_radps).min(axis=1) if len(others) else others
    within = (others > speed_radps[0]) & (others < speed_radps[-1])
    return np.sort(
        np.concatenate([speed_radps, others[within & (away > _ROUNDING * speed_radps[-1])]])
    )
