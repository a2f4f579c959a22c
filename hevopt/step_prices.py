"""Duals with a price for every step: tighter where losses depend on charge, or where the SOC window binds.

With prices p_1 ... p_T on stored energy x_1 ... x_T and the step x_t+1 = x_t - r_t(x_t, u), Lagrange duality gives,
for every choice of prices >= 0, a bound on every feasible plan:

    g(p) = sum over t of  min over u, x of [cost_t(u) + p_t+1 r_t(x, u) + (p_t - p_t+1) x]  + switching
           + p_T x_end - p_1 x_start

with x within the SOC window (t = 0: x = x_start and no x term) and the switching costs exact, a shortest path over
modes. g is positively homogeneous in p but for the costs, so a shape of p is scaled to the maximum of g
(prices.py).
Shapes, both along a rollout:
    costate prices  p_t = p_t+1 (1 - dr_t/dx): then x is stationary where the rollout is
    LP prices       multipliers of the linear program that lets controls be mixed, ignores switching and keeps x
                    within the window, its losses linear in x around the rollout: they jump where the window binds.
                    Whatever the LP's tolerance, g is evaluated afresh and stays a bound.

The inner minimum over x. Where resistance is constant and Uoc linear in SOC within the window, r is convex in x:
with r = U I, D = sqrt(U² - 4 R P), dr/dU = -2 R I² / D <= 0 rises with U, and U² is linear in x, so U is concave
in x and r falls in U: a convex falling function of a concave one. Tangents at the window's ends and at the
rollout lie below it, and the least of their upper envelope below its minimum. For other batteries the window is
cut into cells; in each, r is at least its value at the cell's highest voltage and lowest resistance.
"""

import numpy as np
from numpy.typing import NDArray

from hevopt import _step_prices_kernels as kernels
from hevopt import battery as battery_model
from hevopt.choices import choices_of, without_dominated
from hevopt.errors import SolverError
from hevopt.prices import Line, dual
from hevopt.problem import Problem, Trajectory

Array = NDArray[np.float64]
CELLS = 256


def costate_dual(problem: Problem, rollout: Trajectory) -> list[Line]:
    """Lines of the dual whose prices follow the costate equation along a rollout, the highest last."""
    arrays = problem.battery.arrays
    power, step_s = rollout.battery_power_w, problem.table.step_s
    return dual_of_shape(problem, rollout, kernels.costate(rollout.energy_j, power, step_s, arrays))


def lp_dual(problem: Problem, rollout: Trajectory) -> list[Line]:
    """Lines of the dual whose prices are the multipliers of the linear program, the highest last."""
    return dual_of_shape(problem, rollout, lp_prices_kgpj(problem, rollout))


def dual_of_shape(problem: Problem, rollout: Trajectory, price: Array) -> list[Line]:
    """Lines of g over the scale of (time,) prices p_1 ... p_T >= 0."""
    choices = without_dominated(choices_of(problem))
    pack, step_s = problem.battery, problem.table.step_s
    low, high = problem.window_j
    arguments = choices.first, choices.power_w, step_s, price, rollout.energy_j
    if convex_in_energy(problem):
        worth = kernels.worth_by_tangents(*arguments, low, high, pack.arrays)
    else:
        worth = kernels.worth_by_cells(*arguments, *window_cells(problem, CELLS), pack.arrays)
    constant = price[-1] * problem.end_min_j - price[0] * problem.start_j
    return dual(problem, choices, worth, constant, float(price[-1]))


def lp_prices_kgpj(problem: Problem, rollout: Trajectory) -> Array:
    """(time,) multipliers of the energy steps: minimise cost over mixtures of controls, x in the window.

    The mixtures of a step cost the lower hull of its controls' cost over drain; from the corner of least drain
    the hull falls segment by segment, ever less steeply, so that segments bounded by 0 and 1 are all it needs.
    """
    from scipy.optimize import linprog
    from scipy.sparse import csr_array

    choices = without_dominated(choices_of(problem))
    step = choices.spread(np.arange(choices.steps))
    drain_j, keep_j = kernels.linear_steps(
        choices.first, choices.power_w, choices.step_s, rollout.energy_j, rollout.battery_power_w,
        problem.battery.arrays,
    )  # fmt: skip
    order = np.lexsort((choices.cost_kg, drain_j, step))
    corner = order[kernels.lower_hull(step, drain_j, choices.cost_kg, order)[order]]
    step, drain_j, cost_kg = step[corner], drain_j[corner], choices.cost_kg[corner]
    inside = step[1:] == step[:-1]
    least_j = drain_j[np.append(True, ~inside)]
    segment_step = step[1:][inside]
    segments, steps = len(segment_step), choices.steps
    low, high = problem.window_j
    # Columns: share of every segment, then x_1 ... x_T. Energy may be thrown away: rows <=.
    scale_j = high - low
    following, present = segments + np.arange(steps), segments + np.arange(steps - 1)
    rows = csr_array(
        (
            np.concatenate([np.diff(drain_j)[inside] / scale_j, np.ones(steps), -keep_j[1:]]),
            (
                np.concatenate([segment_step, np.arange(steps), np.arange(1, steps)]),
                np.concatenate([np.arange(segments), following, present]),
            ),
        ),
        shape=(steps, segments + steps),
    )
    offset = ((1.0 - keep_j) * rollout.energy_j[:-1] - least_j) / scale_j
    offset[0] += keep_j[0] * problem.start_j / scale_j
    bounds = np.empty((segments + steps, 2))
    bounds[:segments] = 0.0, 1.0
    bounds[segments:] = low / scale_j, high / scale_j
    bounds[-1, 0] = problem.end_min_j / scale_j
    result = linprog(
        np.concatenate([np.diff(cost_kg)[inside], np.zeros(steps)]),
        A_ub=rows, b_ub=offset, bounds=bounds, method="highs",
    )  # fmt: skip
    if result.status != 0:
        raise SolverError(f"HiGHS stopped with status {result.status}: {result.message}")
    # A joule more after step t saves p: the multiplier of its row is -p.
    return np.maximum(-result.ineqlin.marginals / scale_j, 0.0)


def convex_in_energy(problem: Problem) -> bool:
    """Whether resistance is constant and the voltage linear in SOC throughout the window."""
    pack = problem.battery
    first = int(np.searchsorted(pack.soc, pack.soc_min, "right")) - 1
    last = int(np.searchsorted(pack.soc, pack.soc_max, "left"))
    inside = slice(first, last + 1)
    slopes = np.diff(pack.open_circuit_v[inside]) / np.diff(pack.soc[inside])
    same = [np.ptp(r[inside]) == 0 for r in (pack.discharge_ohm, pack.charge_ohm)]
    return all(same) and bool(np.ptp(slopes) <= 1e-12 * (1 + np.abs(slopes).max()))


def window_cells(problem: Problem, cells: int) -> tuple[Array, Array, Array, Array]:
    """Edges (cell + 1,) over the window, with every point of the curves among them, and per cell the highest
    voltage and the lowest discharge and charge resistance."""
    pack = problem.battery
    edges_soc = np.union1d(
        np.linspace(pack.soc_min, pack.soc_max, cells + 1),
        pack.soc[(pack.soc > pack.soc_min) & (pack.soc < pack.soc_max)],
    )
    voltage, discharge, charge = (
        np.interp(edges_soc, pack.soc, curve)
        for curve in (pack.open_circuit_v, pack.discharge_ohm, pack.charge_ohm)
    )
    lower = [np.minimum(r[1:], r[:-1]) for r in (discharge, charge)]
    return battery_model.energy_j(pack, edges_soc), voltage[1:], *lower
