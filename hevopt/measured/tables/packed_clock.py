"""Clocks written as one number, hhmmss.ss, as satellite receivers and VBOX files have them.

Read as seconds, such a clock leaves out 40 s at the end of every minute and 40 more minutes at that of every hour.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from hevopt.measured.tables.names import PACKED_CLOCK
from hevopt.measured.tables.table import Column

Array = NDArray[np.float64]

# A minute's end counts as one where the step across it is a usual one, within this factor.
_STEPS = 1.5
# So many of them tell such a clock; more where the file says that its times are seconds, as samples may be missing.
_MINUTES, _MINUTES_OF_SECONDS = 1, 3


def as_clock(column: Column | None) -> Column | None:
    """A column of times as seconds of the day where its numbers are hhmmss.ss; any other one as it is."""
    if column is None or column.fixed:
        return column
    said = (column.unit or "").lower().split(".")[0] == PACKED_CLOCK
    if not said and column.unit not in (None, "s"):
        return column
    seconds = seconds_of(column.values)
    needed = _MINUTES if column.unit is None else _MINUTES_OF_SECONDS
    if seconds is None or not (said or _minutes_passed(column.values, seconds) >= needed):
        return column
    seconds.flags.writeable = False
    source = "clock of hours, minutes and seconds in one number"
    return replace(column, values=seconds, unit="s", source=source, fixed=True, clock="time of day")


def seconds_of(packed: Array) -> Array | None:
    """(row,) seconds since midnight of numbers hhmmss.ss, NaN where there is none; None where one is no time."""
    known = packed[np.isfinite(packed)]
    hours, minutes, seconds = known // 10_000, known // 100 % 100, known % 100
    if not len(known) or known.min() < 0 or hours.max() >= 24:
        return None
    if minutes.max() >= 60 or seconds.max() >= 60:
        return None
    found = np.full(len(packed), np.nan)
    found[np.isfinite(packed)] = 3600 * hours + 60 * minutes + seconds
    return found


def _minutes_passed(packed: Array, seconds: Array) -> int:
    """How many ends of minutes are passed in a step that is usual for such a clock alone; 0 where few are."""
    known = np.isfinite(packed)
    minute, steps_s = np.diff(packed[known] // 100), np.diff(seconds[known])
    forward = steps_s[steps_s > 0]
    if not len(forward):
        return 0
    over, step_s = steps_s[minute != 0], float(np.median(forward))
    usual = int(((over >= step_s / _STEPS) & (over <= _STEPS * step_s)).sum())
    return usual if 2 * usual > len(over) else 0
