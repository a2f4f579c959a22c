"""Compiled filter of points that another of the same step beats; see packing.py."""

import numpy as np

from hevopt._compile import compiled
from hevopt.problem.arrays import Array, Flags, Indices


@compiled()
def unbeaten(first: Indices, power: Array, fuel: Array, nox: Array) -> Flags:
    """(point,) whether no other point of its block has no more power, fuel and NOx, and less of one of them.

    first: (block + 1,) starts of the blocks. Of equal points the first is kept.
    """
    keep = np.zeros(len(power), dtype=np.bool_)
    chosen = np.empty(len(power), dtype=np.int64)
    for k in range(len(first) - 1):
        low, high = first[k], first[k + 1]
        order = np.argsort(power[low:high], kind="mergesort")
        count = 0
        for o in order:
            i = low + o
            beaten = False
            # From the last kept backwards: it is the likeliest to be better.
            for c in range(count - 1, -1, -1):
                j = chosen[c]
                if fuel[j] <= fuel[i] and nox[j] <= nox[i]:
                    beaten = True
                    break
            if beaten:
                continue
            # Points of the same power that came before may be beaten by this one.
            left = count
            while left > 0 and power[chosen[left - 1]] == power[i]:
                left -= 1
            write = left
            for c in range(left, count):
                j = chosen[c]
                if not (fuel[i] <= fuel[j] and nox[i] <= nox[j]):
                    chosen[write] = j
                    write += 1
            chosen[write] = i
            count = write + 1
        for c in range(count):
            keep[chosen[c]] = True
    return keep
