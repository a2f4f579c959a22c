"""Tables of a measured map in SI, by role of their columns: a row per point, or a grid with its axes as one."""

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hevopt.display.facts import Shown
from hevopt.errors import DataError
from hevopt.files.shown import shown
from hevopt.measured.maps.matlab import curves_table, points_table
from hevopt.measured.maps.roles import ALIASES, POWERS, QUANTITIES, VALUES_OF
from hevopt.measured.tables.names import base_of, unit_in_name
from hevopt.measured.tables.rows import runs
from hevopt.measured.tables.table import (
    Column,
    Measured,
    asked_column,
    column_of,
    columns_found,
    read_measured,
)
from hevopt.measured.tables.units import in_si, numbers_of

Array = NDArray[np.float64]

_NUMBER = re.compile(r"[+-]?\d+([.,]\d+)?([eE][+-]?\d+)?")


@dataclass(frozen=True, slots=True)
class Source:
    """A table and how to read it. columns: role -> name; units: role -> unit; rows: axis of a grid's rows.

    extra: beside the main table, whose units of speed and torque do not outdo those in this table's header
    """

    path: Path
    sheet: str | None
    columns: Mapping[str, str]
    units: Mapping[str, str]
    rows: str | None
    extra: bool = False


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class MapTable(Shown):
    """Rows of speed, torque and value columns, each (row,) in SI, by role.

    kinds, read: role -> quantity measured, and how its column was read
    """

    measured: Measured
    values: Mapping[str, Array]
    kinds: Mapping[str, str]
    read: Mapping[str, str]
    lines: NDArray[np.int64]
    rectangular: bool
    notes: tuple[str, ...]


def read_table(source: Source, what: str) -> MapTable:
    """Speed, torque and every column that can give "fuel", "nox" or "loss"."""
    measured, is_matlab = _read(source, points_table, source.columns, source.rows)
    names = [column.name for column in measured.columns]
    if not is_matlab and len(names) > 2 and all(_NUMBER.fullmatch(name) for name in names[1:]):
        return _grid(measured, source, what)
    if source.rows is not None and not source.extra and not is_matlab:
        raise DataError(
            f"{measured.path}: --rows is for a grid, and this table has a row per point; leave it out"
        )
    columns = {role: _needed(measured, source, role) for role in ("speed", "torque")}
    columns |= {role: _column(measured, source, role) for role in VALUES_OF[what]}
    return _long(measured, source, columns)


def curve_table(source: Source, role: str, *, plain: bool) -> MapTable | None:
    """Speed and torque of a curve; None where no column holds it. plain: one simply named torque will do."""
    measured, _ = _read(source, curves_table, source.columns, role)
    column = _column(measured, source, role)
    if column is None and plain:
        column = _needed(measured, source, "torque")
    if column is None:
        return None
    return _long(measured, source, {"speed": _needed(measured, source, "speed"), role: column})


def _read(source: Source, layout: Callable, *terms: Any) -> tuple[Measured, bool]:
    """The file's table, of a MATLAB file as a layout with some terms arranges it; whether it is one."""
    arranged = []

    def lay_out(path: Path, variables: Mapping[str, Any]) -> Any:
        arranged.append(path)
        return layout(path, variables, *terms)

    measured = read_measured(source.path, sheet=source.sheet, matlab=lay_out)
    return measured, bool(arranged)


def _column(measured: Measured, source: Source, role: str) -> Column | None:
    column = asked_column(measured, role, source.columns, ALIASES[role])
    if column is None and role in POWERS:
        return column_of(measured, POWERS[role], f"--column {role}=NAME")
    return column


def _needed(measured: Measured, source: Source, role: str) -> Column:
    column = _column(measured, source, role)
    if column is None:
        rest = f"; {measured.left_out}" * bool(measured.left_out)
        raise DataError(
            f"{measured.path}: no column of {role} found; name it with --column {role}=NAME (a grid needs "
            f"numbers in its first row behind a label in its first cell); {columns_found(measured)}{rest}"
        )
    return column


def _long(measured: Measured, source: Source, columns: Mapping[str, Column | None]) -> MapTable:
    values, kinds, read = {}, {}, {}
    for role, column in columns.items():
        if column is None:
            continue
        own = source.extra and role in ("speed", "torque") and column.unit is not None
        unit = None if own else source.units.get(role)
        found = in_si(measured, column, QUANTITIES[role], f"--unit {role}=UNIT", unit)
        values[role], kinds[role] = found.values, found.quantity
        read[role] = f"{role}: {found.note}"
    for role in ("speed", "torque"):
        empty = ~np.isfinite(values[role]) if role in values else np.zeros(0, dtype=bool)
        if empty.any():
            raise DataError(
                f"{measured.path}, {runs(list(measured.lines[empty]))}: no {role}; fill the cells or delete "
                "the rows"
            )
    notes = (*measured.notes, *read.values())
    return MapTable(measured, values, kinds, read, measured.lines, False, notes)


def _grid(measured: Measured, source: Source, what: str) -> MapTable:
    """A grid as one row per cell; the axes' names and units from the corner, the options, or both."""
    down, across, units = _axes(measured, source)
    role = next((r for r in VALUES_OF[what] if r in source.units), VALUES_OF[what][0])
    head = np.array([float(column.name.replace(",", ".")) for column in measured.columns[1:]])
    cells = np.column_stack([numbers_of(column) for column in measured.columns[1:]])
    rows = len(measured.lines)
    raw = {
        down: np.repeat(numbers_of(measured.columns[0]), len(head)),
        across: np.tile(head, rows),
        role: cells.ravel(),
    }
    strange = [c for c in measured.columns if c.strange]
    if strange:
        row, text = strange[0].strange[0]
        raise DataError(
            f"{measured.path}, line {measured.lines[row]}: {shown(text)} is not a number; correct the cell or "
            "empty it"
        )
    lines = np.repeat(measured.lines, len(head))
    flat = Measured(
        measured.path,
        tuple(Column(r, units.get(r), values, "the grid's first cell") for r, values in raw.items()),
        lines,
        measured.notes,
    )  # fmt: skip
    table = _long(flat, source, {column.name: column for column in flat.columns})
    if table.kinds["torque"] == "power":
        raise DataError(
            f"{measured.path}: a grid's axes are speed and torque or mean pressure; give power in a table with "
            "a row per point"
        )
    notes = (*table.notes, f"grid: {rows} rows of {down}, {len(head)} columns of {across}")
    return MapTable(measured, table.values, table.kinds, table.read, lines, True, notes)


def _axes(measured: Measured, source: Source) -> tuple[str, str, dict[str, str | None]]:
    r"""Roles of a grid's first column and first row, and their units: `speed [rpm] \ torque [Nm]`, or a slash."""
    corner = measured.columns[0].name
    # A slash behind a bracket parts the axes; elsewhere it is one of a unit's, such as rad/s.
    parts = [part.strip() for part in re.split(r"\\|(?<=[\])])\s*/", corner)]
    named = [
        next((r for r in ("speed", "torque") if base_of(p) in ALIASES[r]), None) for p in parts
    ]
    units = {r: unit_in_name(p)[0] for r, p in zip(named, parts, strict=True) if r}
    down = source.rows or named[0]
    if down is None or len(parts) > 2 or (len(named) == 2 and set(named) != {"speed", "torque"}):
        raise DataError(
            f"{measured.path}: a grid whose first cell {shown(measured.columns[0].name)} does not tell its axes; "
            r"write it as 'speed [rpm] \ torque [Nm]' (down \ across), or give --rows speed or --rows torque "
            "with --unit speed=UNIT and --unit torque=UNIT"
        )
    return down, "torque" if down == "speed" else "speed", units
