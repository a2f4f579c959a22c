"""Compiled parts of the duals with a price per step; the mathematics is in step_prices.py."""

from typing import NamedTuple

import numpy as np

from hevopt._compile import compiled
from hevopt.problem._battery_kernels import (
    BatteryArrays,
    chemical_power,
    chemical_power_at,
    drain_and_slope,
    touch_at,
    touching,
)
from hevopt.problem.arrays import Array, Flags, Indices
from hevopt.problem.choices import Choices, State

# A step's price is at most this multiple of the next one's; any prices are valid.
_GROWTH_MAX = 10.0
# Only ratios of prices count: where they outgrow this, all so far are taken smaller.
_PRICE_MAX = 2.0**500


class WindowCells(NamedTuple):
    """The window cut into cells. edges_j: (cell + 1,); per cell the highest voltage, the lowest resistances."""

    edges_j: Array
    voltage: Array
    discharge_ohm: Array
    charge_ohm: Array
    efficiency: float


@compiled()
def costate(energy: Array, power: Array, step_s: Array, battery: BatteryArrays) -> Array:
    """Prices (time,) of x_1 ... x_T that make a rollout stationary, 1 at the end or less beside very great ones."""
    steps = len(power)
    price = np.ones(steps)
    for k in range(steps - 1, 0, -1):
        _, slope = drain_and_slope(power[k], energy[k], battery)
        price[k - 1] = price[k] * min(max(1.0 - step_s[k] * slope, 0.0), _GROWTH_MAX)
        if price[k - 1] > _PRICE_MAX:
            price[k - 1 :] /= _PRICE_MAX
    return price


@compiled()
def _worth_with_first_step(
    choices: Choices, price: Array, start: State, battery: BatteryArrays
) -> Array:
    """(entry,) with the first step's entries filled: there x is the start's less what switching takes, and has no
    price of its own."""
    first, power = choices.first, choices.power_w
    worth = np.empty(len(power))
    low, high, case = battery.energy_j[0], battery.energy_j[-1], choices.switching.case[0]
    for n in range(first.shape[1] - 1):
        # Within the window, which no plan leaves.
        x = start.energy_j - choices.switching.energy_j[case, start.mode, n]
        x = min(max(x, low), high)
        for i in range(first[0, n], first[0, n + 1]):
            worth[i] = price[0] * choices.step_s[0] * chemical_power_at(power[i], x, battery)
    return worth


@compiled()
def _tangents(
    x: float, powers: Array, weight: float, tilt: float, battery: BatteryArrays, found: Array
) -> None:
    """(2, entry) height and slope of  weight r(x) + tilt x  for each of some powers, several of them at a time."""
    touch, capacity, efficiency = (
        touch_at(x, battery),
        battery.capacity_as,
        battery.coulombic_efficiency,
    )
    height, slope = found[0], found[1]
    for i in range(len(powers)):
        drain, rise = touching(powers[i], touch, capacity, efficiency)
        height[i] = weight * drain + tilt * x
        slope[i] = weight * rise + tilt


@compiled()
def worth_by_tangents(
    choices: Choices,
    price: Array,
    start: State,
    rollout: Array,
    steep: Flags,
    window: tuple[float, float],
    battery: BatteryArrays,
) -> Array:
    """(entry,) least of  p_t+1 r_t(x) + (p_t - p_t+1) x  over the window, from below, r convex and falling in x.

    rollout: (time,) where a tangent touches beside those at the window's ends
    steep: (entry,) whether r is too steep somewhere for a tangent; then r is at least its value at the upper end
    """
    first, power, step_s = choices.first, choices.power_w, choices.step_s
    low, high = window
    worth = _worth_with_first_step(choices, price, start, battery)
    found, touched = (
        np.empty((3, 2, (first[:, -1] - first[:, 0]).max())),
        np.array([low, low, high]),
    )
    for k in range(1, len(step_s)):
        begin, end, weight, tilt = (
            first[k, 0],
            first[k, -1],
            price[k] * step_s[k],
            price[k - 1] - price[k],
        )
        touched[1] = min(max(rollout[k], low), high)
        for n in range(3):
            _tangents(touched[n], power[begin:end], weight, tilt, battery, found[n])
        for i in range(begin, end):
            if steep[i]:
                drain = chemical_power_at(power[i], high, battery)
                worth[i] = weight * drain + min(tilt * low, tilt * high)
                continue
            of, n = i - begin, 0
            while n < 3 and not found[n, 1, of] >= 0.0:
                n += 1
            # Where the envelope turns upward its least is where this tangent meets the last.
            if n == 0 or n == 3:
                worth[i] = found[min(n, 2), 0, of]
            else:
                y, s = found[:, 0, of], found[:, 1, of]
                worth[i] = _meeting(touched[n - 1], y[n - 1], s[n - 1], touched[n], y[n], s[n])
    return worth


@compiled()
def _meeting(x1: float, y1: float, s1: float, x2: float, y2: float, s2: float) -> float:
    """Height at which a falling tangent at x1 meets a rising one at x2, never above it."""
    if s2 - s1 <= 0.0:
        return min(y1, y2)
    x = (y2 - s2 * x2 - y1 + s1 * x1) / (s1 - s2)
    x = min(max(x, x1), x2)
    return min(y1 + s1 * (x - x1), y2 + s2 * (x - x2))


@compiled()
def worth_by_cells(
    choices: Choices, price: Array, start: State, cells: WindowCells, battery: BatteryArrays
) -> Array:
    """As worth_by_tangents, for any curves: the least over cells, r from below within each."""
    first, power, step_s = choices.first, choices.power_w, choices.step_s
    edges, voltage, discharge, charging, efficiency = cells
    worth = _worth_with_first_step(choices, price, start, battery)
    for k in range(1, len(step_s)):
        after = price[k]
        tilt = price[k - 1] - after
        for i in range(first[k, 0], first[k, -1]):
            best = np.inf
            for c in range(len(voltage)):
                drain = chemical_power(power[i], voltage[c], discharge[c], charging[c], efficiency)
                if np.isnan(drain):
                    continue
                x = edges[c] if tilt >= 0.0 else edges[c + 1]
                best = min(best, after * step_s[k] * drain + tilt * x)
            worth[i] = best
    return worth


@compiled()
def linear_steps(
    choices: Choices, energy: Array, rollout_power: Array, battery: BatteryArrays
) -> tuple[Array, Array]:
    """Fall of energy of every entry at the rollout, (entry,), and the share of x a step keeps, (time,)."""
    first, power, step_s = choices.first, choices.power_w, choices.step_s
    drain = np.empty(len(power))
    keep = np.empty(len(step_s))
    for k in range(len(step_s)):
        _, slope = drain_and_slope(rollout_power[k], energy[k], battery)
        keep[k] = 1.0 - step_s[k] * slope
        for i in range(first[k, 0], first[k, -1]):
            drain[i] = step_s[k] * chemical_power_at(power[i], energy[k], battery)
    return drain, keep


@compiled()
def lower_hull(step: Indices, drain: Array, cost: Array, order: Indices) -> Flags:
    """(entry,) whether an entry is a corner of its step's lower hull of cost over drain, falling part.

    order: entries sorted by step, then drain, then cost. Mixtures of corners cost no more than any other entry.
    """
    count = len(order)
    stack = np.empty(count, dtype=np.int64)
    kept = np.zeros(count, dtype=np.bool_)
    bottom = top = 0
    for place in range(count):
        i = order[place]
        if place == 0 or step[i] != step[order[place - 1]]:
            bottom = top
        if top > bottom and cost[i] >= cost[stack[top - 1]]:
            continue
        while top - bottom >= 2:
            a, b = stack[top - 2], stack[top - 1]
            if (cost[b] - cost[a]) * (drain[i] - drain[a]) < (cost[i] - cost[a]) * (
                drain[b] - drain[a]
            ):
                break
            top -= 1
        stack[top] = i
        top += 1
    kept[stack[:top]] = True
    return kept
