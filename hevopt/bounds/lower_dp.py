"""Lower-bound dynamic programming: a cost-to-go that is nowhere above the true one.

Claim. Let V be piecewise linear on an even grid of stored energy x, non-increasing, and below the true cost-to-go
after the step, and let every choice u of a mode move x by d_u(x), cost f_u. Then a piecewise linear W on the same
grid can be computed that is non-increasing and below  min over u of f_u + V(x + d_u(x))  everywhere.

1. Shift. Within cell i, between nodes i and i + 1, replace d_u(x) by a constant s_u,i at least as great. V does not
   increase, so h_u(x) = f_u + V(x + s_u,i) is below the true branch. s_u,i comes from an upper bound of d_u that is
   linear in x over a piece of the window and rises with x, taken at the cell's right end: a tangent where r = -d /
   dt is convex in x (step_prices.py), else the constant of the piece's highest voltage and lowest resistance.
2. Nodes. W_i is the least over u of h_u at node i, under the shift of the cell to its right, and at the right end
   of a piece also of the cell to its left. Greater shifts give smaller values, so W_i is below h_u under both.
3. Breaks. V has its breaks at nodes, so with a constant shift k + a (0 <= a < 1) h_u has one break in the cell, a
   distance 1 - a from its left node, where its target is node i + k + 1 and its value f_u + V_i+k+1. Between nodes
   and break h_u is linear. So the straight line from W_i to W_i+1 is above h_u by at most
       delta_i = max over u of (a W_i + (1 - a) W_i+1 - f_u - V_i+k+1)+
   and lowering node i by the larger of delta_i-1 and delta_i puts the line below every h_u.
4. Order. Taking at each node the least of itself and the nodes to its left only lowers W, and makes it
   non-increasing. The true cost-to-go does not increase either, as charge may be thrown away.
5. Modes. Switching takes fuel K and stored energy s first: the value before it is the least over modes of
   K + W(x - s). With s rounded down to whole cells the argument grows, so W falls or stays: a function below the
   true one, piecewise linear on the same grid. The least over modes is concave in each cell wherever modes cross,
   so the line between its nodes is below it: no further correction.
6. Moves are taken upward, by what rounding may have done to them and to a plan's own trace, so that 1 to 3 hold as
   computed; no move need be greater than the grid, whose top is as good as anything above it, nor less than the
   grid downward, for a greater one proves less. What is left is rounding of values, some ten operations of each
   step on figures of at most M, the most that any node holds: 16 epsilon T M is taken off.
7. Ends. Above the top node V is constant: what does not fit is thrown away, a relaxation. Below the bottom node,
   and for charge missing at the end, V rises with a steep but finite slope: a relaxation too, for infinity is
   above it.

By induction from the end V at the first step, at the start's energy and mode, is below the cost of every plan that
ends with at least the asked charge.
"""

from collections.abc import Iterator

import numpy as np

from hevopt.bounds import _lower_dp_kernels as kernels
from hevopt.bounds.bounded import undominated_bounded
from hevopt.bounds.prices import EPSILON, drain_magnitude_w, end_slack_j
from hevopt.bounds.step_prices import line_above, steep, window_cells
from hevopt.problem.arrays import Array, Indices
from hevopt.problem.choices import Choices
from hevopt.problem.problem import Problem

_PIECES = 16
_PIECES_CURVED = 256
_PART_MOVES = 2**24
# Slope below the window and for missing end charge, in multiples of what charge is worth.
_STEEPNESS = 4.0


def lower_bound_kg(problem: Problem, price_kgpj: float, *, nodes: int) -> float:
    """A bound on the cost of every plan that ends with at least the asked charge, up to the rounding of a trace.

    price_kgpj: about what stored energy is worth; it sets the slope of the relaxation, any value is valid.
    """
    choices = undominated_bounded(problem)
    low, high = problem.battery.granted_window_j
    cell = (high - low) / (nodes - 1)
    # The asked end charge is a node, and the grid reaches up to a cell beyond the window: a relaxation.
    end = problem.end_min_j - end_slack_j(problem)
    below, above = np.ceil((end - low) / cell), np.ceil((high - end) / cell)
    grid = end + cell * np.arange(-below, max(above, 1.0) + 1)
    slope = slope_kgpj(price_kgpj)
    terminal = slope * np.maximum(end - grid, 0.0)
    unreachable = _unreachable_kg(choices, terminal)
    relaxation = kernels.Relaxation(slope * cell, unreachable)
    value = np.tile(terminal, (choices.modes, 1))
    for part in _parts(choices):
        value = kernels.lower_backward(
            part, value, _move_bounds(problem, part, grid, cell), relaxation
        )
    bound = float(np.interp(problem.start_j, grid, value[problem.start_mode]))
    most = abs(unreachable) + slope * 4.0 * (grid[-1] - grid[0])
    return float(bound - 16.0 * EPSILON * choices.steps * most)


def slope_kgpj(price_kgpj: float) -> float:
    """What a joule counts that is missing below the window or at the end, where charge is worth about the price."""
    return _STEEPNESS * max(price_kgpj, 1e-12)


def _parts(choices: Choices) -> Iterator[Choices]:
    """Choices of consecutive steps, the last ones first: what is known of the moves of a part is some 0.1 GB."""
    length = max(_PART_MOVES * choices.steps // (len(choices.cost_kg) * _PIECES_CURVED), 1)
    for end in range(choices.steps, 0, -length):
        yield choices.part(max(end - length, 0), end)


def _move_bounds(problem: Problem, choices: Choices, grid: Array, cell: float) -> kernels.Moves:
    """Upper bounds of all moves over the pieces of a grid."""
    inside = problem.battery.within_window()
    line = line_above(inside)
    pieces = _PIECES_CURVED if line is None else _PIECES
    pieces = max(min(pieces, (len(grid) - 1) // 2), 1)
    breaks = np.arange(pieces + 1) * (len(grid) - 1) // pieces
    parted = kernels.PartedGrid(float(grid[0]), cell, breaks, grid[breaks])
    if line is None:
        offset = kernels.moves_by_cells(choices, parted, window_cells(problem, pieces))
        rise = np.zeros_like(offset)
    else:
        offset, rise = kernels.moves_by_tangents(choices, steep(choices, line), parted, line)
    magnitude_w = drain_magnitude_w(choices, inside, tangents=line is not None)
    rounding = choices.spread(choices.step_s) * magnitude_w + float(np.abs(grid).max())
    nodes = len(grid)
    offset += 8.0 * EPSILON * (rounding[:, None] / cell + rise * nodes)
    far = np.abs(offset) + rise * nodes > 2.0 * nodes
    furthest = offset + rise * breaks[1:]
    # A piece without a move, of a cell that the window does not touch, stays without.
    offset = np.where(far & np.isfinite(offset), np.clip(furthest, -nodes, nodes), offset)
    return kernels.Moves(
        breaks, offset, np.where(far, 0.0, rise), _switch_cells(choices, grid, cell)
    )


def _switch_cells(choices: Choices, grid: Array, cell: float) -> Indices:
    """(case, mode, mode) cells that switching takes at least, rounding and that of a plan's own trace taken off."""
    energy_j = choices.switching.energy_j
    spared_j = 4.0 * EPSILON * (np.abs(energy_j) + np.abs(grid).max())
    cells = np.floor((energy_j - np.where(energy_j == 0.0, 0.0, spared_j)) / cell)
    return np.clip(cells, -len(grid), 4 * len(grid)).astype(np.int64)


def _unreachable_kg(choices: Choices, terminal_kg: Array) -> float:
    """What a node counts from which no path is known: any figure is a bound there, one above all paths the best."""
    worst_step = float(np.abs(choices.cost_kg).max(initial=0.0)) + float(choices.switching.kg.max())
    return worst_step * choices.steps + 2.0 * float(terminal_kg.max())
