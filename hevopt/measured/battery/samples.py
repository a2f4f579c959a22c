"""A battery's test as a table has it: time, current and voltage, or curves over charge made of them elsewhere.

Which sign of current discharges is told by the voltage, which falls where more is drawn; a state of charge comes
from a column, or from the charge that passes.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from hevopt.display.facts import Shown
from hevopt.errors import DataError
from hevopt.measured.battery.charge import near_steps, passed_as, soc_and_capacity
from hevopt.measured.tables.aliases import TIME
from hevopt.measured.tables.packed_clock import as_clock
from hevopt.measured.tables.rows import runs
from hevopt.measured.tables.table import Measured, asked_column, columns_found, read_measured
from hevopt.measured.tables.units import in_si
from hevopt.measured.tables.usable import check_rows

Array = NDArray[np.float64]

# role -> names without units that mean it, small letters and digits
ALIASES = {
    "time": set().union(*TIME),
    "current": {"current", "i", "batterycurrent", "packcurrent", "cellcurrent", "ibat", "ibatt", "strom", "amps"},
    "voltage": {
        "voltage", "v", "u", "batteryvoltage", "packvoltage", "cellvoltage", "terminalvoltage", "ubat", "vbat",
        "vbatt", "spannung",
    },
    "soc": {"soc", "stateofcharge", "socfraction", "ladezustand"},
    "charge": {"charge", "ah", "q", "amperehours", "amphours", "ampereh", "capacity", "chargedrawn", "ladung"},
    "temperature": {
        "temperature", "temp", "celltemperature", "batterytemperature", "packtemperature", "temperatur",
    },
    "open_circuit": {"ocv", "voc", "uoc", "opencircuitvoltage", "emf", "ruhespannung"},
    "resistance": {"resistance", "r", "internalresistance", "ri", "rint", "dcr", "dcir", "innenwiderstand"},
    "discharge": {
        "resistancedischarge", "dischargeresistance", "rdischarge", "rdis", "rdch", "dischargeohm", "essrdis",
    },
    "charging": {"resistancecharge", "chargeresistance", "rcharge", "rchg", "rch", "chargeohm", "essrchg"},
}  # fmt: skip
ROLES = tuple(ALIASES)
_QUANTITIES = {
    "time": ("time",),
    "current": ("current",),
    "voltage": ("voltage",),
    "soc": ("fraction",),
    "charge": ("charge",),
    "temperature": ("celsius", "kelvin"),
    "open_circuit": ("voltage",),
    "resistance": ("resistance",),
    "discharge": ("resistance",),
    "charging": ("resistance",),
}
_CURVES = ("open_circuit", "resistance", "discharge", "charging")
_ZERO_CELSIUS_K = 273.15
# Share of the largest current by which a change counts as a step.
STEP = 0.05


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class BatterySamples(Shown):
    """A test in time; arrays (row,). current_a > 0 discharges; temperature_c: None where no column has it."""

    time_s: Array
    current_a: Array
    voltage_v: Array
    soc: Array
    temperature_c: Array | None
    capacity_as: float
    lines: NDArray[np.int64]
    notes: tuple[str, ...]


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class BatteryCurves(Shown):
    """Curves over charge as a table has them; arrays (row,)."""

    soc: Array
    open_circuit_v: Array
    discharge_ohm: Array
    charge_ohm: Array
    temperature_c: Array | None
    lines: NDArray[np.int64]
    notes: tuple[str, ...]


def read_test(
    path: Path, sheet: str | None, columns: Mapping[str, str], units: Mapping[str, str],
    start_soc: float | None, capacity_ah: float | None,
) -> BatterySamples | BatteryCurves:  # fmt: skip
    """The table of a test; DataError where something is missing or wrong.

    start_soc: state of charge at the first row, where no column has it; capacity_ah: of what was tested
    """
    measured = read_measured(path, sheet=sheet)
    values, notes = _values(measured, columns, units)
    if "open_circuit" in values:
        if start_soc is not None:
            raise DataError(
                f"{measured.path}: --start-soc is for a test in time, and this table holds curves over charge; "
                "leave it out"
            )
        return _curves(measured, values, notes)
    for role in ("time", "current", "voltage"):
        if role not in values:
            raise DataError(
                f"{measured.path}: no column of {role} found, which a battery's test needs beside "
                f"{'current and voltage' if role == 'time' else 'time'} (or curves: soc, open_circuit and "
                f"resistance, or discharge and charging); name it with --column {role}=NAME; "
                f"{columns_found(measured)}"
            )
    _check_values(measured, values)
    _check_times(measured, values["time"])
    current = _discharging(measured, values, notes)
    soc, capacity_as = soc_and_capacity(measured, values, current, start_soc, capacity_ah, notes)
    return BatterySamples(
        values["time"], current, values["voltage"], soc, values.get("temperature"), capacity_as,
        measured.lines, tuple(notes),
    )  # fmt: skip


def _values(
    measured: Measured, columns: Mapping[str, str], units: Mapping[str, str]
) -> tuple[dict[str, Array], list[str]]:
    """Every role's column in SI, temperatures in °C, and how each was read."""
    values, notes = dict[str, Array](), list(measured.notes)
    for role in ALIASES:
        column = asked_column(measured, role, columns, ALIASES[role])
        if column is None:
            if role in units:
                raise DataError(
                    f"{measured.path}: --unit {role}, and there is no column of it; name it with --column "
                    f"{role}=NAME; {columns_found(measured)}"
                )
            continue
        column = (as_clock(column) or column) if role == "time" else column
        found = in_si(measured, column, _QUANTITIES[role], f"--unit {role}=UNIT", units.get(role))
        cold = _ZERO_CELSIUS_K if found.quantity == "kelvin" else 0.0
        values[role] = found.values - cold
        notes.append(f"{role}: {found.note}")
    of_curves = "open_circuit" in values
    for role in [r for r in values if of_curves and r in ("time", "current", "voltage", "charge")]:
        if role in columns or role in units:
            raise DataError(
                f"{measured.path}: {role} is of a test in time, and this table has an open-circuit voltage, as "
                "curves over charge do; name one of both alone"
            )
        del values[role]
    for role in [r for r in values if not of_curves and r in _CURVES]:
        del values[role]
    return values, notes


def _check_values(measured: Measured, values: Mapping[str, Array]) -> None:
    allowed = {
        "voltage": (1e-6, np.inf, "above 0 V"),
        "open_circuit": (1e-6, np.inf, "above 0 V"),
        "soc": (-1e-9, 1 + 1e-9, "0 to 1, which is 100 %"),
        "resistance": (0.0, np.inf, "0 ohm or more"),
        "discharge": (0.0, np.inf, "0 ohm or more"),
        "charging": (0.0, np.inf, "0 ohm or more"),
        "temperature": (-100.0, 200.0, "-100 to 200 °C"),
    }
    for role, found in values.items():
        low, high, words = allowed.get(role, (-np.inf, np.inf, "a number"))
        good = np.isfinite(found) & (found >= low) & (found <= high)
        check_rows(measured, role, found, good, words)


def _curves(measured: Measured, values: Mapping[str, Array], notes: list[str]) -> BatteryCurves:
    if "soc" not in values:
        raise DataError(
            f"{measured.path}: no column of soc found, which curves over charge need; name it with --column "
            f"soc=NAME; {columns_found(measured)}"
        )
    both = values.get("resistance")
    discharge, charge = values.get("discharge", both), values.get("charging", both)
    if discharge is None or charge is None:
        raise DataError(
            f"{measured.path}: no column of {'discharge' if discharge is None else 'charging'} resistance found; "
            "name discharge and charging, or resistance for both, with --column ROLE=NAME; "
            f"{columns_found(measured)}"
        )
    _check_values(measured, values)
    if both is discharge or both is charge:
        notes.append(
            "resistance: one column, for both directions where they have none of their own"
        )
    return BatteryCurves(
        values["soc"], values["open_circuit"], discharge, charge, values.get("temperature"),
        measured.lines, tuple(notes),
    )  # fmt: skip


def _check_times(measured: Measured, time_s: Array) -> None:
    back = np.diff(time_s) < 0
    if back.any():
        raise DataError(
            f"{measured.path}, {runs(list(measured.lines[1:][back]))}: time goes back; sort the rows, or import "
            "one test at a time"
        )
    if len(time_s) < 3 or time_s[-1] <= time_s[0]:
        raise DataError(f"{measured.path}: {len(time_s)} rows; a test needs three or more in time")


def _discharging(measured: Measured, values: Mapping[str, Array], notes: list[str]) -> Array:
    """The current with the sign that discharges as above 0."""
    current, voltage = values["current"], values["voltage"]
    most = float(np.abs(current).max())
    if most == 0:
        raise DataError(f"{measured.path}: no current flows in this test; check its column")
    change, near = np.diff(current), near_steps(values["time"])
    stepping = near & (np.abs(change) > STEP * most)
    told = -float(np.sum((np.diff(voltage) * change)[stepping]))
    by = "voltage falls where it steps up"
    if told == 0:
        told = -float(np.sum((np.diff(voltage) * (current[1:] + current[:-1]))[near]))
        by = "voltage falls while it flows"
    if "soc" in values:
        flow = np.diff(passed_as(values["time"], current))
        by_soc = -float(np.sum((np.diff(values["soc"]) * flow)[near]))
        if told * by_soc < 0:
            raise DataError(
                f"{measured.path}: the voltage says that current of one sign discharges, the column of soc that of "
                "the other; check both columns"
            )
        told, by = (told, by) if told else (by_soc, "state of charge falls with it")
    if told == 0:
        raise DataError(
            f"{measured.path}: neither voltage nor charge tells which sign of current discharges; a test with "
            "steps of current is needed"
        )
    notes.append(f"current: {'above' if told > 0 else 'below'} 0 discharges, as the {by}")
    return current if told > 0 else -current
