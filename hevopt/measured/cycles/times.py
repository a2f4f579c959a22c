"""Times of a logged drive: their order, clocks that begin again, gaps and long steps.

A clock begins again after a day, after half a day where it shows 12 hours, and after an hour where it shows minutes
and seconds alone or is set back to winter time. A gap is more than five usual steps without a sample, and more than
2 s; one of more than a minute is no dropout. Steps of more than three usual ones are told.
"""

from bisect import bisect_left
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from hevopt.measured.cycles.columns import Drive
from hevopt.measured.cycles.fault_list import Faults, empty_cell
from hevopt.measured.tables.cells import LISTED
from hevopt.measured.tables.clock_ticks import SAME_TIME_S, spread_evenly, ticks_of

Array = NDArray[np.float64]
Rows = NDArray[np.int64]

DROPOUT_MAX_S = 60.0
_GAP_STEPS, _GAP_MIN_S = 5.0, 2.0
_LONG_STEPS = 3.0
_USUAL_MAX_S = 10.0
_AGAIN = "clocks that begin again"
# What a clock leaves out, between what it then stays, and why.
_FOLDS = (
    (86400.0, (0.0, 86400.0), "the clock passes midnight"),
    (43200.0, (0.0, 46800.0), "the clock of 12 hours begins again"),
    (3600.0, (-np.inf, np.inf), "the clock goes through the hour again"),
)


def running_on(drive: Drive, faults: Faults) -> Drive:
    """The drive with a day, half a day or an hour added where a clock begins again; every such line is a fault."""
    rows = np.flatnonzero(np.isfinite(drive.time_s))
    time_s = drive.time_s[rows]
    steps_s = np.diff(time_s)
    falls = np.flatnonzero(steps_s < -_FOLDS[-1][0] / 2)
    if not len(falls):
        return drive
    limit_s = _gap_limit_s(steps_s[steps_s > 0])
    folds = [_fold(time_s, steps_s, k, limit_s) for k in falls]
    if None in folds:
        return drive
    mended = drive.time_s.copy()
    for k, (fold_s, why) in zip(falls, folds, strict=True):
        faults.add(
            drive.lines[rows[k + 1]], _AGAIN,
            "time {:g} s after {:g} s: {}; {:g} s are added from here on",
            time_s[k + 1], time_s[k], why, fold_s,
        )  # fmt: skip
        mended[rows[k + 1] :] += fold_s
    return replace(drive, time_s=mended)


def _fold(time_s: Array, steps_s: Array, k: int, limit_s: float) -> tuple[float, str] | None:
    """What a clock that falls after row k leaves out, and why; None where a row is out of order instead.

    A clock that begins again goes on with a usual step, and no step leads back up.
    """
    for fold_s, (low_s, high_s), why in _FOLDS:
        inside = time_s.min() >= low_s and time_s.max() < high_s
        up = (steps_s > fold_s / 2) & (steps_s <= fold_s + limit_s)
        if 0 < steps_s[k] + fold_s <= limit_s and inside and not up.any():
            return fold_s, why
    return None


def spread(drive: Drive) -> tuple[Drive, list[str]]:
    """The drive with the rows of each moment of a coarse clock spread evenly over it, and what was done.

    Where all rows of a moment are alike, one of them is left.
    """
    ticks = ticks_of(drive.time_s)
    if ticks is None:
        return drive, []
    if _all_alike(drive, ticks.begins, ticks.counts):
        kept = np.zeros(len(drive.time_s), dtype=bool)
        kept[ticks.begins] = True
        return rows_of(drive, kept), [f"{ticks.told()} and are alike: one of them is kept"]
    made = f"{ticks.told()} and are spread evenly over it, {ticks.usual} as a rule"
    return replace(drive, time_s=spread_evenly(drive.time_s, ticks)), [made]


def _all_alike(drive: Drive, begins: Rows, counts: Rows) -> bool:
    """Whether the rows of every moment hold the same values."""
    names = ("speed_mps", "grade", "altitude_m", "gear", "clutch_open")
    columns = [values for name in names if (values := getattr(drive, name)) is not None]
    first = np.repeat(begins, counts)
    return all(np.array_equal(values, values[first], equal_nan=True) for values in columns)


def rows_of(drive: Drive, kept: NDArray[np.bool_]) -> Drive:
    """The drive with some of its rows alone."""
    names = ("lines", "time_s", "speed_mps", "grade", "altitude_m", "gear", "clutch_open")
    part = {n: values[kept] for n in names if (values := getattr(drive, n)) is not None}
    rows = np.flatnonzero(kept)
    text = {
        (role, int(np.searchsorted(rows, row))): cell
        for (role, row), cell in drive.text.items()
        if kept[row]
    }
    return replace(drive, text=text, **part)


def times_in_order(drive: Drive, faults: Faults) -> NDArray[np.bool_]:
    """(row,) rows of the longest series of times that increase; the others are faults."""
    time_s, lines = drive.time_s, drive.lines
    known = np.flatnonzero(np.isfinite(time_s))
    for row in np.flatnonzero(~np.isfinite(time_s)):
        what = empty_cell(drive, "time", row)
        faults.add(lines[row], "without a time", "time {}; the line is left out", what)
    kept = np.zeros(len(time_s), dtype=bool)
    kept[known] = True
    if (np.diff(time_s[known]) > SAME_TIME_S).all():
        return kept
    series = known[_longest_increasing(time_s[known])]
    kept[:] = False
    kept[series] = True
    for row in np.flatnonzero(np.isfinite(time_s) & ~kept):
        before = series[max(np.searchsorted(series, row) - 1, 0)]
        same = abs(time_s[row] - time_s[before]) <= SAME_TIME_S
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
        place = bisect_left(ends, value - SAME_TIME_S)
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


def without_speed(time_s: Array, usable: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """(row,) rows of stretches without a usable speed that last longer than a dropout, up to their neighbours."""
    gone = np.zeros(len(time_s), dtype=bool)
    if not usable.any():
        return gone
    limit_s = max(_gap_limit_s(np.diff(time_s)), DROPOUT_MAX_S)
    edges = np.flatnonzero(np.diff(np.r_[True, usable, True].astype(int)))
    for first, after in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        if time_s[min(after, len(time_s) - 1)] - time_s[max(first - 1, 0)] > limit_s:
            gone[first:after] = True
    return gone


def report_gaps(drive: Drive, faults: Faults) -> Rows:
    """Add every dropout to the faults; the rows after which there is a gap of more than a minute."""
    steps_s = np.diff(drive.time_s)
    limit_s = _gap_limit_s(steps_s)
    long = steps_s > max(limit_s, DROPOUT_MAX_S)
    for row in np.flatnonzero((steps_s > limit_s) & ~long):
        faults.add(
            drive.lines[row + 1], "gaps",
            "{:g} s without a sample before {:g} s (limit {:g} s); the speed is drawn straight across",
            steps_s[row], drive.time_s[row + 1], limit_s,
        )  # fmt: skip
    return np.flatnonzero(long)


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
