"""Whether an explicit step is short enough: eigenvalues of the rates, by finite differences.

Beyond its limit Runge-Kutta does not blow up here: clipped restrictions turn growth into a chatter of two steps,
and the run settles, smooth when sampled, to a wrong turbocharger speed. Nothing but the eigenvalues tells.
"""

import numpy as np
from numpy.typing import NDArray

from hevopt.errors import DataError
from hevopt.mean_value import states as s
from hevopt.mean_value._run_kernels import jacobian
from hevopt.mean_value.parameters import Model

Array = NDArray[np.float64]

# Largest h |lambda| that is let through; on the negative axis Runge-Kutta of fourth order is stable up to 2.785.
STEP_LIMIT = 2.2
# Scales of the states behind the volumes.
_SCALES = (1e4, 5e2, 1.0, 1.0, 1e-2, 1.0, 1.0, 1e2, 1e1, 1e3)


def scales(y: Array) -> Array:
    """(dynamic state,) what a change of each state is measured by."""
    found = np.empty(s.DYNAMIC)
    for n in range(5):
        found[3 * n : 3 * n + 3] = y[3 * n], y[3 * n], y[3 * n + 2]
    found[15:] = _SCALES
    return found


def eigenvalues(t: float, y: Array, model: Model) -> NDArray[np.complex128]:
    """Eigenvalues of the rates at a time and state, 1/s, the fastest first."""
    scale = scales(y)
    rates = jacobian(t, y, scale, model) * scale / scale[:, None]
    if not np.isfinite(rates).all():
        return np.full(1, np.inf, dtype=np.complex128)
    found = np.linalg.eigvals(rates).astype(np.complex128)
    return found[np.argsort(-np.abs(found), kind="stable")]


def longest_step_s(t: float, y: Array, model: Model) -> float:
    """The longest step that the guard lets through at a time and state."""
    fastest = float(np.abs(eigenvalues(t, y, model)[0]))
    return STEP_LIMIT / fastest if fastest < np.inf else 0.0


def check_step(t: float, y: Array, model: Model, step_s: float) -> None:
    """DataError where a step is too long for the fastest of the states."""
    longest = longest_step_s(t, y, model)
    if step_s > longest:
        raise DataError(
            f"step {1e3 * step_s:g} ms at t = {t:.3g} s is too long: gas, clutch or actuators need "
            f"{1e3 * longest:.3g} ms or less there, and beyond it the run would settle to a wrong turbocharger "
            "speed without a sign; give a shorter step, or the integrator lsoda, which chooses its own"
        )
