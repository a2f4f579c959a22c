"""The best bound over a box that a bundle of planes gives: convex combinations of them, by a small linear program.

Planes of several thetas and prices, mixed by weights that add up to 1, lie below the cost under the mixed prices. A
path over the modes is then a sum of planes, and the least over all paths is concave in theta: over a box it is
least at a corner. The weights are raised by cutting planes, a cut being a path at a corner; each bound is
evaluated afresh.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hevopt.display.facts import Shown
from hevopt.problem.arrays import Array, Flags, Indices
from hevopt.sizing.proof.entries import BATTERY, ENGINE, MACHINE, Box, OneBattery, Prices
from hevopt.sizing.proof.laws import Laws

_ROUNDS = 40
_CLOSE = 2e-6
# Share taken off: torques may pass their limits by 1e-5 Nm, powers by 1e-6 W, and sums are rounded.
_ROUNDING = 1e-6


@dataclass(slots=True, eq=False, repr=False)
class Planes(Shown):
    """Planes under prices.

    entries: (entry, time, 4), the last with the engine at rest; switch: (time, mode, mode, 4) what switching costs
    end: (4,) the ends of the stored energy
    """

    entries: Array
    switch: Array
    end: Array
    scale: float


def planes_of(laws: Laws, cell: OneBattery, entries: Array, prices: Prices, scale: float) -> Planes:
    """Planes with what switching costs and the ends of the stored energy under the same prices."""
    kg, joule = laws.switch_kg, laws.switch_j
    by = kg + prices.before[None, :, None, None] * joule
    switch = np.zeros((*kg.shape[1:], 4))
    switch[..., ENGINE], switch[..., MACHINE] = by[0], by[1]
    end = np.zeros(4)
    end[BATTERY] = prices.after[-1] * cell.end_j - prices.after[0] * cell.start_j
    return Planes(entries, switch, end, scale)


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Found(Shown):
    """A bound over a box, its weights, and the mixture of corners that keeps it down, (3,)."""

    bound_kg: float
    weights: Array
    theta: Array


def best_bound(bundle: Sequence[Planes], box: Box, barred: Flags) -> Found:
    """The highest bound over a box that weights of a bundle give, within a share of 2e-6."""
    corners = box.corners
    weights = np.full(len(bundle), 1 / len(bundle))
    best, chosen, theta = -np.inf, weights, box.middle
    cuts: list[Array] = []
    at: list[Array] = []
    for _ in range(_ROUNDS):
        values, paths = _paths(bundle, weights, corners, barred)
        if values.min() > best:
            best, chosen = float(values.min()), weights
        for n in range(len(corners)):
            cuts.append(_cut(bundle, paths[n], corners[n]))
            at.append(corners[n, 1:])
        top, weights, share = _master(np.array(cuts))
        theta = share @ np.array(at)
        if top - best <= _CLOSE * abs(top):
            break
    return Found(best - _ROUNDING * abs(best), chosen, theta)


def _master(cuts: Array) -> tuple[float, Array, Array]:
    """Weights whose least cut is highest, that value, and the cuts' own weights."""
    from scipy.optimize import linprog

    count = cuts.shape[1]
    unit = float(np.abs(cuts).max()) or 1.0
    rows = np.column_stack([-cuts / unit, np.ones(len(cuts))])
    found = linprog(
        np.append(np.zeros(count), -1.0), A_ub=rows, b_ub=np.zeros(len(cuts)),
        A_eq=np.append(np.ones(count), 0.0)[None, :], b_eq=[1.0],
        bounds=[*([(0.0, 1.0)] * count), (None, None)], method="highs",
    )  # fmt: skip
    if found.status != 0:
        return np.inf, np.full(count, 1 / count), np.full(len(cuts), 1 / len(cuts))
    share = np.maximum(-found.ineqlin.marginals, 0.0)
    # Weights that add up to 1 by themselves, whatever the program's tolerance.
    weights = np.maximum(found.x[:-1], 0.0)
    return -found.fun * unit, weights / weights.sum(), share / max(share.sum(), 1e-300)


def _paths(
    bundle: Sequence[Planes], weights: Array, corners: Array, barred: Flags
) -> tuple[Array, Indices]:
    """(corner,) least total of the mixed planes, and (corner, time) the entries of its path."""
    used = [(w, planes) for w, planes in zip(weights, bundle, strict=True) if w > 0]
    entries = sum((w * planes.entries for w, planes in used), np.zeros_like(bundle[0].entries))
    switch = sum((w * planes.switch for w, planes in used), np.zeros_like(bundle[0].switch))
    end = sum((w * planes.end for w, planes in used), np.zeros(4))
    value = np.where(barred[:, :, None], np.inf, entries @ corners.T)
    taken = switch @ corners.T
    on = np.argmin(value[:-1], axis=0)
    least = np.array([np.min(value[:-1], axis=0), value[-1]])
    steps, count = least.shape[1], len(corners)
    to_go = np.zeros((2, count))
    follow = np.zeros((steps, 2, count), dtype=np.int64)
    for k in range(steps - 1, -1, -1):
        total = taken[k] + (least[:, k] + to_go)[None]
        follow[k] = total[:, 1] < total[:, 0]
        to_go = total.min(axis=1)
    path = np.zeros((count, steps), dtype=np.int64)
    mode, each = np.zeros(count, dtype=np.int64), np.arange(count)
    for k in range(steps):
        mode = follow[k, mode, each]
        path[:, k] = np.where(mode == 1, len(value) - 1, on[k])
    return to_go[0] + corners @ end, path


def _cut(bundle: Sequence[Planes], path: Indices, corner: Array) -> Array:
    """(planes,) what the path costs at a corner by each of the bundle."""
    steps = np.arange(len(path))
    mode = (path == len(bundle[0].entries) - 1).astype(np.int64)
    before = np.concatenate([[0], mode[:-1]])
    return np.array([
        (one.entries[path, steps].sum(axis=0) + one.switch[steps, before, mode].sum(axis=0) + one.end) @ corner
        for one in bundle
    ])  # fmt: skip
