"""Dynamic programming against plain NumPy, against a formula, and under finer grids."""

import numpy as np
import pytest
from problems import random_problem

from hevopt import Battery, Control, ControlTable, Problem, simulate
from hevopt._battery_kernels import chemical_power_at
from hevopt.choices import choices_of
from hevopt.strategies import _rollout_kernels as kernels
from hevopt.strategies import dp


def plain_backward(choices, terminal, grid_low, cell, floor_kg, ceiling_kg, unreachable_kg, pack):
    """The same recursion, node by node and without the shift: the exact step, then interpolation."""
    steps, modes = choices.steps, choices.modes
    nodes = np.arange(len(terminal))
    value = np.empty((steps + 1, modes, len(nodes)))
    value[steps] = terminal
    for k in range(steps - 1, -1, -1):
        least = np.full((modes, len(nodes)), unreachable_kg)
        grid = grid_low[k] + cell * nodes
        for m in range(modes):
            for i in range(choices.first[k, m], choices.first[k, m + 1]):
                drain = np.array(
                    [chemical_power_at(choices.power_w[i], e, pack.arrays) for e in grid]
                )
                place = (grid - choices.step_s[k] * drain - grid_low[k + 1]) / cell
                total = choices.cost_kg[i] + np.interp(place, nodes, value[k + 1, m])
                total += floor_kg * np.maximum(-place, 0)
                total += ceiling_kg * np.maximum(place - nodes[-1], 0)
                least[m] = np.minimum(least[m], total)
        cost = np.where(
            choices.switch_allowed[:, :, None], choices.switch_kg[:, :, None] + least, np.inf
        )
        value[k] = np.minimum(cost.min(axis=1), unreachable_kg)
    return value


@pytest.mark.parametrize("seed", [0, 2, 4, 10])
@pytest.mark.parametrize("ceiling", [0.0, 2e-4])
def test_kernel_agrees_with_its_plain_twin_where_the_move_does_not_depend_on_charge(seed, ceiling):
    problem = random_problem(seed)
    pack = problem.battery
    flat = Battery(
        pack.soc,
        np.full(2, 150.0),
        pack.discharge_ohm,
        pack.charge_ohm,
        pack.capacity_as,
        0.95,
        0.2,
        0.9,
    )
    compare_with_twin(problem, flat, ceiling, 1e-9)


@pytest.mark.parametrize("seed", [1, 2, 3, 4, 5])
def test_kernel_agrees_with_its_plain_twin_to_the_curvature_of_the_move(seed):
    problem = random_problem(seed)
    compare_with_twin(problem, problem.battery, 0.0, 5e-3)


def compare_with_twin(problem, pack, ceiling, tolerance):
    problem = Problem(problem.table, pack, 0.5, 0.5)
    choices = choices_of(problem)
    low, high = problem.window_j
    grid_low = low + np.linspace(0, 0.1, choices.steps + 1) * (high - low)
    cell = 0.9 * (high - low) / 200
    terminal = 1e-7 * np.maximum(problem.end_min_j - grid_low[-1] - cell * np.arange(201), 0)
    fast = kernels.backward(
        choices.first, choices.cost_kg, choices.power_w, choices.step_s, choices.switch_kg,
        choices.switch_allowed, terminal, grid_low, cell, 1e-4, ceiling, 1.0, pack.arrays,
    )  # fmt: skip
    plain = plain_backward(choices, terminal, grid_low, cell, 1e-4, ceiling, 1.0, pack)
    scale = np.ptp(plain[plain < 0.9])
    assert np.max(np.abs(fast - plain)) <= tolerance * scale


def quadratic_problem(steps: int, levels: int) -> Problem:
    """Least sum of (demand - u)² under sum of u = 0, a lossless battery giving u: u = demand - mean."""
    demand = 1000.0 * np.sin(np.linspace(0.3, 5.0, steps)) + 300.0
    power = np.tile(np.linspace(-1500.0, 1500.0, levels), (steps, 1))
    fuel = (demand[:, None] - power) ** 2 * 1e-9
    battery = Battery(
        np.array([0.0, 1.0]), np.full(2, 100.0), np.zeros(2), np.zeros(2), 3600.0, 1.0, 0.1, 0.9
    )
    table = ControlTable(
        time_s=np.arange(steps, dtype=float),
        step_s=np.ones(steps),
        fuel_kg=fuel,
        nox_kg=np.zeros_like(fuel),
        battery_power_w=power,
        reject=np.zeros(fuel.shape, dtype=np.uint16),
        mode=np.zeros(levels, dtype=np.int64),
        switch_fuel_kg=np.zeros((1, 1)),
        switch_allowed=np.ones((1, 1), dtype=bool),
        controls=tuple(Control(True, 0, str(n)) for n in range(levels)),
    )
    return Problem(table, battery, 0.5, 0.5)


def test_dp_meets_the_formula_with_second_order_in_the_control_grid():
    steps = 30
    demand = 1000.0 * np.sin(np.linspace(0.3, 5.0, steps)) + 300.0
    exact = steps * np.mean(demand) ** 2 * 1e-9
    errors = []
    for levels in (31, 61, 121, 241):
        problem = quadratic_problem(steps, levels)
        errors.append(simulate(problem, dp.solve(problem).control).cost_kg / exact - 1)
    assert all(error >= -1e-12 for error in errors)
    orders = np.log2(np.array(errors[:-1]) / np.array(errors[1:]))
    assert errors[-1] < 5e-4
    assert np.mean(orders) == pytest.approx(2.0, abs=0.5)


def test_fuel_converges_with_energy_nodes_and_torque_levels(problem_of):
    from hevopt import build_problem, load_architecture, load_cycle

    problem = problem_of("C2", "nedc")
    by_nodes = [
        simulate(problem, dp.solve(problem, nodes=n, refine=False).control).total_fuel_kg
        for n in (201, 401, 801, 1601)
    ]
    car, cycle = load_architecture("C2"), load_cycle("nedc")
    by_levels = []
    for levels in (21, 41, 81):
        finer = build_problem(car, cycle, levels=levels)
        by_levels.append(simulate(finer, dp.solve(finer).control).total_fuel_kg)
    print("C2, NEDC, kg of fuel; nodes 201 401 801 1601:", *(f"{fuel:.5f}" for fuel in by_nodes))
    print("torque levels 21 41 81:", *(f"{fuel:.5f}" for fuel in by_levels))
    best = simulate(problem, dp.solve(problem).control).total_fuel_kg
    errors = np.array(by_nodes) - best
    assert errors[-1] < 0.5 * errors[0] and errors[-1] / best < 2e-3
    steps = np.abs(np.diff(by_levels))
    assert steps[1] < steps[0] and steps[1] / best < 2e-3


def test_order_of_controls_does_not_matter():
    problem = random_problem(12)
    table = problem.table
    order = np.random.default_rng(0).permutation(len(table.mode))
    shuffled = ControlTable(
        table.time_s, table.step_s, table.fuel_kg[:, order], table.nox_kg[:, order],
        table.battery_power_w[:, order], table.reject[:, order], table.mode[order],
        table.switch_fuel_kg, table.switch_allowed, tuple(table.controls[o] for o in order),
    )  # fmt: skip
    other = Problem(
        shuffled, problem.battery, problem.soc_start, problem.soc_end_min, 0, problem.nox_weight
    )
    costs = [simulate(p, dp.solve(p).control).cost_kg for p in (problem, other)]
    assert costs[0] == pytest.approx(costs[1], rel=1e-13)
