"""A date in a column of its own, beside a time of day."""

from datetime import date

import numpy as np
from numpy.typing import NDArray

from hevopt.errors import DataError
from hevopt.files.shown import shown
from hevopt.measured.tables import aliases as column_names
from hevopt.measured.tables.dates import Slashed, moment_in
from hevopt.measured.tables.names import base_of
from hevopt.measured.tables.table import Column, Measured

Array = NDArray[np.float64]

_DAY_S = 86400.0
_YEARS = (1980, 2100)


def date_beside(measured: Measured, time: Column) -> Column | None:
    """The column of dates that belongs to one of times of day; None where there is none, or no need of one."""
    if time.clock != "time of day":
        return None
    named = [c for c in measured.columns if base_of(c.name) in column_names.DATE]
    named = [c for c in named if c.clock == "date" or _written_together(c) is not None or _open(c)]
    found = named or [c for c in measured.columns if c.clock == "date"]
    if len(found) > 1:
        raise DataError(
            f"{measured.path}: columns {', '.join(c.name for c in found)} could all be the date; choose with "
            "--column date=NAME, or leave them out with --column date="
        )
    return found[0] if found else None


def _open(column: Column) -> bool:
    """Whether its cells are dates of which none shows whether the day or the month comes first."""
    return bool(column.strange) and isinstance(moment_in(column.strange[0][1]), Slashed)


def with_dates(measured: Measured, column: Column, time: Column, time_s: Array) -> Array:
    """(row,) times of day plus the days of their dates; an empty date is that of the row before."""
    days = column.values / _DAY_S if column.clock == "date" else _written_together(column)
    if days is None or time.clock != "time of day":
        found = shown(column.strange[0][1]) if column.strange else "no dates"
        raise DataError(
            f"{measured.path}: column {column.name} beside column {time.name}: {found}; needed: dates beside times "
            "of day, such as 2024-02-01 (01/02/2024 where the column shows which of the two is the day); choose "
            "with --column date=NAME, or leave the date out with --column date="
        )
    known = np.maximum.accumulate(np.where(np.isfinite(days), np.arange(len(days)), -1))
    days = np.where(known < 0, np.nan, days[known])
    return time_s + (days - days[np.argmax(np.isfinite(days))]) * _DAY_S


def _written_together(column: Column) -> Array | None:
    """(row,) days of dates such as 20240201, None where a number is none; NaN where a cell is empty."""
    values = column.values
    kinds = np.unique(values[np.isfinite(values)])
    if not len(kinds) or column.strange or len(kinds) > 1000 or (kinds != np.round(kinds)).any():
        return None
    days = {}
    for kind in kinds.astype(np.int64).tolist():
        year, month, day = kind // 10_000, kind // 100 % 100, kind % 100
        try:
            days[kind] = (
                date(year, month, day).toordinal() if _YEARS[0] <= year <= _YEARS[1] else None
            )
        except ValueError:
            return None
        if days[kind] is None:
            return None
    known = np.isfinite(values)
    return np.where(known, [days.get(int(v), 0) for v in np.where(known, values, 0)], np.nan)
