"""How long a long drive will take, said before it is solved, from pieces of it that are solved first."""

import sys
from collections.abc import Callable
from dataclasses import replace
from time import perf_counter

import numpy as np

from hevopt.driving.cycle import Cycle
from hevopt.errors import HevoptError

_LONG_STEPS = 20_000
_SHORT_PIECE, _LONG_PIECE = 1000, 2000
_WORTH_SAYING_S = 30.0


def say_how_long(drive: Cycle, solve: Callable[[Cycle], object]) -> None:
    """One line on stderr about a drive that will take longer than some tens of seconds.

    What all drives take and what a step takes are told apart by two pieces; both were measured to grow in
    proportion (reports/benchmarks_long.md). Shorter pieces may need dearer proofs than any long drive. A piece that
    cannot be solved leaves the word to the drive itself.
    """
    steps = len(drive.time_s) - 1
    if steps < _LONG_STEPS:
        return
    try:
        solve(piece_of(drive, _SHORT_PIECE))  # compiles, or reads what was compiled
        short_s, long_s = (_seconds(solve, drive, n) for n in (_SHORT_PIECE, _LONG_PIECE))
    except HevoptError:
        return
    step_s = (long_s - short_s) / (_LONG_PIECE - _SHORT_PIECE)
    if step_s <= 0:  # a short piece that was dearer to prove, or a busy machine
        step_s = long_s / _LONG_PIECE
    total_s = long_s + step_s * (steps - _LONG_PIECE)
    if total_s > _WORTH_SAYING_S:
        print(
            f"hevopt: {steps} steps will take about {_in_words(total_s)}, as {_LONG_PIECE} of them take "
            f"{long_s:.1f} s",
            file=sys.stderr,
            flush=True,
        )


def piece_of(drive: Cycle, steps: int) -> Cycle:
    """The piece of that many steps in which the most distance is driven; it begins at a multiple of them."""
    way_m = np.concatenate([[0.0], np.cumsum(np.diff(drive.time_s) * drive.speed_mps[:-1])])
    begins = np.arange(0, len(drive.time_s) - steps, steps)
    begin = int(begins[np.argmax(way_m[begins + steps] - way_m[begins])])
    fields = ("time_s", "speed_mps", "grade", "gear", "clutch_open")
    samples = {name: getattr(drive, name) for name in fields}
    inside = slice(begin, begin + steps + 1)
    return replace(drive, **{n: v[inside] for n, v in samples.items() if v is not None})


def _seconds(solve: Callable[[Cycle], object], drive: Cycle, steps: int) -> float:
    began = perf_counter()
    solve(piece_of(drive, steps))
    return perf_counter() - began


def _in_words(seconds: float) -> str:
    if seconds < 90:
        return f"{10 * round(seconds / 10)} s"
    minutes = round(seconds / 60)
    return f"{minutes} min" if minutes < 120 else f"{seconds / 3600:.1f} h"
