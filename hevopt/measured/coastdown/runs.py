"""Coast-down runs from measured tables.

A new run begins where the run's number or the direction changes, in a new file, and, without such a number, where
the time goes back or has a gap. It ends where the car first stands still.
"""

from collections.abc import Mapping, Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from hevopt.errors import DataError
from hevopt.measured.coastdown.checks import check_runs
from hevopt.measured.coastdown.directions import Directions, Way, directions_in, signs
from hevopt.measured.coastdown.fit import Run
from hevopt.measured.tables import aliases as column_names
from hevopt.measured.tables import rows as measured_rows
from hevopt.measured.tables.clock_ticks import spread_evenly, ticks_of
from hevopt.measured.tables.packed_clock import as_clock
from hevopt.measured.tables.samples import at_samples_of
from hevopt.measured.tables.table import (
    Column,
    Measured,
    column_named,
    columns_found,
    first_column_of,
    read_measured,
)
from hevopt.measured.tables.units import in_si, numbers_of, unit_missing

Array = NDArray[np.float64]

_ALIASES = {
    "time": column_names.TIME,
    "speed": column_names.SPEED,
    "run": ({"run", "runnumber", "runno", "runid", "test", "testnumber", "coastdown"},),
    "direction": ({"direction", "dir", "heading", "way"},),
}  # fmt: skip
_QUANTITIES = {"time": "time", "speed": "speed"}
ROLES, ROLES_WITH_UNIT = tuple(_ALIASES), (*_QUANTITIES, "direction")
# Without a column run: a longer gap in time, in seconds and in usual steps, parts two runs.
_GAP_S = 5.0
_GAP_STEPS = 10.0
_LISTED = 20
# What a car that stands still may show, and how fast one stops at the end of a coast-down.
_REST_MAX_MPS, _LAST_FALL_MPS2 = 0.5, 1.0
_SEPARATE = (
    "runs are told apart by a column run with a number for each, by a file for each, or by a gap in time of more "
    f"than {_GAP_S:g} s and {_GAP_STEPS:g} usual steps; cut what lies between them from the log"
)


def read_runs(
    paths: Sequence[Path],
    columns: Mapping[str, str],
    units: Mapping[str, str],
    directions: Sequence[int] | None,
    sheet: str | None,
) -> tuple[list[Run], list[str]]:
    """The runs of all files, and how they were read. directions: of the runs in order, where no column has them."""
    parts, notes = [], []
    for path in paths:
        found, said = _parts(path, columns, units, sheet)
        parts += found
        notes += [f"{path.name}: {note}" for note in said]
    ways, places = [way for *_, way in parts], [place for _, _, place, _ in parts]
    labels, said = signs(ways, places, directions, _SEPARATE)
    notes += said
    runs = [
        Run(str(k + 1), direction, time, speed, place)
        for k, ((time, speed, place, _), direction) in enumerate(zip(parts, labels, strict=True))
    ]
    check_runs(runs, _SEPARATE)
    return runs, notes


def _parts(
    path: Path, columns: Mapping[str, str], units: Mapping[str, str], sheet: str | None
) -> tuple[list[tuple[Array, Array, str, Way]], list[str]]:
    """Time, speed, place and direction of every run of a file, and how it was read."""
    measured = read_measured(path, sheet=sheet)
    if speed := _column(measured, "speed", columns.get("speed")):
        measured = at_samples_of(measured, speed)
    values, ways, notes = _values(measured, columns, units)
    time, begins = values["time"], np.zeros(max(len(values["time"]) - 1, 0), dtype=bool)
    if "run" in values:
        begins = np.diff(values["run"]) != 0
    else:
        gaps = _gaps(time)
        begins = gaps | (np.diff(time) < 0)
        if gaps.any():
            after = measured.lines[1:][gaps]
            more = f" and {len(after) - _LISTED} more" * (len(after) > _LISTED)
            notes.append(
                f"a gap in time begins a new run in line {', '.join(map(str, after[:_LISTED]))}{more}"
            )
    if ways is not None:
        begins |= ways.changes()
    parts, speed, after, spread = [], values["speed"], np.zeros(len(time), dtype=bool), []
    for a, b in pairwise([0, *(np.flatnonzero(begins) + 1), len(time)]):
        end = a + _at_rest(time[a:b], speed[a:b])
        after[end:b] = True
        place = f"{measured.path}, lines {measured.lines[a]} to {measured.lines[end - 1]}"
        way = ways.of_run(slice(a, end), place) if ways is not None else None
        of_run, said = _spread(time[a:end])
        spread += said
        parts.append((of_run, speed[a:end], place, way))
    for role in _QUANTITIES:
        _check_numbers(measured, role, np.where(after, 0.0, values[role]))
    notes += dict.fromkeys(spread)
    if after.any():
        where = measured_rows.runs(measured.lines[after].tolist())
        notes.append(f"left out after a run's end, its first speed of 0 or less: {where}")
    return parts, notes


def _at_rest(time_s: Array, speed_mps: Array) -> int:
    """How many samples a run has before it stands; all where it does not, or where the sensor drops out instead."""
    still = np.flatnonzero(speed_mps <= 0)
    if not len(still) or still[0] == 0:
        return len(speed_mps)
    first = int(still[0])
    rolls = np.nanmax(speed_mps[first:]) > _REST_MAX_MPS
    fall_mps = speed_mps[first - 1] - speed_mps[first]
    dropped = fall_mps > _LAST_FALL_MPS2 * (time_s[first] - time_s[first - 1]) + _REST_MAX_MPS
    return len(speed_mps) if rolls or dropped else first


def _spread(time_s: Array) -> tuple[Array, list[str]]:
    """A run's times, where its clock is coarser than its samples with these spread over it, and a text then."""
    ticks = ticks_of(time_s)
    if ticks is None:
        return time_s, []
    return spread_evenly(time_s, ticks), [f"{ticks.told()} and are spread evenly over it"]


def _values(
    measured: Measured, columns: Mapping[str, str], units: Mapping[str, str]
) -> tuple[dict[str, Array], Directions | None, list[str]]:
    """Values of each role by row, the directions where a column has them, and notes."""
    values, ways, notes = {}, None, list(measured.notes)
    chosen = {role: _column(measured, role, columns.get(role)) for role in ROLES}
    chosen["time"] = as_clock(chosen["time"])
    _check_missing(measured, chosen, units)
    for role, column in chosen.items():
        if column is None:
            continue
        if role in _QUANTITIES:
            found = in_si(
                measured, column, (_QUANTITIES[role],), f"--unit {role}=UNIT", units.get(role)
            )
            values[role], note = found.values, found.note
        elif role == "direction":
            ways = directions_in(measured, column, units.get(role))
            values[role], note = ways.values, ways.note
        else:
            values[role], note = numbers_of(column), f"column {column.name}"
        notes.append(f"{role}: {note}")
        if role not in _QUANTITIES:
            _check_numbers(measured, role, values[role])
    if ways is None and "direction" in units:
        raise DataError(
            f"{measured.path}: --unit direction without a column of direction; name it with --column "
            f"direction=NAME; {columns_found(measured)}"
        )
    return values, ways, notes


def _column(measured: Measured, role: str, named: str | None) -> Column | None:
    if named:
        return column_named(measured, named)
    return first_column_of(measured, _ALIASES[role], f"--column {role}=NAME")


def _check_missing(
    measured: Measured, found: Mapping[str, Column | None], units: Mapping[str, str]
) -> None:
    """DataError with all that the file does not say: columns of time and speed, and their units."""
    missing = []
    for role, quantity in _QUANTITIES.items():
        option = f"--unit {role}=UNIT"
        if found[role] is None:
            missing.append(f"no column of {role}; name it with --column {role}=NAME or its number")
        elif found[role].unit is None and role not in units:
            missing.append(unit_missing(found[role], (quantity,), option))
        if found[role] is None and role not in units:
            missing.append(f"the unit of {role}, by {option}")
    if len(missing) > 1:
        head = f"{len(missing)} things are not in the file; give them all\n  "
        raise DataError(
            f"{measured.path}: {head}" + "\n  ".join([*missing, columns_found(measured)])
        )
    if missing:
        raise DataError(f"{measured.path}: {missing[0]}; {columns_found(measured)}")


def _gaps(time: Array) -> NDArray[np.bool_]:
    """(row - 1,) whether a step is so long that it parts two runs."""
    steps = np.diff(time)
    forward = steps[steps > 0]
    usual = float(np.median(forward)) if len(forward) else 0.0
    return steps > max(_GAP_S, _GAP_STEPS * usual)


def _check_numbers(measured: Measured, role: str, values: Array) -> None:
    bad = ~np.isfinite(values)
    if role == "speed":
        bad |= values < 0
    if bad.any():
        k = int(np.flatnonzero(bad)[0])
        fault = {
            "speed": "is missing, negative or no number",
            "direction": "is missing, or not one of two numbers or two texts",
        }.get(role, "is missing or no number")
        allowed = "; allowed: 1 and -1, or two texts such as N and S" * (role == "direction")
        raise DataError(
            f"{measured.path}, line {measured.lines[k]}: {role} {fault} ({bad.sum()} such rows){allowed}; correct "
            "or delete the rows"
        )
