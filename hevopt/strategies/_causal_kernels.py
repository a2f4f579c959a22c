"""Compiled decisions of the causal strategies: one step each, and nothing ahead of it.

Choices are those of choices.py. A value function is linear between the nodes of a grid of stored energy.
"""

from typing import NamedTuple

import numpy as np

from hevopt._compile import compiled
from hevopt.problem._battery_kernels import BatteryArrays, chemical_power, state_at
from hevopt.problem.arrays import Array, Flags
from hevopt.problem.choices import Choices, State
from hevopt.problem.switching import Switching

# Halvings of the bracket in which a factor over past steps is searched.
_HALVINGS = 14


class SteadyGrid(NamedTuple):
    """An even grid of stored energy, the same at every step: low_j + cell_j x node."""

    low_j: float
    cell_j: float


class View(NamedTuple):
    """What the adaptive factor looks at.

    drain_j: (entry,) fall of stored energy at the start's state of charge, read for past steps only
    interval_s: (time,) from a step's decision to the next
    speed_mps, braking: (time,) of the wheels
    """

    drain_j: Array
    interval_s: Array
    speed_mps: Array
    braking: Flags


class Feedback(NamedTuple):
    """Parameters of the adaptive factor; a_ecms.py says what they mean and where they come from.

    base_kgpj: of a battery that loses nothing in charging; `AdaptiveFactor` holds that of its own
    """

    base_kgpj: float
    proportional: float
    integral_s: float
    integral_max: float
    start_share: float
    recovered_jpv2: float
    recovered_weight_v2: float
    edge: float
    window_s: float
    window_reach: float


class Memory(NamedTuple):
    """What the adaptive factor has learnt of the steps so far.

    recovered_j, slowed_v2: energy stored while braking, and fall of the square of speed
    base_kgpj, since_s: the factor's base, and the time since it moved; integral: of the missing charge
    oldest, span_s: first step of the past window, and its length
    row, energy_j: the last step, -1 before the first, and what was stored before it
    """

    recovered_j: float
    slowed_v2: float
    base_kgpj: float
    integral: float
    since_s: float
    oldest: int
    span_s: float
    row: int
    energy_j: float


@compiled(bare=True)
def _switchable(switching: Switching, case: int, mode: int) -> tuple[float, float]:
    """Most stored energy that a switch from a mode takes, and least, below 0 where it gives back."""
    most, least = 0.0, 0.0
    for n in range(switching.kg.shape[1]):
        if switching.allowed[case, mode, n]:
            most = max(most, switching.energy_j[case, mode, n])
            least = min(least, switching.energy_j[case, mode, n])
    return most, least


@compiled(bare=True)
def decide(
    choices: Choices, k: int, state: State, value: Array, grid: SteadyGrid, battery: BatteryArrays
) -> tuple[int, State]:
    """Entry and state after the choice of least cost + switching + value ahead.

    value: (mode, node), the window's ends being the grid's first and last node.
    Only choices that stay within the window count, between switching and step too, and leave room for the next
    switch, as far as the present step tells; where none does, the one that lacks least room is taken, and the one
    that leaves the window least where each leaves it.
    """
    first, cost, power = choices.first, choices.cost_kg, choices.power_w
    modes, nodes = value.shape
    mode, energy = state
    low, cell = grid
    switching, case = choices.switching, choices.switching.case[k]
    high = low + cell * (nodes - 1)
    between = energy
    _, voltage, discharge, charging = state_at(between, battery)
    best, entry, next_mode, next_energy = np.inf, -1, mode, energy
    least_out, way_out, out_mode, out_energy = np.inf, -1, mode, energy
    for n in range(modes):
        if not switching.allowed[case, mode, n]:
            continue
        if energy - switching.energy_j[case, mode, n] != between:
            between = energy - switching.energy_j[case, mode, n]
            _, voltage, discharge, charging = state_at(between, battery)
        switched_out = max(low - between, between - high) if between != energy else -np.inf
        taken, given = _switchable(switching, case, n)
        for i in range(first[k, n], first[k, n + 1]):
            rate = chemical_power(
                power[i], voltage, discharge, charging, battery.coulombic_efficiency
            )
            after = between - choices.step_s[k] * rate
            outside = max(max(low - after, after - high), switched_out)
            # Leaving the window is worse than any lack of room.
            room = min(max(low + taken - after, after - high - given), high - low)
            outside = room if outside <= 0.0 else outside + (high - low)
            if not outside <= 0.0:  # nor where the voltage cannot deliver the power, NaN
                if outside < least_out:
                    least_out, way_out, out_mode, out_energy = outside, i, n, after
                continue
            place = (after - low) / cell
            j = min(int(place), nodes - 2)
            ahead = value[n, j] + (place - j) * (value[n, j + 1] - value[n, j])
            total = cost[i] + switching.kg[case, mode, n] + ahead
            if total < best:
                best, entry, next_mode, next_energy = total, i, n, after
    if entry < 0:
        return way_out, State(out_mode, out_energy)
    return entry, State(next_mode, next_energy)


@compiled(bare=True)
def neutral_factor(
    choices: Choices,
    drain: Array,
    steps: tuple[int, int],
    wanted_j: float,
    bracket: tuple[float, float],
) -> float:
    """The factor within a bracket at which steps from the first up to the second, each of least cost + factor x
    drain, would have drained `wanted_j` in all; the nearer end where none does."""
    first, cost = choices.first, choices.cost_kg
    start, end = steps
    low, high = bracket
    for _ in range(_HALVINGS):
        factor = 0.5 * (low + high)
        drained = 0.0
        for k in range(start, end):
            best, of_best = np.inf, 0.0
            for i in range(first[k, 0], first[k, -1]):
                total = cost[i] + factor * drain[i]
                if total < best:
                    best, of_best = total, drain[i]
            drained += of_best
        if drained > wanted_j:
            low = factor
        else:
            high = factor
    return 0.5 * (low + high)


@compiled(bare=True)
def _factor(
    p: Feedback,
    base: float,
    shortage: float,
    integral: float,
    energy: float,
    window: tuple[float, float],
) -> float:
    """Equivalence factor for a shortage of charge, and steeper or gone near the window's ends."""
    low, high = window
    edge_j = p.edge * (high - low)
    factor = base * (1.0 + p.proportional * shortage + integral)
    factor *= 1.0 + 3.0 * max(1.0 - (energy - low) / edge_j, 0.0)
    return max(factor * min(max((high - energy) / edge_j, 0.0), 1.0), 0.0)


@compiled(bare=True)
def regained(recovered: float, braking: bool, before: float, after: float) -> float:
    """Energy recovered so far, with what a step that braked has stored, given the charge before it and after."""
    return recovered + max(after - before, 0.0) if braking else recovered


@compiled(bare=True)
def adaptive(
    choices: Choices,
    k: int,
    state: State,
    view: View,
    memory: Memory,
    target: float,
    window: tuple[float, float],
    p: Feedback,
    battery: BatteryArrays,
    value: Array,
) -> tuple[int, float, Memory]:
    """Entry of step k, the factor that it is taken under, and what is remembered from then on.

    value: (mode, 2) room
    memory: that of the step before, k - 1 where a window of past steps is looked at, else whichever it was
    """
    drain, step_s, speed, braking = view
    low, high = window
    energy = state.energy_j
    recovered, slowed, base, integral, since, oldest, span_s, row, before = memory
    if row >= 0:
        recovered = regained(recovered, braking[row], before, energy)
        slowed += max(speed[row] ** 2 - speed[k] ** 2, 0.0)
        since += step_s[row]
        span_s += step_s[row]
    while oldest < k and span_s > p.window_s:
        span_s -= step_s[oldest]
        oldest += 1
    if span_s > 0.9 * p.window_s and since > 0.25 * p.window_s:
        owed = recovered / slowed * (speed[k] ** 2 - speed[oldest] ** 2)
        bracket = p.base_kgpj * (1.0 - p.window_reach), p.base_kgpj * (1.0 + p.window_reach)
        base = neutral_factor(choices, drain, (oldest, k), owed, bracket)
        since = 0.0
    reference = target - recovered / slowed * speed[k] ** 2
    shortage = (reference - energy) / (0.5 * (high - low))
    integral += shortage * step_s[k] / p.integral_s
    integral = min(max(integral, -p.integral_max), p.integral_max)
    factor = _factor(p, base, shortage, integral, energy, window)
    # A switch pays its share at once: the rest of it is handed back.
    later, case = 1.0 - p.start_share, choices.switching.case[k]
    for n in range(len(value)):
        switched_kg = factor * choices.switching.energy_j[case, state.mode, n]
        handed_kg = later * (choices.switching.kg[case, state.mode, n] + switched_kg)
        value[n, 0], value[n, 1] = -handed_kg, -factor * (high - low) - handed_kg
    entry, _ = decide(choices, k, state, value, SteadyGrid(low, high - low), battery)
    seen = Memory(recovered, slowed, base, integral, since, oldest, span_s, k, energy)
    return entry, factor, seen
