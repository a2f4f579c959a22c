"""Compiled rollout on stored energy with the true battery step."""

from typing import NamedTuple

import numpy as np

from hevopt._compile import compiled
from hevopt.problem._battery_kernels import (
    BatteryArrays,
    chemical_power,
    state_at,
)
from hevopt.problem.arrays import Array, Flags, Indices
from hevopt.problem.choices import Choices
from hevopt.strategies._reach_kernels import Reach


class Grid(NamedTuple):
    """Even grids of stored energy, one before each step and one at the end: low_j[k] + cell_j x node.

    low_j: (time + 1,)
    """

    low_j: Array
    cell_j: float


class Course(NamedTuple):
    """How far a rollout has come.

    path: (time,) entries; energy, mode: (time + 1,) before each step; closed: (entry,) dead ends
    after, total: (entry,) room for stored energies after a step, and for what it costs from there on
    at: [present step, furthest step, moves made]
    """

    path: Indices
    energy: Array
    mode: Indices
    closed: Flags
    at: Indices
    after: Array
    total: Array


@compiled(bare=True)
def _afters(
    low: int,
    high: int,
    energy: float,
    state: tuple[float, float, float],
    step: float,
    efficiency: float,
    power: Array,
    after: Array,
) -> None:
    """Stored energy after a step with each of the entries low <= i < high, several of them at a time."""
    voltage, discharge, charging = state
    some, left = power[low:high], after[low:high]
    for i in range(high - low):
        left[i] = energy - step * chemical_power(some[i], voltage, discharge, charging, efficiency)


@compiled(bare=True)
def _totals(
    low: int,
    high: int,
    choices: Choices,
    switch_kg: float,
    ahead: Array,
    grid: tuple[float, float],
    inside: tuple[float, float],
    progress: Course,
) -> None:
    """What a step costs with each of the entries low <= i < high and from there on, inf where it may not be taken,
    several of them at a time.

    ahead: (node,) cost-to-go after the step; grid: its lowest node and its cells; inside: where a step may end
    """
    cost, after, closed = (
        choices.cost_kg[low:high],
        progress.after[low:high],
        progress.closed[low:high],
    )
    total, nodes = progress.total[low:high], len(ahead)
    (low_j, cell_j), (least, greatest) = grid, inside
    if nodes == 2:
        for i in range(high - low):
            share = (after[i] - low_j) / cell_j
            to_go = ahead[0] * (1.0 - share) + ahead[1] * share
            able = (not closed[i]) & (least <= after[i]) & (after[i] <= greatest)
            total[i] = cost[i] + switch_kg + to_go if able else np.inf
        return
    for i in range(high - low):
        total[i] = np.inf
        if not closed[i] and least <= after[i] <= greatest:
            place = (after[i] - low_j) / cell_j
            j = min(max(int(np.floor(place)), 0), nodes - 2)
            share = place - j
            to_go = ahead[j] * (1.0 - share) + ahead[j + 1] * share
            total[i] = cost[i] + switch_kg + to_go


@compiled(bare=True)
def _best_choice(
    choices: Choices,
    k: int,
    ahead: Array,
    grid: Grid,
    reach: Reach,
    battery: BatteryArrays,
    progress: Course,
) -> tuple[int, int, float]:
    """Entry of least cost + switching + cost-to-go at step k, -1 where none is left; mode and energy after it.

    ahead: (mode, node) cost-to-go after the step
    """
    first, modes = choices.first, choices.first.shape[1] - 1
    least, greatest, window = reach
    low, high = window
    slack = 1e-12 * abs(greatest[-1, 0])
    before, mode = progress.energy[k], progress.mode[k]
    switching, case = choices.switching, choices.switching.case[k]
    best, chosen, chosen_mode, chosen_energy = np.inf, -1, 0, 0.0
    energy, efficiency = before, battery.coulombic_efficiency
    state = state_at(energy, battery)[1:]
    for n in range(modes):
        if not switching.allowed[case, mode, n]:
            continue
        if before - switching.energy_j[case, mode, n] != energy:
            energy = before - switching.energy_j[case, mode, n]
            state = state_at(energy, battery)[1:]
        if not (low - slack <= energy <= high + slack):
            continue
        begin, end = first[k, n], first[k, n + 1]
        afters = progress.after
        _afters(begin, end, energy, state, choices.step_s[k], efficiency, choices.power_w, afters)
        span = grid.low_j[k + 1], grid.cell_j
        inside = least[k + 1, n] - slack, greatest[k + 1, n] + slack
        switch_kg = switching.kg[case, mode, n]
        _totals(begin, end, choices, switch_kg, ahead[n], span, inside, progress)
        for i in range(begin, end):
            if progress.total[i] < best:
                best, chosen, chosen_mode = progress.total[i], i, n
                chosen_energy = afters[i]
    return chosen, chosen_mode, chosen_energy


@compiled()
def rollout(
    choices: Choices,
    begin: int,
    value: Array,
    grid: Grid,
    reach: Reach,
    battery: BatteryArrays,
    progress: Course,
    budget: int,
) -> None:
    """Go on along a value function until its last step, or back out of its first one, `begin`.

    value: (step + 1, mode, node) cost-to-go from `begin` on, linear between nodes and beyond them
    A choice that leads where the end cannot be reached is not taken; a dead end is left the way it was
    entered and closed, so that with enough budget every path is tried.
    """
    first, end = choices.first, begin + len(value) - 1
    path, energy, mode, closed, at, _, _ = progress
    k, furthest, moves = at[0], at[1], at[2]
    while begin <= k < end and moves < budget:
        moves += 1
        ahead = value[k + 1 - begin]
        chosen, next_mode, next_energy = _best_choice(
            choices, k, ahead, grid, reach, battery, progress
        )
        if chosen < 0:
            closed[first[k, 0] : first[k, -1]] = False
            k -= 1
            if k >= 0:
                closed[path[k]] = True
            continue
        path[k] = chosen
        energy[k + 1], mode[k + 1] = next_energy, next_mode
        k += 1
        furthest = max(furthest, k)
    at[0], at[1], at[2] = k, furthest, moves
