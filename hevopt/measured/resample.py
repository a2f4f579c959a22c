"""A trace at any times to 1 Hz, keeping distance, final time and standstill.

The measured speed is taken as linear between its samples. Let v_k be its value at the new times t_k, h_k the length
of step k, D_k the measured distance in it and S_k = h_k (v_k + v_k+1) / 2 the one that the new samples alone would
give. Then

    v'_k = v_k (h_k-1 D_k-1 / S_k-1 + h_k D_k / S_k) / (h_k-1 + h_k)

Sum over h_k (v'_k + v'_k+1) / 2 is that over D_k: each step's distance is shared between its ends in proportion to
their speeds. A speed of 0 stays 0, none becomes negative, and samples that already are at 1 Hz stay as they are.
Where a car moves only between two samples at rest, its distance is shared equally.
"""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# Times nearer than this are one time; what converts ms or min to s leaves less.
_SAME_TIME_S = 1e-6
_NO_DISTANCE_M = 1e-9


def one_hertz_times(duration_s: float) -> Array:
    """(sample,) whole seconds from 0, the last of them moved to the end: the last step has 0.5 to 1.5 s."""
    steps = max(int(np.floor(duration_s + 0.5)), 1)
    times_s = np.arange(steps + 1, dtype=float)
    times_s[-1] = duration_s
    return times_s


def distance_at(time_s: Array, speed_mps: Array, at_s: Array) -> Array:
    """Distance driven from the first sample to some times, the speed being linear between samples.

    time_s, speed_mps: (row,) with times that increase; at_s and the result: (sample,)
    """
    steps_m = np.diff(time_s) * (speed_mps[1:] + speed_mps[:-1]) / 2
    driven_m = np.concatenate([[0.0], np.cumsum(steps_m)])
    row = rows_at(time_s, at_s)
    return (
        driven_m[row]
        + (at_s - time_s[row]) * (speed_mps[row] + np.interp(at_s, time_s, speed_mps)) / 2
    )


def rows_at(time_s: Array, at_s: Array) -> NDArray[np.int64]:
    """(sample,) the last row at or before each time, whose gear, clutch and grade hold there."""
    return np.maximum(np.searchsorted(time_s, at_s + _SAME_TIME_S, side="right") - 1, 0)


def speeds_at(time_s: Array, speed_mps: Array, at_s: Array) -> Array:
    """(sample,) speeds at new times by the rule above; at_s begins and ends with time_s."""
    plain = np.interp(at_s, time_s, speed_mps)
    step_s = np.diff(at_s)
    measured_m = np.maximum(np.diff(distance_at(time_s, speed_mps, at_s)), 0.0)
    sampled_m = step_s * (plain[1:] + plain[:-1]) / 2
    rests = sampled_m < _NO_DISTANCE_M
    scale = np.where(rests, 1.0, measured_m / np.where(rests, 1.0, sampled_m))
    shared_m = np.where(rests, measured_m, 0.0)
    speed_s, share_m, weight_s = np.zeros_like(plain), np.zeros_like(plain), np.zeros_like(plain)
    for ends in (slice(None, -1), slice(1, None)):
        speed_s[ends] += step_s * scale
        share_m[ends] += shared_m
        weight_s[ends] += step_s
    return (plain * speed_s + share_m) / weight_s


def mean_grades(time_s: Array, speed_mps: Array, grade: Array, at_s: Array) -> Array:
    """(sample,) mean grade over the distance of each step, so that the climb is kept.

    The row's own where the car rests and in the last row, which begins no step. grade: (row,) held to the next row
    """
    all_s = np.union1d(time_s, at_s)
    climb = np.concatenate(
        [
            [0.0],
            np.cumsum(
                np.diff(distance_at(time_s, speed_mps, all_s)) * grade[rows_at(time_s, all_s)][:-1]
            ),
        ]
    )
    driven_m = np.diff(distance_at(time_s, speed_mps, at_s))
    climbed_m = np.diff(climb[np.searchsorted(all_s, at_s)])
    held = grade[rows_at(time_s, at_s)]
    moving = driven_m > _NO_DISTANCE_M
    held[:-1][moving] = climbed_m[moving] / driven_m[moving]
    return held
