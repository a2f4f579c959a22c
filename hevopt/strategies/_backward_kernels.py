"""Compiled backward recursion of dynamic programming over stored energy, with the true battery step."""

from typing import NamedTuple

import numpy as np

from hevopt._compile import compiled
from hevopt.problem._battery_kernels import BatteryArrays, chemical_power, state_at
from hevopt.problem.arrays import Array, Indices
from hevopt.problem.choices import Choices
from hevopt.problem.switching import Switching
from hevopt.strategies._rollout_kernels import Grid

# Divisions of the grid between which a move over curved battery characteristics is taken as linear.
_PIECES = 24


class Penalty(NamedTuple):
    """What takes the place of infinity: per cell below a grid and above it, and where no path is known."""

    floor_kg: float
    ceiling_kg: float
    unreachable_kg: float


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
    cells = int(np.floor(start))
    if np.floor(start + slope * (high - 1 - low)) == cells and -low <= cells <= nodes - 1 - high:
        # All within the grid, and by the same number of whole cells, as for most.
        _relax(best, value, cost, low, high, cells, start - cells, slope)
        return
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
def _moves(
    power: Array,
    state: Array,
    efficiency: float,
    scale: float,
    drift: float,
    moved: Array,
) -> None:
    """(entry,) cells that each of some powers moves a node of a battery's state by, several of them at a time."""
    voltage, discharge, charging = state[0], state[1], state[2]
    for i in range(len(power)):
        moved[i] = drift + scale * chemical_power(
            power[i], voltage, discharge, charging, efficiency
        )


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
def _switch_back(
    value: Array,
    least: Array,
    switching: Switching,
    k: int,
    apart: float,
    cell: float,
    penalty: Penalty,
) -> None:
    """Fill the cost-to-go (mode, node) before switching from the least after it.

    apart: cells from the grid between switching and step up to that before switching
    """
    case, modes, nodes = switching.case[k], value.shape[0], value.shape[1]
    for m in range(modes):
        value[m] = penalty.unreachable_kg
        for n in range(modes):
            if not switching.allowed[case, m, n]:
                continue
            kg, down = switching.kg[case, m, n], apart - switching.energy_j[case, m, n] / cell
            if down == 0.0:
                _lower(value[m], least[n], kg)
            else:
                _shift(value[m], least[n], kg, 0, nodes, down, 0.0, penalty)


def backward(
    choices: Choices,
    terminal: Array,
    grid: Grid,
    between_j: Array,
    penalty: Penalty,
    battery: BatteryArrays,
) -> Array:
    """Cost-to-go (time + 1, mode, node) by value iteration over stored energy.

    terminal: (mode, node) cost-to-go after the last step
    between_j: (time,) bottom of the grid between switching and step; that of `grid` where switching takes none
    """
    # NumPy asks for large pages of memory, compiled loops do not; small ones would take a third of the time.
    value = np.empty((choices.steps + 1, *terminal.shape))
    value[-1] = terminal
    _fill_back(choices, value, grid, between_j, penalty, battery)
    return value


@compiled()
def _fill_back(
    choices: Choices,
    value: Array,
    grid: Grid,
    between_j: Array,
    penalty: Penalty,
    battery: BatteryArrays,
) -> None:
    """Fill the cost-to-go (time + 1, mode, node) back from its last row.

    A choice moves every node by nearly the same energy; between the points of the battery's curves the move
    is taken as linear in the node, so that the inner loop runs over contiguous memory. Switching is added
    once per mode, after the minimum over the mode's choices; the energy it takes shifts all nodes alike.
    """
    first, grid_low, cell = choices.first, grid.low_j, grid.cell_j
    steps, modes, nodes = first.shape[0], value.shape[1], value.shape[2]
    least, moved = np.empty((modes, nodes)), np.empty((2, (first[:, -1] - first[:, 0]).max()))
    efficiency = battery.coulombic_efficiency
    for k in range(steps - 1, -1, -1):
        breaks, states = _bends(between_j[k], cell, nodes, battery)
        drift = (between_j[k] - grid_low[k + 1]) / cell
        scale = -choices.step_s[k] / cell
        for n in range(modes):
            least[n] = penalty.unreachable_kg
            begin, end = first[k, n], first[k, n + 1]
            power, cost = choices.power_w[begin:end], choices.cost_kg[begin:end]
            _moves(power, states[0], efficiency, scale, drift, moved[0])
            for b in range(len(breaks) - 1):
                low, high = breaks[b], breaks[b + 1]
                start, after = moved[b % 2], moved[(b + 1) % 2]
                _moves(power, states[b + 1], efficiency, scale, drift, after)
                last = high + 1 if b == len(breaks) - 2 else high
                for i in range(end - begin):
                    slope = (after[i] - start[i]) / (high - low)
                    _shift(least[n], value[k + 1, n], cost[i], low, last, start[i], slope, penalty)
        apart = (grid_low[k] - between_j[k]) / cell
        _switch_back(value[k], least, choices.switching, k, apart, cell, penalty)
