"""What a gearbox loses at measured points, as torque at its input: from efficiency (13), torque or power lost.

    efficiency, driving     D = T_in (1 - eta)            with T_out / i = eta T_in
    efficiency, overrun     D = |T_out| / i (1 - eta)     with T_in = eta T_out / i

Which side of the gearbox speed and torque are of is told by their names or the user, never guessed.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from hevopt.display.facts import Shown
from hevopt.errors import DataError
from hevopt.measured.tables.table import Measured, asked_column, columns_found, read_measured
from hevopt.measured.tables.units import in_si, numbers_of
from hevopt.measured.tables.usable import check_rows

Array = NDArray[np.float64]

_SPEED = {"speed", "n", "w", "omega", "rpm", "drehzahl"}
_TORQUE = {"torque", "t", "m", "trq", "nm", "drehmoment"}
_SIDES = {
    "input": ("input", "in", "engine", "inputshaft", "primary"),
    "output": ("output", "out", "wheel", "outputshaft", "secondary", "axle"),
}


def _of_sides(names: set[str]) -> set[str]:
    """The names alone, and behind or before a side's."""
    sides = [side for words in _SIDES.values() for side in words]
    return names | {
        first + last for side in sides for n in names for first, last in ((side, n), (n, side))
    }


# role -> names without units that mean it, small letters and digits
ALIASES = {
    "gear": {"gear", "gearnumber", "gearno", "gang"},
    "speed": _of_sides(_SPEED),
    "torque": _of_sides(_TORQUE),
    "efficiency": {"efficiency", "eta", "eff", "gearboxefficiency", "wirkungsgrad"},
    "loss": {"loss", "losses", "torqueloss", "losstorque", "powerloss", "losspower", "ploss", "tloss"},
}  # fmt: skip
ROLES = tuple(ALIASES)
_QUANTITIES = {
    "speed": ("rotation",),
    "torque": ("torque",),
    "efficiency": ("fraction",),
    "loss": ("torque", "power"),
}


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class GearPoints(Shown):
    """Measured points, all at the input; arrays (point,). notes: how they were read, and what was left out."""

    gear: NDArray[np.int64]
    speed_radps: Array
    torque_nm: Array
    loss_nm: Array
    lines: NDArray[np.int64]
    notes: tuple[str, ...]


def read_gear_points(
    path: Path, sheet: str | None, columns: Mapping[str, str], units: Mapping[str, str], side: str | None,
    ratios: Sequence[float],
) -> GearPoints:  # fmt: skip
    """The points of a table; DataError where something is missing or wrong.

    side: "input" or "output", where the names of speed and torque do not tell; ratios: of each gear, final drive
    included, by which points of the output become such of the input
    """
    measured = read_measured(path, sheet=sheet)
    values, kinds, names, notes = dict[str, Array](), {}, {}, list(measured.notes)
    for role in ALIASES:
        column = asked_column(measured, role, columns, ALIASES[role])
        if column is None:
            _check_missing(measured, role, columns, units)
            continue
        names[role] = column.name
        if role == "gear":
            values[role] = numbers_of(column)
            notes.append(f"gear: column {column.name}")
            continue
        found = in_si(measured, column, _QUANTITIES[role], f"--unit {role}=UNIT", units.get(role))
        values[role], kinds[role] = found.values, found.quantity
        notes.append(f"{role}: {found.note}")
    if ("efficiency" in values) == ("loss" in values):
        what = "both" if "loss" in values else "neither"
        raise DataError(
            f"{measured.path}: {what} of efficiency and loss found; one of them is needed, name it with --column "
            f"efficiency=NAME or loss=NAME; {columns_found(measured)}"
        )
    _check_values(measured, values, len(ratios))
    at_output = _side(measured, names, side) == "output"
    gear = values["gear"].astype(np.int64)
    speed, torque, lost = _at_input(values, kinds, np.asarray(ratios)[gear - 1], at_output)
    known = np.isfinite(lost)
    notes += _left_out(values, known)
    notes.append(
        f"speed and torque of the {'output' if at_output else 'input'}; the losses are taken for those of gearbox "
        "and final drive together"
    )
    if not known.any():
        raise DataError(f"{measured.path}: no point with a loss; {columns_found(measured)}")
    return GearPoints(
        gear[known], speed[known], torque[known], lost[known], measured.lines[known], tuple(notes)
    )


def _check_missing(
    measured: Measured, role: str, columns: Mapping[str, str], units: Mapping[str, str]
) -> None:
    if role in ("gear", "speed", "torque"):
        raise DataError(
            f"{measured.path}: no column of {role} found, which a gearbox map needs; name it with --column "
            f"{role}=NAME; {columns_found(measured)}"
        )
    if role in columns or role in units:
        raise DataError(
            f"{role}: named with --column or --unit, and {measured.path} has no such column"
        )


def _check_values(measured: Measured, values: Mapping[str, Array], gears: int) -> None:
    whole = values["gear"] == np.round(values["gear"])
    checks = {
        "gear": (whole & (values["gear"] >= 1) & (values["gear"] <= gears), f"1 to {gears}, as many as ratios"),
        "speed": (values["speed"] > 0, "above 0"),
        "torque": (np.isfinite(values["torque"]), "a number, below 0 in overrun"),
    }  # fmt: skip
    if "efficiency" in values:
        eta = values["efficiency"]
        checks["efficiency"] = ((eta >= 0) & (eta <= 1) | np.isnan(eta), "0 to 1, which is 100 %")
    else:
        checks["loss"] = ((values["loss"] >= 0) | np.isnan(values["loss"]), "0 or more")
    for role, (good, words) in checks.items():
        check_rows(measured, role, values[role], good & ~np.isinf(values[role]), words)
    missing = sorted(set(range(1, gears + 1)) - set(values["gear"].astype(int).tolist()))
    if missing:
        raise DataError(
            f"{measured.path}: no point in gear {', '.join(map(str, missing))} of {gears}; add points, or correct "
            "ratios with --set ratios=[...]"
        )


def _side(measured: Measured, names: Mapping[str, str], side: str | None) -> str:
    """ "input" or "output", by the names of speed and torque or as the user says."""
    told = {_side_of(names[role]) for role in ("speed", "torque")} - {None}
    if len(told) > 1:
        raise DataError(
            f"{measured.path}: {names['speed']} and {names['torque']} are of two sides of the gearbox; name "
            "columns of one side with --column"
        )
    if side is not None:
        if told and side not in told:
            raise DataError(
                f"--side {side}: the table's own names say {next(iter(told))}; leave the option out, or rename"
            )
        return side
    if not told:
        raise DataError(
            f"{measured.path}: {names['speed']} and {names['torque']} do not tell which side of the gearbox they "
            "are of; give --side input or --side output (the wheels)"
        )
    return str(next(iter(told)))


def _side_of(name: str) -> str | None:
    words = name.lower().replace("-", "_").replace(" ", "_").split("_")
    for side, names in _SIDES.items():
        if any(word in names for word in words):
            return side
    return None


def _at_input(
    values: Mapping[str, Array], kinds: Mapping[str, str], ratio: Array, at_output: bool
) -> tuple[Array, Array, Array]:
    """(point,) speed, torque and torque lost at the input."""
    speed = values["speed"] * ratio if at_output else values["speed"]
    torque = values["torque"] / ratio if at_output else values["torque"]
    if "loss" in values:
        lost = values["loss"] if kinds["loss"] == "torque" else values["loss"] / speed
        return speed, torque + lost if at_output else torque, lost
    return speed, *_by_efficiency(torque, values["efficiency"], at_output)


def _by_efficiency(torque: Array, eta: Array, at_output: bool) -> tuple[Array, Array]:
    """Torque and torque lost at the input; NaN where efficiency tells neither: no torque, or 0 or 1."""
    told = np.where((eta > 0) & (eta < 1) & (torque != 0), eta, np.nan)
    if at_output:
        at_input = np.where(torque > 0, torque / told, torque * told)
        return at_input, at_input - torque
    return torque, np.where(torque > 0, torque * (1 - told), torque * (1 - 1 / told))


def _left_out(values: Mapping[str, Array], known: NDArray[np.bool_]) -> list[str]:
    """What was left out, and why."""
    if known.all():
        return []
    eta = values.get("efficiency", np.full(len(known), np.nan))
    why = [
        f"{count} {words}"
        for count, words in (
            (
                int(np.sum(eta == 0)),
                "of efficiency 0: all power is lost, and nothing says how much more would be",
            ),
            (
                int(np.sum(eta == 1)),
                "of efficiency 1: no gearbox loses nothing, as where a formula was clipped",
            ),
        )
        if count
    ]
    others = int(np.sum(~known)) - int(np.sum((eta == 0) | (eta == 1)))
    why += [f"{others} without a loss or a torque"] if others else []
    return [
        f"left out: {np.sum(~known)} of {len(known)} points, {'; '.join(why)}; the map is straight between those "
        "that stay"
    ]
