"""The dual of the convex model, for prices from anywhere: a bound on every plan.

For prices p_1 ... p_T >= 0 on stored energy, and r(P, x) = a - n b the least rate at which energy falls,

    g(p) = sum over t of  min over m, P in hull, x in window of [cost(P) + p_t+1 dt r(P, x) + (p_t - p_t+1) x]
           + p_T x_end - p_1 x_start                                      (t = 0: x = x_start, no term in x)

(where switching takes stored energy, x is what it leaves, and the least is that over paths of modes, with fuel and
priced energy of switching: step_prices.py)

never exceeds the optimum. r is convex in P and x together, so that a tangent plane lies below it everywhere; with
one per mode the minimum falls apart into the hull's corners and the window's ends. The planes come from the
solver's multipliers and are evaluated afresh: however inexact the solver, what comes out is a bound.
"""

import numpy as np

from hevopt.bounds._prices_kernels import mode_path
from hevopt.bounds.prices import before_steps
from hevopt.problem.arrays import Array
from hevopt.problem.battery import source_power_w
from hevopt.problem.problem import Problem
from hevopt.problem.switching import switching_of
from hevopt.strategies._convex_parts import Cell, HullCorners

# At the voltage's peak dr/dP has no end; any slope gives a tangent.
_LEAST_ROOT = 1e-3


def dual_value_kg(
    problem: Problem,
    hulls: HullCorners,
    cell: Cell,
    price_kgpj: Array,
    place_j: Array,
) -> float:
    """g(p) with tangent planes at the energies place_j, and there where cost + p dt r is least.

    price_kgpj: (time,) p_1 ... p_T; place_j: (block,)
    """
    first, step = hulls.first[:-1], hulls.step
    after = price_kgpj[step]
    switching = switching_of(problem.table)
    start_j = problem.start_j - switching.energy_j[0, problem.start_mode, hulls.mode]
    place = np.where(step == 0, start_j, place_j)
    place = np.clip(place, cell.low_j, cell.high_j)
    lines = cell.intercept_v2[:, None] + cell.slope_v2pj[:, None] * (place - cell.low_j)
    line = np.argmin(lines, axis=0)
    squared_v2, steepness = lines[line, np.arange(len(step))], cell.slope_v2pj[line]
    priced = after * hulls.step_s[step]
    slope = _best_slope(hulls, cell, priced, squared_v2)
    drain, touch, by_v2 = _tangent(cell, slope, squared_v2)
    corner_kg = hulls.cost_kg + (priced * slope)[hulls.block] * (hulls.power_w - touch[hulls.block])
    least_kg = np.minimum.reduceat(corner_kg, first) + priced * drain
    before = np.concatenate([price_kgpj[:1], price_kgpj])[step]
    tilt = priced * by_v2 * steepness
    ends = np.array([[cell.low_j], [cell.high_j]])
    held = np.min((before - after) * ends + tilt * (ends - place), axis=0)
    total = least_kg + np.where(step == 0, 0.0, held)
    ends_kg = price_kgpj[-1] * problem.end_min_j - price_kgpj[0] * problem.start_j
    if switching.energy_j.any():
        least = np.full((len(hulls.step_s), problem.table.modes), np.inf)
        least[step, hulls.mode] = total
        to_go, _ = mode_path(least, switching, before_steps(price_kgpj))
        return float(to_go[0, problem.start_mode] + ends_kg)
    starts = np.searchsorted(step, np.arange(len(hulls.step_s)))
    return float(np.sum(np.minimum.reduceat(total, starts)) + ends_kg)


def _best_slope(hulls: HullCorners, cell: Cell, priced: Array, squared_v2: Array) -> Array:
    """(block,) dr/dP where cost + priced x r is least over a block's hull; at a kink, one that fits both sides.

    The best corner is an end of the best segment: dr/dP there, clipped to the slopes of the segments beside it.
    """
    first, block, power = hulls.first[:-1], hulls.block, hulls.power_w
    factor = np.where(power < 0, cell.efficiency, 1.0)
    ohm = np.where(power < 0, cell.charge_ohm, cell.discharge_ohm)
    voltage = np.sqrt(squared_v2)[block]
    chemical, root_v = source_power_w(power, voltage, ohm)
    root = np.maximum(root_v / voltage, _LEAST_ROOT)
    total = hulls.cost_kg + priced[block] * factor * chemical
    least = np.repeat(np.minimum.reduceat(total, first), np.diff(hulls.first))
    corners = np.flatnonzero(total <= least)
    corner = corners[np.searchsorted(block[corners], np.arange(len(first)))]
    fall = -np.diff(hulls.cost_kg) / np.where(np.diff(block) == 0, np.diff(power), 1.0)
    inner = np.diff(block) == 0
    left = np.concatenate([[np.inf], np.where(inner, fall, np.inf)])[corner]
    right = np.concatenate([np.where(inner, fall, -np.inf), [-np.inf]])[corner]
    scale = np.maximum(priced, 1e-300)
    here = (factor / root)[corner]
    at_kink = np.clip(right / scale, cell.efficiency, 1.0)
    here = np.where(power[corner] == 0, at_kink, here)
    wanted = np.clip(here, right / scale, left / scale)
    return np.where(priced > 0, wanted, 1.0)


def _tangent(cell: Cell, slope: Array, squared_v2: Array) -> tuple[Array, Array, Array]:
    """r, P and dr/dU² where dr/dP is `slope`; at P = 0, a kink, where no other P has it."""
    charging = slope < cell.efficiency
    factor = np.where(charging, cell.efficiency, 1.0)
    ohm = np.where(charging, cell.charge_ohm, np.where(slope > 1, cell.discharge_ohm, 0.0))
    root = np.where(ohm > 0, factor / slope, 1.0)
    power = np.divide(squared_v2 * (1 - root**2), 4 * ohm, out=np.zeros_like(root), where=ohm > 0)
    chemical = 2 * power / (1 + root)
    return factor * chemical, power, -factor * ohm * chemical**2 / (squared_v2**2 * root)
