"""What the engine settles to with full pedal at one speed after another: its own full-load curve."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hevopt.display.facts import Shown
from hevopt.mean_value import states as s
from hevopt.mean_value._run_kernels import observe
from hevopt.mean_value.parameters import Model
from hevopt.mean_value.settle import held, steady_state

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class FullLoad(Shown):
    """Steady full load. speed_radps: (point,); states: (point, state); signals: name -> (point,)"""

    speed_radps: Array
    states: Array
    signals: dict[str, Array]

    def __getitem__(self, name: str) -> Array:
        """(point,) a signal by its name."""
        return self.signals[name]


def full_load(
    model: Model, speed_radps: Array, progress: Callable[[int, int], None] = lambda done, total: None
) -> FullLoad:  # fmt: skip
    """The settled points at some engine speeds; SolverError where there is none."""
    standing, states = held(model), []
    for n, speed in enumerate(speed_radps):
        progress(n, len(speed_radps))
        states.append(steady_state(standing, float(speed)))
    found = np.array(states).reshape(-1, s.SIZE)
    signals = observe(np.zeros(len(found)), found, standing)
    return FullLoad(speed_radps, found, dict(zip(s.SIGNALS, signals.T, strict=True)))
