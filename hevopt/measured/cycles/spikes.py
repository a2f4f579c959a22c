"""Speeds that tyres could not bring about: single wild samples, and dropouts of several.

Friction of tyres on a dry road bounds how fast a speed changes. What the sensor adds to it must not be called a
spike: the smallest step it writes (up to 1 mph), a value that it holds for a while, noise from sample to sample. So

1. a single sample is wild where it is off the line between its neighbours by more than tyres bring about in the
   longer of the two steps, two of the sensor's steps and ten times the noise of such deviations, while its
   neighbours agree;
2. two others agree where their difference needs no more than that friction over the time between them, at least
   0.5 s, and one of the sensor's steps. Between samples that do not agree the drive falls into pieces; kept are
   those which follow each other in agreement and hold the most samples, so that a dropout is left out as a whole.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hevopt.units import KMH_PER_MPS, STANDARD_GRAVITY_MPS2

Array = NDArray[np.float64]
Rows = NDArray[np.int64]

TYRE_FRICTION = 1.0
ACCELERATION_MAX_MPS2 = TYRE_FRICTION * STANDARD_GRAVITY_MPS2
_BASE_S = 0.5
_RESOLUTION_MAX_MPS = 1.0001 * 0.44704
_WILD_NOISE = 10.0
_NORMAL_PER_MAD = 1.4826
# Pieces before one that are searched for its forerunner: all of a log with few faults, less of a hopeless one.
_SEARCHED = 1_000_000


@dataclass(frozen=True, slots=True)
class Spike:
    """A row to be left out, with the jump that condemns it: between a row (itself, or its piece's end) and another.

    first, last: rows of its piece
    """

    row: int
    first: int
    last: int
    edge: int
    other: int


def spikes(time_s: Array, speed_mps: Array, rows: Rows) -> list[Spike]:
    """Spikes among some rows, in their order."""
    resolution = _resolution(speed_mps[rows])
    wild = _wild(time_s[rows], speed_mps[rows], resolution)
    found = [
        Spike(
            row, row, row, row, max(sides, key=lambda side: _demand(time_s, speed_mps, row, side))
        )
        for row, *sides in zip(*(rows[wild + k].tolist() for k in (0, -1, 1)), strict=True)
    ]
    rows = np.delete(rows, wild)
    found += _dropouts(time_s, speed_mps, rows, resolution)
    return sorted(found, key=lambda spike: spike.row)


def _resolution(speed_mps: Array) -> float:
    """The sensor's smallest step, 0 where it is no more than the drive's own changes."""
    changes = np.abs(np.diff(speed_mps))
    smallest = float(min(changes[changes > 0], default=0.0))
    return (smallest if smallest <= _RESOLUTION_MAX_MPS else 0.0) + 1e-9


def _wild(time_s: Array, speed_mps: Array, resolution: float) -> Rows:
    """Places of single samples far off both neighbours, which agree with each other."""
    if len(time_s) < 3:
        return np.zeros(0, dtype=np.int64)
    before_s, after_s = time_s[1:-1] - time_s[:-2], time_s[2:] - time_s[1:-1]
    low, middle, high = speed_mps[:-2], speed_mps[1:-1], speed_mps[2:]
    off = np.abs(middle - (low * after_s + high * before_s) / (before_s + after_s))
    moving = np.maximum(np.maximum(low, middle), high) > 0
    noise = _NORMAL_PER_MAD * float(np.median(off[moving])) if moving.any() else 0.0
    slack = 2 * resolution + _WILD_NOISE * noise
    agree = np.abs(high - low) <= ACCELERATION_MAX_MPS2 * (before_s + after_s) + slack
    wild = agree & (off > ACCELERATION_MAX_MPS2 * np.maximum(before_s, after_s) + slack)
    # Of wild neighbours the one further off goes first, as the other may only look wild beside it.
    worst = np.r_[True, off[1:] > off[:-1]] & np.r_[off[:-1] >= off[1:], True]
    return np.flatnonzero(wild & worst) + 1


def _dropouts(time_s: Array, speed_mps: Array, rows: Rows, resolution: float) -> list[Spike]:
    times, speeds = time_s[rows], speed_mps[rows]
    breaks = np.flatnonzero(np.abs(np.diff(speeds)) > _reach(np.diff(times)) + resolution) + 1
    if not len(breaks):
        return []
    first, last = np.r_[0, breaks], np.r_[breaks, len(rows)] - 1
    kept = _best_series(times, speeds, first, last, resolution)
    found, good = [], np.flatnonzero(kept)
    for k in np.flatnonzero(~kept):
        place = int(np.searchsorted(good, k))
        jumps = [(first[k], last[before]) for before in good[max(place - 1, 0) : place]]
        jumps += [(last[k], first[after]) for after in good[place : place + 1]]
        edge, other = max(jumps, key=lambda jump: _demand(times, speeds, *jump))
        ends = rows[first[k]], rows[last[k]], rows[edge], rows[other]
        found += [Spike(row, *map(int, ends)) for row in rows[first[k] : last[k] + 1].tolist()]
    return found


def _reach(step_s: Array) -> Array:
    return ACCELERATION_MAX_MPS2 * np.maximum(step_s, _BASE_S)


def _demand(times: Array, speeds: Array, edge: int, other: int) -> float:
    return abs(speeds[edge] - speeds[other]) / max(abs(times[edge] - times[other]), _BASE_S)


def _best_series(
    times: Array, speeds: Array, first: Rows, last: Rows, resolution: float
) -> NDArray[np.bool_]:
    """(piece,) pieces that follow each other in agreement and hold the most samples, of equal ones the first."""
    sizes = (last - first + 1).tolist()
    begin_s, begin_mps = times[first].tolist(), speeds[first].tolist()
    end_s, end_mps = times[last].tolist(), speeds[last].tolist()
    count = len(sizes)
    searched = max(2, _SEARCHED // count)
    held, before, most = [0] * count, [-1] * count, [0] * count
    for k in range(count):
        best, place = 0, -1
        for j in range(k - 1, max(k - 1 - searched, -1), -1):
            if most[j] <= best:
                break
            reach = ACCELERATION_MAX_MPS2 * max(begin_s[k] - end_s[j], _BASE_S) + resolution
            if held[j] > best and abs(begin_mps[k] - end_mps[j]) <= reach:
                best, place = held[j], j
        held[k], before[k] = best + sizes[k], place
        most[k] = max(held[k], most[k - 1] if k else 0)
    kept = np.zeros(count, dtype=bool)
    k = held.index(most[-1])
    while k >= 0:
        kept[k] = True
        k = before[k]
    return kept


def text_of(spike: Spike, time_s: Array, speed_mps: Array, lines: Rows) -> tuple[str, tuple]:
    """What a fault says of a spike, and what it is filled with; the jump of a piece stands in its first line."""
    if spike.row != spike.first:
        values = (speed_mps[spike.row] * KMH_PER_MPS, lines[spike.first])
        return "speed {:.4g} km/h is off as line {} is", values
    edge, other = spike.edge, spike.other
    step_s = abs(time_s[edge] - time_s[other])
    change_mps2 = abs(speed_mps[edge] - speed_mps[other]) / step_s
    text = (
        "speed {:.4g} km/h against {:.4g} km/h of line {}, {:.4g} s apart: {:.3g} m/s², more than tyres hold "
        "({:.2f} m/s²)"
    )
    filled = (
        speed_mps[edge] * KMH_PER_MPS, speed_mps[other] * KMH_PER_MPS, lines[other], step_s, change_mps2,
        ACCELERATION_MAX_MPS2,
    )  # fmt: skip
    if spike.first == spike.last:
        return text, filled
    piece = (speed_mps[spike.row] * KMH_PER_MPS, lines[spike.first], lines[spike.last], lines[edge])
    return "speed {:.4g} km/h, in lines {} to {} that are off as a whole; line {}: " + text, (
        *piece,
        *filled,
    )
