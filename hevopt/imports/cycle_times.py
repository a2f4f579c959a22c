"""Times of a logged drive: their order, clocks that pass midnight, gaps and long steps.

A gap is more than five usual steps without a sample, and more than 2 s; steps of
more than three usual ones are told.
"""

from bisect import bisect_left
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from hevopt.imports.cycle_columns import Drive
from hevopt.imports.cycle_fault_list import Faults, empty_cell
from hevopt.imports.measured_cells import LISTED

Array = NDArray[np.float64]

_GAP_STEPS, _GAP_MIN_S = 5.0, 2.0
_LONG_STEPS = 3.0
_USUAL_MAX_S = 10.0
_DAY_S = 86400.0
_SAME_TIME_S = 1e-6


def past_midnight(drive: Drive, faults: Faults) -> Drive:
    """The drive with a day added where a clock begins again at 0; every such line is a fault."""
    rows = np.flatnonzero(np.isfinite(drive.time_s))
    time_s = drive.time_s[rows]
    steps_s = np.diff(time_s)
    falls = np.flatnonzero(steps_s < -_DAY_S / 2)
    in_a_day = not ((time_s < 0) | (time_s >= _DAY_S)).any()
    if not len(falls) or not in_a_day or (steps_s > _DAY_S / 2).any():
        return drive
    limit_s = _gap_limit_s(steps_s[steps_s > 0])
    if not (steps_s[falls] + _DAY_S <= limit_s).all():
        return drive
    for k in falls:
        faults.add(
            drive.lines[rows[k + 1]], "clocks past midnight",
            "time {:g} s after {:g} s: the clock passes midnight; a day, {:g} s, is added from here on",
            time_s[k + 1], time_s[k], _DAY_S,
        )  # fmt: skip
    mended = drive.time_s.copy()
    for k in falls:
        mended[rows[k + 1] :] += _DAY_S
    return replace(drive, time_s=mended)


def times_in_order(drive: Drive, faults: Faults) -> NDArray[np.bool_]:
    """(row,) rows of the longest series of times that increase; the others are faults."""
    time_s, lines = drive.time_s, drive.lines
    known = np.flatnonzero(np.isfinite(time_s))
    for row in np.flatnonzero(~np.isfinite(time_s)):
        what = empty_cell(drive, "time", row)
        faults.add(lines[row], "without a time", "time {}; the line is left out", what)
    kept = np.zeros(len(time_s), dtype=bool)
    kept[known] = True
    if (np.diff(time_s[known]) > _SAME_TIME_S).all():
        return kept
    series = known[_longest_increasing(time_s[known])]
    kept[:] = False
    kept[series] = True
    for row in np.flatnonzero(np.isfinite(time_s) & ~kept):
        before = series[max(np.searchsorted(series, row) - 1, 0)]
        same = abs(time_s[row] - time_s[before]) <= _SAME_TIME_S
        kind, how = (
            ("duplicate times", "stands twice")
            if same
            else ("times out of order", "is out of order")
        )
        faults.add(
            lines[row], kind, "time {:g} s {} (line {}: {:g} s); the line is left out",
            time_s[row], how, lines[before], time_s[before],
        )  # fmt: skip
    return kept


def _longest_increasing(values: Array) -> list[int]:
    """Indices of the longest strictly increasing series, of equal ones the first."""
    ends: list[float] = []
    last: list[int] = []
    before = [-1] * len(values)
    for i, value in enumerate(values.tolist()):
        place = bisect_left(ends, value - _SAME_TIME_S)
        before[i] = last[place - 1] if place else -1
        if place == len(ends):
            ends.append(value)
            last.append(i)
        elif value < ends[place]:  # of equal values the first one stays
            ends[place], last[place] = value, i
    series, i = [], last[-1]
    while i >= 0:
        series.append(i)
        i = before[i]
    return series[::-1]


def report_gaps(drive: Drive, faults: Faults) -> None:
    """Add every gap to the faults."""
    steps_s = np.diff(drive.time_s)
    limit_s = _gap_limit_s(steps_s)
    for row in np.flatnonzero(steps_s > limit_s):
        faults.add(
            drive.lines[row + 1], "gaps",
            "{:g} s without a sample before {:g} s (limit {:g} s); the speed is drawn straight across",
            steps_s[row], drive.time_s[row + 1], limit_s,
        )  # fmt: skip


def _gap_limit_s(steps_s: Array) -> float:
    return max(_GAP_MIN_S, _GAP_STEPS * float(np.median(steps_s))) if len(steps_s) else _GAP_MIN_S


def long_steps(drive: Drive) -> list[str]:
    """One text with the steps well above the usual one that are no gaps, by line; none where there are none."""
    steps_s = np.diff(drive.time_s)
    usual_s = float(np.median(steps_s))
    long = (steps_s > _LONG_STEPS * usual_s) & (steps_s <= _gap_limit_s(steps_s))
    rows = np.flatnonzero(long)
    if not len(rows):
        return []
    texts = [f"line {drive.lines[row + 1]}: {steps_s[row]:g} s" for row in rows[:LISTED]]
    return [
        f"speed drawn straight across {len(rows)} steps of more than {_LONG_STEPS:g} times the usual "
        f"{usual_s:g} s: {'; '.join(texts)}{f' and {len(rows) - LISTED} more' * (len(rows) > LISTED)}"
    ]


def coarse(drive: Drive) -> list[str]:
    """A text where the usual step is so long that the unit of time may be another; none otherwise."""
    usual_s = float(np.median(np.diff(drive.time_s)))
    if usual_s <= _USUAL_MAX_S:
        return []
    return [
        f"NOTE: the usual step of the file is {usual_s:g} s, with the speed drawn straight across; if that is not "
        "so, the unit of time is another, such as --time-unit ms"
    ]
