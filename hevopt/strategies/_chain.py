"""Demand as a Markov chain over classes of speed and wheel power, counted from cycles: see sdp.py."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hevopt.display.facts import Shown
from hevopt.problem.arrays import Array, Indices
from hevopt.problem.table import Signals

SPEED_BIN_MPS = 5.0
POWER_BIN_W = 6000.0
ROWS_PER_CLASS = 3
# Visits that every class is taken to have had, spread as all classes are.
_SMOOTHING = 0.5


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Chain(Shown):
    """Demand as a Markov chain.

    speed_mps, power_w: (class,) centres; class 0 is standing
    transition: (class, class) [from, to]; rows: (row,) steps of the joined training that stand for classes
    row_class: (row,); row_share: (row,) weight of each within its class
    """

    speed_mps: Array
    power_w: Array
    transition: Array
    rows: Indices
    row_class: Indices
    row_share: Array


def chain_of(signals: Sequence[Signals]) -> Chain:
    """The chain of one or more cycles, each read from its start to its end and round again."""
    speed = np.concatenate([s.speed_mps for s in signals])
    power = np.concatenate([s.wheel_power_w for s in signals])
    bins = np.stack([np.floor(speed / SPEED_BIN_MPS), np.round(power / POWER_BIN_W)])
    bins = np.where(speed > 0, bins, -1.0e6)
    _, member = np.unique(bins, axis=1, return_inverse=True)
    member = member.ravel()
    count = np.bincount(member)
    speed_mps, power_w = (np.bincount(member, weights=values) / count for values in (speed, power))
    following = np.concatenate(
        [
            np.roll(part, -1)
            for part in np.split(member, np.cumsum([len(s.speed_mps) for s in signals])[:-1])
        ]
    )
    visits = np.zeros((len(count), len(count)))
    np.add.at(visits, (member, following), 1.0)
    visits += _SMOOTHING * count / count.sum()
    rows, row_class = _representatives(member, power)
    share = 1.0 / np.bincount(row_class)[row_class]
    transition = visits / visits.sum(axis=1, keepdims=True)
    return Chain(speed_mps, power_w, transition, rows, row_class, share)


def classes_of(chain: Chain, signals: Signals) -> Indices:
    """(time,) class of each step: standing, or the nearest centre in bins of speed and power."""
    away = ((signals.speed_mps[:, None] - chain.speed_mps) / SPEED_BIN_MPS) ** 2
    away += ((signals.wheel_power_w[:, None] - chain.power_w) / POWER_BIN_W) ** 2
    moving = signals.speed_mps > 0
    away[np.not_equal.outer(moving, chain.speed_mps > 0)] += 1e6
    nearest: Indices = np.argmin(away, axis=1)
    return nearest


def _representatives(member: Indices, power_w: Array) -> tuple[Indices, Indices]:
    """Rows that stand for each class, at even quantiles of its wheel power, and their classes."""
    rows = []
    for z in range(member.max() + 1):
        inside = np.flatnonzero(member == z)
        inside = inside[np.argsort(power_w[inside], kind="stable")]
        wanted = (np.arange(ROWS_PER_CLASS) + 0.5) / ROWS_PER_CLASS * len(inside)
        rows.append(np.unique(inside[wanted.astype(np.int64)]))
    return np.concatenate(rows), np.repeat(np.arange(len(rows)), [len(r) for r in rows])
