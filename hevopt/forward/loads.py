"""The electric load of a driven car: its cycle's, or its own with the engine at rest and turning."""

import numpy as np

from hevopt.car.architecture import Architecture
from hevopt.driving.cycle import Cycle
from hevopt.forward._acting_kernels import LoopTask
from hevopt.problem.arrays import Array


def loads_w(car: Architecture, cycle: Cycle) -> Array:
    """(2, time) electric load while the engine is at rest and while it turns: the cycle's, or the car's own."""
    if cycle.auxiliary_w is not None:
        return np.array([cycle.auxiliary_w[:-1]] * 2, dtype=np.float64)
    return np.repeat(own_loads_w(car), len(cycle.time_s) - 1, axis=1)


def loads_at(task: LoopTask, time_s: Array) -> Array:
    """(2, step) load at times, the engine at rest and turning; (2, 1) where it does not change."""
    if (task.load_w == task.load_w[:, :1]).all():
        return task.load_w[:, :1]
    k = np.searchsorted(task.time_s, time_s + 1e-9, "right") - 1
    return task.load_w[:, np.minimum(k, task.load_w.shape[1] - 1)]


def own_loads_w(car: Architecture) -> Array:
    """(2, 1) electric load of the car's file while the engine is at rest and while it turns."""
    return np.array([[car.vehicle.load_w(engine_on=on)] for on in (False, True)], dtype=np.float64)
