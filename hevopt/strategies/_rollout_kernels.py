"""Compiled backward recursion and rollout, all on stored energy with the true battery step."""

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

# Divisions of the grid between which a move over curved battery characteristics is taken as linear.
_PIECES = 24


class Grid(NamedTuple):
    """Even grids of stored energy, one before each step and one at the end: low_j[k] + cell_j x node.

    low_j: (time + 1,)
    """

    low_j: Array
    cell_j: float


class Penalty(NamedTuple):
    """What takes the place of infinity: per cell below a grid and above it, and where no path is known."""

    floor_kg: float
    ceiling_kg: float
    unreachable_kg: float


class Progress(NamedTuple):
    """How far a rollout has come.

    path: (time,) entries; energy, mode: (time + 1,) before each step; closed: (entry,) dead ends
    at: [present step, furthest step, moves made]
    """

    path: Indices
    energy: Array
    mode: Indices
    closed: Flags
    at: Indices


@compiled()
def _best_choice(
    choices: Choices,
    k: int,
    ahead: Array,
    grid: Grid,
    reach: Reach,
    battery: BatteryArrays,
    progress: Progress,
) -> tuple[int, int, float]:
    """Entry of least cost + switching + cost-to-go at step k, -1 where none is left; mode and energy after it.

    ahead: (mode, node) cost-to-go after the step
    """
    first, modes, nodes = choices.first, choices.first.shape[1] - 1, ahead.shape[1]
    least, greatest = reach
    slack = 1e-12 * abs(greatest[-1, 0])
    energy, mode = progress.energy[k], progress.mode[k]
    best, chosen, chosen_mode, chosen_energy = np.inf, -1, 0, 0.0
    _, voltage, discharge, charging = state_at(energy, battery)
    for n in range(modes):
        if not choices.switch_allowed[mode, n]:
            continue
        for i in range(first[k, n], first[k, n + 1]):
            if progress.closed[i]:
                continue
            drain = chemical_power(
                choices.power_w[i], voltage, discharge, charging, battery.coulombic_efficiency
            )
            after = energy - choices.step_s[k] * drain
            if not (least[k + 1, n] - slack <= after <= greatest[k + 1, n] + slack):
                continue
            place = (after - grid.low_j[k + 1]) / grid.cell_j
            j = min(max(int(np.floor(place)), 0), nodes - 2)
            share = place - j
            to_go = ahead[n, j] * (1.0 - share) + ahead[n, j + 1] * share
            total = choices.cost_kg[i] + choices.switch_kg[mode, n] + to_go
            if total < best:
                best, chosen, chosen_mode, chosen_energy = total, i, n, after
    return chosen, chosen_mode, chosen_energy


@compiled()
def rollout(
    choices: Choices,
    begin: int,
    value: Array,
    grid: Grid,
    reach: Reach,
    battery: BatteryArrays,
    progress: Progress,
    budget: int,
) -> None:
    """Go on along a value function until its last step, or back out of its first one, `begin`.

    value: (step + 1, mode, node) cost-to-go from `begin` on, linear between nodes and beyond them
    A choice that leads where the end cannot be reached is not taken; a dead end is left the way it was
    entered and closed, so that with enough budget every path is tried.
    """
    first, end = choices.first, begin + len(value) - 1
    path, energy, mode, closed, at = progress
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


@compiled()
def _relax(
    best: Array,
    value: Array,
    cost: float,
    low: int,
    high: int,
    cells: int,
    share: float,
    share_slope: float,
) -> None:
    """best[j] = min(best[j], cost + value at node j + cells + share_j) for low <= j < high."""
    ahead = value[low + cells : high + cells + 1]
    here = best[low:high]
    for j in range(high - low):
        weight = share + share_slope * np.int32(j)
        candidate = cost + ahead[j] + weight * (ahead[j + 1] - ahead[j])
        here[j] = min(here[j], candidate)


@compiled()
def _line(best: Array, low: int, high: int, start: float, slope: float) -> None:
    """best[j] = min(best[j], start + slope (j - low)) for low <= j < high."""
    here = best[low:high]
    for j in range(high - low):
        here[j] = min(here[j], start + slope * np.int32(j))


@compiled()
def _lower(best: Array, other: Array, extra: float) -> None:
    """best[j] = min(best[j], other[j] + extra)."""
    for j in range(len(best)):
        best[j] = min(best[j], other[j] + extra)


@compiled()
def _shift(
    best: Array,
    value: Array,
    cost: float,
    low: int,
    high: int,
    start: float,
    slope: float,
    penalty: Penalty,
) -> None:
    """Relax nodes low <= j < high whose target lies start + slope (j - low) cells away."""
    floor_kg, ceiling_kg, _ = penalty
    nodes = len(value)
    j = low
    while j < high:
        moved = start + slope * (j - low)
        cells = int(np.floor(moved))
        # The run of nodes over which the whole cells stay the same: slope is far below one.
        # A tiny slope needs more nodes than a whole number holds.
        run = high
        further = float(high)
        if slope > 0:
            further = np.ceil((cells + 1 - start) / slope)
        elif slope < 0:
            further = np.floor((cells - start) / slope) + 1.0
        if further < high - low:
            run = max(low + int(further), j + 1)
        bottom = min(max(j, -cells), run)
        top = max(min(run, nodes - 1 - cells), bottom)
        if bottom > j:
            below = -(j + start + slope * (j - low))
            at_first = cost + value[0] + floor_kg * below
            _line(best, j, bottom, at_first, -floor_kg * (1.0 + slope))
        if top > bottom:
            first_share = start + slope * (bottom - low) - cells
            _relax(best, value, cost, bottom, top, cells, first_share, slope)
        if run > top:
            above = top + start + slope * (top - low) - (nodes - 1)
            at_first = cost + value[nodes - 1] + ceiling_kg * above
            _line(best, top, run, at_first, ceiling_kg * (1.0 + slope))
        j = run


@compiled()
def _bends(
    grid_low: float, cell: float, nodes: int, battery: BatteryArrays
) -> tuple[Indices, Array]:
    """Nodes between which a move is taken as linear, and voltage and resistances there.

    The ends, where voltage is linear in SOC and resistance constant; else also _PIECES even divisions.
    """
    constant = np.ptp(battery.discharge_ohm) == 0.0 and np.ptp(battery.charge_ohm) == 0.0
    pieces = 1 if constant and len(battery.soc) == 2 else min(_PIECES, nodes - 1)
    breaks = np.empty(pieces + 1, dtype=np.int64)
    states = np.empty((pieces + 1, 3))
    for b in range(pieces + 1):
        breaks[b] = b * (nodes - 1) // pieces
        _, voltage, discharge, charging = state_at(grid_low + cell * breaks[b], battery)
        states[b, 0], states[b, 1], states[b, 2] = voltage, discharge, charging
    return breaks, states


@compiled()
def backward(
    choices: Choices, terminal: Array, grid: Grid, penalty: Penalty, battery: BatteryArrays
) -> Array:
    """Cost-to-go (time + 1, mode, node) by value iteration over stored energy.

    terminal: (mode, node) cost-to-go after the last step.
    A choice moves every node by nearly the same energy; between the points of the battery's curves the move
    is taken as linear in the node, so that the inner loop runs over contiguous memory. Switching is added
    once per mode, after the minimum over the mode's choices.
    """
    first, grid_low, cell = choices.first, grid.low_j, grid.cell_j
    steps, modes = first.shape[0], first.shape[1] - 1
    nodes = terminal.shape[1]
    value = np.empty((steps + 1, modes, nodes))
    least = np.empty((modes, nodes))
    efficiency = battery.coulombic_efficiency
    value[steps] = terminal
    for k in range(steps - 1, -1, -1):
        breaks, states = _bends(grid_low[k], cell, nodes, battery)
        drift = (grid_low[k] - grid_low[k + 1]) / cell
        scale = -choices.step_s[k] / cell
        for n in range(modes):
            least[n] = penalty.unreachable_kg
            for i in range(first[k, n], first[k, n + 1]):
                p = choices.power_w[i]
                end = drift + scale * chemical_power(
                    p, states[0, 0], states[0, 1], states[0, 2], efficiency
                )
                for b in range(len(breaks) - 1):
                    low, high = breaks[b], breaks[b + 1]
                    start = end
                    end = drift + scale * chemical_power(
                        p, states[b + 1, 0], states[b + 1, 1], states[b + 1, 2], efficiency
                    )
                    last = high + 1 if b == len(breaks) - 2 else high
                    slope = (end - start) / (high - low)
                    _shift(
                        least[n], value[k + 1, n], choices.cost_kg[i], low, last, start, slope,
                        penalty,
                    )  # fmt: skip
        for m in range(modes):
            value[k, m] = penalty.unreachable_kg
            for n in range(modes):
                if choices.switch_allowed[m, n]:
                    _lower(value[k, m], least[n], choices.switch_kg[m, n])
    return value
