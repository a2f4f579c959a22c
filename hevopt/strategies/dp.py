"""Dynamic programming on stored energy and mode, rolled out with the true battery.

    V_t(m, E) = min over u of  cost_t(u) + switching(m, mode(u)) + V_t+1(mode(u), E - r_t(u, E))

The value function is tabulated over a grid of stored energy and interpolated linearly; it only guides the
rollout, whose path is exact, stays within the window and ends with at least the charge that is asked. Missing
charge at the end costs a multiple of the dual's price, steep enough to be avoided and finite, so that
interpolation never meets infinity.

The first grid spans the SOC window; the next ones a band around the path found, each ten times finer.
"""

import numpy as np
from numpy.typing import NDArray

from hevopt.choices import Choices, choices_of, without_dominated
from hevopt.errors import DataError
from hevopt.prices import one_price_dual, typical_price_kgpj
from hevopt.problem import Plan, Problem
from hevopt.simulate import total_cost_kg
from hevopt.strategies import _rollout_kernels as kernels
from hevopt.strategies._rollout import Reach, reach_of, roll

Array = NDArray[np.float64]
ENERGY_NODES = 1001
# Width of each grid as a share of the SOC window.
_BANDS = (1.0, 0.1, 0.01)
# Missing charge costs this many times its worth, so that no plan of use ever leaves some.
_PENALTY_FACTOR = 5.0


def solve(problem: Problem, *, nodes: int = ENERGY_NODES, refine: bool = True) -> Plan:
    """The plan of least cost on grids of `nodes` stored energies; without `refine`, on the first grid only."""
    if not 3 <= nodes <= 1_000_000:
        raise DataError(f"energy nodes {nodes}; allowed: 3 to 1000000")
    every = choices_of(problem)
    reach = reach_of(problem, every, problem.end_min_j)
    price = one_price_dual(problem)[-1].price_kgpj
    low, high = problem.window_j
    centre = np.full(every.steps + 1, (low + high) / 2)
    best_cost, best_path, path = np.inf, None, None
    for band in _BANDS if refine else _BANDS[:1]:
        cell = band * (high - low) / (nodes - 1)
        grid_low = _grid_low_j(problem, centre, cell, nodes)
        path = _solve_on_grid(problem, every, reach, price, grid_low, cell, nodes)
        cost, centre = total_cost_kg(problem, every.control[path])
        if cost < best_cost:
            best_cost, best_path = cost, path
    return Plan(every.control[best_path], {"price_kgpj": price, "nodes": nodes})


def _grid_low_j(problem: Problem, centre_j: Array, cell_j: float, nodes: int) -> Array:
    """(time + 1,) bottom of grids around a path, within the window, with the asked end charge as a node."""
    low, high = problem.window_j
    bottom = np.clip(centre_j - cell_j * (nodes - 1) / 2, low, high - cell_j * (nodes - 1))
    below = np.floor((problem.end_min_j - bottom) / cell_j + 1e-9)
    return problem.end_min_j - cell_j * below


def _solve_on_grid(
    problem: Problem,
    every: Choices,
    reach: Reach,
    price: float,
    grid_low: Array,
    cell: float,
    nodes: int,
) -> NDArray[np.int64]:
    choices = without_dominated(every)
    penalty = _PENALTY_FACTOR * max(price, 0.01 * typical_price_kgpj(every, every.power_w))
    last_grid = grid_low[-1] + cell * np.arange(nodes)
    terminal = penalty * np.maximum(problem.end_min_j - last_grid, 0.0)
    value = kernels.backward(
        choices.first, choices.cost_kg, choices.power_w, choices.step_s, choices.switch_kg,
        choices.switch_allowed, terminal, grid_low, cell, penalty * cell,
        _unreachable_kg(every, terminal), problem.battery.arrays,
    )  # fmt: skip
    return roll(problem, every, reach, value, grid_low, cell)


def _unreachable_kg(choices: Choices, terminal_kg: Array) -> float:
    """More than any path can cost, computed from the problem itself."""
    worst_step = float(choices.cost_kg.max(initial=0.0)) + float(choices.switch_kg.max())
    return worst_step * choices.steps + 2.0 * float(terminal_kg.max()) + 1e-3
