"""Steppers: asked step by step they decide what their plans hold, by the charge that they are told."""

import numpy as np
import pytest

from hevopt import STRATEGIES, InfeasibleError
from hevopt.problem.frozen import frozen
from hevopt.strategies.stepper import driven

STEPPERS = [name for name, strategy in STRATEGIES.items() if strategy.start]


def test_every_causal_strategy_and_every_rule_can_be_asked_step_by_step():
    planned_at_once = {"ecms", "dp", "convex"}
    assert set(STEPPERS) == set(STRATEGIES) - planned_at_once


@pytest.mark.parametrize("name", STEPPERS)
def test_a_plan_is_what_the_stepper_decides_with_the_problem_s_battery(problem_of, name):
    problem = problem_of("C2", "nedc")
    told = {"training": [problem_of("C2", "hwfet")]} if STRATEGIES[name].learns else {}
    stepper = STRATEGIES[name].start(problem, **told)
    control, _ = driven(problem, stepper)
    np.testing.assert_array_equal(control, STRATEGIES[name].solve(problem, **told).control)


@pytest.mark.parametrize("name", ["a_ecms", "sdp", "mpc", "conventional"])
def test_the_charge_is_what_it_is_told(problem_of, name):
    """Driving at 50 km/h with an empty battery the engine runs; with a full one the car drives electrically."""
    problem = problem_of("C2", "nedc")
    told = {"training": [problem_of("C2", "hwfet")]} if STRATEGIES[name].learns else {}
    k = int(np.argmax(problem.table.signals.speed_mps > 13.8))
    low_j, high_j = problem.window_j
    fuel_kg = []
    for energy_j in (low_j + 0.01 * (high_j - low_j), high_j - 0.01 * (high_j - low_j)):
        stepper = STRATEGIES[name].start(problem, **told)
        for step in range(k):
            stepper.decide(step, energy_j, problem.start_mode)
        fuel_kg.append(problem.table.fuel_kg[k, stepper.decide(k, energy_j, problem.start_mode)])
    assert fuel_kg[0] > fuel_kg[1]


def test_a_step_that_leaves_nothing_is_named(problem_of):
    problem = problem_of("C2", "nedc")
    stepper = STRATEGIES["a_ecms"].start(problem)
    none = frozen("allowed", problem.table.switch_allowed[None] & False, np.bool_)
    switching = stepper.choices.switching._replace(allowed=none)
    stepper.choices = stepper.choices._replace(switching=switching)
    with pytest.raises(InfeasibleError, match="a_ecms: at step 0"):
        stepper.decide(0, problem.start_j, problem.start_mode)
