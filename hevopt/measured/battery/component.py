"""A battery component from its test: curves over charge by direction, at one temperature of those measured."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hevopt.car_files.battery import BatteryFile
from hevopt.display.facts import Shown
from hevopt.errors import DataError
from hevopt.files.shown import shown
from hevopt.files.toml import checked
from hevopt.measured.battery.curves import (
    MeasuredCurves,
    at_temperatures,
    from_table,
    said_of,
    the_asked,
)
from hevopt.measured.battery.samples import BatteryCurves, read_test
from hevopt.measured.like import unmeasured

Array = NDArray[np.float64]

_MEASURED = ("curve_soc", "open_circuit_v", "discharge_ohm", "charge_ohm", "resistance_ohm")
_LIKE_KEYS = (
    "cells_in_series", "capacity_ah", "coulombic_efficiency", "power_max_w", "current_max_a", "soc",
)  # fmt: skip
_WINDOW = ("start", "min", "max")


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class ImportedBattery(Shown):
    """A battery. contents: of its file, also checked as `file`; origins: key path -> where it comes from

    notes: what was read and assumed; curves: of every temperature measured; said: what they are
    """

    contents: Mapping[str, Any]
    file: BatteryFile
    origins: Mapping[str, str]
    notes: tuple[str, ...]
    curves: tuple[MeasuredCurves, ...]
    said: tuple[str, ...]


def import_battery(
    path: Path, *, like: str | None, columns: Mapping[str, str], units: Mapping[str, str],
    sheet: str | None, values: Mapping[str, Any], start_soc: float | None, temperature_c: float | None,
) -> ImportedBattery:  # fmt: skip
    """A battery's file; DataError where something is missing or wrong. values: key of the component -> value"""
    test = read_test(path, sheet, columns, units, start_soc, _given_capacity(values))
    if isinstance(test, BatteryCurves):
        curves, notes = from_table(test, path), list(test.notes)
        capacity_ah = None
    else:
        curves, notes = at_temperatures(test, path), list(test.notes)
        capacity_ah = test.capacity_as / 3600
    taken, told = the_asked(curves, temperature_c)
    base, origins = _base(path, like, values, capacity_ah)
    base |= {
        "curve_soc": _tidy(taken.soc),
        "open_circuit_v": _tidy(taken.open_circuit_v),
        "discharge_ohm": _tidy(taken.discharge_ohm),
        "charge_ohm": _tidy(taken.charge_ohm),
    }
    _check_window(base, path)
    file = checked(f"component from {path.name}", _in_order(base), BatteryFile)
    notes += [*told, *_assumed(base, origins)]
    return ImportedBattery(
        _in_order(base), file, origins, tuple(notes), curves, tuple(said_of(curves, taken))
    )


def _given_capacity(values: Mapping[str, Any]) -> float | None:
    given = values.get("capacity_ah")
    if given is None:
        return None
    if isinstance(given, bool) or not isinstance(given, int | float) or not given > 0:
        raise DataError(f"--set capacity_ah={shown(given)}: a number above 0 is needed")
    return float(given)


def _base(
    path: Path, like: str | None, values: Mapping[str, Any], capacity_ah: float | None
) -> tuple[dict[str, Any], dict[str, str]]:
    """Every key but the curves, and where each comes from; DataError naming all that are missing."""
    told = {}
    if capacity_ah is not None and "capacity_ah" not in values:
        told["capacity_ah"] = float(f"{capacity_ah:.6g}"), "by current and soc of the test"
    base, origins = unmeasured(
        path, BatteryFile, like=like, keys=_LIKE_KEYS, values=values, measured=_MEASURED,
        source="the test", by_key=("soc",), told=told,
    )  # fmt: skip
    given: Any = base.get("soc")
    window = given if isinstance(given, dict) else {}
    missing = [key for key in ("cells_in_series", "capacity_ah") if key not in base]
    missing += [f"soc.{key}" for key in _WINDOW if key not in window]
    if missing:
        raise DataError(
            f"the component needs {', '.join(missing)}; give --set KEY=VALUE for each (cells_in_series: how many "
            "of what was tested the car has in series), or --like NAME (such as battery_nimh_40) to take them from "
            "another battery"
        )
    return base, origins


def _check_window(base: Mapping[str, Any], path: Path) -> None:
    """DataError where a car's window goes beyond the charges measured: curves are never continued."""
    low, high = base["curve_soc"][0], base["curve_soc"][-1]
    window = base["soc"]
    for key, beyond in (("min", window["min"] < low), ("max", window["max"] > high)):
        if beyond:
            raise DataError(
                f"{path.name}: the test covers states of charge from {low:.4g} to {high:.4g}, and soc.{key} is "
                f"{window[key]:g}; give --set soc.{key}=VALUE within it, or measure further"
            )


def _assumed(base: Mapping[str, Any], origins: Mapping[str, str]) -> list[str]:
    notes = []
    if "coulombic_efficiency" not in base:
        notes.append(
            "coulombic_efficiency: none given, ASSUMED 1: all charge that is taken is given back; of NiMH and lead "
            "it is less, give --set coulombic_efficiency=VALUE"
        )
    if not {"power_max_w", "current_max_a"} & set(base):
        notes.append(
            "WARNING: no power_max_w and no current_max_a: the battery gives and takes whatever its voltage and "
            "resistance let through; give --set power_max_w=VALUE (of one cell)"
        )
    if str(origins.get("capacity_ah", "")).startswith("from "):
        notes.append(
            f"WARNING: capacity_ah {base['capacity_ah']:g} is that of the battery named by --like, not of what was "
            "tested; give --set capacity_ah=VALUE"
        )
    return notes


def _in_order(base: Mapping[str, Any]) -> dict[str, Any]:
    """Keys in the order of the shipped files: the window, a table, last."""
    return {key: base[key] for key in (*(k for k in base if k != "soc"), "soc")}


def _tidy(values: Array) -> list[float]:
    return [float(f"{value:.6g}") for value in values]
