"""Cells of a measured file to numbers: decimal marks, empty cells, times of day; what is no number is kept.

A comma in a number is a decimal mark only where the file shows that it cannot separate thousands: some number
such as 0,5 or 12,75 must settle it. A number with both marks, or a file that uses both, is refused.
"""

import re
from array import array
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from hevopt.errors import DataError
from hevopt.files import shown
from hevopt.imports.measured_dates import Slashed, in_order, is_moment, moment_in

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


@dataclass(slots=True)
class Cells:
    """A column while it is read. `found` maps a way of writing to the first line and cell that has it.

    strange: (row, text) of cells that are neither numbers nor empty; words: rows of each text among them, of the
    first few texts; clock: rows with dates or times of day; percent: rows with numbers such as 3 %
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
    slashed: array = field(default_factory=lambda: array("d"))
    order: str = ""

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
        _find(column, "point", cells, lines, lambda c: "." in c)
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
    if cell[0] in "0123456789+-.,":
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
            column.found.setdefault("point", (line, cell))
        return value
    moment = _moment(column, cell, row)
    if moment is not None:
        column.clock_count += 1
        column.found.setdefault("clock", (line, cell))
    elif _THOUSANDS.fullmatch(cell):
        column.found.setdefault("thousands", (line, cell))
    return moment


def _moment(column: Cells, cell: str, row: int) -> float | None:
    """Seconds since the column's first date, or since midnight; NaN for a date that the whole column decides."""
    moment = moment_in(cell)
    if isinstance(moment, Slashed):
        column.slashed.extend((row, *moment))
        return np.nan
    if isinstance(moment, datetime):
        column.first_date = column.first_date or moment
        try:
            return (moment - column.first_date).total_seconds()
        except TypeError:  # with and without time zone
            return None
    return moment


def check_decimal_mark(path: Path, columns: Sequence[Cells]) -> str:
    """The file's decimal mark, '.' or ','; DataError where commas could separate thousands."""
    numeric = [c for c in columns if c.number_count + c.clock_count >= c.strange_count]
    first: dict[str, tuple[int, str]] = {}
    for column in numeric + [c for c in columns if "thousands" in c.found]:
        for kind, place in column.found.items():
            first[kind] = min(first.get(kind, place), place)
    if "thousands" in first:
        raise _refused(path, *first["thousands"], "has a thousands separator")
    comma = first.get("comma") or first.get("perhaps thousands")
    if comma and "point" in first:
        line, cell = first["point"]
        raise _refused(path, *comma, f"has a decimal comma, but {cell} in line {line} a point")
    if "perhaps thousands" in first and "comma" not in first:
        raise _refused(path, *first["perhaps thousands"], "could be a thousand or a decimal comma")
    return "," if comma else "."


def _refused(path: Path, line: int, cell: str, why: str) -> DataError:
    return DataError(
        f"{path}, line {line}: {shown(cell)} {why}; write numbers without thousands separators and "
        "with one decimal mark throughout, such as 1234.5"
    )
