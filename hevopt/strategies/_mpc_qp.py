"""The quadratic program of one preview, solved by OSQP, or by Clarabel where OSQP does not solve it.

Variables for the n steps of the preview, energies in a common unit, e counted from the wanted charge:
    r_t  energy drawn, low_t <= r_t <= knee_t        s_t  brake slack, 0 <= s_t <= slack_t        e_t  after step t
    min  sum [a_t r_t²/2 + b_t r_t] - e_n + g e_n²/2      s. t.   e_t - e_t-1 + r_t + s_t = - (switching)_t
The slack is drawn without saving anything: what the friction brakes take instead of the battery. Every step
has one equality row, and bounds are rows of their own, so that only numbers change from step to step.
The multiplier of row t is the price of stored energy after step t; at the end it is 1 - g e_n.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from hevopt.display.facts import Shown
from hevopt.errors import SolverError
from hevopt.problem.arrays import Array

# A fixed rho and no time limit: the same input gives the same bits. rho adapted on the way fails on standstills.
OSQP_SETTINGS = {
    "verbose": False, "eps_abs": 1e-5, "eps_rel": 1e-5, "max_iter": 4000, "check_termination": 25,
    "adaptive_rho": 0, "rho": 0.1, "polishing": False,
}  # fmt: skip
CLARABEL_SETTINGS = {"verbose": False, "max_iter": 200}


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class PreviewQp(Shown):
    """Numbers of one preview, in units of energy and price. curvature, slope, low, knee, slack: (step,)

    start: charge before the first step; switching: (step,) charge that it takes before each
    bottom, top: (step,) bounds on charge; gain: fall of the terminal price per unit of charge
    """

    curvature: Array
    slope: Array
    low: Array
    knee: Array
    slack: Array
    start: float
    switching: Array
    bottom: Array
    top: Array
    gain: float


class HorizonSolver:
    """Solves one preview after another, each warm-started from the last; counts what Clarabel had to solve."""

    def __init__(self) -> None:
        self.fallbacks = 0
        self._steps = 0
        self._osqp: Any = None
        self._last: tuple[Array, Array] | None = None

    def solve(self, qp: PreviewQp, place: str) -> tuple[Array, Array]:
        """Energy drawn, slack included, and price of stored energy, (step,) each; `place` is for messages."""
        n = len(qp.low)
        answer, osqp_status = self._by_osqp(qp)
        if answer is None:
            self.fallbacks += 1
            answer, clarabel_status = _by_clarabel(qp)
            if answer is None:
                raise SolverError(
                    f"mpc: the preview at {place} was solved neither by OSQP ({osqp_status}) nor by "
                    f"Clarabel ({clarabel_status}); try another --horizon, or use ecms or dp"
                )
        x, y = answer
        self._last = _shifted(x, 3), _shifted(y, 4)
        return x[:n] + x[n : 2 * n], y[:n]

    def _by_osqp(self, qp: PreviewQp) -> tuple[tuple[Array, Array] | None, str]:
        import osqp

        n = len(qp.low)
        diagonal, q, lower, upper = _vectors(qp)
        if n != self._steps:
            self._osqp, self._steps, self._last = osqp.OSQP(), n, None
            quadratic, rows = _matrices(n)
            quadratic.data[:] = diagonal
            self._osqp.setup(quadratic, q, rows, lower, upper, **OSQP_SETTINGS)
        else:
            self._osqp.update(q=q, l=lower, u=upper, Px=diagonal)
        if self._last is not None:
            self._osqp.warm_start(*self._last)
        result = self._osqp.solve(raise_error=False)
        if result.info.status_val != osqp.SolverStatus.OSQP_SOLVED:
            return None, result.info.status
        return (np.array(result.x), np.array(result.y)), result.info.status


def _vectors(qp: PreviewQp) -> tuple[Array, Array, Array, Array]:
    """Diagonal of the quadratic form, linear term, lower and upper ends of the rows."""
    n = len(qp.low)
    none, last = np.zeros(n), np.arange(n) == n - 1
    diagonal = np.concatenate([qp.curvature, none, qp.gain * last])
    q = np.concatenate([qp.slope, none, -1.0 * last])
    balance = np.where(np.arange(n) == 0, qp.start, 0.0) - qp.switching
    lower = np.concatenate([balance, qp.low, none, qp.bottom])
    upper = np.concatenate([balance, qp.knee, qp.slack, qp.top])
    return diagonal, q, lower, upper


def _matrices(n: int) -> tuple[Any, Any]:
    """Quadratic form (3n, 3n), a full diagonal, and rows (4n, 3n): energy balance, then bounds."""
    from scipy import sparse

    unit = sparse.identity(n)
    balance = sparse.hstack([unit, unit, unit - sparse.eye(n, k=-1)])
    rows = sparse.vstack([balance, sparse.identity(3 * n)])
    return sparse.identity(3 * n, format="csc"), sparse.csc_matrix(rows)


def _by_clarabel(qp: PreviewQp) -> tuple[tuple[Array, Array] | None, str]:
    """The same by an interior point; rows without width become equalities, the others two inequalities."""
    import clarabel
    from scipy import sparse

    n = len(qp.low)
    diagonal, q, lower, upper = _vectors(qp)
    _, rows = _matrices(n)
    fixed = np.flatnonzero(lower == upper)
    free = np.flatnonzero(lower < upper)
    stacked = sparse.csc_matrix(sparse.vstack([rows[fixed], rows[free], -rows[free]]))
    ends = np.concatenate([upper[fixed], upper[free], -lower[free]])
    cones = [clarabel.ZeroConeT(len(fixed)), clarabel.NonnegativeConeT(2 * len(free))]
    settings = clarabel.DefaultSettings()
    for name, value in CLARABEL_SETTINGS.items():
        setattr(settings, name, value)
    quadratic = sparse.csc_matrix(sparse.diags(diagonal))
    result = clarabel.DefaultSolver(quadratic, q, stacked, ends, cones, settings).solve()
    if result.status != clarabel.SolverStatus.Solved:
        return None, str(result.status)
    z, y = np.array(result.z), np.zeros(4 * n)
    y[fixed] = z[: len(fixed)]
    y[free] = z[len(fixed) : len(fixed) + len(free)] - z[len(fixed) + len(free) :]
    return (np.array(result.x), y), str(result.status)


def _shifted(values: Array, blocks: int) -> Array:
    """One step on: each block moves up by one and repeats its last number."""
    parts = values.reshape(blocks, -1)
    return np.hstack([parts[:, 1:], parts[:, -1:]]).ravel()
