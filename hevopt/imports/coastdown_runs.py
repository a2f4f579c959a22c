"""Coast-down runs from measured tables, with what makes a run useless: rising speed, brakes, gaps in the data.

A new run begins where the run's number or the direction changes, in a new file, and, without such a number, where
the time goes back.
"""

from collections.abc import Mapping, Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from hevopt.errors import DataError
from hevopt.imports.coastdown import Run
from hevopt.imports.measured import Measured, column_named, column_of, in_si, read_measured

Array = NDArray[np.float64]

_ALIASES = {
    "time": {"time", "t", "zeit", "timestamp", "elapsedtime", "testtime", "cyctime", "seconds"},
    "speed": {"speed", "v", "vehiclespeed", "velocity", "vehspeed", "vveh", "gpsspeed", "groundspeed"},
    "run": {"run", "runnumber", "runno", "runid", "test", "testnumber", "coastdown"},
    "direction": {"direction", "dir", "heading", "way"},
}  # fmt: skip
_QUANTITIES = {"time": "time", "speed": "speed"}
ROLES, ROLES_WITH_UNIT = tuple(_ALIASES), tuple(_QUANTITIES)
_SAMPLES_MIN = 10
_FALL_MIN_MPS = 3.0
_BLOCK_S = 3.0
# A rise between blocks, and a deceleration beyond the rest, that no gust or slope of a test track explains.
_RISE_MIN_MPS = 0.3
_BRAKE_MIN_MPS2 = 0.3
_OUTLIER = 8.0
_NORMAL_PER_MAD = 1.4826


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
    labels = _directions(parts, directions)
    runs = [
        Run(str(k + 1), direction, time, speed, place)
        for k, ((time, speed, place, _), direction) in enumerate(zip(parts, labels, strict=True))
    ]
    for run in runs:
        _check_run(run)
    _check_brakes(runs)
    return runs, notes


def _parts(path: Path, columns: Mapping[str, str], units: Mapping[str, str], sheet: str | None):
    measured = read_measured(path, sheet=sheet)
    values, notes = {}, list(measured.notes)
    for role, aliases in _ALIASES.items():
        named = columns.get(role)
        column = (
            column_named(measured, named)
            if named
            else column_of(measured, aliases, f"--column {role}=NAME")
        )
        if column is None and role in _QUANTITIES:
            names = ", ".join(c.name for c in measured.columns)
            raise DataError(
                f"{measured.path}: no column of {role}; name it with --column {role}=NAME; found: {names}"
            )
        if column is None:
            continue
        if role in _QUANTITIES:
            found = in_si(
                measured, column, (_QUANTITIES[role],), f"--unit {role}=UNIT", units.get(role)
            )
            values[role], note = found.values, found.note
        else:
            values[role], note = column.values, f"column {column.name}"
        notes.append(f"{role}: {note}")
        _check_numbers(measured, role, values[role])
    time = values["time"]
    begins = (np.diff(time) < 0) & ("run" not in values)
    for role in ("run", "direction"):
        if role in values:
            begins |= np.diff(values[role]) != 0
    edges = [0, *(np.flatnonzero(begins) + 1), len(time)]
    parts = [
        (
            time[a:b],
            values["speed"][a:b],
            f"{measured.path}, lines {measured.lines[a]} to {measured.lines[b - 1]}",
            values["direction"][a] if "direction" in values else None,
        )
        for a, b in pairwise(edges)
    ]
    return parts, notes


def _check_numbers(measured: Measured, role: str, values: Array) -> None:
    bad = ~np.isfinite(values)
    if role == "speed":
        bad |= values < 0
    if bad.any():
        k = int(np.flatnonzero(bad)[0])
        hint = "; a direction is a number such as 1 and -1" if role == "direction" else ""
        raise DataError(
            f"{measured.path}, line {measured.lines[k]}: {role} is missing, negative or no number ({bad.sum()} "
            f"such rows){hint}; correct or delete the rows"
        )


def _directions(parts: list, given: Sequence[int] | None) -> list[int]:
    """+1 and -1 of every run; +1 is the direction of the first."""
    raw = [direction for *_, direction in parts]
    if given is not None:
        if raw != [None] * len(parts):
            raise DataError(
                "the directions are in a column and in --directions; leave --directions out"
            )
        if len(given) != len(parts):
            raise DataError(
                f"--directions names {len(given)} runs, the files hold {len(parts)}: "
                + "; ".join(place for _, _, place, _ in parts[:6])
            )
        return list(given)
    if None in raw:
        raise DataError(
            f"no column of direction for the {len(parts)} runs found; add one (1 and -1), name it with --column "
            "direction=NAME, or give --directions +,-,+,- in the order of the runs"
        )
    kinds = list(dict.fromkeys(raw))
    if len(kinds) != 2:
        listed = ", ".join(f"{kind:g}" for kind in kinds[:5])
        raise DataError(
            f"{len(kinds)} direction{'s' if len(kinds) > 1 else ''} found ({listed}); needed: runs in two opposite "
            "directions, since slope and wind cancel between them; add runs the other way"
        )
    return [1 if direction == kinds[0] else -1 for direction in raw]


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
            "coast-down only slows down: cut the file to its coasting parts, and mark them with a column run"
        )
    fall = means[0] - means[-1]
    if fall < _FALL_MIN_MPS:
        raise DataError(
            f"{run.place}: run {run.label} falls by {fall * 3.6:.1f} km/h only; needed: "
            f"{_FALL_MIN_MPS * 3.6:.0f} km/h or more to tell C0, C1 and C2 apart"
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
