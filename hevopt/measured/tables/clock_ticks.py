"""Clocks that are coarser than the samples, such as one of whole seconds in a log of several rows a second."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hevopt.display.facts import Shown

Array = NDArray[np.float64]
Rows = NDArray[np.int64]

# Times nearer than this are one time.
SAME_TIME_S = 1e-6
# Rows that share a time with another, from which on a clock is coarse; fewer are faults of single rows.
_SHARED_MIN = 0.25
_TICK_ERROR = 1e-3


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Ticks(Shown):
    """Moments of a coarse clock. begins, counts: (moment,) first row and rows of each; tick_s: its smallest step"""

    begins: Rows
    counts: Rows
    tick_s: float

    @property
    def usual(self) -> int:
        """How many rows a moment usually has."""
        return max(int(np.median(self.counts)), 1)

    def told(self) -> str:
        """What a reader should know of such a clock."""
        return f"up to {self.counts.max()} rows share each {self.tick_s:g} s of the clock"


def ticks_of(time_s: Array) -> Ticks | None:
    """The moments of some times, NaN among them, where they are those of a coarse clock; None otherwise."""
    if len(time_s) < 2:
        return None
    begins = np.flatnonzero(np.r_[True, ~(np.abs(np.diff(time_s)) <= SAME_TIME_S)])
    counts = np.diff(np.r_[begins, len(time_s)])
    known_s = time_s[begins][np.isfinite(time_s[begins])]
    steps_s = np.diff(known_s)
    tick_s = float(min(steps_s[steps_s > 0], default=0.0))
    if counts[counts > 1].sum() < _SHARED_MIN * len(time_s) or tick_s <= SAME_TIME_S:
        return None
    places = (known_s - known_s[0]) / tick_s
    return (
        Ticks(begins, counts, tick_s)
        if np.abs(places - np.round(places)).max() <= _TICK_ERROR
        else None
    )


def spread_evenly(time_s: Array, ticks: Ticks) -> Array:
    """(row,) the times with the rows of every moment spread evenly over it.

    A moment with few rows, as before or after a gap and at the ends, has them where they follow on from the others.
    """
    begins, counts, usual = ticks.begins, ticks.counts, ticks.usual
    share = np.zeros(len(time_s))
    gap = np.r_[True, ~(np.diff(time_s[begins]) <= 1.5 * ticks.tick_s), True]
    for k, (row, count) in enumerate(zip(begins.tolist(), counts.tolist(), strict=True)):
        first, last = gap[k] and count < usual, gap[k + 1] and count < usual
        slots = usual if first or last else count
        share[row : row + count] = (np.arange(count) + (slots - count) * first) / slots
    return time_s + share * ticks.tick_s
