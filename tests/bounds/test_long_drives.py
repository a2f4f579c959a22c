"""Bounds that are worked out in parts, for long drives, are those of the whole."""

from dataclasses import replace

import pytest
from problems import random_problem

from hevopt import build_problem, load_architecture, load_cycle, simulate
from hevopt.bounds import lower_dp, step_prices
from hevopt.bounds.prices import one_price_dual
from hevopt.strategies import dp


@pytest.mark.parametrize("seed", range(8))
def test_the_lower_bound_in_parts_is_that_of_the_whole_to_the_last_bit(seed, monkeypatch):
    problem = random_problem(seed)
    price = one_price_dual(problem)[-1].price_kgpj
    whole = lower_dp.lower_bound_kg(problem, price, nodes=101)
    monkeypatch.setattr(lower_dp, "_PART_MOVES", 1)
    assert lower_dp.lower_bound_kg(problem, price, nodes=101) == whole


def test_prices_of_a_linear_program_in_parts_prove_as_much(monkeypatch):
    """A window so narrow that the drive touches both its ends, again and again."""
    car = load_architecture("C2")
    car = replace(car, battery=replace(car.battery, soc_min=0.57, soc_max=0.63))
    problem = build_problem(car, load_cycle("nedc"), levels=11)
    rollout = simulate(problem, dp.solve(problem).control)
    whole = step_prices.lp_dual(problem, rollout)[-1].value_kg
    costate = step_prices.costate_dual(problem, rollout)[-1].value_kg
    monkeypatch.setattr(step_prices, "_LP_STEPS", 300)
    monkeypatch.setattr(step_prices, "_LP_OVERLAP", 100)
    parts = step_prices.lp_dual(problem, rollout)[-1].value_kg
    assert parts <= rollout.cost_kg
    assert parts - costate > 0.99 * (whole - costate) > 0
