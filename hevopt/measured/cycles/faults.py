"""What is wrong with a logged drive, line by line, and the repairs that a user may ask for."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from hevopt.display.facts import Shown
from hevopt.driving.values import GRADE_MAX, SPEED_MAX_MPS
from hevopt.errors import DataError
from hevopt.measured.cycles.columns import Drive
from hevopt.measured.cycles.fault_list import Faults, empty_cell, refused
from hevopt.measured.cycles.spikes import spikes, text_of
from hevopt.measured.cycles.times import (
    report_gaps,
    rows_of,
    running_on,
    spread,
    times_in_order,
    without_speed,
)
from hevopt.measured.tables.rows import runs
from hevopt.units import KMH_PER_MPS

Array = NDArray[np.float64]

# A car that is slower rests.
SMALLEST_MPS = 1e-3
_GEAR_MAX = 20
# A file with more to repair than this share of its lines is not a log with a few faults.
_REPAIRED_SHARE_MAX = 0.25
_DRAWN = "drawn between its neighbours"
_LEFT_OUT = "left out with more than a minute without a usable speed"


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Sound(Shown):
    """A drive over time without faults.

    faults: what was wrong and is mended; said: what needed no repair
    long_gaps: rows before gaps of more than a minute
    """

    drive: Drive
    faults: Faults
    said: tuple[str, ...]
    long_gaps: NDArray[np.int64]


def sound(drive: Drive) -> Sound:
    """The drive after the repairs; DataError where too many of its lines would change.

    A clock that begins again runs on; lines with a time out of order are left out; speeds below 0 are set to 0,
    missing ones, spikes and dropouts drawn straight between their neighbours, up to a minute of them; other columns
    hold their last value.
    """
    faults = Faults()
    mended, said = spread(running_on(drive, faults))
    kept = times_in_order(mended, faults)
    if len(kept) < 2:
        raise DataError(f"{drive.measured.path}: one line; a drive needs at least 2")
    if kept.sum() < 2:
        advice = "fewer than 2 lines have a time in order; a drive needs at least 2: check the column of time"
        raise refused(drive.measured.path, faults, advice)
    mended, more = _speeds(rows_of(mended, kept), faults)
    long_gaps = report_gaps(mended, faults)
    mended = replace(mended, **held_columns(mended, faults))
    lines, rows = len({fault[0] for fault in faults.found}), len(drive.lines)
    if lines > _REPAIRED_SHARE_MAX * rows:
        raise refused(
            drive.measured.path, faults,
            f"{lines} of {rows} lines are more than the {_REPAIRED_SHARE_MAX:.0%} that --repair changes; correct "
            "the file, or check the columns and their units" + _rates(drive),
        )  # fmt: skip
    return Sound(mended, faults, (*said, *more), long_gaps)


def _rates(drive: Drive) -> str:
    """What to do with a log of several rates, whose speed stands in some rows only; '' for others."""
    known, rows = int(np.isfinite(drive.speed_mps).sum()), len(drive.speed_mps)
    if known > (1 - _REPAIRED_SHARE_MAX) * rows or known < 2:
        return ""
    return (
        f"; {known} of {rows} lines have a speed: where the log writes it less often than other columns, keep the "
        "lines with a speed alone"
    )


def held_columns(drive: Drive, faults: Faults) -> dict[str, Array | None]:
    """Grade, altitude, gear and clutch: a fault takes the value before it, or at the start the one after."""
    names = ("grade", "altitude_m", "gear", "clutch_open")
    return {name: _held(drive, name, faults) for name in names}


def _speeds(drive: Drive, faults: Faults) -> tuple[Drive, list[str]]:
    """The drive with usable speeds alone, without its stretches of more than a minute that have none."""
    speed, lines = drive.speed_mps.copy(), drive.lines
    missing, negative = ~np.isfinite(speed), speed < 0
    speed = np.where(negative, 0.0, speed)
    high = speed > SPEED_MAX_MPS
    kept = ~missing & ~high
    wild = spikes(drive.time_s, speed, np.flatnonzero(kept))
    kept[[spike.row for spike in wild]] = False
    gone = without_speed(drive.time_s, kept)
    for row in np.flatnonzero(missing & ~gone):
        what = empty_cell(drive, "speed", row)
        faults.add(lines[row], "without a speed", f"speed {{}}; {_DRAWN}", what)
    for row in np.flatnonzero(high):
        text = f"speed {{:.4g}} km/h is above {{:g}} km/h; {_LEFT_OUT if gone[row] else _DRAWN}"
        values = np.array([speed[row], SPEED_MAX_MPS]) * KMH_PER_MPS
        faults.add(lines[row], "speeds too high", text, *values)
    for spike in wild:
        if not negative[spike.row]:
            text, values = text_of(spike, drive.time_s, speed, lines)
            text += f"; {_LEFT_OUT if gone[spike.row] else _DRAWN}"
            faults.add(lines[spike.row], "spikes", text, *values)
    for row in np.flatnonzero(negative):
        drawn = f"{_LEFT_OUT if gone[row] else _DRAWN}, against which 0 is a spike"
        how = "set to 0" if kept[row] else drawn
        text = "speed {:.4g} km/h is negative; {}"
        faults.add(lines[row], "negative speeds", text, drive.speed_mps[row] * KMH_PER_MPS, how)
    if kept.any():
        speed = np.interp(drive.time_s, drive.time_s[kept], speed[kept])
    empty = lines[missing & gone].tolist()
    said = [f"more than a minute without a speed, left out: {runs(empty)}"] * bool(empty)
    return rows_of(replace(drive, speed_mps=speed), ~gone), said


def _held(drive: Drive, name: str, faults: Faults) -> Array | None:
    values = getattr(drive, name)
    if values is None:
        return None
    word = name.removesuffix("_m")
    low, high, whole = {
        "grade": (-GRADE_MAX, GRADE_MAX, False),
        "gear": (0, _GEAR_MAX, True),
        "clutch_open": (0, 1, True),
        "altitude_m": (-1e4, 1e4, False),
    }[name]
    good = (values >= low) & (values <= high) & (~np.array(whole) | (values == np.round(values)))
    if not good.any():
        raise DataError(
            f"{drive.measured.path}: column of {word}: no {'whole number' if whole else 'number'} from {low:g} to "
            f"{high:g} in it; check its unit, or leave it out with --column {word}="
        )
    rows = np.maximum.accumulate(np.where(good, np.arange(len(values)), -1))
    held = values[np.where(rows < 0, int(np.argmax(good)), rows)]
    wanted = f"{'a whole number ' if whole else ''}from {low:g} to {high:g}"
    for row in np.flatnonzero(~good):
        known = np.isfinite(values[row])
        what = f"is {values[row]:g}, not {wanted}" if known else empty_cell(drive, word, row)
        place = "before" if rows[row] >= 0 else "after"
        text = "{} {}; {:g} of the line {} is used"
        faults.add(drive.lines[row], f"faults of {word}", text, word, what, held[row], place)
    return held
