"""Arrays that nobody can change: their memory is a bytes object, which no view and no flag opens again.

An array that is only marked as read-only is not enough: a view taken before still writes to it.
"""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

from hevopt.errors import DataError


def frozen(name: str, values: ArrayLike, dtype: DTypeLike = np.float64) -> NDArray[Any]:
    """A copy of the values that cannot be changed; the array itself where it is one already.

    Raises DataError, naming what the values are, where they are no numbers or the type cannot hold them.
    """
    wanted = np.dtype(dtype)
    if isinstance(values, np.ndarray) and values.dtype == wanted and _is_frozen(values):
        return values
    try:
        given = np.asarray(values)
    except ValueError:
        raise DataError(
            f"{name} must be an array of numbers; found rows of unequal length"
        ) from None
    if given.dtype.kind not in "biuf":
        raise DataError(f"{name} must hold numbers; found values of type {given.dtype}")
    with np.errstate(invalid="ignore", over="ignore"):
        held = given.astype(wanted, order="C", copy=False)
        lost = None if wanted.kind in "fb" else given[held != given]
    if lost is not None and lost.size:
        raise DataError(
            f"{name} holds {lost.flat[0]}; allowed: whole numbers from {np.iinfo(wanted).min} to "
            f"{np.iinfo(wanted).max}"
        )
    return np.frombuffer(held.tobytes(), wanted).reshape(held.shape)


def _is_frozen(array: NDArray[Any]) -> bool:
    base = array.base
    return array.flags.c_contiguous and isinstance(
        base.base if type(base) is np.ndarray else base, bytes
    )
