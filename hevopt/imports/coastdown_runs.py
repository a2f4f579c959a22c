"""Coast-down runs from measured tables, with what makes a run useless: rising speed, brakes, gaps in the data.

A new run begins where the run's number or the direction changes, in a new file, and, without such a number, where
the time goes back or has a gap.
"""

from collections.abc import Mapping, Sequence
from itertools import combinations, pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from hevopt.errors import DataError
from hevopt.imports import column_names
from hevopt.imports.coastdown import Run
from hevopt.imports.coastdown_directions import Directions, Way, directions_in, signs
from hevopt.imports.measured import (
    Column,
    Measured,
    column_named,
    column_of,
    columns_found,
    in_si,
    read_measured,
)

Array = NDArray[np.float64]

_ALIASES = {
    "time": column_names.TIME,
    "speed": column_names.SPEED,
    "run": {"run", "runnumber", "runno", "runid", "test", "testnumber", "coastdown"},
    "direction": {"direction", "dir", "heading", "way"},
}  # fmt: skip
_QUANTITIES = {"time": "time", "speed": "speed"}
ROLES, ROLES_WITH_UNIT = tuple(_ALIASES), (*_QUANTITIES, "direction")
_SAMPLES_MIN = 10
_FALL_MIN_MPS = 3.0
_BLOCK_S = 3.0
# A rise between blocks, and a deceleration beyond the rest, that no gust or slope of a test track explains.
_RISE_MIN_MPS = 0.3
_BRAKE_MIN_MPS2 = 0.3
_OUTLIER = 8.0
_NORMAL_PER_MAD = 1.4826
# Without a column run: a longer gap in time, in seconds and in usual steps, parts two runs.
_GAP_S = 5.0
_GAP_STEPS = 10.0
_LISTED = 20
# No two measured runs agree so closely in every sample; a copy written with fewer digits does.
_COPY_S, _COPY_MPS = 1e-3, 1e-3
_SEPARATE = (
    "runs are told apart by a column run with a number for each, by a file for each, or by a gap in time of more "
    f"than {_GAP_S:g} s and {_GAP_STEPS:g} usual steps; cut what lies between them from the log"
)


def read_runs(
    paths: Sequence[Path],
    columns: Mapping[str, str],
    units: Mapping[str, str],
    directions: Sequence[int] | None,
    sheet: str | None,
) -> tuple[list[Run], list[str]]:
    """The runs of all files, and how they were read. directions: of the runs in order, where no column has them."""
    parts, notes = [], []
    for path in paths:
        found, said = _parts(path, columns, units, sheet)
        parts += found
        notes += [f"{path.name}: {note}" for note in said]
    ways, places = [way for *_, way in parts], [place for _, _, place, _ in parts]
    labels, said = signs(ways, places, directions, _SEPARATE)
    notes += said
    runs = [
        Run(str(k + 1), direction, time, speed, place)
        for k, ((time, speed, place, _), direction) in enumerate(zip(parts, labels, strict=True))
    ]
    for run in runs:
        _check_run(run)
    _check_copies(runs)
    _check_brakes(runs)
    return runs, notes


def _parts(
    path: Path, columns: Mapping[str, str], units: Mapping[str, str], sheet: str | None
) -> tuple[list[tuple[Array, Array, str, Way]], list[str]]:
    """Time, speed, place and direction of every run of a file, and how it was read."""
    measured = read_measured(path, sheet=sheet)
    values, ways, notes = _values(measured, columns, units)
    time, begins = values["time"], np.zeros(max(len(values["time"]) - 1, 0), dtype=bool)
    if "run" in values:
        begins = np.diff(values["run"]) != 0
    else:
        gaps = _gaps(time)
        begins = gaps | (np.diff(time) < 0)
        if gaps.any():
            after = measured.lines[1:][gaps]
            more = f" and {len(after) - _LISTED} more" * (len(after) > _LISTED)
            notes.append(
                f"a gap in time begins a new run in line {', '.join(map(str, after[:_LISTED]))}{more}"
            )
    if ways is not None:
        begins |= ways.changes()
    parts = []
    for a, b in pairwise([0, *(np.flatnonzero(begins) + 1), len(time)]):
        place = f"{measured.path}, lines {measured.lines[a]} to {measured.lines[b - 1]}"
        way = ways.of_run(slice(a, b), place) if ways is not None else None
        parts.append((time[a:b], values["speed"][a:b], place, way))
    return parts, notes


def _values(
    measured: Measured, columns: Mapping[str, str], units: Mapping[str, str]
) -> tuple[dict[str, Array], Directions | None, list[str]]:
    """Values of each role by row, the directions where a column has them, and notes."""
    values, ways, notes = {}, None, list(measured.notes)
    for role in ROLES:
        column = _column(measured, role, columns.get(role))
        if column is None:
            continue
        if role in _QUANTITIES:
            found = in_si(
                measured, column, (_QUANTITIES[role],), f"--unit {role}=UNIT", units.get(role)
            )
            values[role], note = found.values, found.note
        elif role == "direction":
            ways = directions_in(measured, column, units.get(role))
            values[role], note = ways.values, ways.note
        else:
            values[role], note = column.values, f"column {column.name}"
        notes.append(f"{role}: {note}")
        _check_numbers(measured, role, values[role])
    if ways is None and "direction" in units:
        raise DataError(
            f"{measured.path}: --unit direction without a column of direction; name it with --column "
            f"direction=NAME; {columns_found(measured)}"
        )
    return values, ways, notes


def _column(measured: Measured, role: str, named: str | None) -> Column | None:
    if named:
        return column_named(measured, named)
    column = column_of(measured, _ALIASES[role], f"--column {role}=NAME")
    if column is None and role in _QUANTITIES:
        raise DataError(
            f"{measured.path}: no column of {role}; name it with --column {role}=NAME; {columns_found(measured)}"
        )
    return column


def _gaps(time: Array) -> NDArray[np.bool_]:
    """(row - 1,) whether a step is so long that it parts two runs."""
    steps = np.diff(time)
    forward = steps[steps > 0]
    usual = float(np.median(forward)) if len(forward) else 0.0
    return steps > max(_GAP_S, _GAP_STEPS * usual)


def _check_numbers(measured: Measured, role: str, values: Array) -> None:
    bad = ~np.isfinite(values)
    if role == "speed":
        bad |= values < 0
    if bad.any():
        k = int(np.flatnonzero(bad)[0])
        fault = {
            "speed": "is missing, negative or no number",
            "direction": "is missing, or not one of two numbers or two texts",
        }.get(role, "is missing or no number")
        allowed = "; allowed: 1 and -1, or two texts such as N and S" * (role == "direction")
        raise DataError(
            f"{measured.path}, line {measured.lines[k]}: {role} {fault} ({bad.sum()} such rows){allowed}; correct "
            "or delete the rows"
        )


def _check_run(run: Run) -> None:
    t, v = run.time_s, run.speed_mps
    if len(t) < _SAMPLES_MIN:
        raise DataError(
            f"{run.place}: run {run.label} has {len(t)} samples; needed: {_SAMPLES_MIN} or more; delete the run or "
            "mark runs with a column run"
        )
    if (np.diff(t) <= 0).any():
        k = int(np.argmax(np.diff(t) <= 0)) + 1
        raise DataError(
            f"{run.place}: run {run.label}: time {t[k]:g} s follows {t[k - 1]:g} s; time must rise: correct or "
            "delete the row"
        )
    starts, means, _ = _blocks(run)
    rises = np.diff(means)
    noise = _scatter(v, t)
    limit = max(_RISE_MIN_MPS, _OUTLIER * noise)
    if len(rises) and rises.max() > limit:
        k = int(np.argmax(rises))
        raise DataError(
            f"{run.place}: run {run.label}: speed rises by {rises[k] * 3.6:.1f} km/h after t = {starts[k]:g} s; a "
            f"coast-down only slows down: cut the file to its coasting parts; {_SEPARATE}"
        )
    fall = means[0] - means[-1]
    if fall < _FALL_MIN_MPS:
        raise DataError(
            f"{run.place}: run {run.label} falls by {fall * 3.6:.1f} km/h only; needed: "
            f"{_FALL_MIN_MPS * 3.6:.0f} km/h or more to tell C0, C1 and C2 apart"
        )


def _check_copies(runs: list[Run]) -> None:
    """DataError where two runs are one: they would make the intervals too narrow."""
    for one, other in combinations(runs, 2):
        if len(one.time_s) != len(other.time_s):
            continue
        times = (one.time_s - one.time_s[0]) - (other.time_s - other.time_s[0])
        speeds = one.speed_mps - other.speed_mps
        if np.abs(times).max() < _COPY_S and np.abs(speeds).max() < _COPY_MPS:
            raise DataError(
                f"runs {one.label} ({one.place}) and {other.label} ({other.place}) are the same recording; the "
                "intervals come from how runs differ: give every run once"
            )


def _blocks(run: Run) -> tuple[Array, Array, Array]:
    """Start, mean speed and deceleration of every three seconds of a run."""
    t, v = run.time_s - run.time_s[0], run.speed_mps
    block = (t // _BLOCK_S).astype(int)
    starts, means, falls = [], [], []
    for b in np.unique(block):
        of_b = block == b
        if of_b.sum() < 2:
            continue
        s, u = t[of_b] - t[of_b].mean(), v[of_b]
        starts.append(run.time_s[of_b][0])
        means.append(u.mean())
        falls.append(-(s @ u) / (s @ s))
    if not starts:  # samples further apart than a block
        return run.time_s[:-1], v[:-1], -np.diff(v) / np.diff(t)
    return np.array(starts), np.array(means), np.array(falls)


def _scatter(v: Array, t: Array) -> float:
    """Noise of single samples: how far each is from the line between its neighbours."""
    share = (t[1:-1] - t[:-2]) / (t[2:] - t[:-2])
    off = v[1:-1] - v[:-2] * (1 - share) - v[2:] * share
    return float(_NORMAL_PER_MAD * np.median(np.abs(off)) / np.sqrt(1.5))


def _check_brakes(runs: list[Run]) -> None:
    """DataError where a run slows down far more for a moment than the others do at that speed."""
    from scipy.optimize import least_squares

    blocks = [_blocks(run) for run in runs]
    speed = np.concatenate([means for _, means, _ in blocks])
    fall = np.concatenate([falls for _, _, falls in blocks])
    sign = np.concatenate(
        [np.full(len(m), run.direction) for run, (_, m, _) in zip(runs, blocks, strict=True)]
    )
    columns = np.column_stack([np.ones_like(speed), speed, speed**2, sign, sign * speed])
    first = np.linalg.lstsq(columns, fall)[0]
    robust = least_squares(lambda x: columns @ x - fall, first, loss="cauchy", f_scale=0.02)
    over = fall - columns @ robust.x
    limit = max(_BRAKE_MIN_MPS2, _OUTLIER * _NORMAL_PER_MAD * float(np.median(np.abs(over))))
    if over.max() <= limit:
        return
    k = int(np.argmax(over))
    which = np.searchsorted(np.cumsum([len(m) for _, m, _ in blocks]), k, side="right")
    time = np.concatenate([starts for starts, _, _ in blocks])[k]
    raise DataError(
        f"{runs[which].place}: run {runs[which].label} slows down by {over[k]:.2f} m/s² more than the others at "
        f"t = {time:g} s ({speed[k] * 3.6:.0f} km/h); allowed: {limit:.2f}; brakes, a gear or an obstacle: cut or "
        "delete the run"
    )
