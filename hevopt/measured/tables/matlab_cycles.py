"""Driving cycles as ADVISOR and tools after it keep them in .mat files: cyc_mph and the like, with cyc_grade.

cyc_mph: (row, 2) time in s and speed. cyc_grade: (row, 2) distance from the start in m and rise over run there,
linear between its rows and constant beyond them, or one number for the whole cycle (ADVISOR 2003, CYC_*.m files).
"""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from hevopt.errors import DataError
from hevopt.measured.resample import distance_at
from hevopt.measured.tables.cells import LARGEST
from hevopt.measured.tables.names import cleaned
from hevopt.units import unit_named

Array = NDArray[np.float64]

# Array of time in seconds and speed -> unit of speed.
CYCLE_ARRAYS = {"cyc_mph": "mph", "cyc_kph": "km/h", "cyc_kmh": "km/h", "cyc_mps": "m/s"}
CONVENTION = "MATLAB convention of cyc_mph"
_GRADE = "cyc_grade"


def array_unit(name: str, array: NDArray, i: int) -> str:
    """Unit of a column of a cycle's array, '' for other arrays."""
    speed = CYCLE_ARRAYS.get(_field(name))
    if _field(name) == _GRADE:
        return "fraction"
    return ("s", speed)[i] if speed is not None and array.shape[1] == 2 else ""


def arranged(
    path: Path, variables: dict[str, NDArray | None]
) -> tuple[dict[str, NDArray | None], list[str]]:
    """The variables with cycles' arrays upright and cyc_grade as one value a row of its cycle, and notes."""
    made, notes = dict(variables), []
    for name, array in variables.items():
        if (
            _field(name) in CYCLE_ARRAYS
            and array is not None
            and array.shape[0] == 2 < array.shape[1]
        ):
            made[name] = array.T
            notes.append(
                f"{cleaned(name)}: {array.shape[0]} x {array.shape[1]}, its rows read as columns"
            )
    for name, grade in variables.items():
        owner = name[: -len(_GRADE)]
        cycles = [made[f"{owner}{n}"] for n in CYCLE_ARRAYS if made.get(f"{owner}{n}") is not None]
        if _field(name) != _GRADE or not cycles:
            continue
        del made[name]
        if grade is not None and not np.any(grade[:, 1:] if grade.shape[1] == 2 else grade):
            notes.append(f"{cleaned(name)}: 0 everywhere")
            continue
        unit = next(u for n, u in CYCLE_ARRAYS.items() if made.get(f"{owner}{n}") is not None)
        made[name] = _by_row(path, cleaned(name), grade, cycles[0], unit)
        notes.append(
            f"{cleaned(name)}: grade over distance in m, averaged over each step of the cycle"
        )
    return made, notes


def _field(name: str) -> str:
    return name.split(".")[-1].lower()


def _by_row(path: Path, name: str, grade: NDArray | None, cycle: NDArray, unit: str) -> Array:
    """(row, 1) mean grade over the distance from each row of a cycle to the next."""
    if grade is not None and grade.size == 1:
        grade = np.array([[0.0, grade.item()], [1.0, grade.item()]])
    wanted = "two columns, distance in m that rises and grade as rise over run"
    if grade is None or grade.shape[1] != 2 or len(grade) < 2 or not _rising(grade):
        found = "no real numbers" if grade is None else " x ".join(map(str, grade.shape))
        raise DataError(
            f"{path}: {name} is {found}; needed: {wanted}; correct it, or leave it out of the file"
        )
    if cycle.shape[1] != 2 or not _rising(cycle):
        raise DataError(
            f"{path}: {name} needs a cycle of two columns whose times rise, without missing numbers, to find the "
            f"distance; correct the cycle, or leave {name} out of the file"
        )
    time_s, speed_mps = cycle[:, 0].astype(float), cycle[:, 1].astype(float) * unit_named(unit).si
    if len(grade) == len(time_s) and np.array_equal(grade[:, 0], time_s):
        raise DataError(
            f"{path}: the first column of {name} is the time of the cycle; needed: {wanted}; or save grade as a "
            "vector of its own beside vectors of time and speed"
        )
    driven_m = distance_at(time_s, np.maximum(speed_mps, 0), time_s)
    place_m, slope = grade.astype(float).T
    ends_m = [min(place_m[0], 0.0) - 1, max(place_m[-1], driven_m[-1]) + 1]
    along_m = np.r_[ends_m[0], place_m, ends_m[1]]
    held = np.r_[slope[0], slope, slope[-1]]
    # The integral of a line between points over distance is that of a speed over time.
    climbed_m, step_m = np.diff(distance_at(along_m, held, driven_m)), np.diff(driven_m)
    here = np.interp(driven_m, along_m, held)
    here[:-1] = np.where(step_m > 0, climbed_m / np.where(step_m > 0, step_m, 1.0), here[:-1])
    return here.reshape(-1, 1)


def _rising(table: NDArray) -> bool:
    """Whether all is numbers of usual size, and the first column rises."""
    values = table.astype(float)
    return bool((np.abs(values) < LARGEST).all() and (np.diff(values[:, 0]) > 0).all())
