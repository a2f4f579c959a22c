"""Kinds of arrays by short names; shapes stand in docstrings, units in the names of what holds them."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
Flags = NDArray[np.bool_]
