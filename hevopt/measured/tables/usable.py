"""Values of a column that cannot be what its role says, told by their lines."""

import numpy as np
from numpy.typing import NDArray

from hevopt.errors import DataError
from hevopt.measured.tables.rows import runs
from hevopt.measured.tables.table import Measured


def check_rows(
    measured: Measured,
    role: str,
    found: NDArray[np.float64],
    good: NDArray[np.bool_],
    words: str,
) -> None:
    """DataError with the lines of the values, (row,), that are not good; words: what is allowed."""
    if good.all():
        return
    k = int(np.argmin(good))
    what = f"{role} {found[k]:.4g}" if np.isfinite(found[k]) else f"no {role}"
    raise DataError(
        f"{measured.path}, {runs(list(measured.lines[~good]))}: {what}; allowed: {words}; correct the cells "
        "or delete the rows"
    )
