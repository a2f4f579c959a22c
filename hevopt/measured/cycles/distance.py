"""A drive over distance, as VECTO's, to one over time.

Without an acceleration, the points are joined by constant accelerations. With one, each speed is a target from
its point to the next: the car speeds up and brakes with it, and drives at the target between. A row of speed 0
is a stop.
"""

from dataclasses import dataclass, replace
from math import sqrt

import numpy as np
from numpy.typing import NDArray

from hevopt.errors import DataError
from hevopt.measured.cycles.columns import Drive
from hevopt.measured.cycles.fault_list import Faults, refused
from hevopt.measured.cycles.faults import SMALLEST_MPS, held_columns
from hevopt.measured.cycles.spikes import ACCELERATION_MAX_MPS2
from hevopt.measured.tables.rows import runs
from hevopt.units import KMH_PER_MPS

Array = NDArray[np.float64]


@dataclass(slots=True)
class _Trace:
    """Points in time as they are made; row: of the file, whose grade and gear hold."""

    time_s: list[float]
    speed_mps: list[float]
    row: list[int]

    def drive_to(self, speed_mps: float, distance_m: float, row: int) -> None:
        """Add a distance driven with constant acceleration to a speed."""
        if distance_m > 0:
            self.row[-1] = row
            self._add(2 * distance_m / (self.speed_mps[-1] + speed_mps), speed_mps, row)

    def stand(self, stop_s: float, row: int) -> None:
        """Add a stop."""
        if stop_s > 0:
            self.row[-1] = row
            self._add(stop_s, 0.0, row)

    def _add(self, step_s: float, speed_mps: float, row: int) -> None:
        self.time_s.append(self.time_s[-1] + step_s)
        self.speed_mps.append(speed_mps)
        self.row.append(row)


def over_time(drive: Drive, acceleration_mps2: float | None) -> Drive:
    """The drive over time; DataError with every fault of its rows."""
    if acceleration_mps2 is not None and not 0 < acceleration_mps2 <= ACCELERATION_MAX_MPS2:
        raise DataError(
            f"--acceleration {acceleration_mps2:g}; allowed: above 0 to {ACCELERATION_MAX_MPS2:.2f} m/s²"
        )
    distance_m, speed_mps = drive.distance_m, drive.speed_mps
    stop_s, said = _stops(drive)
    _check(drive, distance_m, speed_mps, stop_s, acceleration_mps2)
    if acceleration_mps2 is None:
        trace = _joined(distance_m, speed_mps, stop_s)
        rule = "points over distance joined by constant accelerations"
    else:
        trace = _following(distance_m, speed_mps, stop_s, acceleration_mps2)
        rule = f"target speeds over distance followed with {acceleration_mps2:g} m/s²"
    row = np.array(trace.row)
    names = ("lines", "grade", "altitude_m", "gear", "clutch_open")
    part = {n: values[row] for n in names if (values := getattr(drive, n)) is not None}
    part |= {"time_s": np.array(trace.time_s), "speed_mps": np.array(trace.speed_mps)}
    return replace(drive, notes=(*drive.notes, *said, rule), **part)


def _stops(drive: Drive) -> tuple[Array, list[str]]:
    """(row,) stop times, 0 where the cell is empty, and a note of these."""
    if drive.stop_s is None:
        return np.zeros_like(drive.speed_mps), []
    empty = ~np.isfinite(drive.stop_s)
    said = [f"stop: empty in {runs(drive.lines[empty].tolist())}, taken as 0 s"] * bool(empty.any())
    return np.where(empty, 0.0, drive.stop_s), said


def _check(
    drive: Drive,
    distance_m: Array,
    speed_mps: Array,
    stop_s: Array,
    acceleration_mps2: float | None,
) -> None:
    faults = Faults()
    if len(distance_m) < 2:
        raise DataError(f"{drive.measured.path}: one line; a drive needs at least 2")
    for row, line in enumerate(drive.lines):
        if not (np.isfinite(distance_m[row]) and np.isfinite(speed_mps[row])):
            faults.add(line, "empty cells", "distance or speed is no number")
        elif row and not distance_m[row] > distance_m[row - 1]:
            text = "distance {:g} m after {:g} m does not increase"
            faults.add(line, "distances out of order", text, distance_m[row], distance_m[row - 1])
        elif speed_mps[row] < 0 or stop_s[row] < 0:
            faults.add(line, "negative values", "speed or stop time is negative")
        elif stop_s[row] > 0 and speed_mps[row] > 0:
            text = "stop of {:g} s at {:g} km/h; a stop needs the speed 0"
            faults.add(line, "stops at speed", text, stop_s[row], speed_mps[row] * KMH_PER_MPS)
        elif row and max(speed_mps[row - 1 : row + 1]) < SMALLEST_MPS:
            faults.add(line, "distances at rest", "distance is covered at speed 0")
        elif row and acceleration_mps2 is None:
            squares = speed_mps[row] ** 2 - speed_mps[row - 1] ** 2
            acceleration = squares / (2 * (distance_m[row] - distance_m[row - 1]))
            if abs(acceleration) > ACCELERATION_MAX_MPS2:
                text = "{:.3g} m/s² from the line before, more than tyres hold ({:.2f} m/s²)"
                faults.add(line, "jumps of speed", text, acceleration, ACCELERATION_MAX_MPS2)
    held_columns(drive, faults)
    if faults.found:
        raise refused(
            drive.measured.path, faults,
            "correct the file (--repair mends drives over time alone); where speeds are targets that a driver "
            "follows, as in VECTO's cycles, say how fast with --acceleration, such as --acceleration 1",
        )  # fmt: skip


def _joined(distance_m: Array, speed_mps: Array, stop_s: Array) -> _Trace:
    trace = _Trace([0.0], [float(speed_mps[0])], [0])
    for row in range(len(distance_m)):
        if row:
            trace.drive_to(
                float(speed_mps[row]), float(distance_m[row] - distance_m[row - 1]), row - 1
            )
            trace.row[-1] = row
        trace.stand(float(stop_s[row]), row)
    return trace


def _following(
    distance_m: Array, speed_mps: Array, stop_s: Array, acceleration_mps2: float
) -> _Trace:
    """Highest speeds below the targets, from a sweep forwards and one backwards over the points."""
    steps_m = np.diff(distance_m)
    target = np.where(speed_mps[:-1] > 0, speed_mps[:-1], speed_mps[1:])
    at_point = np.concatenate([[speed_mps[0]], np.minimum(target[:-1], target[1:]), [target[-1]]])
    square = np.minimum(at_point, np.where(speed_mps > 0, np.inf, 0.0)) ** 2
    for k in range(len(steps_m)):
        square[k + 1] = min(square[k + 1], square[k] + 2 * acceleration_mps2 * steps_m[k])
    for k in reversed(range(len(steps_m))):
        square[k] = min(square[k], square[k + 1] + 2 * acceleration_mps2 * steps_m[k])
    trace = _Trace([0.0], [sqrt(square[0])], [0])
    trace.stand(float(stop_s[0]), 0)
    for k, step_m in enumerate(steps_m.tolist()):
        top = min(target[k] ** 2, (square[k] + square[k + 1]) / 2 + acceleration_mps2 * step_m)
        speeding_m = max(top - square[k], 0.0) / (2 * acceleration_mps2)
        braking_m = max(top - square[k + 1], 0.0) / (2 * acceleration_mps2)
        trace.drive_to(sqrt(top), speeding_m, k)
        trace.drive_to(sqrt(top), max(step_m - speeding_m - braking_m, 0.0), k)
        trace.drive_to(sqrt(square[k + 1]), braking_m, k)
        trace.row[-1] = k + 1
        trace.stand(float(stop_s[k + 1]), k + 1)
    return trace
