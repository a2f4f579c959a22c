"""Compiled parts of receding-horizon control: hulls, fits, the neutral price of what was seen, the choice."""

from typing import NamedTuple

import numpy as np

from hevopt._compile import compiled
from hevopt.bounds._prices_kernels import shortest_path
from hevopt.problem._battery_kernels import BatteryArrays, chemical_power, state_at
from hevopt.problem.arrays import Array, Indices
from hevopt.problem.choices import Choices, State


class Hulls(NamedTuple):
    """Lower convex hulls of blocks: entries in order of drain, and where each block's begin, (time, block + 1)."""

    entry: Indices
    first: Indices


class Aim(NamedTuple):
    """What a choice is to come close to: price of drained energy, drain wanted and penalty on the distance."""

    price_kgpj: float
    drain_j: float
    curvature: float


class Ahead(NamedTuple):
    """Charge at hand and what it is worth at a preview's end: price x unit x (-x + gain x²/2), x in units."""

    charge: float
    price_kgpj: float
    gain: float
    unit_j: float


@compiled()
def falling_hull(first: Indices, cost: Array, drain: Array) -> Hulls:
    """Lower convex hull of each block's cost over drained energy, where cost falls; first: (time, block + 1)."""
    steps, blocks = first.shape[0], first.shape[1] - 1
    hull = np.empty(len(cost), dtype=np.int64)
    starts = np.empty_like(first)
    top = 0
    for k in range(steps):
        for m in range(blocks):
            starts[k, m] = top
            bottom = top
            order = np.argsort(drain[first[k, m] : first[k, m + 1]], kind="mergesort")
            for i in order + first[k, m]:
                if top > bottom and drain[i] == drain[hull[top - 1]]:
                    if cost[i] >= cost[hull[top - 1]]:
                        continue
                    top -= 1
                elif top > bottom and cost[i] >= cost[hull[top - 1]]:
                    continue
                while top - bottom >= 2:
                    a, b = hull[top - 2], hull[top - 1]
                    rise, run = cost[i] - cost[a], drain[i] - drain[a]
                    if (cost[b] - cost[a]) * run < rise * (drain[b] - drain[a]):
                        break
                    top -= 1
                hull[top] = i
                top += 1
        starts[k, blocks] = top
    return Hulls(hull[:top], starts)


@compiled()
def _parabola(x: Array, y: Array) -> tuple[float, float]:
    """Curvature (>= 0) and slope at 0 of the least-squares parabola through points; a line where there are two."""
    centre = np.mean(x)
    width = np.max(np.abs(x - centre))
    if width == 0.0:
        return 0.0, 0.0
    u, v = (x - centre) / width, y - np.mean(y)
    s2, s3, s4 = np.mean(u * u), np.mean(u**3), np.mean(u**4)
    t1, t2 = np.mean(u * v), np.mean(u * u * v)
    spread = s4 - s2 * s2 - s3 * s3 / s2
    bend = (t2 - s3 * t1 / s2) / spread if len(x) > 2 and spread > 1e-9 else 0.0
    bend = max(bend, 0.0)
    slope = (t1 - bend * s3) / s2 / width
    curvature = 2.0 * bend / width**2
    return curvature, slope - curvature * centre


@compiled()
def fits(first: Indices, cost: Array, drain: Array, hulls: Hulls) -> Array:
    """(time, mode, 5) of each block: least drain, drain of least cost, greatest drain, curvature and slope at 0
    of a convex parabola through the hull of cost over drain; 0 where the block is empty.
    """
    hull, starts = hulls
    steps, modes = first.shape[0], first.shape[1] - 1
    result = np.zeros((steps, modes, 5))
    for k in range(steps):
        for m in range(modes):
            if first[k, m] == first[k, m + 1]:
                continue
            points = hull[starts[k, m] : starts[k, m + 1]]
            result[k, m, 0], result[k, m, 1] = drain[points[0]], drain[points[-1]]
            result[k, m, 2] = np.max(drain[first[k, m] : first[k, m + 1]])
            result[k, m, 3:] = _parabola(drain[points], cost[points])
    return result


@compiled()
def neutral_prices(
    hulls: Hulls, cost: Array, drain: Array, seen: Indices, least_price: float
) -> Array:
    """(time,) price at which the steps seen by then, 0 to seen[k] - 1, would have drained nothing in all.

    hulls: falling ones of whole steps, all modes in one block. A step moves along its hull as the price
    falls; the edges of all steps, steepest first, are walked until the drain is made good. Where the edges end
    before that, the last one counts.
    """
    hull, starts = hulls
    slope, width = np.empty(len(hull)), np.empty(len(hull))
    result = np.empty(len(seen))
    edges, step, total = 0, 0, 0.0
    for k in range(len(seen)):
        while step < seen[k]:
            if starts[step, 1] > starts[step, 0]:
                points = hull[starts[step, 0] : starts[step, 1]]
                total += drain[points[0]]
                edges = _merge(slope, width, edges, drain[points], cost[points])
            step += 1
        drained, j = total, 0
        while j < edges - 1 and drained + width[j] < 0.0:
            drained += width[j]
            j += 1
        result[k] = max(slope[j], least_price) if edges else least_price
    return result


@compiled()
def _merge(slope: Array, width: Array, edges: int, drain: Array, cost: Array) -> int:
    """Put the edges of one hull among the first `edges` of slope and width, steepest first; their new number."""
    new = len(drain) - 1
    i, to = edges - 1, edges + new - 1
    for j in range(new - 1, -1, -1):
        run = drain[j + 1] - drain[j]
        steep = (cost[j] - cost[j + 1]) / run
        while i >= 0 and slope[i] < steep:
            slope[to], width[to] = slope[i], width[i]
            i, to = i - 1, to - 1
        slope[to], width[to] = steep, run
        to -= 1
    return edges + new


@compiled()
def _taken(choices: Choices, path: Indices, start_mode: int) -> float:
    """Stored energy that switching takes along entries, (step,)."""
    first, switching = choices.first, choices.switching
    total, mode = 0.0, start_mode
    for k in range(len(path)):
        n = 0
        while path[k] >= first[k, n + 1]:
            n += 1
        total += switching.energy_j[switching.case[k], mode, n]
        mode = n
    return total


@compiled()
def best_mode_path(
    choices: Choices, drain: Array, start_mode: int, prices: Array, ahead: Ahead
) -> tuple[float, Indices]:
    """Of the shortest paths through a preview under each of `prices`, the one of least cost and terminal cost;
    its total and entries (step,).
    """
    charge, price, gain, unit = ahead
    least_total, best = np.inf, np.zeros(len(choices.first), dtype=np.int64)
    for p in prices:
        priced = choices.cost_kg + p * drain
        before = np.full(len(choices.first), p)
        value, path, _ = shortest_path(choices, priced, before, start_mode)
        if not np.isfinite(value):
            break
        fall = np.sum(drain[path]) + _taken(choices, path, start_mode)
        x = charge - fall / unit
        total = value - p * fall + price * unit * (0.5 * gain * x * x - x)
        if total < least_total:
            least_total, best = total, path
    return least_total, best


@compiled()
def reachable_band(
    start: float, least_drain: Array, greatest_drain: Array, window: tuple[float, float]
) -> tuple[Array, Array]:
    """Bounds (step,) on energy: the window, opened just as far as the drains on hand cannot keep it."""
    low, high = window
    steps = len(least_drain)
    bottom, top = np.empty(steps), np.empty(steps)
    below = above = start
    for t in range(steps):
        below, above = below - greatest_drain[t], above - least_drain[t]
        bottom[t], top[t] = min(low, above), max(high, below)
        below, above = max(below, bottom[t]), min(above, top[t])
    return bottom, top


@compiled()
def nearest_choice(
    choices: Choices,
    k: int,
    state: State,
    modes: Indices,
    band: Array,
    aim: Aim,
    battery: BatteryArrays,
) -> int:
    """Entry of least  cost + switching + price drain + curvature/2 (drain - wanted)²  among some modes.

    Switching counts its fuel, and its stored energy at the price. Only entries that lead within their mode's band
    (mode, 2) of stored energy; -1 where there is none.
    """
    switching, case = choices.switching, choices.switching.case[k]
    least, chosen = np.inf, -1
    for n in modes:
        taken = switching.energy_j[case, state.mode, n]
        energy, paid = state.energy_j - taken, switching.kg[case, state.mode, n]
        paid += aim.price_kgpj * taken
        _, voltage, discharge, charging = state_at(energy, battery)
        for i in range(choices.first[k, n], choices.first[k, n + 1]):
            drain = choices.step_s[k] * chemical_power(
                choices.power_w[i], voltage, discharge, charging, battery.coulombic_efficiency
            )
            if not band[n, 0] <= energy - drain <= band[n, 1]:
                continue
            value = choices.cost_kg[i] + paid + aim.price_kgpj * drain
            value += 0.5 * aim.curvature * (drain - aim.drain_j) ** 2
            if value < least:
                least, chosen = value, i
    return chosen
