"""Duals with a price for every step: tighter where losses depend on charge, or where the SOC window binds.

With prices p_1 ... p_T on stored energy x_1 ... x_T, switching y_t = x_t - s_t(m, m') and the step
x_t+1 = y_t - r_t(y_t, u), Lagrange duality gives, for every choice of prices >= 0, a bound on every feasible plan:

    g(p) = sum over t of  min over u, y of [cost_t(u) + p_t+1 r_t(y, u) + (p_t - p_t+1) y]
           + K_t(m, m') + p_t s_t(m, m')  + p_T x_end - p_1 x_start

Proof: multiply x_t+1 - y_t + r_t <= 0 by p_t+1 and y_t - x_t + s_t = 0 by p_t and add; p_t x_t cancels but at the
ends. At t = 0 x is x_start, so that y = x_start - s_0 is known and has no term of its own, and s_0 is charged p_1.
Every plan keeps y within the SOC window, over which the minimum is taken; fuel K and energy s of switching do not
depend on the control and are exact, a shortest path over modes. (Below x is written for y.) g is positively
homogeneous in p but for the costs, so a shape of p is scaled to the maximum of g (prices.py).
Shapes, both along a rollout:
    costate prices  p_t = p_t+1 (1 - dr_t/dx): then x is stationary where the rollout is
    LP prices       multipliers of the linear program that lets controls be mixed, ignores switching and keeps x
                    within the window, its losses linear in x around the rollout: they jump where the window binds.
                    Whatever the LP's tolerance, g is evaluated afresh and stays a bound.

The inner minimum over x. All curves are cut to the window (Battery.within_window): a kernel cannot look beyond it.
Where resistance is constant and U² linear in stored energy, as where Uoc is linear in SOC, r is convex in x:
with c = 4 R P and a = U², r is (a - sqrt(a (a - c))) / 2R, for charging times the coulombic efficiency; the root,
of a square less a square, is concave in a, so r is convex in a, and a is linear in x. r falls with a. Tangents at
the window's ends and at the rollout lie below it, and the least of their upper envelope below its minimum.
Nothing rests on how nearly linear a curve is: tangents are taken on a line that is nowhere below U², at the lowest
resistance, which loses no more than the battery (`line_above`). It is used where it lies close to the curve. For
other batteries the window is cut into cells; in each, r is at least its value at the cell's highest voltage and
lowest resistance.
"""

from itertools import pairwise

import numpy as np

from hevopt.bounds import _step_prices_kernels as kernels
from hevopt.bounds._step_prices_kernels import WindowCells
from hevopt.bounds.bounded import undominated_bounded
from hevopt.bounds.lines import Line, crossing_of
from hevopt.bounds.prices import (
    EPSILON,
    STEEPEST,
    Priced,
    before_steps,
    dual,
    dual_at,
    priced_rounding,
)
from hevopt.errors import SolverError
from hevopt.problem import _battery_kernels as battery_kernels
from hevopt.problem import battery as battery_model
from hevopt.problem._battery_kernels import BatteryArrays
from hevopt.problem.arrays import Array, Flags, rising
from hevopt.problem.choices import Choices, State
from hevopt.problem.problem import Problem, Trajectory

CELLS = 256
# Longer drives are given to the linear program in parts: its time grows faster than their length.
_LP_STEPS, _LP_OVERLAP = 4000, 1000
# A price by costates lies about so close to that of one multiplier.
_NEAR = 0.01
# Share of the highest U² by which a curve may leave a straight line and still be taken for one.
STRAIGHT = 1e-7


def costate_dual(
    problem: Problem, rollout: Trajectory, choices: Choices | None = None
) -> list[Line]:
    """Lines of the dual whose prices follow the costate equation along a rollout, the highest last.

    choices: those to count in place of the table's own, as of virtual.py
    """
    return dual_of_shape(problem, rollout, costate_prices(problem, rollout), choices)


def costate_bound_kg(problem: Problem, rollout: Trajectory, end_price_kgpj: float) -> float:
    """The best bound by costate prices along a rollout that three evaluations of g find near an end price.

    At most that of the highest line of `costate_dual`, and close to it at the price of one multiplier.
    """
    choices, priced = _priced(problem, rollout, costate_prices(problem, rollout))
    scale = end_price_kgpj / priced.end_price if priced.end_price > 0 else 0.0
    at_price = dual_at(problem, choices, priced, scale)
    uphill = scale * (1 + np.sign(at_price.slope_kg) * _NEAR)
    beside = dual_at(problem, choices, priced, uphill)
    between = dual_at(problem, choices, priced, crossing_of(at_price, beside))
    return max(line.value_kg for line in (at_price, beside, between))


def costate_prices(problem: Problem, rollout: Trajectory) -> Array:
    """(time,) prices that follow the costate equation along a rollout."""
    inside = problem.battery.within_window()
    return kernels.costate(
        after_switching_j(rollout), rollout.battery_power_w, problem.table.step_s, inside
    )


def lp_dual(problem: Problem, rollout: Trajectory, choices: Choices | None = None) -> list[Line]:
    """Lines of the dual whose prices are the multipliers of the linear program, the highest last.

    choices: as above; the program is of the table's own, any prices being valid
    """
    return dual_of_shape(problem, rollout, lp_prices_kgpj(problem, rollout), choices)


def dual_of_shape(
    problem: Problem, rollout: Trajectory, price: Array, choices: Choices | None = None
) -> list[Line]:
    """Lines of g over the scale of (time,) prices p_1 ... p_T >= 0, up to its maximum; choices: as above."""
    return dual(problem, *_priced(problem, rollout, price, choices))


def _priced(
    problem: Problem, rollout: Trajectory, price: Array, choices: Choices | None = None
) -> tuple[Choices, Priced]:
    """The choices of g, and their priced part at scale 1 for (time,) prices p_1 ... p_T >= 0.

    The shape is taken at a size of about 1, by a power of two, which no product of prices and energies overflows.
    Raises SolverError for prices that are not finite and >= 0.
    """
    if not (np.isfinite(price).all() and (price >= 0).all()):
        raise SolverError("the prices of stored energy are not all finite and >= 0")
    price = np.ldexp(price, -np.frexp(price.max())[1])
    if choices is None:
        choices = undominated_bounded(problem)
    inside = problem.battery.within_window()
    line = line_above(inside)
    start = State(problem.start_mode, problem.start_j)
    if line is not None:
        window = float(line.energy_j[0]), float(line.energy_j[1])
        worth = kernels.worth_by_tangents(
            choices, price, start, after_switching_j(rollout), steep(choices, line), window, line
        )
    else:
        cells = window_cells(problem, CELLS)
        worth = kernels.worth_by_cells(choices, price, start, cells, inside)
    constant = price[-1] * problem.end_min_j - price[0] * problem.start_j
    rounding = priced_rounding(problem, choices, price, tangents=line is not None)
    return choices, Priced(worth, before_steps(price), float(constant), float(price[-1]), rounding)


def after_switching_j(rollout: Trajectory) -> Array:
    """(time,) stored energy between switching and step."""
    return rollout.energy_j[:-1] - rollout.switch_energy_j


def line_above(inside: BatteryArrays) -> BatteryArrays | None:
    """A battery of one segment that loses no more than one cut to the window, at any stored energy there.

    Its U² is linear in stored energy and nowhere below the curve's, its resistances are the lowest. None where
    curve and line lie apart.
    """
    energy, squared = inside.energy_j, inside.open_circuit_v**2
    chord = np.interp(energy, energy[[0, -1]], squared[[0, -1]])
    over = squared - chord
    ohms = inside.discharge_ohm, inside.charge_ohm
    apart = [np.ptp(ohm) > STRAIGHT * ohm.max() for ohm in ohms]
    if np.abs(over).max() > STRAIGHT * squared[-1] or any(apart):
        return None
    raised = np.sqrt(squared[[0, -1]] + max(over.max(), 0.0)) * (1 + 4 * EPSILON)
    width = 2 * (energy[-1] - energy[0]) / (inside.capacity_as * raised.sum())
    discharge, charge = (np.full(2, ohm.min()) for ohm in ohms)
    return BatteryArrays(
        np.array([0.0, width]), raised, discharge, charge, energy[[0, -1]], inside.capacity_as,
        inside.coulombic_efficiency,
    )  # fmt: skip


def steep(choices: Choices, battery: BatteryArrays) -> Flags:
    """(entry,) whether a power comes so near the voltage's peak that no tangent is of use."""
    return battery_kernels.amplification(choices.power_w, battery) > STEEPEST


def lp_prices_kgpj(problem: Problem, rollout: Trajectory) -> Array:
    """(time,) multipliers of the energy steps: minimise cost over mixtures of controls, x in the window.

    Switching takes what it takes on the rollout.

    Long drives are given to it in parts, from the end. Each reaches into the next by some steps, counts what is
    left there at the price that the next has found for it, and is believed up to where the next begins.
    """
    choices = undominated_bounded(problem)
    count = -(-choices.steps // _LP_STEPS)
    ends = [n * choices.steps // count for n in range(count + 1)]
    price = np.zeros(choices.steps)
    low, high = problem.window_j
    # Beyond the window, where rounding may lead, a control at the battery's limit may have no current.
    energy_j = np.clip(rollout.energy_j[:-1], low, high)
    between_j = np.clip(after_switching_j(rollout), low, high)
    for begin, end in reversed(list(pairwise(ends))):
        reach = min(end + _LP_OVERLAP, choices.steps)
        wanted = (problem.end_min_j, 0.0) if reach == choices.steps else (low, price[reach - 1])
        along = energy_j[begin:reach], between_j[begin:reach], rollout.battery_power_w[begin:reach]
        found = _lp_part(problem, choices.part(begin, reach), *along, *wanted)
        price[begin:end] = found[: end - begin]
    return price


def _lp_part(
    problem: Problem,
    choices: Choices,
    energy_j: Array,
    between_j: Array,
    power_w: Array,
    end_min_j: float,
    end_price_kgpj: float,
) -> Array:
    """(time,) multipliers of consecutive steps, what is left at their end being at least end_min_j and priced.

    energy_j, between_j, power_w: (time,) along a rollout, whose first stored energy is where they start, before and
    after switching

    The mixtures of a step cost the lower hull of its controls' cost over drain; from the corner of least drain
    the hull falls segment by segment, ever less steeply, so that segments bounded by 0 and 1 are all it needs.
    """
    from scipy.optimize import linprog
    from scipy.sparse import csr_array

    step = choices.spread(np.arange(choices.steps))
    inside_window = problem.battery.within_window()
    drain_j, keep_j = kernels.linear_steps(choices, between_j, power_w, inside_window)
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
    taken_j = energy_j - between_j
    offset = ((1.0 - keep_j) * energy_j - taken_j - least_j) / scale_j
    offset[0] += keep_j[0] * energy_j[0] / scale_j
    bounds = np.empty((segments + steps, 2))
    bounds[:segments] = 0.0, 1.0
    bounds[segments:] = low / scale_j, high / scale_j
    bounds[-1, 0] = end_min_j / scale_j
    # In units of the steps' own costs, so that the solver's tolerance is a share of them.
    unit_kg = float(np.max(np.abs(np.diff(cost_kg)[inside]), initial=0.0)) or 1.0
    cost = np.concatenate([np.diff(cost_kg)[inside] / unit_kg, np.zeros(steps)])
    cost[-1] -= end_price_kgpj * scale_j / unit_kg
    result = linprog(
        cost, A_ub=rows, b_ub=offset, bounds=bounds, method="highs",
    )  # fmt: skip
    if result.status != 0:
        raise SolverError(f"HiGHS stopped with status {result.status}: {result.message}")
    # A joule more after step t saves p: the multiplier of its row is -p.
    prices: Array = np.maximum(-result.ineqlin.marginals * (unit_kg / scale_j), 0.0)
    return prices


def window_cells(problem: Problem, cells: int) -> WindowCells:
    """At least that many cells, every point of the curves among their edges."""
    inside = problem.battery.within_window()
    even = np.linspace(inside.soc[0], inside.soc[-1], cells + 1)
    edges_soc = rising(even, inside.soc)
    voltage, discharge, charge = (
        np.interp(edges_soc, inside.soc, curve)
        for curve in (inside.open_circuit_v, inside.discharge_ohm, inside.charge_ohm)
    )
    edges = battery_model.energy_j(problem.battery, edges_soc)
    edges[[0, -1]] = inside.energy_j[[0, -1]]
    lowest = [np.minimum(ohm[1:], ohm[:-1]) for ohm in (discharge, charge)]
    return WindowCells(edges, voltage[1:], lowest[0], lowest[1], inside.coulombic_efficiency)
