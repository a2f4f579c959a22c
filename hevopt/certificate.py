"""Certificates: how little any plan could cost on the same problem, with the kind of proof.

With prices p_1 ... p_T >= 0 on stored energy x_1 ... x_T and the step x_t+1 = x_t - r_t(x_t, u), Lagrange duality
gives, for every choice of prices, a bound on every feasible plan:

    g(p) = sum over t of  min over u, x of [cost_t(u) + p_t+1 r_t(x, u) + (p_t - p_t+1) x]  + switching
           + p_T x_end - p_1 x_start

with x within the SOC window (t = 0: x = x_start and no x term), and the switching costs exact, a shortest path
over modes. Every rung is one shape of p, scaled to the maximum of g.

    one multiplier    p constant; r at its least over the window (prices.py)
    costate prices    p_t = p_t+1 (1 - dr_t/dx) along a rollout: then x is stationary where the rollout is

The inner minimum over x. Where resistance is constant and Uoc linear in SOC within the window, r is convex in x:
with r = U I, D = sqrt(U² - 4 R P), dr/dU = -2 R I² / D <= 0 rises with U, and U² is linear in x, so U is concave
in x and r falls in U: a convex falling function of a concave one. Tangents at the window's ends and at the
rollout lie below it, and the least of their upper envelope below its minimum. For other batteries the window is
cut into cells; in each, r is at least its value at the cell's highest voltage and lowest resistance.

A bound holds for the tabulated controls, for every strategy alike, and for end charges other than the problem's
own: g moves with x_end by p_T.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hevopt import _certificate_kernels as kernels
from hevopt import battery as battery_model
from hevopt.choices import choices_of, without_dominated
from hevopt.prices import Line, dual, one_price_dual
from hevopt.problem import Problem, Trajectory

Array = NDArray[np.float64]
_CELLS = 256
# Sums of some thousand terms: a bound is lowered by what rounding could have added.
_ROUNDING = 1e-12


@dataclass(frozen=True, slots=True)
class Certificate:
    """Bounds on cost (kg: fuel, plus weighted NOx) for any end charge, as supporting lines.

    proofs: kind of proof -> its lines; the highest line at an end charge is the bound there
    """

    end_min_j: float
    proofs: dict[str, list[Line]]

    def bound_kg(self, end_j: float) -> tuple[float, str]:
        """The highest proven bound for plans that end with at least `end_j`, and its kind of proof."""
        extra_j = end_j - self.end_min_j
        best, kind = max(
            (line.value_kg + line.price_kgpj * extra_j, kind)
            for kind, lines in self.proofs.items()
            for line in lines
        )
        return best - _ROUNDING * abs(best), kind

    @property
    def price_kgpj(self) -> float:
        """What a joule of end charge is worth on this problem: the price of the highest line."""
        lines = [line for group in self.proofs.values() for line in group]
        return max(lines, key=lambda line: line.value_kg).price_kgpj


def certify(problem: Problem, rollout: Trajectory | None = None) -> Certificate:
    """The certificate of a problem; with a rollout, its costate prices too."""
    proofs = {"one multiplier": one_price_dual(problem)}
    if rollout is not None:
        proofs["costate prices"] = costate_dual(problem, rollout)
    return Certificate(problem.end_min_j, proofs)


def costate_dual(problem: Problem, rollout: Trajectory) -> list[Line]:
    """Lines of the dual whose prices follow the costate equation along a rollout."""
    choices = without_dominated(choices_of(problem))
    pack, step_s = problem.battery, problem.table.step_s
    price = kernels.costate(rollout.energy_j, rollout.battery_power_w, step_s, pack.arrays)
    low, high = problem.window_j
    arguments = choices.first, choices.power_w, step_s, price, rollout.energy_j
    if convex_in_energy(problem):
        worth = kernels.worth_by_tangents(*arguments, low, high, pack.arrays)
    else:
        worth = kernels.worth_by_cells(*arguments, *_cells(problem), pack.arrays)
    constant = price[-1] * problem.end_min_j - price[0] * problem.start_j
    return dual(problem, choices, worth, constant, float(price[-1]))


def convex_in_energy(problem: Problem) -> bool:
    """Whether resistance is constant and the voltage linear in SOC throughout the window."""
    pack = problem.battery
    first = int(np.searchsorted(pack.soc, pack.soc_min, "right")) - 1
    last = int(np.searchsorted(pack.soc, pack.soc_max, "left"))
    inside = slice(first, last + 1)
    slopes = np.diff(pack.open_circuit_v[inside]) / np.diff(pack.soc[inside])
    same = [np.ptp(r[inside]) == 0 for r in (pack.discharge_ohm, pack.charge_ohm)]
    return all(same) and bool(np.ptp(slopes) <= 1e-12 * (1 + np.abs(slopes).max()))


def _cells(problem: Problem) -> tuple[Array, Array, Array, Array]:
    """Edges (cell + 1,) over the window, with every point of the curves among them, and per cell the highest
    voltage and the lowest discharge and charge resistance."""
    pack = problem.battery
    edges_soc = np.union1d(
        np.linspace(pack.soc_min, pack.soc_max, _CELLS + 1),
        pack.soc[(pack.soc > pack.soc_min) & (pack.soc < pack.soc_max)],
    )
    voltage, discharge, charge = (
        np.interp(edges_soc, pack.soc, curve)
        for curve in (pack.open_circuit_v, pack.discharge_ohm, pack.charge_ohm)
    )
    lower = [np.minimum(r[1:], r[:-1]) for r in (discharge, charge)]
    return battery_model.energy_j(pack, edges_soc), voltage[1:], *lower
