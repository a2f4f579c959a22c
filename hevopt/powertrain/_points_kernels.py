"""The operating point nearest to where a car is: compiled."""

import numpy as np
from numpy.typing import NDArray

from hevopt._compile import compiled

Array = NDArray[np.float64]


@compiled(bare=True)
def nearest(first: Array, second: Array, at: tuple[float, float], cell: tuple[float, float]) -> int:
    """Number of the point, the first of several, whose coordinates are nearest to a place, by lengths of a cell."""
    found, least = 0, np.inf
    for i in range(len(first)):
        across, along = (first[i] - at[0]) / cell[0], (second[i] - at[1]) / cell[1]
        away = across * across + along * along
        if away < least:
            found, least = i, away
    return found
