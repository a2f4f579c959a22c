"""Which columns of a measured table are a drive's time, speed, grade and gears, and what their units are."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hevopt.display.facts import Shown
from hevopt.errors import DataError, unknown_name
from hevopt.files.shown import shown
from hevopt.measured.cycles.dates import date_beside, with_dates
from hevopt.measured.tables import aliases as column_names
from hevopt.measured.tables.names import base_of, grade_ends_step
from hevopt.measured.tables.packed_clock import as_clock
from hevopt.measured.tables.samples import at_samples_of
from hevopt.measured.tables.table import (
    Column,
    Measured,
    column_named,
    columns_found,
    first_column_of,
)
from hevopt.measured.tables.units import in_si, numbers_of, unit_missing
from hevopt.units import unit_named, units_of

Array = NDArray[np.float64]

# Role -> groups of names without unit, in small letters and digits, by which a column is found on its own.
_ALIASES: dict[str, tuple[tuple[str, ...], ...]] = {
    "time": column_names.TIME,
    "date": (),
    "speed": column_names.SPEED,
    "distance": (("distance", "dist", "s", "station", "weg", "travelleddistance"),),
    "stop": (("stop", "stoptime", "stoppingtime"),),
    "grade": (
        ("grade", "grad", "gradient", "slope", "roadgrade", "roadgradient", "roadslope", "cycgrade",
        "steigung", "inclination"),
    ),
    "gear": (("gear", "gears", "gang", "selectedgear", "gearnumber"),),
    "clutch_open": (("clutchopen",),),
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
    "2024-02-01 10:00:01, 2024/02/01 10:00:01, 01.02.2024 10:00:01, 01-Feb-2024 10:00:01; 01/02/2024 where the "
    "column shows which of the two is the day)"
}
_OPTIONS = {"time": "--time-unit", "speed": "--speed-unit"}
# A column of time alone in its unit is the drive's where it hardly ever falls.
_RISING_SHARE = 0.9


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Drive(Shown):
    """A drive as its file has it, in SI; all arrays (row,), NaN where a cell is empty or no number.

    time_s is None for a drive over distance_m; what the file lacks is None. notes: one text per assumption
    text: (role, row) -> cell that is no number
    grade_ends: whether a row's grade holds over the step that ends at the row, not the one that begins there
    hints: what the file has that is not used
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
    hints: tuple[str, ...] = ()


def drive_of(measured: Measured, columns: Mapping[str, str], units: Mapping[str, str]) -> Drive:
    """The drive in a table; `columns` and `units` map a role to a column's name ('' for none) and to a unit."""
    for given in (*columns, *units):
        if given not in ROLES:
            raise unknown_name("role of a column", given, list(ROLES))
    chosen = _chosen_columns(measured, columns)
    if chosen["speed"] is not None:
        measured = at_samples_of(measured, chosen["speed"])
        chosen = _chosen_columns(measured, columns)
    _check_missing(measured, chosen, units)
    _check_together(measured, chosen, units)
    notes, values = [], {}
    for role, column in chosen.items():
        if role != "date":
            values[role] = _values(measured, role, column, units.get(role), notes)
    if chosen["date"] is not None:
        values["time"] = with_dates(measured, chosen["date"], chosen["time"], values["time"])
        notes.append(f"date: {chosen['date'].name}, added to the time of day")
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
        tuple(notes), text, _grade_ends(measured, chosen), _unused_altitude(measured, chosen),
    )  # fmt: skip


def _chosen_columns(measured: Measured, columns: Mapping[str, str]) -> dict[str, Column | None]:
    chosen = {role: _chosen(measured, role, columns) for role in ROLES}
    if chosen["speed"] is None and "speed" not in columns:
        chosen["speed"] = _alone(measured, "speed", chosen)
    if chosen["time"] is None and chosen["distance"] is None and "time" not in columns:
        chosen["time"] = _alone(measured, "time", chosen)
    chosen["time"] = as_clock(chosen["time"])
    if chosen["time"] is not None and "distance" not in columns:
        chosen["distance"] = chosen["stop"] = None
    if chosen["time"] is not None and "date" not in columns:
        chosen["date"] = date_beside(measured, chosen["time"])
    return chosen


def _chosen(measured: Measured, role: str, columns: Mapping[str, str]) -> Column | None:
    if role in columns:
        return column_named(measured, columns[role]) if columns[role].strip() else None
    if role == "distance" and columns.get("time", "").strip():
        return None
    return first_column_of(measured, _ALIASES[role], f"--column {role}=NAME")


def _alone(measured: Measured, role: str, chosen: Mapping[str, Column | None]) -> Column | None:
    """The only column whose unit is one of the role's quantity, if there is one."""
    free = [column for column in measured.columns if column not in chosen.values()]
    found = [c for c in free if _quantity(c) == role and (role != "time" or _runs_on(c))]
    return found[0] if len(found) == 1 else None


def _quantity(column: Column) -> str | None:
    unit = unit_named(column.unit) if column.unit else None
    return None if unit is None else unit.quantity


def _runs_on(column: Column) -> bool:
    values = column.values[np.isfinite(column.values)]
    rising = len(values) > 1 and values[-1] > values[0]
    return rising and np.mean(np.diff(values) >= 0) >= _RISING_SHARE and column.clock != "date"


def _check_missing(
    measured: Measured, chosen: Mapping[str, Column | None], units: Mapping[str, str]
) -> None:
    """DataError with all that the file does not say: which columns are meant, and their units."""
    missing, options = [], []
    over = "distance" if chosen["time"] is None and chosen["distance"] is not None else "time"
    for role in (over, "speed"):
        if chosen[role] is None:
            missing.append(_unnamed(role))
            options.append(f"--column {role}={_number_of(measured, role)}")
    for role, column in chosen.items():
        option = _OPTIONS.get(role, f"--unit {role}=UNIT")
        needs = (
            role in _QUANTITIES
            and role not in units
            and (column is not None or role in (over, "speed"))
        )
        if not needs or (column is not None and (column.unit is not None or _unreadable(column))):
            continue
        if column is not None:
            missing.append(unit_missing(column, _QUANTITIES[role], option))
        else:
            missing.append(f"the unit of {role}, by {option}")
        symbol = {"time": "s", "speed": "km/h"}.get(role, units_of(_QUANTITIES[role][0])[0])
        options.append(f"{option.removesuffix('=UNIT')}{'=' if '=' in option else ' '}{symbol}")
    if not missing:
        return
    if len(missing) == 1:
        raise DataError(f"{measured.path}: {missing[0]}; {columns_found(measured)}")
    raise DataError(
        f"{measured.path}: {len(missing)} things are not in the file; give them all, such as "
        f"{' '.join(options)}\n  " + "\n  ".join([*missing, columns_found(measured)])
    )


def _unreadable(column: Column) -> bool:
    return bool(column.strange) and not np.isfinite(column.values).any()


def _unnamed(role: str) -> str:
    names = ", ".join(_ALIASES[role][0][:4])
    also = " or distance" if role == "time" else ""
    return (
        f"no column of {role}{also} found by its name ({names} and the like) or its unit; choose it with "
        f"--column {role}=NAME or its number"
    )


def _number_of(measured: Measured, role: str) -> int:
    """The number of a column for an example: time is the first one that runs on, speed the next one after it."""
    runs_on = [k for k, column in enumerate(measured.columns) if _runs_on(column)]
    time = runs_on[0] if runs_on else 0
    if role == "time" or len(measured.columns) < 2:
        return time + 1
    return 2 if time == 0 else 1


def _check_together(
    measured: Measured, chosen: Mapping[str, Column | None], units: Mapping[str, str]
) -> None:
    """DataError where two choices exclude each other, or one hangs in the air."""
    if chosen["grade"] is not None and chosen["altitude"] is not None:
        raise DataError(
            f"{measured.path}: grade and altitude are both given; leave one out, such as with --column grade="
        )
    if chosen["clutch_open"] is not None and chosen["gear"] is None:
        raise DataError(
            f"{measured.path}: clutch_open without gear; name the gear's column with --column gear=NAME, or leave "
            "the clutch out with --column clutch_open="
        )
    if "date" in units:
        raise DataError(f"{measured.path}: date has no unit; leave out --unit date={units['date']}")
    for role in units:
        if chosen[role] is None:
            raise DataError(
                f"{measured.path}: a unit is given for {role}, for which no column is used; leave it out, or "
                f"choose one with --column {role}=NAME; {columns_found(measured)}"
            )


def _grade_ends(measured: Measured, chosen: Mapping[str, Column | None]) -> bool:
    if chosen["grade"] is None or chosen["time"] is None:
        return False
    return grade_ends_step(chosen["grade"].name, [column.name for column in measured.columns])


def _unused_altitude(measured: Measured, chosen: Mapping[str, Column | None]) -> tuple[str, ...]:
    """A text on a column of altitude that nothing uses, where the drive has no grade."""
    if chosen["grade"] is not None or chosen["altitude"] is not None:
        return ()
    found = [c for c in measured.columns if base_of(c.name) in column_names.ALTITUDE]
    if not found:
        return ()
    name = found[0].name
    unit = "" if found[0].unit else " --unit altitude=m"
    return (
        f"NOTE: the road counts as level; the grade comes from column {name} with --column altitude={shown(name)}"
        f"{unit}",
    )


def _values(
    measured: Measured, role: str, column: Column | None, unit: str | None, notes: list[str]
) -> Array | None:
    """A column's values in SI, with a note of where its unit comes from."""
    if column is None:
        return None
    numbers_of(column)
    if _unreadable(column):
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
