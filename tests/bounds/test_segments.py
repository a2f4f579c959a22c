"""Prices of stretches between moments at the window's ends: in order, a bound, better where the window binds."""

import numpy as np
import pytest
from problems import every_plan, random_problem

from hevopt import InfeasibleError, build_problem, certify, load_architecture, load_cycle, simulate
from hevopt.bounds import certificate as certificate_module
from hevopt.bounds.claim import Proof
from hevopt.bounds.segments import Segments, in_order, segment_dual
from hevopt.bounds.step_prices import costate_dual
from hevopt.strategies import dp


def test_prices_jump_down_at_the_lower_limit_and_up_at_the_upper_one():
    price = np.array([3.0, 3.0, 3.0, 5.0, 2.0, 2.0, 4.0, 4.0, 3.0])
    energy = np.array([5.0, 4.0, 2.0, 0.0, 0.0, 7.0, 10.0, 9.0, 10.0, 5.0])
    # Up at the lower limit for one step, and down at the upper one for the last: both take their neighbour's.
    found = in_order(Segments(price, energy, 4), 5.0)
    assert found.tolist() == [3, 3, 3, 3, 2, 2, 4, 4, 4]
    assert price[3] == 5.0  # the segments themselves stay
    assert in_order(Segments(found, energy, 2), 5.0).tolist() == found.tolist()


def test_prices_of_stretches_are_a_bound_on_random_problems():
    checked = 0
    for seed in range(60):
        problem = random_problem(seed)
        cost, end_j = every_plan(problem)
        try:
            rollout = simulate(problem, dp.solve(problem).control)
        except InfeasibleError:
            continue
        beside = costate_dual(problem, rollout)
        lines = segment_dual(problem, rollout, beside=beside)
        assert lines[-1].value_kg == max(line.value_kg for line in lines)
        for line in lines:
            above = line.value_kg + line.price_kgpj * (end_j - problem.end_min_j) - cost
            assert above.max() <= 1e-12 * np.abs(cost).max(), seed
        checked += 1
    assert checked > 30


def test_the_mean_of_two_prices_bounds_no_worse_than_the_mean_of_their_bounds():
    better = 0
    for seed in range(40):
        problem = random_problem(seed)
        try:
            rollout = simulate(problem, dp.solve(problem).control)
        except InfeasibleError:
            continue
        beside, alone = costate_dual(problem, rollout), segment_dual(problem, rollout)
        both = segment_dual(problem, rollout, beside=beside)
        assert both[-1].value_kg >= alone[-1].value_kg
        mean_kg = (alone[-1].value_kg + beside[-1].value_kg) / 2
        assert both[-1].value_kg >= mean_kg - 1e-12 * rollout.cost_kg, seed
        better += both[-1].value_kg > max(alone[-1].value_kg, beside[-1].value_kg)
    assert better > 0


@pytest.mark.parametrize(
    ("cycle", "kind"), [("nedc", Proof.LP_PRICES), ("wltc_class3b", Proof.SEGMENT_PRICES)]
)
def test_half_a_battery_is_proven_by_prices_alone(monkeypatch, cycle, kind):
    car = load_architecture("C2", {"battery.capacity_ah": 3.5})
    problem = build_problem(car, load_cycle(cycle))
    rollout = simulate(problem, dp.solve(problem).control)

    def unneeded(*arguments, **settings):
        raise AssertionError("the lower-bound DP was tried")

    monkeypatch.setattr(certificate_module, "lower_bound_kg", unneeded)
    certificate = certify(problem, rollout)
    bound_kg, proven = certificate.bound_of(rollout)
    assert proven is kind
    assert rollout.cost_kg < (1 + 5e-4) * bound_kg
    costate = certificate.proofs[Proof.COSTATE_PRICES][-1]
    extra_j = rollout.end_j - problem.end_min_j
    assert costate.value_kg + costate.price_kgpj * extra_j < bound_kg
