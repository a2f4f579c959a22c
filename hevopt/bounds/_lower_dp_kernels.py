"""Compiled parts of the lower-bound dynamic program; the proof is in lower_dp.py."""

from typing import NamedTuple

import numpy as np

from hevopt._compile import compiled
from hevopt.bounds._step_prices_kernels import WindowCells
from hevopt.problem._battery_kernels import BatteryArrays, chemical_power, drain_and_slope
from hevopt.problem.arrays import Array, Flags, Indices
from hevopt.problem.choices import Choices
from hevopt.problem.switching import Switching


class PartedGrid(NamedTuple):
    """An even grid of stored energy, the nodes that part it into pieces and their energies, (piece + 1,)."""

    low_j: float
    cell_j: float
    breaks: Indices
    breaks_j: Array


class Moves(NamedTuple):
    """Upper bounds of the choices' moves, in cells: offset + rise x node, (entry, piece) each.

    switch: (case, mode, mode) whole cells that switching takes, or fewer
    """

    breaks: Indices
    offset: Array
    rise: Array
    switch: Indices


class Relaxation(NamedTuple):
    """What takes the place of infinity: per cell below the grid, and where no path is known."""

    floor_kg: float
    unreachable_kg: float


@compiled()
def moves_by_tangents(
    choices: Choices, steep: Flags, grid: PartedGrid, battery: BatteryArrays
) -> tuple[Array, Array]:
    """(entry, piece) offset and rise of tangents above the move, in cells over nodes; move concave in energy.

    Tangents touch within the battery's curves. steep: (entry,) where the move counts as it is at their end.
    """
    first, power, step_s = choices.first, choices.power_w, choices.step_s
    grid_low, cell, breaks, _ = grid
    low, high = battery.energy_j[0], battery.energy_j[-1]
    pieces = len(breaks) - 1
    offset = np.empty((len(power), pieces))
    rise = np.empty((len(power), pieces))
    for k in range(len(step_s)):
        scale = step_s[k] / cell
        for i in range(first[k, 0], first[k, -1]):
            for b in range(pieces):
                middle = grid_low + cell * 0.5 * (breaks[b] + breaks[b + 1])
                at = high if steep[i] else min(max(middle, low), high)
                drain, slope = drain_and_slope(power[i], at, battery)
                rise[i, b] = 0.0 if steep[i] else -step_s[k] * slope
                offset[i, b] = -scale * drain - rise[i, b] * ((at - grid_low) / cell)
    return offset, rise


@compiled()
def moves_by_cells(choices: Choices, grid: PartedGrid, cells: WindowCells) -> Array:
    """(entry, piece) greatest move in cells within each piece, from the best of every window cell it touches."""
    first, power, step_s = choices.first, choices.power_w, choices.step_s
    edges, voltage, discharge, charging, efficiency = cells
    cell, piece_j = grid.cell_j, grid.breaks_j
    pieces = len(piece_j) - 1
    offset = np.full((len(power), pieces), -np.inf)
    for k in range(len(step_s)):
        for i in range(first[k, 0], first[k, -1]):
            b = 0
            for c in range(len(voltage)):
                drain = chemical_power(power[i], voltage[c], discharge[c], charging[c], efficiency)
                if np.isnan(drain):
                    continue
                while b < pieces - 1 and piece_j[b + 1] <= edges[c]:
                    b += 1
                n = b
                while n < pieces and piece_j[n] < edges[c + 1]:
                    offset[i, n] = max(offset[i, n], -step_s[k] * drain / cell)
                    n += 1
    return offset


@compiled()
def _lower_nodes(best: Array, ahead: Array, cost: float, share: float, rise: float) -> None:
    for j in range(len(best)):
        weight = share + rise * np.int32(j)
        # With 0.0, which changes nothing, all are stored: see _backward_kernels.py.
        best[j] = min(best[j], cost + ahead[j] + weight * (ahead[j + 1] - ahead[j])) + 0.0


@compiled()
def _raise_defects(
    defect: Array, best: Array, ahead: Array, cost: float, share: float, rise: float
) -> None:
    for j in range(len(defect)):
        weight = share + rise * np.int32(j)
        line = weight * best[j] + (1.0 - weight) * best[j + 1]
        defect[j] = max(defect[j], line - cost - ahead[j + 1]) + 0.0


@compiled()
def _run_end(low: int, high: int, start: float, rise: float, whole: int) -> int:
    """First cell at or after `low` whose move start + rise (cell - low) has left `whole`, at most `high`."""
    if rise <= 0.0:
        return high
    # A tiny rise needs more cells than a whole number holds.
    cells = np.ceil((whole + 1 - start) / rise)
    end = max(low + int(cells), low + 1) if cells < high - low else high
    while end > low + 1 and start + rise * (end - 1 - low) > whole + 1:
        end -= 1
    return end


@compiled()
def _switch_back(
    value: Array,
    best: Array,
    switching: Switching,
    cells: Indices,
    k: int,
    relaxation: Relaxation,
) -> None:
    """Fill the value (mode, node) before switching from that between switching and step k."""
    case, modes, nodes = switching.case[k], value.shape[0], value.shape[1]
    for m in range(modes):
        value[m] = relaxation.unreachable_kg
        for n in range(modes):
            if not switching.allowed[case, m, n]:
                continue
            kg, down = switching.kg[case, m, n], cells[case, m, n]
            bottom, top = min(max(down, 0), nodes), max(min(nodes + down, nodes), 0)
            for j in range(bottom):
                below_kg = relaxation.floor_kg * (down - j)
                value[m, j] = min(value[m, j], kg + best[n, 0] + below_kg)
            for j in range(bottom, top):
                value[m, j] = min(value[m, j], kg + best[n, j - down]) + 0.0
            for j in range(top, nodes):
                value[m, j] = min(value[m, j], kg + best[n, nodes - 1])


@compiled()
def lower_backward(
    choices: Choices, terminal: Array, moves: Moves, relaxation: Relaxation
) -> Array:
    """(mode, node) lower bound of the cost-to-go before the first step; terminal: the same after the last."""
    first, cost = choices.first, choices.cost_kg
    breaks, offset, rise, switch = moves
    floor_kg, unreachable_kg = relaxation
    steps, modes, nodes = first.shape[0], first.shape[1] - 1, terminal.shape[1]
    pieces = len(breaks) - 1
    furthest = 0.0
    for move in offset.flat:
        if move > -1e300:
            furthest = max(furthest, abs(move))
    pad = 3 + int(np.ceil(furthest + nodes * np.max(rise)))
    padded = np.empty((modes, nodes + 2 * pad))
    best = np.empty((modes, nodes))
    defect = np.empty(nodes - 1)
    value = terminal.copy()
    for k in range(steps - 1, -1, -1):
        for n in range(modes):
            for j in range(pad):
                padded[n, pad - 1 - j] = value[n, 0] + floor_kg * (j + 1)
                padded[n, pad + nodes + j] = value[n, nodes - 1]
            padded[n, pad : pad + nodes] = value[n]
        for n in range(modes):
            best[n] = unreachable_kg
            defect[:] = 0.0
            for task in range(2):
                for i in range(first[k, n], first[k, n + 1]):
                    for b in range(pieces):
                        if offset[i, b] < -1e300:
                            continue
                        # The move of a cell is the bound at its right end.
                        low, high = breaks[b], breaks[b + 1]
                        while low < high:
                            start = offset[i, b] + rise[i, b] * (low + 1)
                            whole = int(np.floor(start))
                            end = _run_end(low, high, start, rise[i, b], whole)
                            ahead = padded[n, pad + low + whole : pad + end + whole + 1]
                            if task == 0:
                                _lower_nodes(
                                    best[n, low:end], ahead, cost[i], start - whole, rise[i, b]
                                )
                                if end == breaks[b + 1]:
                                    # The piece's last node, under the move of the cell to its left.
                                    share = start - whole + rise[i, b] * (end - 1 - low)
                                    at = pad + end + whole
                                    step = padded[n, at + 1] - padded[n, at]
                                    best[n, end] = min(
                                        best[n, end], cost[i] + padded[n, at] + share * step
                                    )
                            else:
                                _raise_defects(
                                    defect[low:end], best[n, low : end + 1], ahead, cost[i],
                                    start - whole, rise[i, b],
                                )  # fmt: skip
                            low = end
            least = np.inf
            for j in range(nodes):
                left = defect[j - 1] if j > 0 else 0.0
                right = defect[j] if j < nodes - 1 else 0.0
                least = min(least, best[n, j] - max(left, right))
                padded[n, pad + j] = least
        for n in range(modes):
            best[n] = padded[n, pad : pad + nodes]
        _switch_back(value, best, choices.switching, switch, k, relaxation)
    return value
