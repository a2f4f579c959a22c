"""Compiled lower convex hulls; see _convex_model.py."""

import numpy as np

from hevopt._compile import compiled
from hevopt.problem.arrays import Array, Indices


@compiled()
def lower_hulls(first: Indices, cost: Array, power: Array) -> tuple[Indices, Indices]:
    """Entries on the lower convex hull of cost over power, block by block, and their new block starts.

    Within a block power rises and cost falls (`without_dominated`); blocks are joined to (time, mode + 1).
    """
    steps, columns = first.shape
    kept = np.empty(len(cost), dtype=np.int64)
    new_first = np.empty_like(first)
    count = 0
    for k in range(steps):
        for m in range(columns - 1):
            new_first[k, m] = count
            start = count
            for i in range(first[k, m], first[k, m + 1]):
                while count - start >= 2:
                    a, b = kept[count - 2], kept[count - 1]
                    above = (cost[b] - cost[a]) * (power[i] - power[a])
                    if above < (cost[i] - cost[a]) * (power[b] - power[a]):
                        break
                    count -= 1
                kept[count] = i
                count += 1
        new_first[k, columns - 1] = count
    return kept[:count], new_first
