"""A logged drive or another tool's cycle to cycle files at 1 Hz."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from hevopt.errors import DataError, unknown_name
from hevopt.files.keywords import check_keywords
from hevopt.measured.cycles.columns import Drive, drive_of
from hevopt.measured.cycles.distance import over_time
from hevopt.measured.cycles.fault_list import Faults, refused
from hevopt.measured.cycles.faults import Sound, sound
from hevopt.measured.cycles.gaps import (
    GAPS,
    bridged,
    check_cut,
    gap_text,
    gap_texts,
    gaps_unsaid,
    joined,
    moving_ends,
    parts_of,
)
from hevopt.measured.cycles.sampled import ImportedCycle, Told, cycle_from, with_grade
from hevopt.measured.cycles.standstill import never_at_rest, standing
from hevopt.measured.cycles.times import DROPOUT_MAX_S, coarse, long_steps
from hevopt.measured.tables.table import read_measured


def import_cycle(path: str | Path, **options: Any) -> ImportedCycle:
    """The one cycle in a measured file: a logged drive, or another tool's, checked and resampled to 1 Hz.

    options: those of `import_drives`, which gives several where gaps is "split". Raises DataError as that does, and
    for an option that it does not have.
    """
    check_keywords("import_cycle", import_drives, options)
    imported, *others = import_drives(path, **options)
    if others:
        raise DataError(
            f"import_cycle: {path} holds {1 + len(others)} trips; import_drives gives all of them"
        )
    return imported


def import_drives(
    path: str | Path,
    *,
    columns: Mapping[str, str] | None = None,
    units: Mapping[str, str] | None = None,
    sheet: str | None = None,
    repair: bool = False,
    gaps: str | None = None,
    acceleration_mps2: float | None = None,
    standstill_mps: float | None = None,
    altitude_baseline_m: float | None = None,
) -> tuple[ImportedCycle, ...]:
    """The cycle in a measured file, at 1 Hz, or its trips where gaps is "split".

    Raises DataError with every fault by line where the file has any and `repair` is not set.
    columns, units: role (time, date, speed, distance, stop, grade, altitude, gear, clutch_open) to a column's name,
    unit
    acceleration_mps2: with which the target speeds of a drive over distance are followed
    altitude_baseline_m: length of road over which grade is taken from altitude, None for one chosen by its noise
    standstill_mps: slower than which for a while the car counts as standing
    gaps: cut, split or bridge those of more than a minute
    """
    path = Path(path)
    measured = read_measured(path, sheet=sheet)
    drive = drive_of(measured, columns or {}, units or {})
    _check_options(drive, gaps, acceleration_mps2, standstill_mps, altitude_baseline_m)
    made = _Making(path, standstill_mps, altitude_baseline_m)
    if drive.time_s is None:
        drive = over_time(drive, acceleration_mps2)
        return (cycle_from(path, drive, Told(hints=drive.hints), altitude_baseline_m),)
    found = sound(drive)
    unsaid = len(found.long_gaps) > 0 and gaps is None
    if unsaid or (found.faults.found and not repair):
        raise _refusal(found, made, repair, gaps)
    return made.cycles(found, gaps)


def _check_options(
    drive: Drive,
    gaps: str | None,
    acceleration_mps2: float | None,
    standstill_mps: float | None,
    altitude_baseline_m: float | None,
) -> None:
    """DataError for an option that the file leaves without a meaning."""
    path = drive.measured.path
    if gaps is not None and gaps not in GAPS:
        raise unknown_name("--gaps", gaps, list(GAPS))
    if drive.time_s is None:
        for option, value in (("--standstill", standstill_mps), ("--gaps", gaps)):
            if value is not None:
                raise DataError(f"{path}: a drive over distance; leave {option} out")
    elif acceleration_mps2 is not None:
        raise DataError(f"{path}: a drive over time; leave --acceleration out")
    if altitude_baseline_m is not None and drive.altitude_m is None:
        raise DataError(
            f"{path}: --altitude-baseline without an altitude; name it with --column altitude=NAME"
        )


def _refusal(found: Sound, made: "_Making", repair: bool, gaps: str | None) -> DataError:
    """The error that lists faults and gaps, with advice that has been tried: what it names will not be refused."""
    faults, advice = Faults() if repair else found.faults, []
    asked = len(found.long_gaps) and gaps is None
    if faults.found:
        try:
            made.cycles(found, "split" if asked else gaps)
            advice.append("correct the file, or let --repair mend these lines as told")
        except DataError as error:
            advice.append(f"correct the file; --repair does not help, since then: {error}")
    if asked:
        faults = Faults([*faults.found])
        for k in found.long_gaps:
            faults.add(found.drive.lines[k + 1], "long gaps", "{}", gap_text(found.drive, k))
        advice.append(gaps_unsaid(found.drive, found.long_gaps))
    return refused(found.drive.measured.path, faults, "\n".join(advice))


@dataclass(frozen=True, slots=True)
class _Making:
    """How cycles are made of sound drives."""

    path: Path
    standstill_mps: float | None
    altitude_baseline_m: float | None

    def cycles(self, found: Sound, gaps: str | None) -> tuple[ImportedCycle, ...]:
        """The cycles of a drive, with its long gaps dealt with as told."""
        drive, rows = found.drive, found.long_gaps
        hints = (*drive.hints, *coarse(drive))
        told = Told(found.said, tuple(found.faults.texts()), hints)
        if not len(rows):
            nothing = f"--gaps {gaps}: no gap of more than {DROPOUT_MAX_S:g} s"
            return (self._cycle(drive, _with(told, [nothing] * (gaps is not None))),)
        if gaps == "bridge":
            return (self._cycle(drive, _with(told, [bridged(drive, rows)])),)
        parts = parts_of(drive, rows)
        told = _with(told, parts.said, moving_ends(parts.drives, gaps == "cut"))
        where = "; ".join(gap_texts(drive, rows))
        if gaps == "cut":
            check_cut(drive, rows)
            told = _with(told, [f"gaps cut out, their time and distance left out: {where}"])
            return (self._joined(parts.drives, told),)
        return tuple(
            self._cycle(part, _with(told, [_trip(k, parts.drives), f"gaps: {where}"]))
            for k, part in enumerate(parts.drives, start=1)
        )

    def _joined(self, parts: tuple[Drive, ...], told: Told) -> ImportedCycle:
        """One cycle of all parts, each with the grade of its own altitude."""
        graded = [with_grade(part, self.altitude_baseline_m) for part in parts]
        for _, of_part in graded:
            told = _with(told, of_part.rules, of_part.hints)
        return self._cycle(joined(tuple(part for part, _ in graded)), told)

    def _cycle(self, drive: Drive, told: Told) -> ImportedCycle:
        told = _with(told, long_steps(drive))
        if self.standstill_mps is None:
            told = _with(told, hints=never_at_rest(drive))
        else:
            drive, counted = standing(drive, self.standstill_mps)
            told = _with(told, counted)
        return cycle_from(self.path, drive, told, self.altitude_baseline_m)


def _with(told: Told, rules: Iterable[str] = (), hints: Iterable[str] = ()) -> Told:
    """What is told, with more that does not stand there yet."""
    rules = tuple(dict.fromkeys((*told.rules, *rules)))
    return replace(told, rules=rules, hints=tuple(dict.fromkeys((*told.hints, *hints))))


def _trip(k: int, parts: tuple[Drive, ...]) -> str:
    lines = parts[k - 1].lines
    return f"trip {k} of {len(parts)}, lines {lines[0]} to {lines[-1]}"
