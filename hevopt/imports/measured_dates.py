"""Dates and times of day as loggers and Excel write them.

2024-03-01 12:00:00 (ISO, with a time zone or not), 2024/03/01 12:00, 01.03.2024 12:00:00, 12:00:00 and 11:59:30 AM
say what they mean. 03/01/2024 leaves open whether the day or the month comes first: the whole column decides, where
only one order makes dates of it, or both the same differences of time.
"""

import re
from array import array
from collections.abc import Callable
from contextlib import suppress
from datetime import date, datetime, timedelta
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_TIME = r"([0-9]{1,2}):([0-9]{2})(?::([0-9]{2}(?:[.,][0-9]+)?))?(?:\s*([AaPp])\.?[Mm]\.?)?"
_CLOCK = re.compile(r"([0-9]{1,6}):([0-9]{2}):([0-9]{2}(?:[.,][0-9]+)?)")
_HALF_DAYS = re.compile(_TIME)
_ISO = re.compile(r"[0-9]{4}-[0-9]{2}-[0-9]{2}[ T][0-9]{2}:[0-9]{2}.*")
_YEAR_FIRST = re.compile(r"([0-9]{4})[-/.]([0-9]{1,2})[-/.]([0-9]{1,2})[ T,]+" + _TIME)
_POINTS = re.compile(r"([0-9]{1,2})\.([0-9]{1,2})\.([0-9]{4}|[0-9]{2})[ T,]+" + _TIME)
_SLASHES = re.compile(r"([0-9]{1,2})/([0-9]{1,2})/([0-9]{4})[ T,]+" + _TIME)
_DAY_S = 86400.0


class Slashed(NamedTuple):
    """A date as 03/01/2024 with its time: two numbers of which one is the day, the other the month."""

    first: int
    second: int
    year: int
    seconds: float


def is_moment(text: str) -> bool:
    """Whether a cell is written as a date with a time, or as a time of day."""
    patterns = (_ISO, _CLOCK, _YEAR_FIRST, _POINTS, _SLASHES)
    return any(p.fullmatch(text) for p in patterns) or (
        text[-1:] in "mM." and bool(_HALF_DAYS.fullmatch(text))
    )


def moment_in(text: str) -> float | datetime | Slashed | None:
    """Seconds since midnight, a date with its time, one of open order; None where a cell is none of them."""
    if text[4:5] == "-" and len(text) > 15:
        with suppress(ValueError):  # 12-hour clocks are read below
            return datetime.fromisoformat(text.replace(",", "."))
    try:
        if clock := _CLOCK.fullmatch(text):
            hours, minutes, seconds = clock.groups()
            return int(hours) * 3600.0 + int(minutes) * 60.0 + float(seconds.replace(",", "."))
        if (clock := _HALF_DAYS.fullmatch(text)) and clock[4]:
            return _seconds(*clock.groups())
        for pattern, order in ((_YEAR_FIRST, (0, 1, 2)), (_POINTS, (2, 1, 0)), (_SLASHES, None)):
            if found := pattern.fullmatch(text):
                numbers = [int(n) for n in found.groups()[:3]]
                seconds = _seconds(*found.groups()[3:])
                if order is None:
                    return Slashed(*numbers, seconds)
                year, month, day = (numbers[i] for i in order)
                short = len(found.groups()[order[0]]) == 2
                midnight = datetime(year + 2000 * short, month, day)
                return midnight + timedelta(seconds=seconds)
    except ValueError:  # no such day, or no such time
        return None
    return None


def _seconds(hours: str, minutes: str, seconds: str | None, half: str | None) -> float:
    """Seconds since midnight; ValueError where a clock shows no such time."""
    hour, minute, second = int(hours), int(minutes), float((seconds or "0").replace(",", "."))
    if half is not None:
        if not 1 <= hour <= 12:
            raise ValueError("an hour of a half day is from 1 to 12")
        hour = hour % 12 + 12 * (half in "pP")
    if hour > 23 or minute > 59 or second >= 60:
        raise ValueError("no time of day")
    return hour * 3600.0 + minute * 60.0 + second


def in_order(slashed: array) -> tuple[NDArray[np.int64], Array, str] | None:
    """Rows of a column's slashed dates, their seconds since its first one, and the order; None where it stays open.

    slashed: row and the numbers of a `Slashed`, one after the other
    """
    table = np.array(slashed).reshape(-1, 5)
    orders: dict[str, Callable[[int, int, int], date]] = {
        "day first": lambda a, b, year: date(year, b, a),
        "month first": lambda a, b, year: date(year, a, b),
    }
    found = {}
    kinds, of_row = np.unique(table[:, 1:4].astype(int), axis=0, return_inverse=True)
    for order, made in orders.items():
        try:
            days = np.array([made(*kind).toordinal() for kind in kinds.tolist()], dtype=float)
        except ValueError:  # no such day in one of the rows
            continue
        seconds = days[of_row.ravel()] * _DAY_S + table[:, 4]
        found[order] = seconds - seconds[0]
    if len(found) == 2 and not np.array_equal(*found.values()):
        return None
    if not found:
        return None
    order = next(iter(found)) if len(found) == 1 else "day and month in either order"
    return table[:, 0].astype(np.int64), next(iter(found.values())), order
