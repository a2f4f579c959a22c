"""What makes coast-down runs useless: rising speed, brakes, too few samples, the same run twice."""

from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from hevopt.errors import DataError
from hevopt.measured.coastdown.fit import Run

Array = NDArray[np.float64]

_SAMPLES_MIN = 10
_FALL_MIN_MPS = 3.0
_BLOCK_S = 3.0
# A rise between blocks, and a deceleration beyond the rest, that no gust or slope of a test track explains.
_RISE_MIN_MPS = 0.3
_BRAKE_MIN_MPS2 = 0.3
_OUTLIER = 8.0
_NORMAL_PER_MAD = 1.4826
# No two measured runs agree so closely in every sample; a copy written with fewer digits does.
_COPY_S, _COPY_MPS = 1e-3, 1e-3


def check_runs(runs: list[Run], separate: str) -> None:
    """DataError where a run or two of them are useless; separate: how runs are told apart, for messages."""
    for run in runs:
        _check_run(run, separate)
    _check_copies(runs)
    _check_brakes(runs)


def _check_run(run: Run, separate: str) -> None:
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
            f"coast-down only slows down: cut the file to its coasting parts; {separate}"
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
