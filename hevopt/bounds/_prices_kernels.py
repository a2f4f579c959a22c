"""Compiled shortest path over modes; see prices.py."""

import numpy as np

from hevopt._compile import compiled
from hevopt.problem.arrays import Array, Indices
from hevopt.problem.choices import Choices
from hevopt.problem.switching import Switching


@compiled()
def block_minima(first: Indices, value: Array) -> tuple[Array, Indices]:
    """(time, mode) least value of each block and its entry; inf and -1 where the block is empty."""
    steps, modes = first.shape[0], first.shape[1] - 1
    least, entry = np.empty((steps, modes)), np.empty((steps, modes), dtype=np.int64)
    for k in range(steps):
        for m in range(modes):
            best, best_entry = np.inf, -1
            for i in range(first[k, m], first[k, m + 1]):
                if value[i] < best:
                    best, best_entry = value[i], i
            least[k, m], entry[k, m] = best, best_entry
    return least, entry


@compiled()
def priced_minima(choices: Choices, worth: Array, price: Array) -> tuple[Array, Indices]:
    """As `block_minima`, of the choices' costs and (entry,) worths at a (time,) price."""
    first, cost = choices.first, choices.cost_kg
    steps, modes = first.shape[0], first.shape[1] - 1
    least, entry = np.empty((steps, modes)), np.empty((steps, modes), dtype=np.int64)
    for k in range(steps):
        for m in range(modes):
            best, best_entry = np.inf, -1
            for i in range(first[k, m], first[k, m + 1]):
                value = cost[i] + price[k] * worth[i]
                if value < best:
                    best, best_entry = value, i
            least[k, m], entry[k, m] = best, best_entry
    return least, entry


@compiled()
def mode_path(least: Array, switching: Switching, price: Array) -> tuple[Array, Indices]:
    """Cost-to-go (time + 1, mode) and best next mode (time, mode) of (time, mode) least values.

    price: (time,) of the stored energy that switching takes before each step
    """
    case, switch_kg, switch_j, allowed = switching
    steps, modes = least.shape
    to_go = np.zeros((steps + 1, modes))
    follow = np.zeros((steps, modes), dtype=np.int64)
    for k in range(steps - 1, -1, -1):
        c = case[k]
        for m in range(modes):
            best = np.inf
            for n in range(modes):
                if allowed[c, m, n]:
                    taken_kg = switch_kg[c, m, n] + price[k] * switch_j[c, m, n]
                    total = taken_kg + least[k, n] + to_go[k + 1, n]
                    if total < best:
                        best = total
                        follow[k, m] = n
            to_go[k, m] = best
    return to_go, follow


@compiled()
def _followed(
    least: Array, entry: Indices, switching: Switching, price: Array, start_mode: int
) -> tuple[float, Indices, Array]:
    """The shortest path over the least values of blocks, as `shortest_path` tells it."""
    to_go, follow = mode_path(least, switching, price)
    path = np.zeros(len(least), dtype=np.int64)
    if np.isfinite(to_go[0, start_mode]):
        mode = start_mode
        for k in range(len(least)):
            mode = follow[k, mode]
            path[k] = entry[k, mode]
    return to_go[0, start_mode], path, to_go


@compiled()
def shortest_path(
    choices: Choices, value: Array, price: Array, start_mode: int
) -> tuple[float, Indices, Array]:
    """Least total of (entry,) values and switching, its (time,) entries, cost-to-go (time + 1, mode).

    price: (time,) of the stored energy that switching takes before each step
    """
    least, entry = block_minima(choices.first, value)
    return _followed(least, entry, choices.switching, price, start_mode)


@compiled()
def priced_path(
    choices: Choices, worth: Array, price: Array, before: Array, start_mode: int
) -> tuple[float, Indices, Array]:
    """As `shortest_path`, of the choices' costs and (entry,) worths at a (time,) price, without an array of their
    sums. before: (time,) price of the stored energy that switching takes before each step
    """
    least, entry = priced_minima(choices, worth, price)
    return _followed(least, entry, choices.switching, before, start_mode)
