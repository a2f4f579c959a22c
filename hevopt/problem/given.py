"""What `ControlTable.from_arrays` makes of what may be left out: lengths of steps, and modes without switching."""

import numpy as np

from hevopt.errors import DataError
from hevopt.problem.arrays import Array, Indices
from hevopt.problem.frozen import frozen

MODES_MAX = 1000


def one_per_step(step_s: float | Array, shape: tuple[int, ...]) -> Array:
    """(time,) lengths of steps, from one number or one per step; DataError for another shape."""
    steps = frozen("step_s", step_s)
    if steps.shape not in ((), (1,), shape):
        raise DataError(
            f"step_s has shape {steps.shape}; allowed: one number, or one per step, {shape}"
        )
    return np.broadcast_to(steps, shape)


def no_switching(modes: Indices) -> Array:
    """(mode, mode) of 0 for every mode that stands in the list."""
    highest = int(modes.max(initial=0))
    if not 0 <= highest < MODES_MAX:
        raise DataError(f"mode runs to {highest}; allowed: 0 to {MODES_MAX - 1}")
    return np.zeros((highest + 1, highest + 1))
