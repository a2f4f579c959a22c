"""Compiled backward recursion of dynamic programming over stored energy, with the true battery step."""

from typing import NamedTuple

import numpy as np

from hevopt._compile import compiled
from hevopt.problem._battery_kernels import BatteryArrays, chemical_power, state_at
from hevopt.problem.arrays import Array, Indices
from hevopt.problem.choices import Choices, by_power
from hevopt.problem.switching import Switching
from hevopt.strategies._contending_kernels import Penalty, Room, contenders, rises_of, room_for
from hevopt.strategies._rollout_kernels import Grid

# Divisions of a whole battery's energy between which a move over its curves is taken as linear, and about
# the fewest and the most nodes of a grid that are one.
_DIVISIONS, _NODES_LEAST, _NODES_MOST = 40, 40, 128


# Where a lesser value is kept, 0.0 is added, which changes none: without it a loop stores only where it is less,
# which takes some machines more than twice as long.


@compiled(bare=True)
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
        here[j] = min(here[j], candidate) + 0.0


@compiled(bare=True)
def _line(best: Array, low: int, high: int, start: float, slope: float) -> None:
    """best[j] = min(best[j], start + slope (j - low)) for low <= j < high."""
    here = best[low:high]
    for j in range(high - low):
        here[j] = min(here[j], start + slope * np.int32(j)) + 0.0


@compiled(bare=True)
def _lower(best: Array, other: Array, extra: float) -> None:
    """best[j] = min(best[j], other[j] + extra)."""
    for j in range(len(best)):
        best[j] = min(best[j], other[j] + extra) + 0.0


@compiled(bare=True)
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


class _Moving(NamedTuple):
    """What a step does to the nodes of a grid.

    breaks: (division + 1,) nodes between which a move is taken as linear
    states: (division + 1, 3) open-circuit voltage and resistances there
    scale, drift: cells per chemical power, and those that the next grid lies lower by
    """

    breaks: Indices
    states: Array
    efficiency: float
    scale: float
    drift: float


@compiled(bare=True)
def _moves(power: Array, moving: _Moving, b: int, moved: Array) -> None:
    """(entry,) cells that each of some powers moves a node by, several of them at a time."""
    voltage, discharge, charging = moving.states[b, 0], moving.states[b, 1], moving.states[b, 2]
    for i in range(len(power)):
        moved[i] = moving.drift + moving.scale * chemical_power(
            power[i], voltage, discharge, charging, moving.efficiency
        )


@compiled()
def _bends(
    grid_low: float, cell: float, nodes: int, battery: BatteryArrays
) -> tuple[Indices, Array]:
    """Nodes between which a move is taken as linear, the ends among them; voltage and resistances there."""
    share = cell * (nodes - 1) / (battery.energy_j[-1] - battery.energy_j[0])
    fine = min(int(np.ceil(_DIVISIONS * share)), nodes // _NODES_LEAST)
    divisions = max(fine, nodes // _NODES_MOST, 1)
    breaks = np.empty(divisions + 1, dtype=np.int64)
    states = np.empty((divisions + 1, 3))
    for b in range(divisions + 1):
        breaks[b] = b * (nodes - 1) // divisions
        _, voltage, discharge, charging = state_at(grid_low + cell * breaks[b], battery)
        states[b, 0], states[b, 1], states[b, 2] = voltage, discharge, charging
    return breaks, states


@compiled(bare=True)
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
    choices = by_power(choices)
    # NumPy asks for large pages of memory, compiled loops do not; small ones would take a third of the time.
    value = np.empty((choices.steps + 1, *terminal.shape))
    value[-1] = terminal
    _fill_back(choices, value, grid, between_j, penalty, battery)
    return value


@compiled(bare=True)
def _step_back(
    best: Array,
    value: Array,
    cost: Array,
    power: Array,
    moving: _Moving,
    penalty: Penalty,
    room: Room,
) -> None:
    """Lower the best (node,) of a step to that of its choices, (entry,) by rising power; value: after it."""
    breaks, nodes, entries = moving.breaks, len(value), len(cost)
    if entries > 1:
        rises_of(value, room)
    _moves(power, moving, 0, room.moved[0, :entries])
    for b in range(len(breaks) - 1):
        low, high = breaks[b], breaks[b + 1]
        start, after = room.moved[b % 2, :entries], room.moved[(b + 1) % 2, :entries]
        _moves(power, moving, b + 1, after)
        first, last = contenders(cost, start, after, (low, high), nodes, penalty, room)
        end = high + 1 if b == len(breaks) - 2 else high
        for c in range(first, last):
            i = room.kept[c]
            slope = (after[i] - start[i]) / (high - low)
            _shift(best, value, cost[i], low, end, start[i], slope, penalty)


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
    least = np.empty((modes, nodes))
    room = room_for(nodes, (first[:, -1] - first[:, 0]).max())
    for k in range(steps - 1, -1, -1):
        breaks, states = _bends(between_j[k], cell, nodes, battery)
        moving = _Moving(
            breaks,
            states,
            battery.coulombic_efficiency,
            -choices.step_s[k] / cell,
            (between_j[k] - grid_low[k + 1]) / cell,
        )
        for n in range(modes):
            least[n] = penalty.unreachable_kg
            begin, end = first[k, n], first[k, n + 1]
            _step_back(
                least[n], value[k + 1, n], choices.cost_kg[begin:end], choices.power_w[begin:end],
                moving, penalty, room,
            )  # fmt: skip
        apart = (grid_low[k] - between_j[k]) / cell
        _switch_back(value[k], least, choices.switching, k, apart, cell, penalty)
