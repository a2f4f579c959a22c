"""What the columns of a cycle may hold; every fault is told with its line."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
# Called with every fault found: line and text.
Tell = Callable[[int, str], None]
_TIME_MAX_S = 1e9
SPEED_MAX_MPS = 100.0
GRADE_MAX = 0.5
_STEP_MIN_S, _STEP_MAX_S = 1e-4, 3600.0
# Twice the friction limit of a dry road: nothing on tyres does more.
_ACCELERATION_MAX_MPS2 = 20.0


def check_time_and_speed(
    lines: list[int],
    time_s: NDArray[np.float64],
    speed_mps: NDArray[np.float64],
    column: str,
    factor: float,
    tell: Tell,
) -> None:
    """Time must increase by steps of a cycle, and speed keep to what a car on tyres does."""
    check_range(lines, "time_s", time_s, -_TIME_MAX_S, _TIME_MAX_S, tell)
    steps_s = np.diff(time_s)
    for k in np.flatnonzero(steps_s <= 0) + 1:
        tell(
            lines[k],
            f"time {time_s[k]:g} s after {time_s[k - 1]:g} s; time must increase from line to line; "
            "sort the lines or remove the duplicate",
        )
    for k in (
        np.flatnonzero((steps_s > 0) & ((steps_s < _STEP_MIN_S) | (steps_s > _STEP_MAX_S))) + 1
    ):
        tell(
            lines[k],
            f"{steps_s[k - 1]:g} s after the line before; allowed: {_STEP_MIN_S:g} to {_STEP_MAX_S:g} s; "
            "time is in seconds",
        )
    outside = (speed_mps < 0) | (speed_mps > SPEED_MAX_MPS)
    for k in np.flatnonzero(outside):
        tell(
            lines[k],
            f"{column} is {speed_mps[k] / factor:g}; allowed: 0 to {SPEED_MAX_MPS / factor:g}; check the "
            "unit in the column's name",
        )
    judged = (steps_s > 0) & ~outside[1:] & ~outside[:-1]
    acceleration = np.diff(speed_mps) / np.where(judged, steps_s, 1.0)
    for k in np.flatnonzero(judged & (np.abs(acceleration) > _ACCELERATION_MAX_MPS2)) + 1:
        tell(
            lines[k],
            f"acceleration {acceleration[k - 1]:.3g} m/s²; allowed: ±{_ACCELERATION_MAX_MPS2:g} m/s², more "
            "than tyres hold; check the units of time and speed, or repair the spike",
        )


def check_range(
    lines: list[int],
    column: str,
    values: Array,
    low: float,
    high: float,
    tell: Tell,
    meaning: str = "",
) -> None:
    """Values must lie within low and high; meaning: what else the message says of them."""
    for k in np.flatnonzero((values < low) | (values > high)):
        tell(lines[k], f"{column} is {values[k]:g}; allowed: {low:g} to {high:g}{meaning}")


def whole_numbers(
    lines: list[int], column: str, values: Array, high: int, tell: Tell
) -> NDArray[np.int64]:
    """The values as whole numbers from 0 to high, which they must be."""
    check_range(lines, column, values, 0, high, tell)
    for k in np.flatnonzero(values != np.round(values)):
        tell(lines[k], f"{column} is {values[k]:g}; a whole number is needed")
    whole: NDArray[np.int64] = np.clip(np.round(values), 0, high).astype(np.int64)
    return whole
