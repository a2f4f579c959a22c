"""Gaps of more than a minute in a logged speed are no dropouts: what becomes of them is for the user to say.

cut: the parts before and after are joined without the time of the gap. Their two samples there become one, whose
speed v is such that h (v - v1) + k (v - v2) = 0 for the steps h before and k after it: as the speed is linear
between samples, neither distance nor time is lost or made up.
split: every part is a drive of its own. bridge: the speed is drawn straight across.
"""

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from hevopt.driving.cycle import DISTANCE_MIN_M
from hevopt.errors import DataError
from hevopt.measured.cycles.columns import Drive
from hevopt.measured.cycles.times import DROPOUT_MAX_S, rows_of
from hevopt.measured.resample import distance_at
from hevopt.measured.tables.cells import LISTED
from hevopt.units import KMH_PER_MPS

Rows = NDArray[np.int64]

GAPS = ("cut", "split", "bridge")
# How fast a car's speed may change between the parts that a cut joins, and within how long at least.
_JOIN_MPS2, _JOIN_S = 3.0, 1.0


@dataclass(frozen=True, slots=True)
class Parts:
    """The parts of a drive between its long gaps. said: what is left out of them"""

    drives: tuple[Drive, ...]
    said: tuple[str, ...]


def parts_of(drive: Drive, gaps: Rows) -> Parts:
    """The parts that are drives: of two samples or more, over some distance; DataError where none is."""
    drives, said = [], []
    for a, b in pairwise([0, *(gaps + 1).tolist(), len(drive.lines)]):
        kept = np.zeros(len(drive.lines), dtype=bool)
        kept[a:b] = True
        driven_m = distance_at(*(v[a:b] for v in (drive.time_s, drive.speed_mps, drive.time_s)))[-1]
        if driven_m >= DISTANCE_MIN_M:
            drives.append(rows_of(drive, kept))
        else:
            said.append(
                f"lines {drive.lines[a]} to {drive.lines[b - 1]} between gaps left out: {driven_m:.2g} m driven"
            )
    if not drives:
        raise DataError(
            f"{drive.measured.path}: no part between gaps of more than {DROPOUT_MAX_S:g} s covers "
            f"{DISTANCE_MIN_M:g} m; check the units of time and speed"
        )
    return Parts(tuple(drives), tuple(said))


def gap_texts(drive: Drive, gaps: Rows) -> list[str]:
    """By line how long the first gaps last, and how fast the car is before and after them."""
    texts = [f"line {drive.lines[k + 1]}: {gap_text(drive, k)}" for k in gaps[:LISTED]]
    return texts + [f"and {len(gaps) - LISTED} more"] * (len(gaps) > LISTED)


def gap_text(drive: Drive, k: int) -> str:
    """How long the gap after row k lasts, and how fast the car is before and after it."""
    before, after = drive.speed_mps[k : k + 2] * KMH_PER_MPS
    step_s = drive.time_s[k + 1] - drive.time_s[k]
    return f"{_long(step_s)} without a usable speed, {before:.3g} km/h before and {after:.3g} km/h after"


def _long(seconds: float) -> str:
    text = f"{seconds:.10g} s"
    hours, minutes = divmod(round(seconds / 60), 60)
    return f"{text} ({hours} h {minutes:02} min)" if hours else f"{text} ({minutes} min)"


def gaps_unsaid(drive: Drive, gaps: Rows) -> str:
    """The message's part on gaps of which the user has not said what becomes of them."""
    cut = "" if _too_fast(drive, gaps) is not None else (
        "--gaps cut to join the drive without them, as where the car was parked; "
    )  # fmt: skip
    hour = any(3600 < drive.time_s[k + 1] - drive.time_s[k] <= 3600 + DROPOUT_MAX_S for k in gaps)
    summer = " (an hour may be a clock set to summer time: --gaps cut)" * (hour and bool(cut))
    return (
        f"a gap of more than {DROPOUT_MAX_S:g} s is no dropout, and what the car did in it is not in the file; say "
        f"what becomes of it: {cut}--gaps split for one cycle a trip; --gaps bridge to draw the speed straight "
        f"across, as where the log leaves out rows without change{summer}"
    )


def _too_fast(drive: Drive, gaps: Rows) -> int | None:
    """The row before a gap across which the speed changes more than a car's does, if there is one."""
    time_s, speed_mps = drive.time_s, drive.speed_mps
    for k in gaps.tolist():
        steps_s = (
            time_s[k] - time_s[max(k - 1, 0)] + time_s[min(k + 2, len(time_s) - 1)] - time_s[k + 1]
        )
        usual_s = min(steps_s, 2 * float(np.median(np.diff(time_s))))
        if abs(speed_mps[k + 1] - speed_mps[k]) > _JOIN_MPS2 * max(usual_s, _JOIN_S):
            return k
    return None


def check_cut(drive: Drive, gaps: Rows) -> None:
    """DataError where a gap has two speeds that no car joins."""
    if (k := _too_fast(drive, gaps)) is not None:
        raise DataError(
            f"{drive.measured.path}, line {drive.lines[k + 1]}: {gap_text(drive, k)}: no car changes its speed so "
            "fast, the parts cannot be joined; use --gaps split for one cycle a trip, or --gaps bridge to draw the "
            "speed straight across"
        )


def joined(drives: tuple[Drive, ...]) -> Drive:
    """The parts as one drive, their samples at each join made one."""
    whole = drives[0]
    for part in drives[1:]:
        whole = _two_joined(whole, part)
    return whole


def _two_joined(one: Drive, other: Drive) -> Drive:
    before_s, after_s = one.time_s[-1] - one.time_s[-2], other.time_s[1] - other.time_s[0]
    speed_mps = (before_s * one.speed_mps[-1] + after_s * other.speed_mps[0]) / (before_s + after_s)
    first, second = one.speed_mps.copy(), other.speed_mps.copy()
    first[-1] = second[0] = speed_mps
    one = replace(one, speed_mps=first)
    other = replace(other, speed_mps=second, time_s=other.time_s - other.time_s[0] + one.time_s[-1])
    part = {}
    for name in ("lines", "time_s", "speed_mps", "grade", "gear", "clutch_open"):
        if (values := getattr(one, name)) is not None:
            last, begins = (None, 1) if name == "grade" and one.grade_ends else (-1, 0)
            part[name] = np.concatenate([values[:last], getattr(other, name)[begins:]])
    return replace(one, altitude_m=None, text={}, **part)


def bridged(drive: Drive, gaps: Rows) -> str:
    """What drawing the speed across some gaps adds."""
    steps_s = np.diff(drive.time_s)[gaps]
    added_m = float(np.sum(steps_s * (drive.speed_mps[gaps] + drive.speed_mps[gaps + 1]) / 2))
    return (
        f"speed drawn straight across gaps, as --gaps bridge asks, {_long(float(steps_s.sum()))} and "
        f"{added_m:.4g} m: " + "; ".join(gap_texts(drive, gaps))
    )


def moving_ends(drives: tuple[Drive, ...], cut: bool) -> list[str]:
    """One text with the ends at gaps where the car is not at rest; none where it is at all of them."""
    ends = [
        (part.lines[row], part.speed_mps[row])
        for one, other in pairwise(drives) for part, row in ((one, -1), (other, 0))
    ]  # fmt: skip
    texts = [f"line {line}: {v * KMH_PER_MPS:.3g} km/h" for line, v in ends if v > 0]
    if not texts:
        return []
    what = "the drive goes on at speed where it is cut" if cut else "trips end or begin at speed"
    more = f" and {len(texts) - LISTED} more" * (len(texts) > LISTED)
    return [
        f"NOTE: {what}, as a logger's gap leaves it: {'; '.join(texts[:LISTED])}{more}; what was driven in the "
        "gap is missing"
    ]
