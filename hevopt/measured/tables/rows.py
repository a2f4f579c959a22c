"""From rows of text cells to a table: where the header is, the units row, and every number with its line."""

from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from itertools import chain, islice
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from hevopt.display.facts import Shown
from hevopt.errors import DataError
from hevopt.files.shown import printable
from hevopt.measured.tables.cells import LISTED, Cells, is_empty, is_value, marks_of, read_chunk
from hevopt.measured.tables.header import Row, header_of

ROWS_MAX = 1_000_000
CELLS_MAX = 10_000_000
_HEAD_ROWS = 500
_CHUNK_ROWS = 10_000
_COLUMNS_MAX = 2_000
# Cells that are not written as plain numbers take ten times as long.
_SLOW_CELLS_MAX = 2_500_000


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Table(Shown):
    """What the rows of a file hold. units: None without a units row; lines: (row,)

    also: by column, its names in further header rows
    unclear: by column, why its numbers may mean two things, or ''
    left_out: what else the file holds that is no column of it, or ''
    sampled: by column, the rows that hold a value of it, where each row is one column's; see signals.py
    """

    names: list[str]
    units: list[str] | None
    columns: list[Cells]
    lines: NDArray[np.int64]
    notes: list[str]
    units_source: str = "units row"
    also: list[tuple[str, ...]] | None = None
    unclear: list[str] | None = None
    left_out: str = ""
    sampled: list[NDArray[np.int64]] | None = None


def table_of(path: Path, rows: Iterable[Row], *, padded: bool) -> Table:
    """The table in some rows; `padded`: short rows end in empty cells rather than being faults."""
    left_out = _LeftOut()
    rows = _with_cells(path, iter(rows), left_out)
    head = list(islice(rows, _HEAD_ROWS))
    if padded:
        widest = max((len(cells) for _, cells in head), default=0)
        head = [(line, cells + [""] * (widest - len(cells))) for line, cells in head]
    start, width = _first_data_row(path, head)
    header = header_of(head, start, width)
    left_out.headers, notes = header.rows, header.notes
    before = [line for line, _ in head[: start - len(header.rows)]]
    if before:
        notes.insert(0, f"text before the header: {runs(before)}")
    columns, lines = _read(path, chain(head[start:], rows), width, padded, left_out)
    mark, unclear = marks_of(path, columns)
    notes += ["decimal comma"] * (mark == ",") + left_out.notes()
    kept = [
        i
        for i in range(width)
        if header.names[i] != f"column {i + 1}" or _holds_something(columns[i])
    ]
    names, columns, also, unclear = (
        [values[i] for i in kept] for values in (header.names, columns, header.also, unclear)
    )
    units = header.units and [header.units[i] for i in kept]
    return Table(names, units, columns, lines, notes, also=also, unclear=unclear)


@dataclass(slots=True)
class _LeftOut:
    """Rows that are no data: those without any value, and headers that a logger writes again where it goes on."""

    empty: list[int] = field(default_factory=list)
    again: list[int] = field(default_factory=list)
    headers: list[list[str]] = field(default_factory=list)

    def takes(self, line: int, cells: list[str]) -> bool:
        """Whether a row is such; if so, it is noted."""
        if cells in self.headers:
            self.again.append(line)
        elif all(map(is_empty, cells)):
            self.empty.append(line)
        else:
            return False
        return True

    def notes(self) -> list[str]:
        """What a reader should know of them."""
        kinds = (("rows without any value, left out", self.empty), ("header again", self.again))
        return [f"{what}: {runs(sorted(lines))}" for what, lines in kinds if lines]


def _holds_something(column: Cells) -> bool:
    return bool(column.number_count or column.clock_count or column.strange_count)


def _with_cells(path: Path, rows: Iterator[Row], left_out: _LeftOut) -> Iterator[Row]:
    """Rows with text in some cell; DataError where one is too wide."""
    for line, cells in rows:
        if len(cells) > _COLUMNS_MAX:
            raise DataError(
                f"{path}, line {line}: {len(cells)} columns; allowed: up to {_COLUMNS_MAX}"
            )
        if any(cells):
            yield line, cells
        else:
            left_out.empty.append(line)


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


def _read(
    path: Path, rows: Iterator[Row], width: int, padded: bool, left_out: _LeftOut
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
            if left_out.takes(line, cells):
                continue
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
