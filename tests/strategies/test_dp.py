"""Dynamic programming against plain NumPy, against a formula, and under finer grids."""

import os
import subprocess
import sys
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from problems import random_problem

from hevopt import (
    Battery,
    Control,
    ControlTable,
    InfeasibleError,
    Problem,
    build_problem,
    certify,
    load_architecture,
    load_cycle,
    simulate,
)  # fmt: skip
from hevopt.driving.cycle import Cycle
from hevopt.problem._battery_kernels import chemical_power_at
from hevopt.problem.choices import choices_of
from hevopt.strategies import _backward_kernels as kernels
from hevopt.strategies import dp, ecms
from hevopt.strategies._rollout_kernels import Grid


def plain_backward(
    choices, terminal, grid_low, cell, floor_kg, ceiling_kg, unreachable_kg, pack, linear
):
    """The same recursion, node by node, for every choice; linear: the battery's step at some nodes, else at all."""
    steps, modes = choices.steps, choices.modes
    nodes = np.arange(len(terminal))
    value = np.empty((steps + 1, modes, len(nodes)))
    value[steps] = terminal
    for k in range(steps - 1, -1, -1):
        least = np.full((modes, len(nodes)), unreachable_kg)
        grid = grid_low[k] + cell * nodes
        breaks, _ = kernels._bends(grid_low[k], cell, len(nodes), pack.arrays)
        breaks = breaks if linear else nodes
        for m in range(modes):
            for i in range(choices.first[k, m], choices.first[k, m + 1]):
                drain = [
                    chemical_power_at(choices.power_w[i], grid[b], pack.arrays) for b in breaks
                ]
                moved = grid - choices.step_s[k] * np.interp(nodes, breaks, drain)
                place = (moved - grid_low[k + 1]) / cell
                total = choices.cost_kg[i] + np.interp(place, nodes, value[k + 1, m])
                total += floor_kg * np.maximum(-place, 0)
                total += ceiling_kg * np.maximum(place - nodes[-1], 0)
                least[m] = np.minimum(least[m], total)
        cost = np.where(
            choices.switching.allowed[0][:, :, None],
            choices.switching.kg[0][:, :, None] + least,
            np.inf,
        )
        value[k] = np.minimum(cost.min(axis=1), unreachable_kg)
    return value


@pytest.mark.parametrize("ceiling", [0.0, 2e-4])
@pytest.mark.parametrize("seed", range(8))
def test_kernel_agrees_with_its_plain_twin(seed, ceiling):
    compare_with_twin(random_problem(seed), ceiling, True, 1e-9)


@pytest.mark.parametrize("share", [0.02, 0.2])
@pytest.mark.parametrize("seed", range(4))
def test_choices_left_out_are_the_best_nowhere(seed, share):
    # Of many choices few are tried; those of narrow grids lead beyond them.
    compare_with_twin(random_problem(seed, 60), 0.0, True, 1e-9, share)


@pytest.mark.parametrize("share", [0.02, 0.9])
def test_of_choices_that_are_alike_one_is_tried(share):
    problem = random_problem(3, 20)
    table, twice = problem.table, np.repeat(np.arange(problem.table.mode.size), 2)
    columns = {
        name: getattr(table, name)[:, twice]
        for name in ("fuel_kg", "nox_kg", "battery_power_w", "reject")
    }
    controls = tuple(table.controls[c] for c in twice)
    doubled = replace(table, **columns, mode=table.mode[twice], controls=controls)
    compare_with_twin(replace(problem, table=doubled), 0.0, True, 1e-9, share)


@pytest.mark.parametrize("seed", range(6))
def test_linear_moves_agree_with_the_exact_step_to_their_curvature(seed):
    compare_with_twin(random_problem(seed), 0.0, False, 5e-3)


def compare_with_twin(problem, ceiling, linear, tolerance, share=0.9):
    pack = problem.battery
    problem = Problem(problem.table, pack, 0.5, 0.5)
    choices = choices_of(problem)
    low, high = problem.window_j
    grid_low = low + np.linspace(0, 0.1, choices.steps + 1) * (high - low)
    cell = share * (high - low) / 200
    terminal = 1e-7 * np.maximum(problem.end_min_j - grid_low[-1] - cell * np.arange(201), 0)
    fast = kernels.backward(
        choices, np.tile(terminal, (choices.modes, 1)), Grid(grid_low, cell), grid_low[:-1],
        kernels.Penalty(1e-4, ceiling, 1.0), pack.arrays,
    )  # fmt: skip
    plain = plain_backward(choices, terminal, grid_low, cell, 1e-4, ceiling, 1.0, pack, linear)
    assert np.max(np.abs(fast - plain)) <= tolerance * np.ptp(plain[plain < 0.9])


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


@pytest.mark.parametrize("name", ["B", "C2", "D"])
def test_a_quick_look_is_taken_only_where_it_is_proven_to_be_enough(problem_of, name, monkeypatch):
    problem = problem_of(name, "hwfet")
    whole, grids, gaps = simulate(problem, dp.solve(problem).control), [], []
    on_grid, proven_gap = dp._solve_on_grid, dp._proven_gap
    monkeypatch.setattr(dp, "_solve_on_grid", lambda *args: grids.append(args) or on_grid(*args))
    monkeypatch.setattr(dp, "_proven_gap", lambda *args: gaps.append(proven_gap(*args)) or gaps[-1])

    def looked(gap: float) -> int:
        grids.clear()
        quick = simulate(problem, dp.solve(problem, enough_gap=gap).control)
        bound_kg, _ = certify(problem, quick).bound_of(quick)
        assert quick.cost_kg - bound_kg <= max(gap, 5e-4) * quick.cost_kg
        assert quick.cost_kg <= whole.cost_kg * (1 + gap)
        return len(grids)

    def anew() -> bool:
        cells = [grid.cell_j for _, grid, *_ in grids]
        return any(after >= before for before, after in pairwise(cells))

    assert looked(1e-12) > len(dp._QUICK) and len(gaps) == 2 and anew()
    first, second = gaps
    assert second <= first
    if second < first:  # of B; where another band gains nothing, no gap lies between
        assert looked((first + second) / 2) == 3
    else:
        assert name != "B"
    assert looked(first) == 2 and grids[0][3] < grids[1][3]
    # Nearly proven: bands narrow on, none begins anew.
    nearly = looked(second / 2)
    assert nearly >= len(dp._QUICK) and not anew()


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


def test_same_bits_with_one_and_two_threads(tmp_path):
    code = (
        "import numba; from hevopt import *; "
        "p = build_problem(load_architecture('C2'), load_cycle('hwfet')); said = []\n"
        "for threads in (1, 2):\n"
        "    numba.set_num_threads(threads); t = simulate(p, solve(p).control)\n"
        "    said.append((t.total_fuel_kg, t.end_j, certify(p, t).bound_kg(t.end_j)[0], *t.soc))\n"
        "print(said[0] == said[1])"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], env=os.environ | {"NUMBA_NUM_THREADS": "2"},
        capture_output=True, text=True,
    )  # fmt: skip
    assert done.stdout == "True\n", done.stderr


def chain(steps=4, **changes):
    """A small table of two modes that can only lose charge, or as changed."""
    arrays = {
        "fuel_kg": np.full((steps, 2), 1e-4),
        "battery_power_w": np.tile([500.0, 900.0], (steps, 1)),
        "mode": np.array([0, 1]),
        "switch_allowed": np.ones((2, 2), dtype=bool),
        "switch_fuel_kg": np.zeros((2, 2)),
    } | changes
    battery = Battery(
        np.array([0.0, 1.0]), np.full(2, 100.0), np.zeros(2), np.zeros(2), 100.0, 1.0, 0.3, 0.9
    )
    return Problem(ControlTable.from_arrays(**arrays), battery, 0.5, 0.35)


@pytest.mark.parametrize("solve", [dp.solve, ecms.solve], ids=["dp", "ecms"])
def test_a_problem_without_solution_names_the_first_step_and_the_reason(solve):
    with pytest.raises(InfeasibleError, match=r"SOC 0\.3500 is asked, 0\.3000"):
        solve(chain())
    with pytest.raises(
        InfeasibleError, match=r"nothing is reachable after step 4 .*leave the SOC window"
    ):
        solve(chain(6))
    feasible = np.ones((4, 2), dtype=bool)
    feasible[2] = False
    with pytest.raises(InfeasibleError, match=r"step 2 .*every control is rejected"):
        solve(chain(battery_power_w=np.zeros((4, 2)), feasible=feasible))
    power = np.tile([0.0, 100.0], (4, 1))
    feasible[2] = [False, True]
    with pytest.raises(InfeasibleError, match=r"step 2 .*switch"):
        solve(chain(battery_power_w=power, feasible=feasible, switch_allowed=np.eye(2, dtype=bool)))


def test_a_problem_from_arrays_alone_is_solved_to_a_certificate():
    rng = np.random.default_rng(5)
    power = np.linspace(-8e3, 8e3, 33) + np.zeros((200, 1))
    demand = 10e3 + 8e3 * np.sin(np.arange(200) / 9)[:, None]
    engine = demand - power
    fuel = 1e-4 + engine / 43e6 / 0.38 * (1 + engine / 1e5) + rng.uniform(0, 1e-6, power.shape)
    fuel[engine < 0] = np.nan
    battery = Battery(
        np.array([0.0, 0.5, 1.0]), np.array([190.0, 200.0, 230.0]), np.array([0.4, 0.3, 0.3]),
        np.array([0.3, 0.3, 0.5]), 2 * 3600, 0.95, 0.4, 0.8, current_max_discharge_a=30.0,
    )  # fmt: skip
    problem = Problem(ControlTable.from_arrays(fuel, power, engine >= 0), battery, 0.6, 0.6)
    assert not problem.table.feasible[:, power[0] > 30 * 200].any()
    trajectory = simulate(problem, dp.solve(problem).control)
    bound, _ = certify(problem, trajectory).bound_kg(trajectory.end_j)
    assert 0 <= trajectory.cost_kg / bound - 1 < 1e-3


def test_a_window_of_few_steps_energy_is_searched_on_grids_fine_enough():
    """A thousandth of C2's charge: 0.35 % were left where the first grid was kept."""
    car, whole = load_architecture("C2"), load_cycle("udds")
    narrow = replace(car, battery=replace(car.battery, soc_min=0.5995, soc_max=0.6005))
    drive = Cycle(
        "udds, 200 s", *(getattr(whole, name)[:201] for name in ("time_s", "speed_mps", "grade"))
    )
    problem = build_problem(narrow, drive)
    usual, finer = (simulate(problem, dp.solve(problem, nodes=n).control) for n in (1001, 4001))
    assert usual.cost_kg <= 1.001 * finer.cost_kg
