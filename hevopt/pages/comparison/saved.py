"""Reading a saved comparison: unpacked within bounds, and checked before anything is drawn from it."""

import zlib
from itertools import pairwise
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from hevopt.errors import DataError
from hevopt.files.lookup import loaded_json, read_bytes
from hevopt.files.shown import printable
from hevopt.pages.comparison.results import FORMAT, Results, SavedRow
from hevopt.pages.comparison.room import MEGABYTES_MAX, check_room
from hevopt.pages.comparison.saved_car import CarFigures

_ADVICE = "give a file written by hevopt compare --save"
_MAGIC = b"\x1f\x8b"
_FAULTS_LISTED, _FAULT_CHARACTERS = 5, 200
_ROUNDING_PERCENT = 1e-6
# What every solved row has; the others do not exist for every engine, fuel or bound.
_FIGURES_OF_A_SOLVED_ROW = (
    "fuel_l_per_100km", "fuel_corrected_l_per_100km", "co2_g_per_km", "soc_start", "soc_end", "engine_starts",
    "bound_l_per_100km", "certificate", "solve_s",
)  # fmt: skip
_OVER_TIME = ("step_s", "speed_mps", "wheel_power_w", "missing_torque_nm")
_OVER_VALUES = ("fuel_l_per_100km", "delta_percent", "nox_mg_per_km", "delta_nox_percent")


def load_results(path: Path) -> Results:
    """Results from a saved file; DataError says what is wrong with it."""
    try:
        results = Results.model_validate(_contents(path))
        faults = _disagreements(results)
    except ValidationError as error:
        results = None
        faults = [
            f"{printable('.'.join(map(str, fault['loc'])))[:120]}: {fault['msg'].lower()}"
            for fault in error.errors(include_input=False, include_url=False)
        ]
    if results is None or faults:
        # Names in the file may be of any length.
        said = "; ".join(fault[:_FAULT_CHARACTERS] for fault in faults[:_FAULTS_LISTED])
        raise DataError(f"{path}: not a saved comparison ({said}); {_ADVICE}")
    return results


def _disagreements(results: Results) -> list[str]:
    """What fits its own key but not the others: lists that differ in length, figures or a car that are missing."""
    faults = [
        fault
        for name, car in results.cars.items()
        for fault in _faults_of_car(printable(name), car)
    ]
    for n, row in enumerate(results.rows):
        if row.detail is not None:
            faults += [f"rows.{n}{fault}" for fault in _faults_of_row(results, row)]
    if any(row.detail for row in results.rows) and not results.distance_m > 0:
        faults.append("distance_m: not above 0")
    for n, line in enumerate(results.sensitivity or []):
        lists = [getattr(line, name) for name in _OVER_VALUES]
        if len(line.values) < 2 or any(len(values) != len(line.values) for values in lists):
            faults.append(f"sensitivity.{n}: not as many figures as values, two or more")
    for n, front in enumerate(results.pareto or []):
        if not front.points or not all(point.nox_weights for point in front.points):
            faults.append(f"pareto.{n}.points: without points, or a point without weights")
    return faults


def _faults_of_car(name: str, car: CarFigures) -> list[str]:
    faults, steps = [], len(car.time_s)
    for key in _OVER_TIME:
        if len(getattr(car, key)) != steps or not steps:
            faults.append(f"cars.{name}.{key}: not of {steps} steps, or of none")
    if car.about is not None:
        about = car.about
        if len(about.braking_mps) != len(about.braking_share):
            faults.append(f"cars.{name}.about: not as many speeds as shares of braking")
        points = len(about.battery_soc)
        rising = all(low < high for low, high in pairwise(about.battery_soc))
        if points < 2 or points != len(about.battery_v) or not rising:
            faults.append(f"cars.{name}.about: no curve of the battery's voltage over rising SOC")
    for key, drawn in (("engine", car.engine), ("machine", car.machine)):
        speeds, torques = len(drawn.speed_radps), len(drawn.torque_nm)
        over_speed = [
            drawn.limit_nm,
            drawn.least_nm,
            drawn.efficiency,
            *filter(None, [drawn.nox_kgpj]),
        ]
        over_torque = [*drawn.efficiency, *(drawn.nox_kgpj or [])]
        if {*map(len, over_speed)} != {speeds} or {*map(len, over_torque)} != {torques}:
            faults.append(f"cars.{name}.{key}: not of {speeds} speeds x {torques} torques")
    return faults


def _faults_of_row(results: Results, row: SavedRow) -> list[str]:
    """Faults of a row that was solved, each after the row's place."""
    car, detail = results.cars.get(row.figures.architecture), row.detail
    if car is None:
        return [f": no car {printable(row.figures.architecture)!r}"]
    faults = [
        f".figures.{name}: missing"
        for name in _FIGURES_OF_A_SOLVED_ROW
        if getattr(row.figures, name) is None
    ]
    if (row.figures.gap_percent or 0.0) < -_ROUNDING_PERCENT:
        faults.append(".figures.gap_percent: below 0, a bound above a plan")
    steps, trace = len(car.time_s), detail.trace.model_dump()
    if {len(values) - (name == "soc") for name, values in trace.items()} != {steps}:
        faults.append(f".detail.trace: not of {steps} steps, as car {printable(car.name)} has")
    if not set(trace["operation"]) <= set(range(len(results.operations))):
        faults.append(f".detail.trace.operation: beyond the {len(results.operations)} operations")
    if not sum(share.time_s for share in detail.shares) > 0:
        faults.append(".detail.shares: no time")
    return faults


def _contents(path: Path) -> dict[str, Any]:
    try:
        text = _unpacked(path)
        check_room(path, text, _ADVICE)
        contents = loaded_json(text.decode())
    except (zlib.error, ValueError, RecursionError):
        raise DataError(f"{path}: neither JSON nor JSON packed with gzip; {_ADVICE}") from None
    if not isinstance(contents, dict) or contents.get("format") != FORMAT:
        raise DataError(f"{path}: not in the form {FORMAT!r}; {_ADVICE} of this version")
    return contents


def _unpacked(path: Path) -> bytes:
    contents = read_bytes(path, MEGABYTES_MAX)
    if not contents.startswith(_MAGIC):
        return contents
    unpacker = zlib.decompressobj(wbits=31)
    text = unpacker.decompress(contents, MEGABYTES_MAX * 1_000_000)
    if not unpacker.eof:
        raise DataError(f"{path}: cut short, or beyond {MEGABYTES_MAX} MB unpacked; {_ADVICE}")
    return text
