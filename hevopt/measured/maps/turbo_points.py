"""Points of a compressor or turbine map, on speed lines, as the machine's own numbers have them.

Flow and speed become W sqrt(T) / p and n / sqrt(T), in which neither air nor bench is left: from values corrected
to a temperature and pressure, or from such reduced values themselves.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from hevopt.display.facts import Shown
from hevopt.errors import DataError
from hevopt.measured.clusters import clusters
from hevopt.measured.tables.table import (
    Measured,
    asked_column,
    columns_found,
    read_measured,
)
from hevopt.measured.tables.units import in_si
from hevopt.measured.tables.usable import check_rows
from hevopt.units import RPM_PER_RADPS

Array = NDArray[np.float64]

# role -> names without units that mean it, small letters and digits; a "ratio" behind counts as unit
ALIASES = {
    "speed": {
        "speed", "n", "rpm", "turbospeed", "turbinespeed", "compressorspeed", "shaftspeed", "correctedspeed",
        "reducedspeed", "speedcorrected", "speedcorr", "ncorr", "nred", "ncor", "speedparameter", "drehzahl",
    },
    "flow": {
        "flow", "massflow", "mflow", "m", "mdot", "w", "correctedflow", "reducedflow", "correctedmassflow",
        "reducedmassflow", "massflowcorrected", "flowcorrected", "wcorr", "wred", "mcorr", "mred", "flowparameter",
        "massflowparameter", "massenstrom",
    },
    "ratio": {
        "ratio", "pressureratio", "pr", "pi", "totalpressureratio", "pressureratiott", "pressureratiots",
        "prts", "prtt", "pressure", "totalpressure", "expansion", "expansionratio", "er",
        "druckverhaeltnis", "druckverhältnis",
    },
    "efficiency": {
        "efficiency", "eta", "eff", "isentropicefficiency", "etais", "etac", "etat", "etatm", "totalefficiency",
        "efficiencytt", "efficiencyts", "combinedefficiency", "wirkungsgrad",
    },
    "vanes": {"vanes", "vane", "vaneposition", "vgt", "vgtposition", "vtg", "vnt", "rack", "opening", "position"},
}  # fmt: skip
ROLES = tuple(ALIASES)
_QUANTITIES = {
    "speed": ("rotation", "reduced speed"),
    "flow": ("mass flow", "reduced flow"),
    "ratio": ("fraction",),
    "efficiency": ("fraction",),
    "vanes": ("fraction",),
}
_NEEDED = ("speed", "flow", "ratio", "efficiency")
# Speeds closer than this are one line.
_LINE_SHARE = 0.02
_LINES_MIN, _PER_LINE_MIN = 2, 3
# Best efficiency below which per cent have been read as parts of a hundredth.
_EFFICIENCY_MIN = 0.1
_REFERENCE_K, _REFERENCE_PA = (200.0, 1500.0), (2e4, 1e6)


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class TurboPoints(Shown):
    """Measured points by speed line and, of a turbine, by vane position.

    speed: (point,) n / sqrt(T), rad/s and K; flow: (point,) W sqrt(T) / p, kg/s, K, Pa; ratio: (point,) higher over
    lower pressure; line: (point,) which; line_speed: (line,); lines: (point,) of the file
    vanes: (point,) position as the file has it, 0 where it has none; notes: how the columns were read
    """

    speed: Array
    flow: Array
    ratio: Array
    efficiency: Array
    vanes: Array
    line: NDArray[np.int64]
    line_speed: Array
    lines: NDArray[np.int64]
    notes: tuple[str, ...]


def turbo_points(
    path: Path, kind: str, sheet: str | None, columns: Mapping[str, str], units: Mapping[str, str],
    reference: tuple[float, float] | None,
) -> TurboPoints:  # fmt: skip
    """The points of a "compressor" or "turbine"; DataError where the table is none of its map.

    reference: temperature in K and pressure in Pa to which the table's flow and speed are corrected
    """
    measured = read_measured(path, sheet=sheet)
    values, kinds, notes = {}, {}, list(measured.notes)
    for role in ALIASES:
        column = asked_column(measured, role, columns, ALIASES[role])
        if column is None or (role == "vanes" and kind == "compressor"):
            _refuse_missing(measured, role, kind, columns, units)
            continue
        unit = units.get(role)
        if role in ("ratio", "vanes") and unit is None and column.unit is None:
            unit = "-"
        found = in_si(measured, column, _QUANTITIES[role], f"--unit {role}=UNIT", unit)
        values[role], kinds[role] = found.values, found.quantity
        notes.append(f"{role}: {found.note}")
    _check_values(measured, values)
    speed, flow = _reduced(measured, values, kinds, reference, notes)
    line, line_speed = clusters(speed, 0.0, _LINE_SHARE)
    vanes = values.get("vanes", np.zeros(len(speed)))
    _check_lines(measured, line, line_speed * _from_reduced(reference), vanes)
    return TurboPoints(
        speed, flow, values["ratio"], values["efficiency"], vanes, line, line_speed, measured.lines, tuple(notes)
    )  # fmt: skip


def _refuse_missing(
    measured: Measured, role: str, kind: str, columns: Mapping[str, str], units: Mapping[str, str]
) -> None:
    if role in _NEEDED:
        raise DataError(
            f"{measured.path}: no column of {role} found, which a {kind} map needs; name it with --column "
            f"{role}=NAME; {columns_found(measured)}"
        )
    if role in columns or role in units:
        why = (
            "a compressor has none"
            if kind == "compressor"
            else f"{measured.path} has no such column"
        )
        raise DataError(f"{role}: named with --column or --unit, and {why}; leave it out")


def _check_values(measured: Measured, values: Mapping[str, Array]) -> None:
    allowed = {
        "speed": (0.0, np.inf, "above 0"),
        "flow": (0.0, np.inf, "above 0"),
        "ratio": (1.0, 20.0, "above 1 to 20, the higher pressure over the lower"),
        "efficiency": (0.0, 1.0, "above 0 to 1, which is 100 %"),
        "vanes": (-np.inf, np.inf, "a number"),
    }
    for role, found in values.items():
        low, high, words = allowed[role]
        good = np.isfinite(found) & (found > low) & (found <= high)
        check_rows(measured, role, found, good, words)
    best = float(values["efficiency"].max())
    if best < _EFFICIENCY_MIN:
        raise DataError(
            f"{measured.path}: the highest efficiency is {best:.3g}; allowed: {_EFFICIENCY_MIN:g} to 1, which is "
            "100 %; correct the unit in the header, or give it with --unit efficiency=-"
        )


def _reduced(
    measured: Measured, values: Mapping[str, Array], kinds: Mapping[str, str],
    reference: tuple[float, float] | None, notes: list[str],
) -> tuple[Array, Array]:  # fmt: skip
    corrected = [role for role, kind in kinds.items() if kind in ("rotation", "mass flow")]
    if reference is None and corrected:
        raise DataError(
            f"{measured.path}: {' and '.join(corrected)}: corrected to which temperature and pressure? Give them "
            "with --reference KELVIN,BAR, such as 298.15,1.013, as the map's own header has them"
        )
    if reference is None:
        return values["speed"], values["flow"]
    if not corrected:
        raise DataError(
            f"{measured.path}: flow and speed are reduced ones, which need no reference; leave it out"
        )
    kelvin, pascal = reference
    for value, (low, high), unit, share in (
        (kelvin, _REFERENCE_K, "K", 1.0), (pascal, _REFERENCE_PA, "bar", 1e-5),
    ):  # fmt: skip
        if not low <= value <= high:
            raise DataError(
                f"--reference: {value * share:g} {unit}; allowed: {low * share:g} to {high * share:g} {unit}; give "
                "KELVIN,BAR, such as 298.15,1.013"
            )
    notes.append(f"corrected to {kelvin:g} K and {pascal / 1e5:g} bar (--reference)")
    speed, flow = values["speed"], values["flow"]
    if kinds["speed"] == "rotation":
        speed = speed / np.sqrt(kelvin)
    if kinds["flow"] == "mass flow":
        flow = flow * np.sqrt(kelvin) / pascal
    return speed, flow


def _from_reduced(reference: tuple[float, float] | None) -> float:
    """What makes reduced speeds those of the file again, in rpm."""
    return RPM_PER_RADPS * (1.0 if reference is None else float(np.sqrt(reference[0])))


def _check_lines(
    measured: Measured, line: NDArray[np.int64], speed_rpm: Array, vanes: Array
) -> None:
    if len(speed_rpm) < _LINES_MIN:
        raise DataError(
            f"{measured.path}: one speed line, at {speed_rpm[0]:.4g} rpm; allowed: {_LINES_MIN} or more; what the "
            "map does at other speeds cannot be told from one, add lines"
        )
    for position in np.unique(vanes):
        count = np.bincount(line[vanes == position], minlength=len(speed_rpm))
        thin = (count > 0) & (count < _PER_LINE_MIN)
        if thin.any():
            k = int(np.argmax(thin))
            raise DataError(
                f"{measured.path}: {count[k]} points on the line at {speed_rpm[k]:.4g} rpm; allowed: "
                f"{_PER_LINE_MIN} or more on each; add points, or delete the line"
            )
