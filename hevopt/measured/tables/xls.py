"""Workbooks of Excel 97 to 2003 (.xls) to tables; cells mean what they do in an .xlsx workbook."""

from collections.abc import Iterator
from io import StringIO
from pathlib import Path
from typing import TYPE_CHECKING

from hevopt.errors import DataError
from hevopt.measured.tables.excel import cell_text, chosen_rows, filled_rows, sheet_table
from hevopt.measured.tables.rows import Row, Table

if TYPE_CHECKING:
    from xlrd import Book
    from xlrd.sheet import Cell

# A cell takes 2 bytes or more of a workbook, and 1 µs: what can be read in seconds.
_BYTES_MAX = 20_000_000


def xls_table(path: Path, contents: bytes, sheet: str | None) -> Table:
    """The table in a sheet of an .xls workbook: the named one, or the only one that holds anything."""
    import xlrd

    if len(contents) > _BYTES_MAX:
        raise DataError(
            f"{path}: more than the {_BYTES_MAX / 1e6:.0f} MB allowed in an .xls workbook; save it as .xlsx or CSV"
        )
    try:
        book = xlrd.open_workbook(
            file_contents=contents,
            logfile=StringIO(),
            formatting_info=True,  # per cent is a matter of format
            on_demand=True,
            ragged_rows=True,
        )
        chosen, rows = chosen_rows(
            path, book.sheet_names(), lambda name: _rows_of(path, book, name), sheet
        )
    except (DataError, MemoryError):
        raise
    except Exception as error:  # the reader of a broken workbook raises whatever it stumbles over
        raise DataError(
            f"{path}: not an .xls workbook that can be read ({type(error).__name__}): broken, under a password, or "
            "of another program; save it as .xlsx or CSV"
        ) from None
    return sheet_table(path, chosen, rows)


def _rows_of(path: Path, book: "Book", name: str) -> Iterator[Row]:
    sheet = book.sheet_by_name(name)
    rows = ([_text(book, cell) for cell in sheet.row(n)] for n in range(sheet.nrows))
    return filled_rows(path, name, rows)


def _text(book: "Book", cell: "Cell") -> str:
    from openpyxl.styles.numbers import is_date_format, is_timedelta_format
    from openpyxl.utils.datetime import CALENDAR_MAC_1904, CALENDAR_WINDOWS_1900, from_excel
    from xlrd import (
        XL_CELL_BOOLEAN,
        XL_CELL_DATE,
        XL_CELL_ERROR,
        XL_CELL_NUMBER,
        error_text_from_code,
    )

    if cell.ctype == XL_CELL_ERROR:
        return error_text_from_code.get(cell.value, "#ERROR")
    if cell.ctype == XL_CELL_BOOLEAN:
        return cell_text(bool(cell.value), "")
    if cell.ctype not in (XL_CELL_DATE, XL_CELL_NUMBER):
        return cell_text(cell.value, "")
    shown = book.format_map[book.xf_list[cell.xf_index].format_key].format_str
    if not is_date_format(shown):
        return cell_text(cell.value, shown)
    epoch = CALENDAR_MAC_1904 if book.datemode else CALENDAR_WINDOWS_1900
    try:
        return cell_text(from_excel(cell.value, epoch, timedelta=is_timedelta_format(shown)), shown)
    except (ValueError, OverflowError):  # no date: as .xlsx has it
        return "#VALUE!"
