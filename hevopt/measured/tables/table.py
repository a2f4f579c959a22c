"""Measured tables in whatever shape other tools wrote them: read into columns with units and line numbers.

Text with any usual separator, decimal mark and encoding, .xls, .xlsx and .mat. A unit comes from the header, a
units row, the name's suffix or the convention of a known tool; where none says it, whoever needs it must be told.
"""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from hevopt.display.facts import Shown
from hevopt.errors import DataError, close_to
from hevopt.files.shown import printable, shown
from hevopt.measured.tables.cells import Cells
from hevopt.measured.tables.names import base_of, unit_by_convention, unit_in_name, units_in_name
from hevopt.measured.tables.rows import Table
from hevopt.units import unit_named

Array = NDArray[np.float64]

_BYTES_MAX = 100_000_000
_COLUMNS_NAMED = 30
_OLD_WORKBOOK = b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1"
_PROGRAM = (
    "a program of MATLAB, which hevopt does not run; run it in MATLAB or Octave, and save what it made, such as "
    "save('map.mat', 'fc_map_spd', 'fc_map_trq', 'fc_fuel_map', 'fc_max_trq', '-v7')"
)
MatlabLayout = Callable[[Path, dict[str, NDArray | None]], Table]
_UNREADABLE = {
    b"%PDF": "a PDF; give the table as CSV or .xlsx",
    b"\x1f\x8b": "packed with gzip; unpack it first",
}


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Column(Shown):
    """A column of a file, in the file's unit.

    unit: as the file writes it, None where nothing says it; source: how it is known
    values: (row,) NaN where the cell is empty or no number; strange: (row, text) of the first cells that are no
    numbers, strange_count of them in all; words: rows of each such text, of the first few texts
    against: another unit that the file states, and how; fixed: whether the cells themselves carry the unit
    clock: "date", "time of day" or "moment" where the cells are such; also: names in further header rows
    unclear: why the numbers could mean two things, or ''
    sampled: rows that hold a value of it, where each row of the table is one column's; None elsewhere
    """

    name: str
    unit: str | None
    values: Array
    source: str
    strange: tuple[tuple[int, str], ...] = ()
    strange_count: int = 0
    words: Mapping[str, Sequence[int]] = field(default_factory=dict)
    against: tuple[str, str] | None = None
    fixed: bool = False
    clock: str = ""
    also: tuple[str, ...] = ()
    unclear: str = ""
    sampled: NDArray[np.int64] | None = None


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Measured(Shown):
    """A file's table. lines: (row,) line or sheet row of every data row; notes: what was assumed on reading.

    left_out: what else the file holds that is no column of it, or ''; one of the notes too
    """

    path: Path
    columns: tuple[Column, ...]
    lines: NDArray[np.int64]
    notes: tuple[str, ...]
    left_out: str = ""


def read_measured(
    path: Path, *, sheet: str | None = None, matlab: MatlabLayout | None = None
) -> Measured:
    """The table of a CSV, TSV, Excel or .mat file; DataError where it has none that can be read.

    matlab: how the variables of a .mat file become a table, else its vectors one column each
    """
    shown_path = Path(printable(str(path)))
    contents = _contents(path, shown_path)
    try:
        table = _table(shown_path, contents, sheet, matlab)
    except MemoryError:
        raise DataError(
            f"{shown_path}: too large for this machine's memory; shorten the file"
        ) from None
    columns = _columns(shown_path, table)
    table.lines.flags.writeable = False
    notes = (*table.notes, table.left_out) if table.left_out else tuple(table.notes)
    return Measured(shown_path, tuple(columns), table.lines, notes, table.left_out)


def _contents(path: Path, shown_path: Path) -> bytes:
    try:
        if path.is_dir():
            raise DataError(f"{shown_path}: a folder; give the path of a file")
        if not path.exists():
            raise DataError(f"{shown_path}: no such file; check the path")
        if not path.is_file():
            raise DataError(f"{shown_path}: not a regular file; give a CSV, Excel or .mat file")
        with path.open("rb") as file:
            contents = file.read(_BYTES_MAX + 1)
    except (OSError, ValueError) as error:
        why = getattr(error, "strerror", None) or "not a path"
        raise DataError(f"{shown_path}: cannot be read ({why}); check the path") from None
    if len(contents) > _BYTES_MAX:
        raise DataError(
            f"{shown_path}: more than the {_BYTES_MAX / 1e6:.0f} MB allowed; shorten the file, or use a lower "
            "sampling rate"
        )
    if not contents.strip():
        raise DataError(f"{shown_path}: empty; a header line and rows of numbers are needed")
    return contents


def _table(path: Path, contents: bytes, sheet: str | None, matlab: MatlabLayout | None) -> Table:
    for start, what in _UNREADABLE.items():
        if contents.startswith(start):
            raise DataError(f"{path}: {what}")
    if contents.startswith(b"PK\x03\x04"):
        from hevopt.measured.tables.excel import excel_table

        return excel_table(path, contents, sheet)
    if contents.startswith(_OLD_WORKBOOK):
        from hevopt.measured.tables.xls import xls_table

        return xls_table(path, contents, sheet)
    if sheet is not None:
        raise DataError(f"{path}: not an Excel workbook; leave --sheet out")
    if path.suffix.lower() == ".mat" or contents.startswith((b"MATLAB ", b"\x89HDF")):
        from hevopt.measured.tables.matlab import columns_table, matlab_variables

        return (matlab or columns_table)(path, matlab_variables(path, contents))
    if path.suffix.lower() == ".m":
        raise DataError(f"{path}: {_PROGRAM}")
    from hevopt.measured.tables.text import text_table

    return text_table(path, contents)


def _columns(path: Path, table: Table) -> list[Column]:
    convention = unit_by_convention(table.names, vecto=path.suffix.lower() == ".vdri")
    columns = []
    for i, (name, cells) in enumerate(zip(table.names, table.columns, strict=True)):
        unit, source = unit_in_name(name)
        if table.units and table.units[i]:
            unit, source = table.units[i], table.units_source
        elif name in convention:
            unit, source = convention[name]
        also = table.also[i] if table.also else ()
        stated = [convention[name]] if name in convention else units_in_name(name)
        stated += [found for other in also for found in units_in_name(other)]
        if not unit and stated:
            unit, source = stated[0]
        against = next((s for s in stated if unit and unit_named(s[0]) != unit_named(unit)), None)
        values = cells.values()
        unclear = table.unclear[i] if table.unclear else ""
        column = Column(
            name, unit, values, source, tuple(cells.strange), cells.strange_count, cells.words, against,
            also=also, unclear=unclear, sampled=table.sampled[i] if table.sampled else None,
        )  # fmt: skip
        column = _carrying_units(column, cells, table)
        column.values.flags.writeable = False
        columns.append(column)
    return columns


def _carrying_units(column: Column, cells: Cells, table: Table) -> Column:
    """The column whose cells are dates, times of day or per cent: these are never scaled by another unit."""
    plain = cells.number_count - cells.percent_count
    clock = "dates or times of day" + f", {cells.order}" * bool(cells.order)
    for kind, count, others, unit, what in (
        ("clock", cells.clock_count, cells.number_count, "s", clock),
        ("percent", cells.percent_count, plain + cells.clock_count, "%", "cells in per cent"),
    ):
        if not count:
            continue
        if others:  # neither a column of numbers nor one of these
            line, text = cells.found[kind]
            strange = ((int(np.searchsorted(table.lines, line)), text), *column.strange)
            column = replace(column, strange=strange, strange_count=column.strange_count + count)
            continue
        known, own = unit_named(column.unit) if column.unit else None, unit_named(unit)
        against = None
        if kind == "percent" and column.unit and (known is None or known.quantity != own.quantity):
            against = (column.unit, column.source)
        elif column.unit and known != own:
            what += f"; {column.unit} of the {column.source} is not applied"
        column = replace(column, unit=unit, source=what, against=against, fixed=True)
        column = replace(column, clock=cells.clock() if kind == "clock" else "")
    return column


def column_named(measured: Measured, name: str) -> Column:
    """The column that a user names: as in the file, without its unit, or by its number from 1."""
    exact = [c for c in measured.columns if c.name == name]
    matches = exact or [c for c in measured.columns if base_of(c.name) == base_of(name)]
    matches = matches or [c for c in measured.columns if base_of(name) in map(base_of, c.also)]
    if not matches and name.isdecimal() and 0 < int(name) <= len(measured.columns):
        matches = [measured.columns[int(name) - 1]]
    if len(matches) == 1:
        return matches[0]
    if matches:
        raise DataError(
            f"{measured.path}: {len(matches)} columns are named {shown(name)}; give one by its number, 1 to "
            f"{len(measured.columns)}"
        )
    hint = close_to(name, [c.name for c in measured.columns], cutoff=0.5)
    raise DataError(f"{measured.path}: no column {shown(name)}; {hint}{columns_found(measured)}")


def column_of(measured: Measured, aliases: Collection[str], option: str) -> Column | None:
    """The one column whose name without unit is an alias, written in small letters and digits alone.

    None where there is none; DataError where there are several, between which the option chooses.
    """
    found = [c for c in measured.columns if base_of(c.name) in aliases]
    found = found or [c for c in measured.columns if any(base_of(n) in aliases for n in c.also)]
    if len(found) > 1:
        names = ", ".join(c.name for c in found)
        raise DataError(
            f"{measured.path}: columns {names} could all be meant; choose with {option}"
        )
    return found[0] if found else None


def asked_column(
    measured: Measured, role: str, columns: Mapping[str, str], aliases: Collection[str]
) -> Column | None:
    """The column that --column names for a role, else the one whose name is an alias; None where there is none."""
    if role in columns:
        return column_named(measured, columns[role])
    return column_of(measured, aliases, f"--column {role}=NAME")


def first_column_of(
    measured: Measured, tiers: Sequence[Collection[str]], option: str
) -> Column | None:
    """The column of the first group of aliases that names one, such as the car's own speed before that of a GPS."""
    for aliases in tiers:
        if column := column_of(measured, aliases, option):
            return column
    return None


def columns_found(measured: Measured) -> str:
    """The columns of a file with their units, for a message."""
    named = [
        f"{c.name} [{c.unit}]" if c.unit and c.unit not in c.name else c.name
        for c in measured.columns
    ]
    more = f" and {len(named) - _COLUMNS_NAMED} more" if len(named) > _COLUMNS_NAMED else ""
    return f"columns found: {', '.join(named[:_COLUMNS_NAMED])}{more}"
