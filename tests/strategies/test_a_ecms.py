"""Adaptive ECMS: causal, within the window, neutral by its own feedback, and never below the bound."""

import numpy as np
import pytest
from conftest import CYCLES, HYBRIDS
from problems import random_problem, rows

from hevopt import (
    Battery,
    ControlTable,
    DataError,
    Problem,
    build_problem,
    certify,
    load_architecture,
    load_cycle,
    simulate,
)
from hevopt.car.storing import storing_kgpj
from hevopt.problem.choices import choices_of
from hevopt.strategies import _causal_kernels as kernels
from hevopt.strategies import a_ecms, dp

HEATING_VALUE_JPKG = 42.9e6
CUTS = (1, 137, 400, 800)


def gained_percent(problem, trajectory) -> float:
    fuel_j = trajectory.total_fuel_kg * HEATING_VALUE_JPKG
    return 100 * (trajectory.end_j - problem.start_j) / fuel_j


@pytest.mark.parametrize("architecture", ["C2", "E"])
@pytest.mark.parametrize("window_s", [None, 120.0])
def test_a_decision_does_not_change_when_the_cycle_after_it_changes(
    problem_of, architecture, window_s
):
    problem = problem_of(architecture, "nedc")
    steps = np.arange(len(problem.table.step_s))
    plan = a_ecms.solve(problem, window_s=window_s).control
    rng = np.random.default_rng(3)
    for cut in CUTS:
        shuffled = np.concatenate([steps[:cut], rng.permutation(steps[cut:])])
        for order in (steps[:cut], shuffled, np.concatenate([steps[:cut], steps[::-1]])):
            other = a_ecms.solve(rows(problem, order), window_s=window_s).control
            np.testing.assert_array_equal(other[:cut], plan[:cut])


@pytest.mark.parametrize("architecture", ["C2", "D"])
@pytest.mark.parametrize("cycle, most_percent", [("nedc", 2.0), ("wltc_class3b", 1.0)])
def test_charge_is_neutral_by_feedback_alone(problem_of, architecture, cycle, most_percent):
    """NEDC ends soon after the one stretch at 120 km/h, too soon to use up what is charged there."""
    problem = problem_of(architecture, cycle)
    trajectory = simulate(problem, a_ecms.solve(problem).control)
    assert abs(gained_percent(problem, trajectory)) <= most_percent


@pytest.mark.parametrize("architecture", HYBRIDS)
@pytest.mark.parametrize("cycle", CYCLES)
def test_loss_is_positive_and_small_on_every_shipped_cycle(problem_of, architecture, cycle):
    problem = problem_of(architecture, cycle)
    certificate = certify(problem, simulate(problem, dp.solve(problem).control))
    trajectory = simulate(problem, a_ecms.solve(problem).control)
    bound, _ = certificate.bound_kg(trajectory.end_j)
    gap = 100 * (trajectory.cost_kg / bound - 1)
    print(
        f"{architecture} {cycle}: gap {gap:.2f} %, charge {gained_percent(problem, trajectory):+.2f} %"
    )
    assert 0 <= gap < 5.5
    assert abs(gained_percent(problem, trajectory)) < 3.0


def test_the_moving_base_also_keeps_the_window_and_loses_little(problem_of):
    problem = problem_of("C2", "wltc_class3b")
    fixed, moving = (a_ecms.solve(problem, window_s=w) for w in (None, 300.0))
    assert not np.array_equal(fixed.control, moving.control)
    cost = [simulate(problem, plan.control).cost_kg for plan in (fixed, moving)]
    assert cost[1] < 1.02 * cost[0]


def test_a_factor_over_past_steps_matches_the_drain_that_is_asked():
    """Two controls a step, 1 g for 20 kJ more: below 0.05 mg/J every step drains, above none does."""
    cost, drain = np.array([[0.0, 1e-3], [0.0, 3e-3]]), np.array([2e4, 0.0, 2e4, 0.0])
    pack = Battery([0, 1], [100, 100], [0, 0], [0, 0], 3600.0)
    choices = choices_of(Problem(ControlTable.from_arrays(cost, 0 * cost), pack, 0.5, 0.5))
    for wanted, expected in ((2.5e4, 5e-8), (1e4, 1.5e-7)):
        factor = kernels.neutral_factor(choices, drain, (0, 2), wanted, (1e-8, 1e-6))
        assert factor == pytest.approx(expected, rel=0.01)


@pytest.mark.parametrize("saved, started", [(0.50, False), (0.54, True)])
@pytest.mark.parametrize("by_energy", [False, True])
def test_a_start_pays_the_same_share_in_fuel_and_in_energy(by_energy, saved, started):
    """Where the engine's running saves a bit more within the step than 0.52 of what its start takes, it starts."""
    pack = Battery([0, 1], [100, 100], [0, 0], [0, 0], 3600.0, 0.8)
    base = a_ecms.FEEDBACK.base_kgpj / 0.8
    start_j = 1000.0 / saved
    switch = np.array([[0, start_j], [0, 0]])
    name, factor = ("switch_energy_j", 1.0) if by_energy else ("switch_fuel_kg", base)
    table = ControlTable.from_arrays(
        [[0.0, 0.0]], [[1000.0, 0.0]], mode=[0, 1], **{name: factor * switch}
    )
    plan = a_ecms.solve(Problem(table, pack, 0.5, 0.5))
    assert plan.notes["base_kgpj"] == plan.notes["price_kgpj"] == base
    assert plan.control.tolist() == [int(started)]


def test_same_input_same_plan(problem_of):
    problem = problem_of("E", "udds")
    plans = [a_ecms.solve(problem) for _ in range(2)]
    np.testing.assert_array_equal(plans[0].control, plans[1].control)
    assert plans[0].notes == plans[1].notes


def test_window_is_kept_where_a_control_keeps_it():
    """A tiny battery, cheap controls that would empty or overfill it at once, and one that is neutral."""
    rng = np.random.default_rng(0)
    power = np.column_stack([rng.uniform(-3e3, 3e3, 400), np.zeros(400)])
    fuel = np.column_stack([np.zeros(400), np.full(400, 1e-3)])
    battery = Battery(
        np.array([0.0, 1.0]),
        np.full(2, 100.0),
        np.full(2, 0.1),
        np.full(2, 0.1),
        200.0,
        1.0,
        0.4,
        0.6,
    )
    problem = Problem(ControlTable.from_arrays(fuel, power), battery, 0.5, 0.5)
    trajectory = simulate(problem, a_ecms.solve(problem).control)
    assert trajectory.soc.min() >= 0.4 and trajectory.soc.max() <= 0.6


@pytest.mark.parametrize("seed", range(12))
def test_every_control_taken_is_feasible_on_tables_without_signals(seed):
    problem = random_problem(seed)
    control = a_ecms.solve(problem).control
    assert problem.table.feasible[np.arange(len(control)), control].all()


@pytest.mark.parametrize("window_s", [0.0, -5.0, float("nan")])
def test_a_window_that_is_none_is_refused(problem_of, window_s):
    with pytest.raises(DataError, match="window_s"):
        a_ecms.solve(problem_of("C2", "nedc"), window_s=window_s)


def test_a_car_of_free_engine_speed_has_the_price_of_its_own_engine_and_generator():
    """By hand: engine and generator of series_1500 on one shaft, all operating points of the engine's map."""
    car = load_architecture("series_1500")
    engine, generator = car.engine, car.machines[0]
    best = 0.0
    for speed in np.linspace(engine.idle_radps, engine.speed_max_radps, 60):
        for torque in np.linspace(5.0, float(engine.full_load_nm(speed)), 60):
            made_w = torque * speed - float(generator.loss_w(-torque, speed))
            fuel_kgps = float(engine.fuel_kgps(np.array(torque), np.array(speed)))
            if fuel_kgps > 0:  # nor NaN
                best = max(best, made_w / fuel_kgps)
    assert storing_kgpj(car) == pytest.approx(1 / best, rel=2e-3)
    assert storing_kgpj(car) > 1.2 * a_ecms.FEEDBACK.base_kgpj
    split = load_architecture("prius_1998")
    share = split.engine.best_efficiency * 0.94 * split.engine.heating_value_jpkg
    assert storing_kgpj(split) == pytest.approx(1 / share)
    assert storing_kgpj(load_architecture("C2")) is storing_kgpj(load_architecture("A")) is None


def test_a_series_car_keeps_its_charge_by_feedback_alone():
    car = load_architecture("series_1500")
    problem = build_problem(car, load_cycle("udds"), levels=7)
    own, shared = a_ecms.solve(problem), a_ecms.solve(problem, feedback=a_ecms.FEEDBACK)
    ends = [gained_percent(problem, simulate(problem, plan.control)) for plan in (own, shared)]
    assert own.notes["base_kgpj"] == storing_kgpj(car) / problem.battery.coulombic_efficiency
    assert abs(ends[0]) < 0.8 and ends[1] < -1.0
