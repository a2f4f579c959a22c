"""A least time on and off of the engine, asked for in its file, in every strategy and bound."""

import numpy as np
import pytest

from hevopt import (
    STRATEGIES,
    build_problem,
    certify,
    load_architecture,
    load_cycle,
    simulate,
    solve,
)
from hevopt.powertrain.powertrain import around_plan

ON_S, OFF_S = 5.0, 3.0


def dwelling(name):
    changes = {"engine.least_on_s": ON_S, "engine.least_off_s": OFF_S}
    return build_problem(load_architecture(name, changes), load_cycle("nedc"), levels=7)


@pytest.fixture(scope="module")
def solved():
    problem = dwelling("C2")
    plan = simulate(problem, solve(problem).control)
    return problem, plan, certify(problem, plan)


@pytest.mark.parametrize("strategy", ["conventional", "nox_cut", "ecms", "a_ecms", "dp"])
def test_every_strategy_keeps_to_it_and_every_bound_counts_it(solved, strategy):
    problem, _, certificate = solved
    run = simulate(problem, STRATEGIES[strategy].solve(problem).control)
    on = np.array([problem.table.controls[c].engine_on for c in run.control])
    changes = np.flatnonzero(np.diff(on)) + 1
    lasted = np.diff(problem.table.time_s[changes])
    assert len(changes) > 4
    assert lasted[on[changes[:-1]]].min() >= ON_S and lasted[~on[changes[:-1]]].min() >= OFF_S
    bound_kg, _ = certificate.bound_kg(run.end_j)
    assert bound_kg <= run.cost_kg * (1 + 1e-12)
    assert np.abs(run.residuals["whole car"]).max() < 1e-5


def test_the_rule_as_a_stepper_takes_what_its_plan_takes(solved):
    from hevopt.strategies import conventional
    from hevopt.strategies.stepper import driven

    problem = solved[0]
    stepper = conventional.start(problem)
    assert np.array_equal(driven(problem, stepper)[0], stepper.plan.control)


def test_torques_are_told_of_a_plan_that_keeps_to_it(solved):
    problem, run, _ = solved
    torques = around_plan(run, problem.table, 0.1).torque_nm
    assert sum(np.isfinite(torque).sum() for torque in torques.values()) > 500


def test_without_it_the_table_is_what_it_was():
    car = load_architecture("C2")
    assert build_problem(car, load_cycle("nedc"), levels=7).table.modes == 2
