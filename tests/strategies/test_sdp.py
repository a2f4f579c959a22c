"""Stochastic dynamic programming: learnt from other cycles, causal, neutral, and never below the bound."""

from dataclasses import replace

import numpy as np
import pytest
from conftest import CYCLES
from problems import rows

from hevopt import DataError, certify, simulate
from hevopt.problem.problem import Plan
from hevopt.problem.table import Signals
from hevopt.strategies import _causal_kernels as kernels
from hevopt.strategies import _policy_kernels as policies
from hevopt.strategies import dp, sdp

HEATING_VALUE_JPKG = 42.9e6


@pytest.fixture
def plan_of(problem_of):
    """(architecture, cycle) -> plan learnt from the other shipped cycles."""

    def plan(architecture: str, cycle: str) -> Plan:
        others = [problem_of(architecture, other) for other in CYCLES if other != cycle]
        return sdp.solve(problem_of(architecture, cycle), others)

    return plan


def test_a_decision_does_not_change_when_the_cycle_after_it_changes(problem_of):
    problem, training = problem_of("C2", "nedc"), [problem_of("C2", "cadc_urban")]
    steps = np.arange(len(problem.table.step_s))
    plan = sdp.solve(problem, training).control
    rng = np.random.default_rng(5)
    for cut in (1, 400, 800):
        for order in (steps[:cut], np.concatenate([steps[:cut], rng.permutation(steps[cut:])])):
            other = sdp.solve(rows(problem, order), training).control
            np.testing.assert_array_equal(other[:cut], plan[:cut])


@pytest.mark.parametrize(
    "architecture, cycle",
    [("C2", "nedc"), ("C2", "wltc_class3b"), ("D", "nedc"), ("D", "wltc_class3b")],
)
def test_charge_is_neutral_and_the_loss_positive_and_small(
    problem_of, plan_of, architecture, cycle
):
    problem = problem_of(architecture, cycle)
    trajectory = simulate(problem, plan_of(architecture, cycle).control)
    gained_j, fuel_j = (
        trajectory.end_j - problem.start_j,
        trajectory.total_fuel_kg * HEATING_VALUE_JPKG,
    )
    certificate = certify(problem, simulate(problem, dp.solve(problem).control))
    gap = 100 * (trajectory.cost_kg / certificate.bound_kg(trajectory.end_j)[0] - 1)
    print(f"{architecture} {cycle}: gap {gap:.2f} %, charge {100 * gained_j / fuel_j:+.2f} %")
    # Charge is held softly: D does not follow its reference down in the fast minute before the NEDC's last stop.
    assert abs(gained_j) <= 0.015 * fuel_j
    assert 0 <= gap < 4.0


@pytest.mark.parametrize("architecture, cycle", [("C1", "cadc_urban"), ("E", "us06")])
def test_the_other_couplings_are_driven_too(problem_of, plan_of, architecture, cycle):
    plan = plan_of(architecture, cycle)
    trajectory = simulate(problem_of(architecture, cycle), plan.control)
    assert plan.notes["settled"]
    assert trajectory.soc.min() > 0.45 and trajectory.soc.max() < 0.75


def test_same_input_same_plan(problem_of):
    training = [problem_of("D", "us06")]
    plans = [sdp.solve(problem_of("D", "cadc_urban"), training) for _ in range(2)]
    np.testing.assert_array_equal(plans[0].control, plans[1].control)
    assert plans[0].notes == plans[1].notes


def cycle_of(speed: list[float], power: list[float]) -> Signals:
    steps = len(speed)
    return Signals(
        np.array(speed), np.array(power), np.ones(steps, np.int64), np.zeros(steps, dtype=bool)
    )


def test_chain_counts_what_follows_and_standing_is_a_class_of_its_own():
    signals = cycle_of([0.0, 0.0, 12.0, 12.0], [0.0, 0.0, 2e4, 2e4])
    chain = sdp.chain_of([signals])
    assert len(chain.speed_mps) == 2 and chain.speed_mps[0] == 0.0
    np.testing.assert_allclose(chain.transition.sum(axis=1), 1.0)
    np.testing.assert_allclose(chain.transition, 0.5)
    np.testing.assert_array_equal(sdp.classes_of(chain, signals), [0, 0, 1, 1])
    other = cycle_of([0.1, 40.0, 0.0], [0.0, 9e4, 0.0])
    np.testing.assert_array_equal(sdp.classes_of(chain, other), [1, 1, 0])


def test_rows_that_stand_for_a_class_are_of_that_class(problem_of):
    training = [problem_of("C2", name) for name in ("us06", "cadc_urban")]
    chain = sdp.chain_of([other.table.signals for other in training])
    joined = sdp._joined_rows(training, chain.rows)
    starts = [0, len(training[0].table.step_s)]
    for r in range(0, len(chain.rows), 7):
        part = int(chain.rows[r] >= starts[1])
        k, table = chain.rows[r] - starts[part], training[part].table
        entries = slice(joined.first[r, 0], joined.first[r, -1])
        np.testing.assert_array_equal(
            joined.power_w[entries], table.battery_power_w[k, joined.control[entries]]
        )


def test_kernels_agree_with_a_plain_twin(problem_of):
    training = [problem_of("E", "cadc_urban")]
    problem, nodes = training[0], 7
    chain = sdp.chain_of([problem.table.signals])
    joined = sdp._joined_rows(training, chain.rows)
    low, high = problem.window_j
    cell, classes = (high - low) / (nodes - 1), len(chain.speed_mps)
    ahead = np.random.default_rng(1).uniform(0, 1e-3, (classes, joined.modes, nodes))
    policy = policies.improve(
        joined, chain.row_class, ahead, kernels.SteadyGrid(low, cell), 1e-6, problem.battery.arrays
    )
    value = np.empty_like(ahead)
    listed = policies.Rows(chain.row_class, chain.row_share)
    policies.evaluate(policy, listed, np.zeros((classes, nodes)), ahead, value)
    assert joined.switching.energy_j.any()
    for z in (0, 3, classes - 1):
        np.testing.assert_allclose(
            value[z], plain_value(problem, chain, joined, ahead, z), rtol=1e-9, atol=1e-15
        )


def plain_value(problem, chain, joined, ahead, z):
    """One Bellman step of a class, switch by switch and choice by choice."""
    from hevopt.problem._battery_kernels import chemical_power_at

    low, high = problem.window_j
    modes, nodes = ahead.shape[1:]
    grid = np.linspace(low, high, nodes)
    members = np.flatnonzero(chain.row_class == z)
    switching = joined.switching
    value = np.zeros((modes, nodes))

    def led_to(cost_kg, wanted_j, later):
        inside = np.clip(wanted_j, low, high)
        return cost_kg + 1e-6 * np.abs(wanted_j - inside) + np.interp(inside, grid, later)

    for r in members:
        least = np.full((modes, nodes), np.inf)
        for n in range(modes):
            for i in range(joined.first[r, n], joined.first[r, n + 1]):
                rate = [
                    chemical_power_at(joined.power_w[i], e, problem.battery.arrays) for e in grid
                ]
                after = grid - joined.step_s[r] * np.array(rate)
                least[n] = np.minimum(least[n], led_to(joined.cost_kg[i], after, ahead[z, n]))
        kg, energy_j = (part[switching.case[r]] for part in (switching.kg, switching.energy_j))
        for m in range(modes):
            switches = [led_to(kg[m, n], grid - energy_j[m, n], least[n]) for n in range(modes)]
            value[m] += np.min(switches, axis=0) / len(members)
    return value


def test_what_training_must_be_is_said(problem_of):
    problem = problem_of("C2", "nedc")
    with pytest.raises(DataError, match="pass a list of problems of the same car"):
        sdp.solve(problem, [])
    with pytest.raises(DataError, match="same car"):
        sdp.solve(problem, [problem_of("E", "us06")])
    blind = replace(problem, table=replace(problem.table, signals=None))
    with pytest.raises(DataError, match="signals"):
        sdp.solve(problem, [blind])
    with pytest.raises(DataError, match="of arrays alone has none, so solve it with dp"):
        sdp.solve(blind)
    with pytest.raises(DataError, match="allowed"):
        sdp.solve(problem, [problem_of("C2", "us06")], memory_s=0.0)
