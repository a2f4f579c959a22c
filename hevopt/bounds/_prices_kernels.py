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
    least = np.full((steps, modes), np.inf)
    entry = np.full((steps, modes), -1, dtype=np.int64)
    for k in range(steps):
        for m in range(modes):
            for i in range(first[k, m], first[k, m + 1]):
                if value[i] < least[k, m]:
                    least[k, m] = value[i]
                    entry[k, m] = i
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
def shortest_path(
    choices: Choices, value: Array, price: Array, start_mode: int
) -> tuple[float, Indices, Array]:
    """Least total of (entry,) values and switching, its (time,) entries, cost-to-go (time + 1, mode).

    price: (time,) of the stored energy that switching takes before each step
    """
    least, entry = block_minima(choices.first, value)
    to_go, follow = mode_path(least, choices.switching, price)
    path = np.zeros(len(least), dtype=np.int64)
    if np.isfinite(to_go[0, start_mode]):
        mode = start_mode
        for k in range(len(least)):
            mode = follow[k, mode]
            path[k] = entry[k, mode]
    return to_go[0, start_mode], path, to_go
