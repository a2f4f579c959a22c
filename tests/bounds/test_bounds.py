"""Bound <= exact <= every strategy, on small problems solved by trying every plan."""

import numpy as np
import pytest
from problems import every_plan, random_problem

from hevopt import InfeasibleError, certify, simulate
from hevopt.strategies import dp, ecms

ROUNDING = 1 + 1e-12


@pytest.mark.parametrize("seed", range(200))
def test_bound_is_below_exact_and_exact_below_every_strategy(seed):
    problem = random_problem(seed)
    cost, end_j = every_plan(problem)
    enough = end_j >= problem.end_min_j - 1e-9
    if not enough.any():
        for strategy in (dp, ecms):
            with pytest.raises(InfeasibleError, match=r"step|charge"):
                strategy.solve(problem)
        return
    exact = cost[enough].min()
    best = simulate(problem, dp.solve(problem).control)
    certificate = certify(problem, best)
    assert certificate.bound_kg(problem.end_min_j)[0] <= exact * ROUNDING
    assert exact <= best.cost_kg * ROUNDING
    # 1001 nodes see a staircase of a few plans through cells of a thousandth of the window.
    assert best.cost_kg <= 1.02 * exact
    assert exact <= simulate(problem, ecms.solve(problem).control).cost_kg * ROUNDING
    for plan_cost, plan_end_j in zip(cost, end_j, strict=True):
        assert certificate.bound_kg(plan_end_j)[0] <= plan_cost * ROUNDING


def test_dp_on_a_fine_grid_finds_the_exact_optimum():
    found = []
    for seed in range(0, 200, 4):
        problem = random_problem(seed)
        cost, end_j = every_plan(problem)
        enough = end_j >= problem.end_min_j - 1e-9
        if enough.any():
            plan = dp.solve(problem, nodes=50_001, refine=False)
            found.append(simulate(problem, plan.control).cost_kg / cost[enough].min() - 1)
    assert len(found) > 40
    assert np.max(np.abs(found)) < 1e-9


def test_every_line_of_a_certificate_is_a_bound_not_only_the_best():
    problem = random_problem(7)
    cost, end_j = every_plan(problem)
    certificate = certify(problem, simulate(problem, dp.solve(problem).control))
    for lines in certificate.proofs.values():
        for line in lines:
            bound = line.value_kg + line.price_kgpj * (end_j - problem.end_min_j)
            assert (bound <= cost + 1e-15).all()


def test_a_bound_from_a_bad_rollout_is_loose_but_still_a_bound():
    problem = random_problem(3)
    cost, end_j = every_plan(problem)
    enough = end_j >= problem.end_min_j - 1e-9
    worst = problem.table.feasible.argmax(axis=1)
    try:
        rollout = simulate(problem, worst)
    except InfeasibleError:
        pytest.skip("the first feasible controls break the window on this seed")
    assert certify(problem, rollout).bound_kg(problem.end_min_j)[0] <= cost[enough].min() * ROUNDING
