"""Which columns of a measured table are a drive's time, speed, grade and gears, and what their units are."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hevopt.errors import DataError, unknown_name
from hevopt.files import shown
from hevopt.imports import column_names
from hevopt.imports.measured import (
    Column,
    Measured,
    column_named,
    column_of,
    columns_found,
    in_si,
)
from hevopt.imports.measured_names import grade_ends_step

Array = NDArray[np.float64]

# Role -> names without unit, in small letters and digits, by which a column is found on its own.
_ALIASES: dict[str, tuple[str, ...]] = {
    "time": column_names.TIME,
    "speed": column_names.SPEED,
    "distance": ("distance", "dist", "s", "station", "weg", "travelleddistance"),
    "stop": ("stop", "stoptime", "stoppingtime"),
    "grade": (
        "grade", "grad", "gradient", "slope", "roadgrade", "roadgradient", "roadslope", "cycgrade",
        "steigung", "inclination",
    ),
    "gear": ("gear", "gang", "selectedgear", "gearnumber"),
    "clutch_open": ("clutchopen",),
    "altitude": (),
}  # fmt: skip
ROLES = tuple(_ALIASES)
_QUANTITIES = {
    "time": ("time",),
    "speed": ("speed",),
    "distance": ("length",),
    "stop": ("time",),
    "grade": ("fraction", "angle"),
    "altitude": ("length",),
}
_READ_AS = {
    "time": "a time that can be read (seconds, 10:00:01 with hours, minutes and seconds, 10:00:01 AM, or "
    "2024-02-01 10:00:01, 2024/02/01 10:00:01, 01.02.2024 10:00:01; 01/02/2024 where the column shows which of "
    "the two is the day)"
}
_OPTIONS = {"time": "--time-unit", "speed": "--speed-unit"}


@dataclass(frozen=True, slots=True, eq=False)
class Drive:
    """A drive as its file has it, in SI; all arrays (row,), NaN where a cell is empty or no number.

    time_s is None for a drive over distance_m; what the file lacks is None. notes: one text per assumption
    text: (role, row) -> cell that is no number
    grade_ends: whether a row's grade holds over the step that ends at the row, not the one that begins there
    """

    measured: Measured
    lines: NDArray[np.int64]
    speed_mps: Array
    time_s: Array | None
    distance_m: Array | None
    stop_s: Array | None
    grade: Array | None
    altitude_m: Array | None
    gear: Array | None
    clutch_open: Array | None
    notes: tuple[str, ...]
    text: dict[tuple[str, int], str]
    grade_ends: bool


def drive_of(measured: Measured, columns: Mapping[str, str], units: Mapping[str, str]) -> Drive:
    """The drive in a table; `columns` and `units` map a role to a column's name ('' for none) and to a unit."""
    for given in (*columns, *units):
        if given not in ROLES:
            raise unknown_name("role of a column", given, list(ROLES))
    chosen = {role: _chosen(measured, role, columns) for role in ROLES}
    if chosen["speed"] is None:
        raise _missing(measured, "speed")
    if chosen["time"] is None and chosen["distance"] is None:
        raise _missing(measured, "time")
    if chosen["time"] is not None and "distance" not in columns:
        chosen["distance"] = chosen["stop"] = None
    if chosen["grade"] is not None and chosen["altitude"] is not None:
        raise DataError(
            f"{measured.path}: grade and altitude are both given; leave one out, such as with --column grade="
        )
    if chosen["clutch_open"] is not None and chosen["gear"] is None:
        raise DataError(
            f"{measured.path}: clutch_open without gear; name the gear's column with --column gear=NAME, or leave "
            "the clutch out with --column clutch_open="
        )
    for role in units:
        if chosen[role] is None:
            raise DataError(
                f"{measured.path}: a unit is given for {role}, for which no column is used; leave it out, or "
                f"choose one with --column {role}=NAME; {columns_found(measured)}"
            )
    notes, values = [], {}
    for role, column in chosen.items():
        values[role] = _values(measured, role, column, units.get(role), notes)
    used = [column.name for column in chosen.values() if column is not None]
    unused = [column.name for column in measured.columns if column.name not in used]
    if unused:
        notes.append(f"columns not used: {', '.join(unused)}")
    text = {
        (role, row): cell
        for role, column in chosen.items()
        if column is not None
        for row, cell in column.strange
    }
    return Drive(
        measured, measured.lines, values["speed"], values["time"], values["distance"],
        values["stop"], values["grade"], values["altitude"], values["gear"], values["clutch_open"],
        tuple(notes), text, _grade_ends(measured, chosen),
    )  # fmt: skip


def _grade_ends(measured: Measured, chosen: Mapping[str, Column | None]) -> bool:
    if chosen["grade"] is None or chosen["time"] is None:
        return False
    return grade_ends_step(chosen["grade"].name, [column.name for column in measured.columns])


def _chosen(measured: Measured, role: str, columns: Mapping[str, str]) -> Column | None:
    if role in columns:
        return column_named(measured, columns[role]) if columns[role].strip() else None
    if role == "distance" and columns.get("time", "").strip():
        return None
    return column_of(measured, _ALIASES[role], f"--column {role}=NAME")


def _missing(measured: Measured, role: str) -> DataError:
    names = ", ".join(_ALIASES[role][:4])
    also = " or distance" if role == "time" else ""
    return DataError(
        f"{measured.path}: no column of {role}{also} found by its name ({names} and the like); choose it with "
        f"--column {role}=NAME or its number; {columns_found(measured)}"
    )


def _values(
    measured: Measured, role: str, column: Column | None, unit: str | None, notes: list[str]
) -> Array | None:
    """A column's values in SI, with a note of where its unit comes from."""
    if column is None:
        return None
    if column.strange and not np.isfinite(column.values).any():
        row, cell = column.strange[0]
        raise DataError(
            f"{measured.path}, line {measured.lines[row]}: column {column.name}: {shown(cell)} is not "
            f"{_READ_AS.get(role, 'a number')}, nor is any other cell; correct the column, or choose another with "
            f"--column {role}=NAME; {columns_found(measured)}"
        )
    if role not in _QUANTITIES:
        if unit is not None:
            raise DataError(f"{measured.path}: {role} has no unit; leave out --unit {role}={unit}")
        notes.append(f"{role}: {column.name}")
        return column.values
    option = _OPTIONS.get(role, f"--unit {role}=UNIT")
    # A stop that cannot be read would be left out of the drive; other cells are faults that a repair may mend.
    mendable = role != "stop"
    found = in_si(measured, column, _QUANTITIES[role], option, unit, text_as_empty=mendable)
    notes.append(f"{role}: {found.note}")
    if found.quantity == "angle":
        return np.tan(found.values)
    return found.values
