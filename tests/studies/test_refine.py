"""Torque levels added around a plan, until its cost settles."""

import pytest

from hevopt import load_architecture, load_cycle, simulate
from hevopt.bounds.step_prices import costate_dual
from hevopt.strategies import STRATEGIES, fitting
from hevopt.studies.case import prepare
from hevopt.studies.settings import Settings

REFINED = Settings(refine=True)


def cost_and_bound(case):
    trajectory = simulate(case.problem, case.dp_plan.control)
    bound, _ = case.certificate.bound_kg(trajectory.end_j)
    return trajectory.cost_kg, bound


@pytest.mark.parametrize("name", ["C2", "E"])
def test_few_levels_refined_come_to_what_many_levels_give(name):
    car, cycle = load_architecture(name), load_cycle("nedc")
    coarse, _ = cost_and_bound(prepare(car, cycle, levels=6))
    few = prepare(car, cycle, REFINED, levels=6)
    refined, bound = cost_and_bound(few)
    many, _ = cost_and_bound(prepare(car, cycle, levels=81))
    assert coarse > many * 1.0005
    assert refined == pytest.approx(many, rel=4e-4)
    # Among the table's own controls the plan is proven; the bound of every split lies lower, by what could lie
    # between six levels in the modes that the plan leaves out, where none were added.
    line = costate_dual(few.problem, few.dp_trajectory)[-1]
    own = line.value_kg + line.price_kgpj * (few.dp_trajectory.end_j - few.problem.end_min_j)
    assert bound <= own <= refined <= 1.0005 * own
    assert refined <= 1.002 * bound


@pytest.mark.parametrize("name", ["B", "C1", "D"])
def test_the_default_levels_need_no_refinement(name):
    car, cycle = load_architecture(name), load_cycle("nedc")
    costs = [
        cost_and_bound(prepare(car, cycle, Settings(refine=refine)))[0] for refine in (False, True)
    ]
    assert costs[1] == pytest.approx(costs[0], rel=2e-4)


def test_the_certificate_is_of_the_table_with_the_added_levels(beginnings):
    car = load_architecture("C2")
    case = prepare(car, load_cycle(beginnings / "hwfet.csv"), REFINED, levels=6)
    assert any(control.level.startswith("refined") for control in case.problem.table.controls)
    for name in fitting(car.functions):
        trajectory = simulate(case.problem, STRATEGIES[name].solve(case.problem).control)
        assert case.certificate.bound_kg(trajectory.end_j)[0] <= trajectory.cost_kg * (1 + 1e-12)
