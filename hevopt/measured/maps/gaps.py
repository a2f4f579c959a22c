"""Where measured points stand thin: the widest gap between them, and the lowest torque measured with fuel."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from hevopt.measured.maps.envelope import Envelope
from hevopt.measured.maps.lines import Lines, envelope_nm

Array = NDArray[np.float64]

WIDE = 3.0
_FINE = 100
_ROUNDING = 1e-6


@dataclass(frozen=True, slots=True)
class Gap:
    """The place furthest from any measured point, with both axes scaled by the points' spans.

    times: its distance over the median one; near: speed and torque of its nearest point
    reach: half axes, rad/s and Nm, of the ellipse around the place without a point
    """

    speed_radps: float
    torque_nm: float
    near: tuple[float, float]
    times: float
    reach: tuple[float, float]


def fired(lines: Lines) -> NDArray[np.bool_]:
    """(point,) all but those of an engine dragged without fuel."""
    return (lines.points.value > 0) | (lines.points.torque_nm >= 0)


def lowest_fired_nm(lines: Lines, speed_radps: Array) -> Array:
    """Lowest torque measured at each speed, points of the unfired engine left out."""
    points = lines.points
    burning = replace(points, torque_nm=np.where(fired(lines), points.torque_nm, np.inf))
    speed, lowest = envelope_nm(replace(lines, points=burning), -1.0)
    known = np.isfinite(lowest)
    return np.interp(speed_radps, speed[known], lowest[known])


def widest_gap(lines: Lines, envelope: Envelope) -> Gap | None:
    """The widest gap between the lowest and the highest torque measured, as far as the component gets.

    None without any distance.
    """
    from scipy.spatial import cKDTree

    points = lines.points
    ends = np.clip(lines.speed_radps[[0, -1]], *envelope.speed_radps[[0, -1]])
    axis = np.linspace(*ends, _FINE)
    least, most = (
        np.interp(axis, envelope.speed_radps, t) for t in (envelope.low_nm, envelope.high_nm)
    )
    low = np.clip(lowest_fired_nm(lines, axis), least, most)
    high = np.clip(np.interp(axis, *envelope_nm(lines)), low, most)
    shares = np.linspace(0.0, 1.0, _FINE)
    torque = low[:, None] * (1 - shares) + high[:, None] * shares
    places = np.column_stack([np.repeat(axis, _FINE), torque.ravel()])
    measured = np.column_stack([points.speed_radps, points.torque_nm])
    span = np.maximum(np.ptp(measured, axis=0), _ROUNDING)
    away, nearest = cKDTree(measured / span).query(places / span)
    k, usual = int(np.argmax(away)), float(np.median(away))
    if usual < _ROUNDING:
        return None
    speed, torque_nm = (float(x) for x in places[k])
    near = float(measured[nearest[k], 0]), float(measured[nearest[k], 1])
    reach = float(away[k] * span[0]), float(away[k] * span[1])
    return Gap(speed, torque_nm, near, float(away[k]) / usual, reach)
