"""A manoeuvre in time: fixed-step Runge-Kutta under the eye of the guard, or LSODA with its own step."""

from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from hevopt.display.facts import Shown
from hevopt.errors import DataError, SolverError
from hevopt.mean_value import states as s
from hevopt.mean_value._run_kernels import TABLEAUX, march, observe, rates
from hevopt.mean_value.parameters import Model
from hevopt.mean_value.stability import check_step

Array = NDArray[np.float64]
Integrator = Literal["rk4", "lsoda"]

STEP_S, SAMPLE_S = 0.25e-3, 5e-3
LSODA_TOLERANCE = 1e-8
_GUARD_EVERY_S = 1.0
_LEAST_STEP_S = 1e-6


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Run(Shown):
    """States over time. time_s: (sample,); states: (sample, state), see states.py; signals: name -> (sample,)"""

    model: Model
    time_s: Array
    states: Array
    signals: dict[str, Array]

    def __getitem__(self, name: str) -> Array:
        """(sample,) a signal by its name."""
        return self.signals[name]


def simulate(
    model: Model, y: Array, duration_s: float, *, step_s: float = STEP_S, integrator: Integrator = "rk4"
) -> Run:  # fmt: skip
    """The run from a state at time 0, sampled every 5 ms; DataError where the step is too long for a fixed one."""
    samples = max(round(duration_s / SAMPLE_S), 1)
    time_s = SAMPLE_S * np.arange(samples + 1, dtype=np.float64)
    states = (
        _lsoda(model, y, time_s) if integrator == "lsoda" else _fixed(model, y, samples, step_s)
    )
    if not np.isfinite(states).all():
        k = int(np.argmax(~np.isfinite(states).all(axis=1)))
        raise SolverError(
            f"the run has no value any more at t = {time_s[k]:.3g} s; give a shorter step than {1e3 * step_s:g} ms"
        )
    return Run(
        model, time_s, states, dict(zip(s.SIGNALS, observe(time_s, states, model).T, strict=True))
    )


def _fixed(model: Model, y: Array, samples: int, step_s: float) -> Array:
    steps = round(SAMPLE_S / step_s) if step_s >= _LEAST_STEP_S else 0
    if steps < 1 or abs(steps * step_s - SAMPLE_S) > 1e-9 * SAMPLE_S:
        raise DataError(
            f"step {1e3 * step_s:g} ms; allowed: {1e3 * SAMPLE_S:g} ms divided by a whole number, such as 0.25, "
            "0.2 or 0.1"
        )
    found, chunk = [y[None]], round(_GUARD_EVERY_S / SAMPLE_S)
    for first in range(0, samples, chunk):
        check_step(first * SAMPLE_S, found[-1][-1], model, step_s)
        count = min(chunk, samples - first)
        found.append(
            march(first * SAMPLE_S, found[-1][-1], step_s, count, steps, *TABLEAUX[4], model)[1:]
        )
    return np.concatenate(found)


def _lsoda(model: Model, y: Array, time_s: Array) -> Array:
    """States by LSODA, begun afresh where the pedal's ramp ends."""
    from scipy.integrate import solve_ivp

    rate = model.drive.pedal_rate_ps
    kink = (1.0 - y[s.PEDAL]) / rate if rate > 0 else np.inf
    edges = [time_s[0], *([kink] if time_s[0] < kink < time_s[-1] else []), time_s[-1]]
    parts, start = [], y
    for low, high in pairwise(edges):
        inside = time_s[(time_s >= low) & (time_s < high)]
        found = solve_ivp(
            lambda t, state: rates(t, state, model), (low, high), start, "LSODA", np.append(inside, high),
            rtol=LSODA_TOLERANCE, atol=LSODA_TOLERANCE * _tolerances(y), max_step=0.05,
        )  # fmt: skip
        if not found.success:
            raise SolverError(f"LSODA stopped at t = {found.t[-1]:.3g} s: {found.message}")
        parts.append(found.y[:, :-1])
        start = found.y[:, -1]
    return np.concatenate([*parts, start[:, None]], axis=1).T


def _tolerances(y: Array) -> Array:
    """(state,) sizes of the states, by which absolute tolerances are measured."""
    from hevopt.mean_value.stability import scales

    return np.concatenate([scales(y), np.full(s.SIZE - s.DYNAMIC, 1e3)])
