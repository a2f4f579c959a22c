"""Cells of a measured file to numbers: decimal marks, empty cells, times of day; what is no number is kept.

A comma in a number is a decimal mark only where the file shows that it cannot separate thousands: some number
such as 0,5 or 12,75 must settle it. A column with both marks, or one that stays open, is refused where it is used.
"""

import re
from array import array
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from datetime import datetime, time
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from hevopt.display.facts import Shown
from hevopt.files.shown import shown
from hevopt.measured.tables.dates import Slashed, in_order, is_moment, moment_in

EMPTY = frozenset(("", "nan", "na", "n/a", "#n/a", "#div/0!", "-", "--", "null", "none"))
# Faults of one kind that a message lists before it counts the rest.
LISTED = 20
# Different texts of a column whose rows are all kept, such as north and south.
_WORDS = 8
# Beyond any measured value in any unit, and small enough that its square is a number.
LARGEST = 1e100
_PLAIN = re.compile(r"[0-9+\-.eE\n]*")
_WITH_COMMAS = re.compile(r"[0-9+\-,eE\n]*")
_POINT = re.compile(r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?")
_COMMA = re.compile(r"[+-]?(?:[0-9]+,[0-9]*|,[0-9]+)(?:[eE][+-]?[0-9]+)?")
_PERHAPS_THOUSANDS = re.compile(r"[+-]?[1-9][0-9]{0,2}[.,][0-9]{3}")
_THOUSANDS = re.compile(r"[+-]?[0-9]{1,3}(?:[., '’\u00a0\u202f][0-9]{3})+(?:[.,][0-9]+)?")
_PERCENT = re.compile(r"[+-]?(?:[0-9]+(?:[.,][0-9]*)?|[.,][0-9]+)(?:[eE][+-]?[0-9]+)?\s?%")


@dataclass(slots=True, repr=False)
class Cells(Shown):
    """A column while it is read. `found` maps a way of writing to the first line and cell that has it.

    strange: (row, text) of cells that are neither numbers nor empty; words: rows of each text among them, of the
    first few texts; clock: rows with dates or times of day; dated, midnight: of these, dates and dates at 0:00;
    percent: rows with numbers such as 3 %
    slashed: row, two numbers, year and seconds of each date whose order the column decides, which is then `order`
    """

    chunks: list[NDArray[np.float64]] = field(default_factory=list)
    strange: list[tuple[int, str]] = field(default_factory=list)
    strange_count: int = 0
    words: dict[str, array] = field(default_factory=dict)
    found: dict[str, tuple[int, str]] = field(default_factory=dict)
    clock_count: int = 0
    percent_count: int = 0
    number_count: int = 0
    slow_count: int = 0
    first_date: datetime | None = None
    dated_count: int = 0
    midnight_count: int = 0
    slashed: array = field(default_factory=lambda: array("d"))
    order: str = ""

    def clock(self) -> str:
        """What a column of dates and times holds: "date", "time of day", or "moment" for both."""
        if self.dated_count == 0:
            return "time of day"
        return "date" if self.midnight_count == self.clock_count else "moment"

    def values(self) -> NDArray[np.float64]:
        """(row,) NaN where a cell is empty or strange; dates of open order are decided here, or become strange."""
        values = np.concatenate(self.chunks) if self.chunks else np.empty(0)
        if not self.slashed:
            return values
        count = len(self.slashed) // 5
        decided = in_order(self.slashed) if count == self.clock_count else None
        if decided is None:
            self.strange.insert(0, (int(self.slashed[0]), self.found["clock"][1]))
            self.strange_count += count
            self.clock_count -= count
        else:
            rows, seconds, self.order = decided
            values[rows] = seconds
        return values


def is_value(text: str) -> bool:
    """Whether a cell could be one of a data row: a number, a date or a time of day."""
    return any(p.fullmatch(text) for p in (_POINT, _COMMA, _PERCENT, _THOUSANDS)) or is_moment(text)


def is_empty(text: str) -> bool:
    """Whether a cell says that nothing was measured."""
    return text.lower() in EMPTY


def read_chunk(column: Cells, cells: Sequence[str], lines: Sequence[int], first_row: int) -> None:
    """Append the numbers of some cells to a column; lines: those of the cells."""
    values = _fast(column, cells, lines)
    if values is None:
        numbered = enumerate(zip(cells, lines, strict=True), start=first_row)
        values = np.array([_slow(column, cell, line, row) for row, (cell, line) in numbered])
        column.slow_count += len(cells)
    column.chunks.append(values)


def _fast(column: Cells, cells: Sequence[str], lines: Sequence[int]) -> NDArray | None:
    """Values of cells written alike, None where they need a look one by one."""
    joined = "\n".join(cells)
    comma = "," in joined
    if not (_WITH_COMMAS if comma else _PLAIN).fullmatch(joined):
        return None
    kept = dict(column.found)
    if comma:
        _find(column, "perhaps thousands", cells, lines, lambda c: "," in c)
        _find(column, "comma", cells, lines, lambda c: _is_decimal(c, ","))
        cells = joined.replace(",", ".").split("\n")
    elif "." in joined:
        _find(column, "perhaps point", cells, lines, lambda c: "." in c)
        _find(column, "point", cells, lines, lambda c: _is_decimal(c, "."))
    try:
        values = np.fromiter((float(c or "nan") for c in cells), float, len(cells))
    except ValueError:
        values = np.array([np.inf])
    if (np.abs(values) > LARGEST).any():
        column.found = kept
        return None
    column.number_count += int(np.isfinite(values).sum())
    return values


def _find(
    column: Cells,
    kind: str,
    cells: Sequence[str],
    lines: Sequence[int],
    test: Callable[[str], bool],
) -> None:
    if kind not in column.found:
        first = next((i for i, cell in enumerate(cells) if test(cell)), None)
        if first is not None:
            column.found[kind] = (int(lines[first]), cells[first])


def _is_decimal(cell: str, mark: str) -> bool:
    return mark in cell and not _PERHAPS_THOUSANDS.fullmatch(cell)


def _slow(column: Cells, cell: str, line: int, row: int) -> float:
    if cell.lower() in EMPTY:
        return np.nan
    if cell[0] in "0123456789+-.," or (cell[0].isalpha() and cell[-1].isdecimal()):
        value = _number(column, cell, line, row)
        if value is not None:
            return value
    column.strange_count += 1
    if len(column.strange) < LISTED:
        column.strange.append((row, cell))
    if cell in column.words or len(column.words) < _WORDS:
        column.words.setdefault(cell, array("q")).append(row)
    return np.nan


def _number(column: Cells, cell: str, line: int, row: int) -> float | None:
    """A number, or the seconds of a date or a time of day; None where a cell is neither."""
    percent = _PERCENT.fullmatch(cell)
    cell = cell[:-1].rstrip() if percent else cell
    point = _POINT.fullmatch(cell)
    if point or _COMMA.fullmatch(cell):
        value = float(cell.replace(",", "."))
        if abs(value) > LARGEST:
            return None
        column.number_count += 1
        if percent:
            column.percent_count += 1
            column.found.setdefault("percent", (line, f"{cell}%"))
        if "," in cell:
            kind = "comma" if _is_decimal(cell, ",") else "perhaps thousands"
            column.found.setdefault(kind, (line, cell))
        elif "." in cell:
            kind = "point" if _is_decimal(cell, ".") else "perhaps point"
            column.found.setdefault(kind, (line, cell))
        return value
    moment = _moment(column, cell, row)
    if moment is not None:
        column.clock_count += 1
        column.found.setdefault("clock", (line, cell))
    elif _THOUSANDS.fullmatch(cell):
        column.found.setdefault("thousands", (line, cell))
        marks = [mark for mark in cell if mark in ".,"]
        if len(set(marks)) == 2:  # the last one is the decimal mark
            column.found.setdefault("comma" if marks[-1] == "," else "point", (line, cell))
    return moment


def _moment(column: Cells, cell: str, row: int) -> float | None:
    """Seconds since the column's first date, or since midnight; NaN for a date that the whole column decides."""
    moment = moment_in(cell)
    if isinstance(moment, Slashed):
        _count_date(column, moment.seconds == 0)
        column.slashed.extend((row, *moment))
        return np.nan
    if isinstance(moment, datetime):
        _count_date(column, moment.time() == time())
        column.first_date = column.first_date or moment
        try:
            return (moment - column.first_date).total_seconds()
        except TypeError:  # with and without time zone
            return None
    return moment


def _count_date(column: Cells, midnight: bool) -> None:
    column.dated_count += 1
    column.midnight_count += midnight


def marks_of(path: Path, columns: Sequence[Cells]) -> tuple[str, list[str]]:
    """The file's decimal mark, '.' or ',', and by column why its numbers could mean two things, '' where not."""
    first: dict[str, tuple[int, str]] = {}
    for column in columns:
        if column.number_count + column.clock_count >= column.strange_count or (
            "thousands" in column.found
        ):
            for kind, place in column.found.items():
                first[kind] = min(first.get(kind, place), place)
    comma = "comma" in first or "perhaps thousands" in first
    return "," if comma else ".", [_unclear(path, column.found, first) for column in columns]


def _unclear(path: Path, own: dict[str, tuple[int, str]], first: dict[str, tuple[int, str]]) -> str:
    """Why the numbers of a column could mean two things; first: what the columns of the file show."""
    if "thousands" in own:
        return _refused(path, *own["thousands"], "has a thousands separator")
    comma = own.get("comma") or own.get("perhaps thousands")
    point = own.get("point") or own.get("perhaps point")
    if comma and not point and "comma" not in own:
        point = first.get("point") or first.get("perhaps point")
    if comma and point:
        line, cell = point
        return _refused(path, *comma, f"has a decimal comma, but {cell} in line {line} a point")
    if comma and "comma" not in first:
        return _refused(path, *comma, "could be a thousand or a decimal comma")
    if point and "point" not in own and "comma" in first:
        line, cell = first["comma"]
        return _refused(
            path, *point, f"could be a thousand: {cell} in line {line} has a decimal comma"
        )
    return ""


def _refused(path: Path, line: int, cell: str, why: str) -> str:
    return (
        f"{path}, line {line}: {shown(cell)} {why}; write numbers without thousands separators and "
        "with one decimal mark throughout, such as 1234.5"
    )
