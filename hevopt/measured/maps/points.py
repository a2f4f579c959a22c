"""Measured points of an engine or machine map, and its curves, in SI.

Fuel and NOx become mass flows: specific consumption and efficiency say nothing where there is no power, and a flow
is nearly linear in torque. What a row cannot say is left out, and listed.
"""

from dataclasses import dataclass, replace
from math import pi

import numpy as np
from numpy.typing import NDArray

from hevopt.display.facts import Shown
from hevopt.errors import DataError
from hevopt.measured.maps.roles import VALUES_OF
from hevopt.measured.maps.tables import MapTable, Source, curve_table, read_table
from hevopt.measured.tables.rows import runs
from hevopt.measured.tables.table import columns_found
from hevopt.units import RPM_PER_RADPS

Array = NDArray[np.float64]

# kg/s or W beyond which no component's file goes.
_LARGEST = {"fuel": 1e3, "nox": 1e3, "loss": 1e6}


@dataclass(frozen=True, slots=True)
class EngineFacts:
    """What some units need; None where not given for the very component that was measured."""

    displacement_m3: float | None
    heating_value_jpkg: float | None
    fuel_density_kgpm3: float | None


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Points(Shown):
    """A quantity at measured points; arrays (point,).

    rectangular: read from a grid; roles: of the columns read; notes: how they were read
    """

    speed_radps: Array
    torque_nm: Array
    value: Array
    lines: NDArray[np.int64]
    rectangular: bool
    roles: frozenset[str]
    notes: tuple[str, ...]


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Curve(Shown):
    """Torque over speed, speed rising; arrays (point,). note: where it comes from; roles: of the columns read."""

    speed_radps: Array
    torque_nm: Array
    note: str
    roles: frozenset[str] = frozenset()


def read_points(source: Source, what: str, facts: EngineFacts) -> Points | None:
    """The points of "fuel" or "nox" (kg/s) or "loss" (W) in a table; None where no column holds it."""
    table = read_table(source, what)
    found = [role for role in VALUES_OF[what] if role in table.values]
    if not found:
        return None
    speed, torque = table.values["speed"], _torque_nm(table, "torque", facts)
    value, powerless = np.full(speed.shape, np.nan), np.zeros(speed.shape, dtype=bool)
    for role in found:
        with np.errstate(all="ignore"):  # what overflows is refused below
            candidate = _value(table, role, what, torque, facts)
        missing = np.isnan(value)
        powerless |= missing & np.isnan(candidate) & ~np.isnan(table.values[role])
        value = np.where(missing, candidate, value)
    _check_values(table, what, value, torque)
    known = ~np.isnan(value)
    if not known.any():
        raise DataError(
            f"{table.measured.path}: no point with {what}; {columns_found(table.measured)}"
        )
    return Points(
        speed[known],
        torque[known],
        value[known],
        table.lines[known],
        table.rectangular,
        frozenset(table.kinds),
        (*table.notes, *_left_out(table, what, known, powerless & ~known)),
    )


def read_curve(source: Source, role: str, facts: EngineFacts, *, plain: bool) -> Curve | None:
    """The "full" or "motoring" curve of a table with a column of speed; None where no column holds it.

    plain: a column that is simply named torque will do.
    """
    table = curve_table(source, role, plain=plain)
    if table is None:
        return None
    measured = table.measured
    torque, notes = _torque_nm(table, role, facts), table.notes
    if role == "motoring":
        torque, notes = _drag(table, torque)
    known = ~np.isnan(torque)
    speed, first = np.unique(table.values["speed"][known], return_index=True)
    torque = torque[known]
    if len(speed) < 2:
        raise DataError(f"{measured.path}: a {role} curve needs 2 or more speeds")
    same = np.array([np.ptp(torque[table.values["speed"][known] == s]) == 0 for s in speed])
    if not same.all():
        raise DataError(
            f"{measured.path}: {role} torque has several values at "
            f"{speed[~same][0] * RPM_PER_RADPS:g} rpm; a curve has one torque at each speed"
        )
    note = f"{role} curve from {measured.path.name}: {'; '.join(notes)}"
    curve = Curve(speed, torque[first], note, frozenset(table.kinds))
    return above_zero(curve) if role == "full" else curve


def above_zero(full: Curve) -> Curve:
    """A full-load curve from its first to its last torque above 0, which its note says."""
    driving = np.flatnonzero(full.torque_nm > 0)
    if len(driving) < 2:
        raise DataError(
            f"{full.note}: {len(driving)} speeds with a torque above 0; a full-load curve needs 2 or more"
        )
    kept = slice(driving[0], driving[-1] + 1)
    between = full.torque_nm[kept] <= 0
    if between.any():
        k = driving[0] + int(np.argmax(between))
        raise DataError(
            f"{full.note}: full-load torque {full.torque_nm[k]:.4g} Nm at "
            f"{full.speed_radps[k] * RPM_PER_RADPS:.4g} rpm, between speeds where it is above 0; correct it"
        )
    note = full.note
    for word, end, beyond in (("first", kept.start, -1), ("last", kept.stop - 1, 1)):
        if 0 <= (k := end + beyond) < len(full.torque_nm):
            rpm = full.speed_radps[[end, k]] * RPM_PER_RADPS
            note += (
                f"; {full.torque_nm[k]:.4g} Nm at {rpm[1]:.5g} rpm: READ TO ITS {word.upper()} POINT ABOVE 0, at "
                f"{rpm[0]:.5g} rpm, and not used beyond"
            )
    return replace(
        full, speed_radps=full.speed_radps[kept], torque_nm=full.torque_nm[kept], note=note
    )


def _drag(table: MapTable, torque_nm: Array) -> tuple[Array, tuple[str, ...]]:
    """The torque of the unfired engine below 0, and the notes; DataError where some rows brake and others drive."""
    turning = table.values["speed"] > 0
    driving, braking = turning & (torque_nm > 0), turning & (torque_nm < 0)
    fewer, many = (driving, braking) if driving.sum() <= braking.sum() else (braking, driving)
    still = turning & (torque_nm == 0)
    if fewer.any() or still.any():
        what, rows = ("has the other sign", fewer) if fewer.any() else ("is 0", still)
        raise DataError(
            f"{table.measured.path}, {_places(table, rows)}: the motoring torque of the turning engine {what}; "
            "give it below 0 in every row, or as drag above 0 in every row"
        )
    if many is driving:
        return -torque_nm, (*table.notes, "given as drag, sign turned")
    return torque_nm, table.notes


def _torque_nm(table: MapTable, role: str, facts: EngineFacts) -> Array:
    values, kind = table.values[role], table.kinds[role]
    if kind == "torque":
        return values
    if kind == "power":
        still = (table.values["speed"] == 0) & ~np.isnan(values)
        if still.any():
            raise DataError(
                f"{table.measured.path}, {_places(table, still)}: {role} is a power, which says nothing about "
                "torque at rest; give the torque, or delete the rows"
            )
        return values / np.where(table.values["speed"] == 0, np.nan, table.values["speed"])
    if facts.displacement_m3 is None:
        raise DataError(
            f"{table.measured.path}: {role} is a mean pressure, which needs the displacement of the engine "
            "measured (--like's may be another); give --displacement-cm3 VALUE"
        )
    return values * facts.displacement_m3 / (4 * pi)


def _value(table: MapTable, role: str, what: str, torque_nm: Array, facts: EngineFacts) -> Array:
    """A value column as flow or loss, NaN where it says nothing."""
    values, kind = table.values[role], table.kinds[role]
    power_w = torque_nm * table.values["speed"]
    driving = np.where(power_w > 0, power_w, np.nan)
    if kind == "mass flow" or role == "loss":
        return values
    if role == "electric":
        return values - power_w
    if kind == "specific consumption":
        return values * driving
    if kind == "volume flow":
        return values * _known(
            table, facts.fuel_density_kgpm3, "a volume flow", "fuel.density_kgpl"
        )
    if (values > 1).any():
        raise DataError(
            f"{table.measured.path}, {_places(table, values > 1)}: efficiency up to {np.nanmax(values):g}; "
            f"allowed: up to 1, which is 100 %; read as {table.read['efficiency']}; "
            "correct the cells, or give the unit in the header or with --unit efficiency=UNIT"
        )
    efficiency = np.where(values > 0, values, np.nan)
    if what == "loss":
        moving = np.where(power_w == 0, np.nan, power_w)
        return np.where(power_w > 0, moving * (1 / efficiency - 1), -moving * (1 - efficiency))
    heat = _known(table, facts.heating_value_jpkg, "an efficiency", "fuel.heating_value_mjpkg")
    return driving / efficiency / heat


def _known(table: MapTable, value: float | None, what: str, key: str) -> float:
    if value is None:
        raise DataError(
            f"{table.measured.path}: {what} needs {key} of the fuel measured (--like's may be another); give "
            f"--set {key}=VALUE"
        )
    return value


def _check_values(table: MapTable, what: str, value: Array, torque_nm: Array) -> None:
    """DataError, with lines, for what no bench measures."""
    speed = table.values["speed"]
    fired = (speed > 0) & (torque_nm > 0)
    for bad, found in (
        (speed < 0, "speed below 0"),
        (value < 0, f"{what} below 0"),
        (
            ~(np.abs(value) <= _LARGEST[what]) & ~np.isnan(value),
            f"{what} beyond any engine or machine",
        ),
        ((value == 0) & fired & (what == "fuel"), "fuel 0 at a torque above 0"),
    ):
        if bad.any():
            k = np.flatnonzero(bad)[0]
            raise DataError(
                f"{table.measured.path}, {_places(table, bad)}: {found} (first: at "
                f"{speed[k] * RPM_PER_RADPS:.4g} rpm and {torque_nm[k]:.4g} Nm, {what} {value[k]:.4g} in SI); "
                "correct the cells; leave those that were not measured empty"
            )


def _left_out(table: MapTable, what: str, known: NDArray[np.bool_], powerless: NDArray[np.bool_]):
    empty = ~known & ~powerless
    if powerless.any():
        yield (
            f"{what}: {powerless.sum()} points left out, {_places(table, powerless)}: without power (torque or "
            "speed 0, or torque below 0) g/kWh or an efficiency says nothing; give a flow there"
            if what != "loss"
            else f"loss: {powerless.sum()} points left out, {_places(table, powerless)}: without power, or at "
            "efficiency 0, an efficiency says nothing; give the loss there"
        )
    if empty.any():
        yield f"{what}: {empty.sum()} points not measured, {_places(table, empty)}: cells are empty"


def _places(table: MapTable, where: NDArray[np.bool_]) -> str:
    return runs(sorted(set(table.lines[where].tolist())))
