"""A sound drive to a cycle file at 1 Hz, with all that was assumed and changed."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from hashlib import sha256
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from hevopt import __version__
from hevopt.driving.cycle import SAMPLES_MAX, Cycle, cycle_of
from hevopt.errors import DataError
from hevopt.files.shown import printable
from hevopt.files.writing import check_outs, csv_comment, write_whole
from hevopt.measured.cycles.altitude import grade_from_altitude
from hevopt.measured.cycles.columns import Drive
from hevopt.measured.resample import distance_at, mean_grades, one_hertz_times, rows_at, speeds_at
from hevopt.units import KMH_PER_MPS

Array = NDArray[np.float64]

RULE = (
    "1 Hz: speed linear between samples, at each whole second scaled so that the distance of the two seconds "
    "around it is kept; standstill stays standstill; the last step, 0.5 to 1.5 s long, ends at the file's last time"
)
_ALREADY = "already at 1 Hz: speeds kept as they are"
_TIME_DIGITS, _SPEED_DIGITS, _GRADE_DIGITS = 6, 6, 8


@dataclass(frozen=True, slots=True, eq=False)
class ImportedCycle:
    """A cycle made from a file, with texts for the user.

    text: the cycle file; assumptions: how the file was read; rules: how the cycle was made; repairs: by line
    distance_m: as the source has it after the repairs, between samples at uneven times
    hints: what the user may want to change
    """

    source: Path
    cycle: Cycle
    text: str
    distance_m: float
    assumptions: tuple[str, ...]
    rules: tuple[str, ...]
    repairs: tuple[str, ...]
    hints: tuple[str, ...]

    def write(self, out: str | Path) -> None:
        """Write the cycle file; DataError where its name does not end in .csv, or it cannot be written."""
        path = Path(out)
        check_cycle_file(path, self.source)
        write_whole(path, self.text.encode())


@dataclass(frozen=True, slots=True)
class Told:
    """What is known of a cycle besides its drive: how it was made, repairs by line, what the user may change."""

    rules: tuple[str, ...] = ()
    repairs: tuple[str, ...] = ()
    hints: tuple[str, ...] = ()


def check_cycle_file(out: Path, source: Path) -> None:
    """DataError where a cycle file could not be written there, or would replace the one that it is made from."""
    if out.suffix.lower() != ".csv":
        raise DataError(f"--out {out}: a cycle file's name ends in .csv; give such a name")
    check_outs({"--out": out}, [source])


def cycle_from(
    path: Path, drive: Drive, told: Told, altitude_baseline_m: float | None
) -> ImportedCycle:
    """The cycle of a drive over time. path: the file that it comes from"""
    distance_m = _distance(drive)[-1]
    columns, rules, noticed = _at_one_hertz(drive, altitude_baseline_m)
    assumptions = (*drive.measured.notes, *drive.notes)
    rules, hints = (*rules, *told.rules), (*told.hints, *noticed)
    said = [*(f"read as: {text}" for text in assumptions), *(f"made by: {text}" for text in rules)]
    shown = drive.measured.path
    text = _text(path, shown, [*said, *hints], told.repairs, columns)
    return ImportedCycle(
        shown, _checked(shown, text), text, float(distance_m), assumptions, rules, told.repairs, hints
    )  # fmt: skip


def summary(imported: ImportedCycle) -> list[tuple[str, str]]:
    """Name and text of each figure that tells whether a cycle was read as meant."""
    cycle = imported.cycle
    speed, step_s = cycle.speed_mps, np.diff(cycle.time_s)
    rests = (speed[1:] == 0) & (speed[:-1] == 0)
    stops = int(np.sum((speed[1:] == 0) & (speed[:-1] > 0)))
    acceleration = np.diff(speed) / step_s
    up, down = max(acceleration.max(), 0.0), abs(min(acceleration.min(), 0.0))
    change = round(cycle.distance_m / imported.distance_m - 1, 6) + 0.0
    whose = "repaired drive's" if imported.repairs else "file's"
    rows = [
        ("samples", f"{len(speed)}"),
        ("duration", f"{cycle.duration_s:.10g} s"),
        ("distance", f"{cycle.distance_m / 1e3:.4f} km ({change:+.4%} of the {whose})"),
        ("max speed", f"{speed.max() * KMH_PER_MPS:.1f} km/h"),
        ("max acceleration", f"{up:.2f} m/s², braking {down:.2f} m/s²"),
        ("stops", f"{stops}"),
        ("standstill", f"{np.sum(step_s[rests]) / cycle.duration_s:.1%} of the time"),
    ]
    if cycle.grade.any():
        climb_m = (
            cycle.grade[:-1] / np.hypot(1, cycle.grade[:-1]) * step_s * (speed[1:] + speed[:-1]) / 2
        )
        up, down = climb_m[climb_m > 0].sum(), abs(climb_m[climb_m < 0].sum())
        rows.append(("grade", f"{up:.1f} m up, {down:.1f} m down"))
    if cycle.gear is not None:
        rows.append(("gears", f"0 to {cycle.gear.max()}"))
    return rows


def _distance(drive: Drive) -> Array:
    return distance_at(drive.time_s, drive.speed_mps, drive.time_s)


def with_grade(drive: Drive, baseline_m: float | None) -> tuple[Drive, Told]:
    """The drive with a grade in place of its altitude, where it has one, and how that was made."""
    if drive.altitude_m is None:
        return drive, Told()
    road = grade_from_altitude(_distance(drive), drive.altitude_m, baseline_m)
    told = Told(rules=(road.rule,), hints=(road.hint,) * bool(road.hint))
    return replace(drive, grade=road.grade, altitude_m=None), told


def _at_one_hertz(
    drive: Drive, altitude_baseline_m: float | None
) -> tuple[dict[str, Array], list[str], list[str]]:
    """Columns of the cycle file, the rules by which they were made, and hints."""
    start_s = float(drive.time_s[0])
    time_s = drive.time_s - start_s
    duration_s = round(float(time_s[-1]), _TIME_DIGITS)
    if duration_s > SAMPLES_MAX - 1:
        raise DataError(
            f"{drive.measured.path}: {duration_s:g} s long; allowed: up to {SAMPLES_MAX - 1} s, in 1 s steps; "
            "check the unit of time, or cut the drive"
        )
    at_s = one_hertz_times(float(time_s[-1]))
    columns = {"time_s": at_s, "speed_mps": speeds_at(time_s, drive.speed_mps, at_s)}
    already = len(at_s) == len(time_s) and np.allclose(at_s, time_s, rtol=0, atol=10**-_TIME_DIGITS)
    rules = [_ALREADY if already else f"{RULE}; steps of the file: {_steps(time_s)}"]
    if abs(start_s) > 10**-_TIME_DIGITS:
        rules.append(f"time begins at 0: {start_s:.10g} s subtracted")
    row = rows_at(time_s, at_s)
    for name in ("gear", "clutch_open"):
        if (values := getattr(drive, name)) is not None:
            columns[name] = values[row]
            rules.append(f"{name}: the last sample's")
    drive, told = with_grade(drive, altitude_baseline_m)
    grade, hints = drive.grade, list(told.hints)
    rules += told.rules
    if drive.grade_ends and grade is not None:
        grade = np.append(grade[1:], grade[-1])
    if grade is not None:
        columns["grade"] = mean_grades(time_s, drive.speed_mps, grade, at_s)
        holds = (
            "over the step that ends at it (FASTSim convention)"
            if drive.grade_ends
            else "to the next"
        )
        rules.append(f"grade: each row's holds {holds}; mean over the distance of each second")
    return columns, rules, hints


def _steps(time_s: Array) -> str:
    steps_s = np.diff(time_s)
    return f"{len(steps_s)}, of {steps_s.min():.4g} to {steps_s.max():.4g} s"


def _text(
    path: Path, shown: Path, told: list[str], repairs: Sequence[str], columns: dict[str, Array]
) -> str:
    """The cycle file: comments with source, assumptions and every repair, then the columns."""
    digest = sha256(path.read_bytes()).hexdigest()
    comments = [
        f"Made by hevopt {__version__} from {shown.name}, sha256 {digest}.",
        *told,
        *([f"{len(repairs)} repairs, by line of that file:"] if repairs else []),
        *(f"  {text}" for text in repairs),
    ]
    lines = [csv_comment(printable(comment)) for comment in comments]
    lines.append(",".join(columns))
    for row in zip(*(_written(name, values) for name, values in columns.items()), strict=True):
        lines.append(",".join(row))
    return "\n".join(lines) + "\n"


def _written(name: str, values: Array) -> list[str]:
    digits = {"time_s": _TIME_DIGITS, "speed_mps": _SPEED_DIGITS, "grade": _GRADE_DIGITS}.get(
        name, 0
    )
    return [
        f"{value:.{digits}f}".rstrip("0").rstrip(".") if digits else f"{value:.0f}"
        for value in values + 0.0
    ]


def _checked(path: Path, text: str) -> Cycle:
    """The cycle as it will be read; DataError where the reader of cycles would refuse it."""
    try:
        return cycle_of(path.with_suffix(".csv"), text)
    except DataError as error:
        raise DataError(f"the cycle made from {path.name} cannot be used: {error}") from None
