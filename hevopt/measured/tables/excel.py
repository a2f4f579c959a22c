"""Excel workbooks to tables, within limits that hold before a workbook is unpacked."""

import re
import warnings
import zipfile
from collections.abc import Callable, Iterable, Iterator
from datetime import date, datetime, time, timedelta
from functools import cache
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING

from hevopt.errors import DataError, unknown_name
from hevopt.files.shown import printable
from hevopt.measured.tables.rows import Row, Table, runs, table_of

if TYPE_CHECKING:
    from openpyxl.worksheet._read_only import ReadOnlyWorksheet

_UNPACKED_MAX = 200_000_000
# A workbook's cells take 20 µs each, its elements 200 bytes each where they are nested and none is ever closed.
_SHEET_CELLS_MAX = 400_000
_TAGS_MAX = 8 * _SHEET_CELLS_MAX
_BLOCK_BYTES = 1_000_000
# Parts of a number format that are shown as they stand, as the sign in 0.0" %" is; a bare % shows hundredths.
_FORMAT_TEXT = re.compile(r'"[^"]*"|[\\_*].|\[[^\]]*\]')


def excel_table(path: Path, contents: bytes, sheet: str | None) -> Table:
    """The table in a sheet of an .xlsx workbook: the named one, or the only one that holds anything."""
    import openpyxl

    _check_unpacked(path, contents)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter(
                "ignore"
            )  # of what hevopt does not read: styles, drawings, validations
            book = openpyxl.load_workbook(BytesIO(contents), read_only=True, data_only=True)
            chosen, rows = chosen_rows(
                path,
                [s.title for s in book.worksheets],
                lambda name: _rows_of(path, book[name]),
                sheet,
            )
    except (DataError, MemoryError):
        raise
    except Exception as error:  # the reader of a broken workbook raises whatever it stumbles over
        raise DataError(
            f"{path}: not a readable .xlsx workbook ({type(error).__name__}); save it again, or as CSV"
        ) from None
    return sheet_table(path, chosen, rows)


def sheet_table(path: Path, chosen: str, rows: list[Row]) -> Table:
    """The table in the rows of a sheet with a name."""
    table = table_of(path, rows, padded=True)
    present = {number for number, _ in rows}
    blank = (
        [number for number in range(rows[0][0], rows[-1][0]) if number not in present]
        if rows
        else []
    )
    if blank:
        table.notes.append(f"blank: {runs(blank)}")
    table.notes.insert(
        0, f"Excel workbook, sheet {printable(chosen)!r}; formulas by their stored values"
    )
    return table


def _check_unpacked(path: Path, contents: bytes) -> None:
    try:
        with zipfile.ZipFile(BytesIO(contents)) as archive:
            unpacked = sum(entry.file_size for entry in archive.infolist())
            tags = _tags(archive) if unpacked <= _UNPACKED_MAX else 0
    except (
        Exception
    ):  # a broken archive raises errors of the archive, of its packing and of its names
        raise DataError(
            f"{path}: not a readable .xlsx workbook; save it again, or as CSV"
        ) from None
    if unpacked > _UNPACKED_MAX or tags > _TAGS_MAX:
        raise DataError(
            f"{path}: {unpacked / 1e6:.0f} MB unpacked; allowed: up to {_UNPACKED_MAX / 1e6:.0f} MB and about "
            f"{_SHEET_CELLS_MAX} cells in all sheets; save the sheet as CSV"
        )


def _tags(archive: zipfile.ZipFile) -> int:
    tags = 0
    for entry in archive.infolist():
        with archive.open(entry) as member:
            while (block := member.read(_BLOCK_BYTES)) and tags <= _TAGS_MAX:
                tags += block.count(b"<")
    return tags


def chosen_rows(
    path: Path, names: list[str], rows_of: Callable[[str], Iterator[Row]], sheet: str | None
) -> tuple[str, list[Row]]:
    """Name and rows of the sheet that is asked for, or of the only one that holds anything."""
    if sheet is not None:
        if sheet not in names:
            raise unknown_name(f"{path}: sheet", sheet, names)
        return sheet, list(rows_of(sheet))
    filled = {name: rows for name in names if (rows := list(rows_of(name)))}
    if len(filled) != 1:
        found = (
            f"sheets {', '.join(map(repr, filled))}; choose one with --sheet"
            if filled
            else "no cells"
        )
        raise DataError(f"{path}: {printable(found)}")
    return next(iter(filled.items()))


def _rows_of(path: Path, sheet: "ReadOnlyWorksheet") -> Iterator[Row]:
    sheet.reset_dimensions()  # what a file says of its own size may be wrong
    rows = ([cell_text(c.value, c.number_format) for c in row] for row in sheet.iter_rows())
    return filled_rows(path, sheet.title, rows)


def filled_rows(path: Path, sheet: str, rows: Iterable[list[str]]) -> Iterator[Row]:
    """Rows with anything in them, numbered from 1, without the empty cells at their ends."""
    cells_read = 0
    for number, cells in enumerate(rows, start=1):
        cells_read += max(len(cells), 1)
        if cells_read > _SHEET_CELLS_MAX:
            raise DataError(
                f"{path}, sheet {printable(sheet)!r}, row {number}: more than {_SHEET_CELLS_MAX} "
                "cells; save the sheet as CSV, or keep fewer columns"
            )
        while cells and not cells[-1]:
            cells.pop()
        if cells:
            yield number, cells


def cell_text(value: object, number_format: str) -> str:
    """A cell as a text file would have it: durations as H:MM:SS, what is shown in per cent with its sign."""
    if value is None:
        return ""
    if isinstance(value, bool):
        return str(int(value))
    if isinstance(value, datetime):
        return value.isoformat(" ")
    if isinstance(value, date):
        return f"{value.isoformat()} 00:00"
    if isinstance(value, time):
        return value.isoformat()
    if isinstance(value, timedelta):
        return _duration(value)
    if not isinstance(value, int | float):
        return str(value).strip()
    if _in_percent(number_format):
        return f"{value * 100:.15g}%"
    return repr(value).removesuffix(".0")


def _duration(value: timedelta) -> str:
    minutes, seconds = divmod(value, timedelta(minutes=1))
    if minutes < 0:
        return f"{value} (a duration below 0)"
    micro = f".{seconds.microseconds:06}" if seconds.microseconds else ""
    return f"{minutes // 60}:{minutes % 60:02}:{seconds.seconds:02}{micro}"


@cache
def _in_percent(number_format: str) -> bool:
    return "%" in _FORMAT_TEXT.sub("", number_format)
