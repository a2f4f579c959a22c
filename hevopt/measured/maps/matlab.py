"""Maps as MATLAB files keep them: vectors of speed and torque, and matrices over both.

ADVISOR 2003 (files of fuel converters and motors) and tools after it: rows of a matrix are speeds, columns torques;
speed in rad/s, torque in Nm, fuel and NOx in g/s, efficiency as a fraction.
"""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from hevopt.errors import DataError
from hevopt.measured.maps.roles import ALIASES
from hevopt.measured.tables.matlab import Variables, cells_of, columns_table
from hevopt.measured.tables.names import base_of, cleaned
from hevopt.measured.tables.rows import CELLS_MAX, ROWS_MAX, Table

CONVENTION = "MATLAB convention of fc_map_spd"
_UNITS = {
    "map_spd": "rad/s", "map_trq": "Nm", "max_trq": "Nm", "ct_trq": "Nm", "fuel_map": "g/s", "nox_map": "g/s",
    "fuel_map_gpkWh": "g/kWh", "eff_map": "fraction",
}  # fmt: skip
_PREFIXES = ("fc_", "mc_", "gc_")


def points_table(
    path: Path, variables: Variables, columns: Mapping[str, str], rows: str | None
) -> Table:
    """A row per point of a map's axes and matrices, else the file's vectors as columns.

    columns: role -> name of a variable; rows: "speed" or "torque" where a square matrix needs telling
    """
    speed, torque = (_named(path, variables, role, columns) for role in ("speed", "torque"))
    if speed is None or torque is None:
        return _plain(path, variables, rows)
    axes = {speed: variables[speed], torque: variables[torque]}
    if axes[speed].shape == axes[torque].shape and min(axes[speed].shape) > 1:
        shape = axes[speed].shape
        alike = {n: v for n, v in _matrices(variables).items() if v.shape == shape}
        flat = {name: values.ravel() for name, values in (axes | alike).items()}
        lines = np.repeat(np.arange(1, shape[0] + 1), shape[1])
        return _table(path, variables, flat, lines, f"{shape[0]} x {shape[1]} matrices")
    count = axes[speed].size, axes[torque].size
    over = {
        name: values
        for name, values in _matrices(variables).items()
        if values.shape in (count, count[::-1]) and name not in axes and _of_one(name, speed)
    }
    if not over or any(min(values.shape) > 1 for values in axes.values()):
        return _plain(path, variables, rows)
    down = _down(path, speed, rows, count, over)
    flat = {
        speed: np.repeat(axes[speed].ravel(), count[1]),
        torque: np.tile(axes[torque].ravel(), count[0]),
    }
    for name, values in over.items():
        flat[name] = (values if down(values) else values.T).ravel()
    lines = np.repeat(np.arange(1, count[0] + 1), count[1])
    return _table(path, variables, flat, lines, f"grid of {count[0]} speeds and {count[1]} torques")


def curves_table(path: Path, variables: Variables, columns: Mapping[str, str], role: str) -> Table:
    """The vectors over the vector of speeds; torques that are an axis of a matrix are none of them."""
    speed = _named(path, variables, "speed", columns)
    if speed is None:
        return columns_table(path, variables)
    count = variables[speed].size
    square = any(values.shape == (count, count) for values in _matrices(variables).values())
    axes = [n for n in variables if base_of(n) in ALIASES["torque"] or n == columns.get("torque")]
    flat = {
        name: values.ravel()
        for name, values in variables.items()
        if values is not None
        and values.size == count
        and min(values.shape) == 1
        and _of_one(name, speed)
        and not (square and name in axes and name != columns.get(role))
    }
    return _table(path, variables, flat, np.arange(1, count + 1), f"curves of {count} speeds")


def _named(path: Path, variables: Variables, role: str, columns: Mapping[str, str]) -> str | None:
    """The variable of real numbers that the user names for a role, or that is called so."""
    real = [name for name, values in variables.items() if values is not None and values.size > 1]
    wanted = columns.get(role)
    if wanted is not None:
        found = [n for n in real if n == wanted] or [
            n for n in real if base_of(n) == base_of(wanted)
        ]
    else:
        found = [name for name in real if base_of(name) in ALIASES[role]]
    if len(found) > 1:
        raise DataError(
            f"{path}: variables {', '.join(map(cleaned, found))} could all be meant; choose with "
            f"--column {role}=NAME, or save the variables of one map alone"
        )
    return found[0] if found else None


def _matrices(variables: Variables) -> dict[str, NDArray]:
    return {n: v for n, v in variables.items() if v is not None and min(v.shape) > 1}


def _plain(path: Path, variables: Variables, rows: str | None) -> Table:
    if rows is not None:
        raise DataError(
            f"{path}: --rows is for a matrix over vectors of speed and torque, and there is none; leave it out"
        )
    return columns_table(path, variables)


def _down(
    path: Path, speed: str, rows: str | None, count: tuple[int, int], over: Mapping[str, NDArray]
):
    """Whether speeds run down a matrix, as a function of it."""
    if count[0] != count[1]:
        if rows is not None and any((v.shape == count) != (rows == "speed") for v in over.values()):
            raise DataError(
                f"{path}: --rows {rows}, but {cleaned(next(iter(over)))} of {count[0]} speeds and {count[1]} "
                "torques lies the other way; leave it out"
            )
        return lambda values: values.shape == count
    if rows is None and not _unit(speed):
        raise DataError(
            f"{path}: {count[0]} speeds and as many torques: which way {cleaned(next(iter(over)))} lies is not to "
            "be seen; give --rows speed where each row is one speed, or --rows torque"
        )
    return lambda _: rows != "torque"


def _table(
    path: Path, variables: Variables, flat: Mapping[str, NDArray], lines: NDArray, what: str
) -> Table:
    if len(lines) > ROWS_MAX or len(lines) * len(flat) > CELLS_MAX:
        raise DataError(
            f"{path}: {len(lines)} points of {len(flat)} variables; allowed: up to {ROWS_MAX} points and "
            f"{CELLS_MAX} numbers; save fewer"
        )
    rest = ", ".join(cleaned(name) for name in variables if name not in flat)
    return Table(
        [cleaned(name) for name in flat],
        [_unit(name) for name in flat],
        [cells_of(values) for values in flat.values()],
        lines,
        [f"MATLAB file, {what}"],
        CONVENTION,
        left_out=f"left out, not over these: {rest}" * bool(rest),
    )


def _of_one(name: str, speed: str) -> bool:
    """Whether the convention gives neither name to another component than the other's."""
    prefixes = {n.split(".")[-1][:3] for n in (name, speed)}
    return len(prefixes & {*_PREFIXES}) < 2


def _unit(name: str) -> str:
    """The unit that the convention gives a variable of a name, '' for others."""
    field = name.split(".")[-1]
    return _UNITS.get(field[3:], "") if field.startswith(_PREFIXES) else ""
