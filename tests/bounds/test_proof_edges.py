"""Proofs at the edges of what numbers hold, and of what a window and an asked end grant."""

import numpy as np
import pytest
from problems import every_plan, random_problem
from proofs.run import attack

from hevopt import Battery, ControlTable, Problem, certify, simulate
from hevopt.bounds import _step_prices_kernels as price_kernels
from hevopt.bounds._lower_dp_kernels import _run_end
from hevopt.bounds.prices import end_slack_j
from hevopt.bounds.step_prices import costate_dual, dual_of_shape
from hevopt.problem import battery as battery_model
from hevopt.strategies import dp
from hevopt.strategies._backward_kernels import Penalty, _shift


@pytest.mark.parametrize("slope", [5e-324, 1e-300, 1e-19, 1e-12])
def test_a_move_that_hardly_changes_is_one_run_of_nodes(slope):
    for run_end in (_run_end, _run_end.py_func):
        assert run_end(0, 4000, 0.25, slope, 0) == 4000
    for sign in (1.0, -1.0):
        value, best = np.arange(4001.0), np.full(4001, np.inf)
        _shift.py_func(best, value, 1.0, 0, 4001, 0.25, sign * slope, Penalty(1.0, 1.0, np.inf))
        assert best == pytest.approx(np.arange(4001.0) + 1.25)


@pytest.mark.parametrize("size", [1e-320, 1e-300, 1e150, 1e300, 1.7e308])
def test_prices_of_any_size_prove_what_their_shape_proves(size):
    problem = random_problem(1)
    rollout = simulate(problem, dp.solve(problem).control)
    shape = np.linspace(1.0, 0.5, len(problem.table.step_s))
    found = dual_of_shape(problem, rollout, shape)[-1].value_kg
    assert 0 < found <= rollout.cost_kg
    # The smallest numbers have few digits.
    sized = dual_of_shape(problem, rollout, size * shape)[-1].value_kg
    assert sized == pytest.approx(found, rel=1e-3 if size < 1e-308 else 1e-12)


def test_prices_that_outgrow_numbers_stay_a_bound():
    steps, peak = 1400, 10.0**2 / 4
    power = np.tile([[peak, -40.0], [0.0, -40.0]], (steps // 2, 1))
    fuel = np.tile([[0.0, 1e-3], [1e-3, 2e-3]], (steps // 2, 1))
    pack = Battery([0, 1], [10, 12], [1.0, 1.0], [1.0, 1.0], 5000.0)
    problem = Problem(ControlTable.from_arrays(fuel, power, step_s=1.0), pack, 0.0, 0.0)
    control = np.tile([1, 1, 0, 1], steps // 4)
    rollout = simulate(problem, control)
    at_peak = np.zeros(steps + 1)
    prices = price_kernels.costate(
        at_peak, np.full(steps, peak), np.full(steps, 1e4), pack.within_window()
    )
    assert np.isfinite(prices).all() and prices.max() > 0 and prices[-1] == 0
    for line in (*dual_of_shape(problem, rollout, prices), *costate_dual(problem, rollout)):
        assert line.value_kg <= rollout.cost_kg


def test_no_bound_is_above_0_by_what_is_below_the_smallest_normal_number():
    assert attack(range(702_923, 702_924)) == []


@pytest.mark.parametrize("seed", [8, 12, 14, 24])
def test_an_end_missed_within_what_is_granted_is_certified_as_it_is_planned(seed):
    problem = random_problem(seed)
    _, ends = every_plan(problem)
    asked_j = ends.max() + 0.4e-12 * problem.window_j[1]
    asked = float(battery_model.soc(problem.battery, asked_j))
    problem = Problem(
        problem.table,
        problem.battery,
        problem.soc_start,
        asked,
        problem.start_mode,
        problem.nox_weight,
    )
    rollout = simulate(problem, dp.solve(problem).control)
    assert 0 < problem.end_min_j - rollout.end_j < end_slack_j(problem)
    bound, _ = certify(problem, rollout, target_gap=0.0).bound_of(rollout)
    assert bound <= rollout.cost_kg


def test_a_plan_that_rounding_leads_below_a_kink_of_the_resistance_is_certified():
    """Below the window the power that every charge within it can deliver has no current."""
    pack = Battery(
        [0, 0.2, 1], [100.0] * 3, [1e7, 1.0, 1.0], [0.1] * 3, 1e4, soc_min=0.2, soc_max=0.9
    )
    peak = 100.0**2 / 4
    power = np.array([[1500.0] * 3, [-800.0, peak, 500.0], [-1500.0, -100.0, 0.0]])
    table = ControlTable.from_arrays(np.maximum(0.0, 0.2 - power / 2e4), power, step_s=20.0)
    low, granted = 0.2 * 100 * 1e4, pack.granted_window_j[0]
    chemical = battery_model.chemical_power_w(pack, np.array([1500.0]), 100.0, 1.0)[0]
    start_j = (low + granted) / 2 + 20.0 * chemical
    problem = Problem(table, pack, float(battery_model.soc(pack, start_j)), 0.2)
    rollout = simulate(problem, [0, 0, 0])
    assert granted < rollout.energy_j[1] < low and problem.table.feasible.all()
    certificate = certify(problem, rollout, target_gap=0.0)
    assert {"LP prices", "costate prices"} <= set(certificate.proofs)
    assert certificate.bound_of(rollout)[0] <= rollout.cost_kg
