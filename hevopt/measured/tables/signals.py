"""Logs with one signal a row, its name and unit in columns of their own, as Car Scanner writes them.

    SECONDS;PID;VALUE;UNITS;LATITUDE;LONGTITUDE

become a table with a column a signal, which holds a value in the rows of that signal alone.
"""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from hevopt.errors import DataError
from hevopt.measured.tables.cells import Cells, marks_of, read_chunk
from hevopt.measured.tables.names import cleaned
from hevopt.measured.tables.rows import CELLS_MAX, ROWS_MAX, Row, Table, listed
from hevopt.units import unit_named

Rows = NDArray[np.int64]

_TIME, _NAME, _VALUE, _UNIT = "seconds", "pid", "value", "units"
# Where all signals are too many numbers, those of a drive are kept.
_OF_DRIVES = ("speed", "length")


def is_signals_header(cells: Sequence[str]) -> bool:
    """Whether a row of cells is the header of such a log."""
    return {_TIME, _NAME, _VALUE} <= {cell.strip().lower() for cell in cells}


def signals_table(path: Path, header: Row, rows: Iterable[Row]) -> Table:
    """The table of a log's rows below its header."""
    place = {cell.strip().lower(): i for i, cell in enumerate(header[1])}
    width = max(place[name] for name in (_TIME, _NAME, _VALUE)) + 1
    times, lines, short = [], [], []
    found: dict[tuple[str, str], tuple[list[int], list[str]]] = {}
    for line, cells in rows:
        if len(cells) < width or not cells[place[_NAME]]:
            short += [line] if any(cells) else []
            continue
        unit = cells[place[_UNIT]] if place.get(_UNIT, len(cells)) < len(cells) else ""
        of, texts = found.setdefault((cleaned(cells[place[_NAME]]), cleaned(unit)), ([], []))
        of.append(len(times))
        texts.append(cells[place[_VALUE]])
        times.append(cells[place[_TIME]])
        lines.append(line)
    if short or not times:
        raise DataError(
            f"{path}, line {short[0] if short else header[0]}: not a row of "
            f"{listed([name.upper() for name in place if name], ', ')}; complete or remove it"
        )
    if len(times) > ROWS_MAX:
        raise DataError(f"{path}: more than {ROWS_MAX} rows; shorten the file")
    return _table(path, header, times, lines, found)


def _table(
    path: Path,
    header: Row,
    times: list[str],
    lines: list[int],
    found: dict[tuple[str, str], tuple[list[int], list[str]]],
) -> Table:
    kept, left_out = found, ""
    if len(found) * len(times) > CELLS_MAX:
        kept = {key: of for key, of in found.items() if _of_drive(key[1])}
        others = [name for name, unit in found if (name, unit) not in kept]
        left_out = f"left out, signals without a unit of speed or length: {listed(others, ', ')}"
    time = Cells()
    read_chunk(time, times, lines, 0)
    twice = {name for name, _ in kept if sum(name == other for other, _ in kept) > 1}
    names, units, columns = [_TIME.upper()], ["s"], [time]
    sampled = [np.arange(len(times))]
    for (name, unit), (rows, texts) in kept.items():
        names.append(f"{name} [{unit}]" if name in twice else name)
        units.append(unit if unit_named(unit) else "")
        columns.append(_spread(rows, texts, [lines[row] for row in rows], len(times)))
        sampled.append(np.array(rows))
    notes = [f"header in line {header[0]}", f"one signal a row: {len(kept)} signals"]
    mark, unclear = marks_of(path, columns)
    return Table(
        names, units, columns, np.array(lines, dtype=np.int64), notes + ["decimal comma"] * (mark == ","),
        units_source="units of the signal's rows", unclear=unclear, left_out=left_out, sampled=sampled,
    )  # fmt: skip


def _of_drive(unit: str) -> bool:
    known = unit_named(unit)
    return known is not None and known.quantity in _OF_DRIVES


def _spread(rows: list[int], texts: list[str], lines: list[int], count: int) -> Cells:
    """The cells of a signal in the rows that are its own."""
    own = Cells()
    read_chunk(own, texts, lines, 0)
    values = np.full(count, np.nan)
    values[rows] = own.values()
    strange = [(rows[row], text) for row, text in own.strange]
    words = {
        text: type(found)("q", (rows[row] for row in found)) for text, found in own.words.items()
    }
    return replace(own, chunks=[values], strange=strange, words=words, slashed=own.slashed[:0])
