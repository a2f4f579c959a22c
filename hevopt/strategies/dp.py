"""Dynamic programming on stored energy and mode, rolled out with the true battery.

    V_t(m, E) = min over n of  K_t(m, n) + W_t(n, E - s_t(m, n))       K, s: fuel and stored energy of switching
    W_t(n, E) = min over u leading to n of  cost_t(u) + V_t+1(n, E - r_t(u, E))

The value function is tabulated over a grid of stored energy and interpolated linearly; it only guides the
rollout, whose path is exact, stays within the window and ends with at least the charge that is asked. Outside
the window, and for charge missing at the end, a finite price takes the place of infinity, so that interpolation
stays meaningful: a gentle one first, and charge beyond a full battery may be thrown away, which makes every
dominated choice superfluous. Where the rollout cannot keep what the value function promised, that gentleness
misled it, and steep prices with all choices follow; where they cannot keep theirs either, as in windows that hold
few steps' energy, once more on finer grids.

The first grid spans the SOC window; the next ones ever narrower bands around the path found. A quick look comes
before where a gap that is enough is told: a coarse grid over the window and one band, and where a bound does not
prove that its path keeps to that gap, one band more. Where it does then, as for most cars, there is no other grid.
Where the bound leaves little more open, as where the window binds a little, bands narrow on while that gains; where
it leaves much, as in windows that hold few steps' energy, a coarse grid may mislead, and all begins anew.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from hevopt.bounds.prices import TINY, one_price_dual, typical_price_kgpj
from hevopt.bounds.step_prices import costate_bound_kg
from hevopt.errors import DataError, SolverError
from hevopt.problem.arrays import Array, Indices
from hevopt.problem.choices import Choices, choices_of, undominated_choices
from hevopt.problem.problem import Plan, Problem
from hevopt.problem.simulation import simulate, total_cost_kg
from hevopt.problem.switching import switched
from hevopt.strategies._backward_kernels import backward
from hevopt.strategies._contending_kernels import Penalty
from hevopt.strategies._reach_kernels import Reach
from hevopt.strategies._rollout import follow, reach_of
from hevopt.strategies._rollout_kernels import Grid
from hevopt.strategies._value_blocks import ValueBlocks

ENERGY_NODES = 1001
# Widths of the grids as shares of the SOC window; finer ones are tried while they gain this share of cost.
_BANDS = (1.0, 0.1, 0.01, 0.003, 0.001)
_GAIN_WORTH_MORE = 2e-5
# The grids of a quick look, as shares of window and nodes; the path is tried from the second on.
_QUICK = ((1.0, 0.25), (0.1, 1.0), (0.01, 1.0))
# Times the gap that is enough within which what a bound leaves open counts as the bound's own.
_NEARLY = 4.0
# Missing charge costs this many times what it is worth.
_GENTLE, _STEEP = 5.0, 1e4
# A rollout dearer than promised by this share has been misled.
_PROMISE_TOLERANCE = 1e-3
_NODES_MAX = 1_000_000
# Times as many nodes where steep prices mislead as well.
_FINER = 4


@dataclass(frozen=True, slots=True, eq=False)
class _Setting:
    """A problem with what every grid needs. choices: those of the recursion; every: those of the rollout."""

    problem: Problem
    every: Choices
    choices: Choices
    reach: Reach
    penalty_kgpj: float
    hard_top: bool


def solve(
    problem: Problem,
    *,
    nodes: int = ENERGY_NODES,
    refine: bool = True,
    enough_gap: float = 0.0,
) -> Plan:
    """The plan of least cost on grids of `nodes` stored energies; without `refine`, on the first grid only.

    enough_gap: a share of the cost; a plan of few grids that is proven to be within it of the optimum is taken, and
    one proven to be within four times as much that narrower grids do not better
    """
    if not 3 <= nodes <= _NODES_MAX:
        raise DataError(f"energy nodes {nodes}; allowed: 3 to {_NODES_MAX}")
    every = choices_of(problem)
    reach = reach_of(problem, problem.end_min_j)
    price = one_price_dual(problem)[-1].price_kgpj
    worth = max(price, 0.01 * typical_price_kgpj(every, every.power_w))
    gentle = _Setting(
        problem, every, undominated_choices(problem), reach, _GENTLE * worth, hard_top=False
    )
    notes = {"price_kgpj": price, "nodes": nodes}
    if enough_gap > 0 and refine:
        looked = _quick_look(gentle, nodes, enough_gap, price)
        if looked is not None:
            return Plan(looked, notes)
    bands = _BANDS if refine else _BANDS[:1]
    *_, (cost, control, (promised, *_)) = _search(gentle, [(band, nodes) for band in bands])
    steep = _Setting(problem, every, every, reach, _STEEP * worth, hard_top=True)
    for finer in (nodes, min(_FINER * nodes, _NODES_MAX)):
        if cost - promised <= _PROMISE_TOLERANCE * abs(cost):
            break
        *_, (steep_cost, steep_control, (promised, *_)) = _search(
            steep, [(band, finer) for band in bands]
        )
        if steep_cost < cost:
            cost, control = steep_cost, steep_control
    return Plan(control, notes)


def _quick_look(setting: _Setting, nodes: int, enough_gap: float, price: float) -> Indices | None:
    """Controls of a plan of few grids proven to be within a gap, or nearly and not to be bettered; None else."""
    narrower = [(band, 1.0) for band in _BANDS if band < _QUICK[-1][0]]
    grids = [(band, max(int(share * nodes), 3)) for band, share in (*_QUICK, *narrower)]
    control = np.empty(0, np.int64)
    for cost, control, promises in _search(setting, grids):
        if 1 < len(promises) <= len(_QUICK):
            gap = _proven_gap(setting.problem, control, cost, price)
            if gap <= enough_gap:
                return control
            if len(promises) == len(_QUICK) and gap > _NEARLY * enough_gap:
                return None
    return control


def _proven_gap(problem: Problem, control: Indices, cost_kg: float, price: float) -> float:
    """The share of its cost by which costate prices along a plan prove it to be at most above the optimum."""
    try:
        bound_kg = costate_bound_kg(problem, simulate(problem, control), price)
    except SolverError:
        return np.inf
    return (cost_kg - bound_kg) / max(abs(cost_kg), TINY)


def _search(
    setting: _Setting, grids: Sequence[tuple[float, int]]
) -> Iterator[tuple[float, Indices, list[float]]]:
    """After every grid: cost and controls of the best path so far, and what each grid promised.

    grids: width as a share of the SOC window, and number of nodes
    """
    problem, choices = setting.problem, setting.every
    low, high = problem.window_j
    centre = np.full(choices.steps + 1, (low + high) / 2)
    switch_j = np.zeros(choices.steps)
    best_cost, best, promises = np.inf, np.empty(0, np.int64), list[float]()
    for band, nodes in grids:
        cell = band * (high - low) / (nodes - 1)
        grid = _grid_around(problem, centre, cell, nodes)
        between = _grid_around(problem, centre[:-1] - switch_j, cell, nodes).low_j
        path, promise = _solve_on_grid(setting, grid, between, nodes)
        promises.append(promise)
        cost, energy_j = total_cost_kg(problem, choices.control[path])
        settled = best_cost - cost < _GAIN_WORTH_MORE * abs(cost) and len(promises) > 2
        if cost < best_cost:
            best_cost, best, centre = cost, choices.control[path], energy_j
            switch_j = switched(problem.table, problem.start_mode, best).energy_j
        yield best_cost, best, promises
        if settled:
            break


def _grid_around(problem: Problem, centre_j: Array, cell_j: float, nodes: int) -> Grid:
    """Grids around a path, (time + 1,), within the window, with the asked end charge as a node."""
    low, high = problem.window_j
    bottom = np.clip(centre_j - cell_j * (nodes - 1) / 2, low, high - cell_j * (nodes - 1))
    below = np.floor((problem.end_min_j - bottom) / cell_j + 1e-9)
    return Grid(problem.end_min_j - cell_j * below, cell_j)


def _solve_on_grid(
    setting: _Setting, grid: Grid, between_j: Array, nodes: int
) -> tuple[Indices, float]:
    """Entries (time,) of the rollout on one grid, and the cost its value function promised.

    between_j: (time,) bottom of the grid between switching and step
    """
    problem, choices = setting.problem, setting.choices
    last_grid = grid.low_j[-1] + grid.cell_j * np.arange(nodes)
    terminal = setting.penalty_kgpj * np.maximum(problem.end_min_j - last_grid, 0.0)
    per_cell = setting.penalty_kgpj * grid.cell_j
    ceiling = per_cell if setting.hard_top else 0.0
    penalty = Penalty(per_cell, ceiling, _unreachable_kg(choices, terminal))
    battery = problem.battery.arrays

    def block(begin: int, end: int, after: Array) -> Array:
        part = Grid(grid.low_j[begin : end + 1], grid.cell_j)
        return backward(
            choices.part(begin, end), after, part, between_j[begin:end], penalty, battery
        )

    values = ValueBlocks(choices.steps, np.tile(terminal, (choices.modes, 1)), block)
    first_grid = grid.low_j[0] + grid.cell_j * np.arange(nodes)
    at_start = values.block_of(0)[1][0, problem.start_mode]
    promised = float(np.interp(problem.start_j, first_grid, at_start))
    path, _ = follow(problem, setting.every, setting.reach, values.block_of, grid)
    return path, promised


def _unreachable_kg(choices: Choices, terminal_kg: Array) -> float:
    """More than any path can cost, computed from the problem itself."""
    worst_step = float(choices.cost_kg.max(initial=0.0)) + float(choices.switching.kg.max())
    return worst_step * choices.steps + 2.0 * float(terminal_kg.max()) + 1e-3
