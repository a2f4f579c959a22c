"""Dates and times of day as loggers, phones and Excel write them.

2024-03-01 12:00:00 (ISO, with a time zone or not), 2024/03/01 12:00, 01.03.2024 12:00:00, 01-Mar-2024 12:00:00,
Fri Mar 01 12:00:00 GMT+01:00 2024, 12:00:00 and 11:59:30 AM say what they mean; dates may stand alone.
03/01/2024 leaves open whether the day or the month comes first: the whole column decides, where only one order
makes dates of it, or both the same differences of time.
"""

import re
from array import array
from collections.abc import Callable
from contextlib import suppress
from datetime import date, datetime, timedelta, timezone
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hevopt.measured.tables.month_names import month_of

Array = NDArray[np.float64]

_TIME = (
    r"(?P<hour>[0-9]{1,2})(?P<mark>[:.])(?P<minute>[0-9]{2})(?:(?P=mark)(?P<second>[0-9]{2}(?:[.,][0-9]+)?))?"
    r"(?:\s*(?P<half>[AaPp])\.?\s?[Mm]\.?)?"
)
_ZONE = r"(?P<zone>(?![AP]M$)[A-Z]{1,5}|(?:GMT|UTC)?(?P<offset>[+-][0-9]{1,2}:?[0-9]{2}))"
_AND_TIME = rf"(?:[ T,]+{_TIME}(?:\s*{_ZONE})?)?"
_WORD = r"[^\W\d_]{2,12}"
_DATES = [
    re.compile(pattern)
    for pattern in (
        r"(?P<year>[0-9]{4})[-/.](?P<month>[0-9]{1,2})[-/.](?P<day>[0-9]{1,2})" + _AND_TIME,
        r"(?P<day>[0-9]{1,2})\.(?P<month>[0-9]{1,2})\.(?P<year>[0-9]{4}|[0-9]{2})" + _AND_TIME,
        r"(?P<first>[0-9]{1,2})(?P<s>[/-])(?P<other>[0-9]{1,2})(?P=s)(?P<year>[0-9]{4}|[0-9]{2})" + _AND_TIME,
        rf"(?:{_WORD}[.,]*\s+)?(?P<day>[0-9]{{1,2}})\.?[-/ ]+(?:de )?(?P<name>{_WORD})\.?[-/, ]+(?:de )?"
        r"(?P<year>[0-9]{4}|[0-9]{2})" + _AND_TIME,
        rf"(?:{_WORD}[.,]*\s+)?(?P<name>{_WORD})\.? (?P<day>[0-9]{{1,2}}),? (?P<year>[0-9]{{4}})" + _AND_TIME,
        rf"(?:{_WORD}[.,]*\s+)?(?P<name>{_WORD})\.?\s+(?P<day>[0-9]{{1,2}}) {_TIME}(?:\s*{_ZONE})? "
        r"(?P<year>[0-9]{4})",
        rf"(?P<year>[0-9]{{4}})[-/ ](?P<name>{_WORD})\.?[-/ ](?P<day>[0-9]{{1,2}})" + _AND_TIME,
    )
]  # fmt: skip
_CLOCK = re.compile(rf"([0-9]{{1,6}}):([0-9]{{2}}):([0-9]{{2}}(?:[.,][0-9]+)?)(?:\s*{_ZONE})?")
_HALF_DAYS = re.compile(_TIME)
# As spreadsheets show a time of day in a CSV file; without the fraction it could be hours and minutes.
_MINUTES = re.compile(r"([0-9]{1,3}):([0-5][0-9][.,][0-9]+)")
_DAY_S = 86400.0
_ZONES_H = {
    "Z": 0, "UTC": 0, "GMT": 0, "WET": 0, "BST": 1, "WEST": 1, "CET": 1, "MEZ": 1, "CEST": 2, "MESZ": 2, "EET": 2,
    "EEST": 3, "MSK": 3, "EST": -5, "EDT": -4, "CST": -6, "CDT": -5, "MST": -7, "MDT": -6, "PST": -8, "PDT": -7,
}  # fmt: skip


class Slashed(NamedTuple):
    """A date as 03/01/2024 with its time: two numbers of which one is the day, the other the month."""

    first: int
    second: int
    year: int
    seconds: float


def is_moment(text: str) -> bool:
    """Whether a cell is written as a date, a date with a time, or a time of day."""
    if _CLOCK.fullmatch(text) or _MINUTES.fullmatch(text):
        return True
    if (clock := _HALF_DAYS.fullmatch(text)) and clock["half"]:
        return True
    return _dated(text) is not None or (text[4:5] == "-" and _iso(text) is not None)


def moment_in(text: str) -> float | datetime | Slashed | None:
    """Seconds since midnight, a date with its time, one of open order; None where a cell is none of them."""
    if text[4:5] == "-" and (moment := _iso(text)):
        return moment
    try:
        if clock := _CLOCK.fullmatch(text):
            hours, minutes, seconds = clock.groups()[:3]
            return int(hours) * 3600.0 + int(minutes) * 60.0 + float(seconds.replace(",", "."))
        if clock := _MINUTES.fullmatch(text):
            return int(clock[1]) * 60.0 + float(clock[2].replace(",", "."))
        if (clock := _HALF_DAYS.fullmatch(text)) and clock["half"]:
            return _seconds(clock)
        found = _dated(text)
        return None if found is None else _moment(found)
    except ValueError:  # no such day, or no such time
        return None


def _iso(text: str) -> datetime | None:
    if len(text) > 15:
        with suppress(ValueError):  # 12-hour clocks are read below
            return datetime.fromisoformat(text.replace(",", "."))
    return None


def _dated(text: str) -> re.Match | None:
    for pattern in _DATES:
        if found := pattern.fullmatch(text):
            if "name" not in found.groupdict() or month_of(found["name"]):
                return found
    return None


def _moment(found: re.Match) -> datetime | Slashed:
    """What a date's parts say; ValueError where there is no such day or time."""
    parts = found.groupdict()
    year = int(parts["year"]) + 2000 * (len(parts["year"]) == 2)
    seconds = _seconds(found) if parts["hour"] else 0.0
    if "first" in parts:
        return Slashed(int(parts["first"]), int(parts["other"]), year, seconds)
    month = month_of(parts["name"]) if "name" in parts else int(parts["month"])
    moment = datetime(year, month, int(parts["day"])) + timedelta(seconds=seconds)
    hours = _zone_h(parts["zone"], parts["offset"])
    return moment if hours is None else moment.replace(tzinfo=timezone(timedelta(hours=hours)))


def _zone_h(name: str | None, offset: str | None) -> float | None:
    """Hours ahead of UTC; None without a zone, and for one of whose name nothing is known."""
    if offset is None:
        return None if name is None else _ZONES_H.get(name)
    hours, minutes = offset[1:].replace(":", "")[:-2], offset[-2:]
    return (int(hours) + int(minutes) / 60) * (-1 if offset[0] == "-" else 1)


def _seconds(clock: re.Match) -> float:
    """Seconds since midnight; ValueError where a clock shows no such time."""
    hour, minute = int(clock["hour"]), int(clock["minute"])
    second = float((clock["second"] or "0").replace(",", "."))
    if clock["half"] is not None:
        if not 1 <= hour <= 12:
            raise ValueError("an hour of a half day is from 1 to 12")
        hour = hour % 12 + 12 * (clock["half"] in "pP")
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
