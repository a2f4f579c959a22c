"""Values that lie close together as one: what a test bench was to hold and missed by a little."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# Share of the largest value by which two are the same but for rounding.
_SAME = 1e-6


def clusters(values: Array, apart: float, share: float) -> tuple[NDArray[np.int64], Array]:
    """Number of each value's cluster, and the clusters' means, rising.

    Neighbours are of one cluster up to a distance `apart`, or a share of the value; rounding is none.
    """
    order = np.argsort(values, kind="stable")
    ordered, rounding = values[order], _SAME * np.abs(values).max()
    reach = np.maximum(np.maximum(apart, share * np.abs(ordered)), rounding)
    cluster = np.empty(len(values), dtype=np.int64)
    cluster[order] = np.cumsum(np.concatenate([[False], np.diff(ordered) > reach[1:]]))
    return cluster, np.bincount(cluster, values) / np.bincount(cluster)
