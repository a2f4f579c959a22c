"""Kinds of arrays by short names; shapes stand in docstrings, units in the names of what holds them."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
Flags = NDArray[np.bool_]


def rising(*values: Array | Sequence[float]) -> Array:
    """(value,) every value, once, rising; `unique` loads numpy's masked arrays first, which takes longer."""
    every = np.sort(np.concatenate(values))
    new = np.ones(len(every), dtype=bool)
    new[1:] = every[1:] != every[:-1]
    found: Array = every[new]
    return found
