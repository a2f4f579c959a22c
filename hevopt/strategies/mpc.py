"""Receding-horizon control: at every step a quadratic program over a preview of the cycle, and its first control.

The strategy knows the preview (20 s of the table by default), the past, and the stored energy E. Of what comes
after the preview it knows nothing: its decisions depend neither on that nor on where the cycle ends. At step k:

1.  Terminal price. A joule at the end of the preview is worth p_k [1 - GAIN x], where x is the charge there above
    the wanted, as a share of the SOC window: feedback, and the price of a terminal cost quadratic in x. p_k is the
    multiplier of the dual of what was seen so far, preview included: at that price it would have been neutral.
    Wanted is the asked end charge less what braking from the speed at the preview's end returns (_mpc_model.py).
2.  Modes. Shortest paths over modes through the preview, switching costs exact, one under the last QP's terminal
    price and some under prices around the present one; of these the path of least cost, terminal cost included.
    A single price would start and stop the engine at every crossing.
3.  Powers. Along that path the cost of a step is a convex parabola in the drained energy, fitted to the hull of the
    mode's controls. A QP splits the energy over the preview (_mpc_qp.py): OSQP, warm-started; Clarabel where
    OSQP does not solve it, and counted. Any other status is an error.
4.  Control. Of the planned mode, the one of least cost + price of the drained energy + the parabola's penalty on
    the distance from the QP's energy, among those from which the window can be kept to the end of the preview.

Neutrality comes from the feedback alone: the end charge is near the asked one, not at it.
"""

import numpy as np

from hevopt.errors import DataError, InfeasibleError
from hevopt.problem.arrays import Array, Indices
from hevopt.problem.choices import Choices, State
from hevopt.problem.problem import Plan, Problem
from hevopt.strategies import _mpc_kernels as kernels
from hevopt.strategies._mpc_model import PreviewModel, model_of
from hevopt.strategies._mpc_qp import HorizonSolver, PreviewQp
from hevopt.strategies._reach_kernels import reachable
from hevopt.strategies.stepper import driven

HORIZON_S = 20.0
# Chosen once for all cars and cycles: 1 % of the fuel of 11 km is 6 % of the window of a 1.6 kWh pack, and a price
# 9 % off turns a car from charging to discharging (dual prices of the shipped cycles differ by less).
GAIN = 1.5
_HORIZON_MAX_S = 600.0
_UNITS_PER_WINDOW = 100.0
# End charges around the present one, as shares of the window, whose prices the mode paths are tried under.
_LADDER = np.linspace(-0.15, 0.15, 13)
# In units of price and energy; a straight line would leave it open how the QP splits the energy.
_LEAST_CURVATURE = 1e-3
_ENERGY_ROUNDING = 1e-12


class Controller:
    """Decides step by step; it remembers the last QP's answer, and the mode and stored energy before the step."""

    def __init__(self, problem: Problem, model: PreviewModel) -> None:
        self.problem, self.model = problem, model
        self.solver = HorizonSolver()
        self.mode, self.energy_j = problem.start_mode, problem.start_j
        low_j, high_j = problem.window_j
        self.unit_j = (high_j - low_j) / _UNITS_PER_WINDOW
        self.last_price_kgpj = float(model.price_kgpj[0])

    def decide(self, k: int, energy_j: float, mode: int) -> int:
        """Index of the control taken at step k."""
        self.energy_j, self.mode = energy_j, mode
        modes = self._mode_path(k)
        target_j, price_kgpj = self._powers(k, modes)
        entry = self._entry(k, int(modes[0]), float(target_j[0]), float(price_kgpj[0]))
        self.last_price_kgpj = float(price_kgpj[-1])
        return int(self.model.choices.control[entry])

    def _taken_j(self, k: int, before: Indices, modes: Indices) -> Array:
        """Stored energy that switching takes, (step,) from step k on."""
        case, _, energy_j, _ = self.model.choices.switching
        taken_j: Array = energy_j[case[k : k + len(modes)], before, modes]
        return taken_j

    def _charge(self, k: int) -> float:
        """Stored energy above the wanted, in units."""
        return float(self.energy_j - self.model.wanted_j[k]) / self.unit_j

    def _mode_path(self, k: int) -> Indices:
        """(step,) modes of the best path through the preview; step 2 above."""
        part, drain_j = self._preview(k)
        here, price = self._charge(k), self.model.price_kgpj[k]
        shares = 1.0 - GAIN * (here / _UNITS_PER_WINDOW + _LADDER)
        prices = np.append(np.maximum(price * shares, 0.0), self.last_price_kgpj)
        ahead = kernels.Ahead(here, float(price), GAIN / _UNITS_PER_WINDOW, self.unit_j)
        total, path = kernels.best_mode_path(part, drain_j, self.mode, prices, ahead)
        if not np.isfinite(total):
            raise InfeasibleError(
                f"mpc: no path over the modes through the preview at {self._place(k)}: a switch is forbidden "
                "there; see switch_allowed of the table, lengthen the preview, or use dp"
            )
        return self.problem.table.mode[part.control[path]]

    def _preview(self, k: int) -> tuple[Choices, Array]:
        """The choices of the preview at step k, and their drain, (entry,)."""
        choices, end = self.model.choices, int(self.model.end[k])
        entries = slice(choices.first[k, 0], choices.first[end - 1, -1])
        return choices.part(k, end), self.model.drain_j[entries]

    def _powers(self, k: int, modes: Indices) -> tuple[Array, Array]:
        """Energy drawn and price of stored energy after the step, (step,), along a mode path; step 3 above."""
        unit, price, wanted_j = self.unit_j, self.model.price_kgpj[k], self.model.wanted_j[k]
        steps = np.arange(k, self.model.end[k])
        low, knee, greatest, curvature, slope = self.model.fit[steps, modes].T
        taken = self._taken_j(k, np.concatenate([[self.mode], modes[:-1]]), modes)
        bottom, top = kernels.reachable_band(
            self.energy_j, low + taken, greatest + taken, self.problem.window_j
        )
        qp = PreviewQp(
            curvature=np.maximum(curvature * unit / price, _LEAST_CURVATURE),
            slope=slope / price,
            low=low / unit,
            knee=knee / unit,
            slack=(greatest - knee) / unit,
            start=self._charge(k),
            switching=taken / unit,
            bottom=(bottom - wanted_j) / unit,
            top=(top - wanted_j) / unit,
            gain=GAIN / _UNITS_PER_WINDOW,
        )
        drawn, worth = self.solver.solve(qp, self._place(k))
        return drawn * unit, np.maximum(worth, 0.0) * price

    def _entry(self, k: int, mode: int, target_j: float, price_kgpj: float) -> int:
        """The choice of step 4 above; of another mode, or safe for one step only, where there is no other."""
        least_curvature = _LEAST_CURVATURE * self.model.price_kgpj[k] / self.unit_j
        curvature = max(float(self.model.fit[k, mode, 3]), least_curvature)
        switching = self.model.choices.switching
        allowed = np.flatnonzero(switching.allowed[switching.case[k], self.mode])
        slack = _ENERGY_ROUNDING * self.problem.window_j[1] * np.array([-1.0, 1.0])
        window = np.array([self.problem.window_j] * self.model.choices.modes)
        state, aim = State(self.mode, self.energy_j), kernels.Aim(price_kgpj, target_j, curvature)
        for band in self._safe_band(k), window:
            for modes in np.array([mode]), allowed:
                entry = kernels.nearest_choice(
                    self.model.choices, k, state, modes, band + slack, aim,
                    self.problem.battery.arrays,
                )  # fmt: skip
                if entry >= 0:
                    return entry
        raise InfeasibleError(
            f"mpc: every control at {self._place(k)} leaves the SOC window "
            f"{self.problem.battery.soc_min:g} to {self.problem.battery.soc_max:g}; widen it, lengthen the "
            "preview, or use dp, which plans for the whole cycle"
        )

    def _safe_band(self, k: int) -> Array:
        """(mode, 2) stored energy after step k between which the window can be kept to the preview's end."""
        part, _ = self._preview(k)
        window_j = self.problem.window_j
        reach = reachable(part, window_j, window_j[0], self.problem.battery.arrays)
        return np.column_stack([reach.least_j[1], reach.greatest_j[1]])

    def _place(self, k: int) -> str:
        return f"step {k} (t = {self.problem.table.time_s[k]:g} s)"


def start(problem: Problem, *, horizon_s: float = HORIZON_S) -> Controller:
    """The strategy before the first step, with a preview of `horizon_s`."""
    if not 0 < horizon_s <= _HORIZON_MAX_S:
        raise DataError(f"mpc: horizon_s {horizon_s:g}; allowed: above 0 to {_HORIZON_MAX_S:g} s")
    return Controller(problem, model_of(problem, horizon_s))


def solve(problem: Problem, *, horizon_s: float = HORIZON_S) -> Plan:
    """The controls of receding-horizon control; notes["fallbacks"] counts the previews OSQP did not solve."""
    stepper = start(problem, horizon_s=horizon_s)
    control, _ = driven(problem, stepper)
    notes = {"horizon_s": horizon_s, "solver": "OSQP", "fallbacks": stepper.solver.fallbacks}
    return Plan(control, notes)
