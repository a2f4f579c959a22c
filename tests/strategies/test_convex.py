"""The convex relaxation is a bound, agrees with the dual where both are the same model, and leads to good plans."""

import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from problems import every_plan, random_problem

from hevopt import Battery, ControlTable, InfeasibleError, Problem, SolverError, certify, simulate
from hevopt.bounds.prices import one_price_dual
from hevopt.problem.choices import choices_of
from hevopt.strategies import convex, dp
from hevopt.strategies._convex_dual import dual_value_kg
from hevopt.strategies._convex_model import optimum
from hevopt.strategies._convex_parts import cell_of, hulls_of


def flat_battery(ohm: float, efficiency: float = 1.0) -> Battery:
    return Battery(
        np.array([0.0, 1.0]), np.full(2, 230.0), np.full(2, ohm), np.full(2, ohm), 25200.0,
        efficiency, 0.1, 0.9,
    )  # fmt: skip


def engine_table(levels: int, steps: int = 60, idle_kg: float = 5e-5) -> ControlTable:
    """Mode 0: engine off, one control; mode 1: engine on, `levels` battery powers at a convex cost."""
    rng = np.random.default_rng(3)
    demand = rng.uniform(-4e3, 12e3, steps)[:, None]
    power = demand - np.linspace(0.0, 20e3, levels)
    engine = demand - power
    fuel = idle_kg + 5.5e-8 * engine + 6e-13 * engine**2
    off = np.zeros((steps, 1))
    mode = np.concatenate([[0], np.ones(levels, dtype=int)])
    return ControlTable.from_arrays(np.hstack([off, fuel]), np.hstack([demand, power]), mode=mode)


def relaxation(problem: Problem, guess: float | None = None):
    guess = one_price_dual(problem)[-1].price_kgpj if guess is None else guess
    return optimum(problem, hulls_of(choices_of(problem)), guess)


# 40 seeds hold more than a dozen problems with a plan that keeps the charge.
def test_relaxation_exact_and_plan_are_in_order_on_small_problems():
    checked = 0
    for seed in range(40):
        problem = random_problem(seed)
        cost, end_j = every_plan(problem)
        enough = end_j >= problem.end_min_j - 1e-9
        if not enough.any():
            with pytest.raises((InfeasibleError, SolverError)):
                convex.solve(problem)
            continue
        plan = convex.solve(problem)
        rollout = simulate(problem, plan.control)
        assert plan.notes["relaxation_kg"] <= cost[enough].min() * (1 + 1e-12), seed
        assert rollout.cost_kg >= cost[enough].min() * (1 - 1e-12), seed
        assert rollout.end_j >= problem.end_min_j * (1 - 1e-11), seed
        checked += 1
    assert checked > 12


def test_any_prices_and_places_bound_the_small_problems():
    for seed in range(30):
        problem, rng = random_problem(seed), np.random.default_rng(seed)
        cost, end_j = every_plan(problem)
        enough = end_j >= problem.end_min_j - 1e-9
        if not enough.any():
            continue
        hulls = hulls_of(choices_of(problem))
        for scale in (0.0, 1e-8, 1e-7, 1e-6):
            price = scale * rng.uniform(0.0, 2.0, len(hulls.step_s))
            place = rng.uniform(*problem.window_j, len(hulls.step))
            bound = dual_value_kg(problem, hulls, cell_of(problem), price, place)
            assert bound <= cost[enough].min() * (1 + 1e-12), (seed, scale)


# Without loss a mixture of two powers drains what they drain between them: both models are one linear program.
@pytest.mark.parametrize("end_shift", [-0.02, 0.0, 0.02])
def test_relaxation_equals_the_dual_without_losses(end_shift):
    problem = Problem(engine_table(21), flat_battery(0.0), 0.5, 0.5 + end_shift)
    solution, best = relaxation(problem), one_price_dual(problem)[-1]
    # The solver's accuracy; its oldest allowed release is 5e-6 off.
    assert solution.value_kg == pytest.approx(best.value_kg, rel=1e-5)
    assert solution.bound_kg == pytest.approx(best.value_kg, rel=1e-5)
    assert solution.price_kgpj[-1] == pytest.approx(best.price_kgpj, rel=0.05)


# With losses the mixture of two powers loses less than they do; a fine table leaves no room between them.
def test_relaxation_equals_the_dual_of_a_fine_table_with_losses():
    problem = Problem(engine_table(2001), flat_battery(0.25, 0.98), 0.5, 0.5)
    solution, best = relaxation(problem), one_price_dual(problem)[-1]
    assert solution.bound_kg <= best.value_kg * (1 + 1e-12)
    assert solution.bound_kg == pytest.approx(best.value_kg, rel=1e-6)


def free_switching(problem: Problem) -> Problem:
    """The problem with switching for nothing, as the convex model takes it to be."""
    free = np.zeros_like(problem.table.switch_fuel_kg)
    return replace(problem, table=replace(problem.table, switch_fuel_kg=free, switch_energy_j=free))


def test_relaxation_equals_the_dual_of_a_car_without_starts(problem_of):
    problem = replace(free_switching(problem_of("C2", "nedc")), battery=flat_battery(0.2432))
    solution, best = relaxation(problem), one_price_dual(problem)[-1]
    assert solution.bound_kg <= best.value_kg * (1 + 1e-12)
    # The rest is the room between neighbouring torque levels.
    assert solution.bound_kg == pytest.approx(best.value_kg, rel=1e-4)


# The plans of `dp` are certified to 0.05 % (test_certificate.py); the convex ones may lose a little more.
@pytest.mark.parametrize("cycle", ["nedc", "wltc_class3b"])
@pytest.mark.parametrize("car", ["C2", "D"])
def test_plans_are_certified_to_0_03_percent(problem_of, car, cycle):
    problem = problem_of(car, cycle)
    plan = convex.solve(problem)
    rollout = simulate(problem, plan.control)
    certificate = certify(problem, simulate(problem, dp.solve(problem).control))
    bound, _ = certificate.bound_kg(rollout.end_j)
    assert rollout.cost_kg <= 1.0003 * bound
    assert plan.notes["relaxation_kg"] <= certificate.bound_kg(problem.end_min_j)[0] * 1.0005
    assert plan.notes["split_kg"] == pytest.approx(rollout.cost_kg, rel=1e-3)
    assert plan.notes["solver"] == "CLARABEL" and plan.notes["iterations"] >= 1


def test_solver_and_dual_agree_on_a_car(problem_of):
    solution = relaxation(free_switching(problem_of("C2", "nedc")))
    assert solution.value_kg == pytest.approx(solution.bound_kg, rel=2e-6)


# The model knows of no switching. The dual counts it at the model's prices: a bound, here the higher.
@pytest.mark.parametrize("car", ["C2", "D", "E"])
def test_where_switching_takes_energy_the_dual_counts_it(problem_of, car):
    problem = problem_of(car, "nedc")
    assert problem.table.switch_energy_j.any()
    solution, best = relaxation(problem), simulate(problem, dp.solve(problem).control)
    assert solution.value_kg < solution.bound_kg <= best.cost_kg
    assert solution.bound_kg > 0.997 * best.cost_kg


def test_a_wrong_price_guess_costs_the_bound_little(problem_of):
    problem = free_switching(problem_of("C2", "nedc"))
    assert relaxation(problem, 0.0).bound_kg == pytest.approx(
        relaxation(problem).bound_kg, rel=1e-4
    )


def test_with_one_mode_split_and_dp_agree():
    table = engine_table(201)
    table = replace(table, reject=np.where(table.mode == 0, np.uint16(512), table.reject))
    problem = Problem(table, flat_battery(0.25, 0.98), 0.5, 0.5)
    plan = convex.solve(problem)
    best = simulate(problem, dp.solve(problem).control).cost_kg
    assert plan.notes["split_kg"] == pytest.approx(best, rel=1e-3)
    assert simulate(problem, plan.control).cost_kg == pytest.approx(best, rel=1e-3)


def test_where_the_window_binds_the_relaxation_stays_a_bound(problem_of):
    base = problem_of("C2", "nedc")
    pack = replace(base.battery, soc_min=0.58, soc_max=0.62)
    problem = replace(base, battery=pack)
    rollout = simulate(problem, convex.solve(problem).control)
    best = simulate(problem, dp.solve(problem).control)
    solution = relaxation(problem)
    assert solution.bound_kg <= min(rollout.cost_kg, best.cost_kg)
    free = relaxation(free_switching(problem))
    assert free.value_kg == pytest.approx(free.bound_kg, rel=1e-4)
    # A tenth of the usual window: prices jump at its ends, and mode paths by price miss them.
    assert rollout.cost_kg <= 1.02 * best.cost_kg


def test_an_end_charge_out_of_reach_is_an_error_that_says_so():
    problem = Problem(engine_table(5, steps=3), flat_battery(0.1), 0.5, 0.89)
    with pytest.raises(InfeasibleError, match="end charge cannot be reached"):
        convex.solve(problem)
    with pytest.raises(InfeasibleError, match="CLARABEL proves"):
        relaxation(problem, 1e-7)


def test_a_solver_that_stops_early_is_an_error_with_its_status(monkeypatch):
    import cvxpy

    run = cvxpy.Problem.solve
    monkeypatch.setattr(
        cvxpy.Problem, "solve", lambda self, solver: run(self, solver=solver, max_iter=2)
    )
    problem = Problem(engine_table(21), flat_battery(0.2), 0.5, 0.5)
    with pytest.raises(SolverError, match=r"CLARABEL stopped with .*user_limit.* use dp"):
        convex.solve(problem)


def test_importing_the_strategy_does_not_import_the_solver():
    code = "import sys, hevopt.strategies.convex; sys.exit('cvxpy' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code]).returncode == 0
