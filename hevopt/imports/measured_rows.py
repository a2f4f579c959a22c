"""From rows of text cells to a table: where the header is, the units row, and every number with its line."""

from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import chain, islice
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from hevopt.errors import DataError
from hevopt.files import printable
from hevopt.imports.measured_cells import (
    LISTED,
    Cells,
    check_decimal_mark,
    is_empty,
    is_value,
    read_chunk,
)
from hevopt.imports.measured_names import cleaned, unit_in_cell
from hevopt.units import unit_named

ROWS_MAX = 1_000_000
CELLS_MAX = 10_000_000
_HEAD_ROWS = 500
_CHUNK_ROWS = 10_000
_COLUMNS_MAX = 2_000
# Cells that are not written as plain numbers take ten times as long.
_SLOW_CELLS_MAX = 2_500_000

Row = tuple[int, list[str]]  # line number, cells without blanks around them


@dataclass(frozen=True, slots=True, eq=False)
class Table:
    """What the rows of a file hold. units: None without a units row; lines: (row,)"""

    names: list[str]
    units: list[str] | None
    columns: list[Cells]
    lines: NDArray[np.int64]
    notes: list[str]
    units_source: str = "units row"


def table_of(path: Path, rows: Iterable[Row], *, padded: bool) -> Table:
    """The table in some rows; `padded`: short rows end in empty cells rather than being faults."""
    rows = _not_too_wide(path, iter(rows))
    head = list(islice(rows, _HEAD_ROWS))
    if padded:
        widest = max((len(cells) for _, cells in head), default=0)
        head = [(line, cells + [""] * (widest - len(cells))) for line, cells in head]
    start, width = _first_data_row(path, head)
    names, units, used, notes = _header(head, start, width)
    before = [line for line, _ in head[: start - used]]
    if before:
        notes.insert(0, f"text before the header: {runs(before)}")
    columns, lines = _read(path, chain(head[start:], rows), width, padded)
    if check_decimal_mark(path, columns) == ",":
        notes.append("decimal comma")
    kept = [
        i for i in range(width) if names[i] != f"column {i + 1}" or _holds_something(columns[i])
    ]
    units = units and [units[i] for i in kept]
    return Table([names[i] for i in kept], units, [columns[i] for i in kept], lines, notes)


def _holds_something(column: Cells) -> bool:
    return bool(column.number_count or column.clock_count or column.strange_count)


def _not_too_wide(path: Path, rows: Iterator[Row]) -> Iterator[Row]:
    for line, cells in rows:
        if len(cells) > _COLUMNS_MAX:
            raise DataError(
                f"{path}, line {line}: {len(cells)} columns; allowed: up to {_COLUMNS_MAX}"
            )
        yield line, cells


def runs(lines: list[int]) -> str:
    """Line numbers in words: `line 3`, `lines 1-4, 9`."""
    groups: list[list[int]] = []
    for line in lines:
        if groups and line == groups[-1][1] + 1:
            groups[-1][1] = line
        else:
            groups.append([line, line])
    texts = [f"{a}-{b}" if b > a else f"{a}" for a, b in groups[:LISTED]]
    more = f" and {len(groups) - LISTED} more places" if len(groups) > LISTED else ""
    return f"line{'s' if len(lines) > 1 else ''} {', '.join(texts)}{more}"


def numeric_share(cells: list[str]) -> float:
    """Which part of a row's cells are numbers or times; 0 for a row without any."""
    filled = [cell for cell in cells if not is_empty(cell)]
    return sum(map(is_value, filled)) / len(filled) if filled else 0.0


def _first_data_row(path: Path, head: list[Row]) -> tuple[int, int]:
    """Index of the first data row, and how many cells the data rows have."""
    shares = [numeric_share(cells) for _, cells in head]
    widths = Counter(len(c) for (_, c), share in zip(head, shares, strict=True) if share >= 0.5)
    if not widths:
        raise DataError(
            f"{path}: no row of numbers found in {len(head)} lines; a header line and rows of numbers, "
            "separated by commas, semicolons, tabs or blanks, are needed"
        )
    width = max(widths, key=lambda w: widths[w])
    # A row of numbers alone is data, not text above the header, whatever its length.
    start = next(
        i for i, ((_, cells), share) in enumerate(zip(head, shares, strict=True))
        if (share >= 0.5 and len(cells) == width) or (share == 1 and len(cells) > 1)
    )  # fmt: skip
    # A grid's first row has a label, or nothing, in its corner, and numbers to the right of it.
    corner = head[start][1][0]
    if (
        start + 1 < len(head)
        and width > 2
        and not is_value(corner)
        and is_value(head[start + 1][1][0])
    ):
        start += 1
    return start, width


def _header(
    head: list[Row], start: int, width: int
) -> tuple[list[str], list[str] | None, int, list[str]]:
    """Names, units row, how many rows both take, and notes."""
    above = [(line, _padded(cells, width)) for line, cells in head[:start]]
    above = [row if len(row[1]) == width else None for row in above]
    units, used = None, 0
    if (
        len(above) > 1
        and above[-1]
        and above[-2]
        and (units := _units_row(above[-1][1], above[-2][1]))
    ):
        used = 1
    if len(above) <= used or above[-1 - used] is None:
        return [f"column {i + 1}" for i in range(width)], None, 0, ["no header: columns by number"]
    line, cells = above[-1 - used]
    names = [cleaned(cell) or f"column {i + 1}" for i, cell in enumerate(cells)]
    notes = [f"header in line {line}"]
    if used:
        notes.append(f"units row in line {above[-1][0]}")
    return names, units, 1 + used, notes


def _padded(cells: list[str], width: int) -> list[str]:
    return cells + [""] * (width - len(cells)) if width - 2 <= len(cells) < width else cells


def _units_row(cells: list[str], names: list[str]) -> list[str] | None:
    """Units by column where the cells below some names are such; None where they are no units row.

    One that no table knows, such as degC, is kept: it matters only where its column is used.
    """
    units = [unit_in_cell(cell) for cell in cells]
    if not any(unit and unit != "1" and unit_named(unit) for unit in units):
        return None
    strange = units.count(None)
    if not strange:
        return units
    filled = [name for name, cell in zip(names, cells, strict=True) if cell]
    # Titles over groups of columns are no names: they repeat, or leave columns blank.
    named = all(filled) and len(set(filled)) == len(filled) and not any(map(is_value, names))
    if not named or 2 * strange > len(filled) or any(map(is_value, cells)):
        return None
    return [cell if unit is None else unit for unit, cell in zip(units, cells, strict=True)]


def _read(
    path: Path, rows: Iterator[Row], width: int, padded: bool
) -> tuple[list[Cells], NDArray[np.int64]]:
    """Columns and the lines of their rows; DataError with all lines of another length."""
    columns = [Cells() for _ in range(width)]
    lines: list[int] = []
    ragged: list[str] = []
    rows_max = min(ROWS_MAX, CELLS_MAX // width)
    while chunk := list(islice(rows, _CHUNK_ROWS)):
        kept = []
        for line, cells in chunk:
            if len(cells) > width:
                cells = cells[:width] + [c for c in cells[width:] if c]
            elif padded:
                cells = cells + [""] * (width - len(cells))
            if len(cells) == width:
                kept.append((line, cells))
            else:
                ragged.append(f"line {line}: {len(cells)} values")
        if len(lines) + len(kept) > rows_max:
            raise DataError(
                f"{path}: more than {rows_max} rows of {width} columns; shorten the file, keep fewer "
                "columns or use a lower sampling rate"
            )
        if kept:
            numbers = [line for line, _ in kept]
            for column, cells in zip(columns, zip(*(c for _, c in kept), strict=True), strict=True):
                read_chunk(column, cells, numbers, len(lines))
            lines += numbers
        if sum(column.slow_count for column in columns) > _SLOW_CELLS_MAX:
            raise DataError(
                f"{path}: more than {_SLOW_CELLS_MAX} cells of columns with text, dates or empty cells in words; "
                "remove the columns that are not needed"
            )
        if len(ragged) > ROWS_MAX // 10:
            break
    if ragged:
        raise DataError(
            f"{path}: {width} columns, but {listed(ragged)}; complete or remove these lines"
        )
    return columns, np.array(lines, dtype=np.int64)


def listed(faults: list[str], separator: str = "; ") -> str:
    """Faults one after the other, the first ones in full, the rest counted."""
    more = [f"and {len(faults) - LISTED} more"] if len(faults) > LISTED else []
    return separator.join([printable(fault) for fault in faults[:LISTED]] + more)
