"""Compiled filter of dominated choices; see choices.py."""

import numpy as np

from hevopt._compile import compiled
from hevopt.problem.arrays import Array, Indices


@compiled()
def undominated(first: Indices, cost: Array, power: Array) -> tuple[Indices, Indices]:
    """Entries kept, by rising power within each block, and their new block starts."""
    steps, blocks = first.shape
    kept = np.empty(len(cost), dtype=np.int64)
    new_first = np.empty_like(first)
    count = 0
    for k in range(steps):
        for m in range(blocks - 1):
            new_first[k, m] = count
            low, high = first[k, m], first[k, m + 1]
            order = np.argsort(power[low:high], kind="mergesort")
            best, block_start = np.inf, count
            for o in order:
                i = low + o
                if cost[i] < best:
                    if count > block_start and power[kept[count - 1]] == power[i]:
                        count -= 1
                    kept[count] = i
                    count += 1
                    best = cost[i]
        new_first[k, blocks - 1] = count
    return kept[:count], new_first
