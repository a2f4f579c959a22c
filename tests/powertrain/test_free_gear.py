"""The engine's gear as a control."""

from dataclasses import replace

import numpy as np
import pytest

from hevopt import build_problem, certify, load_architecture, load_cycle, simulate, solve
from hevopt.strategies import STRATEGIES, fitting

RPM = 2 * np.pi / 60


def free(name, **gearbox):
    car = load_architecture(name)
    return replace(car, gearbox=replace(car.gearbox, **gearbox)).with_free_gear()


@pytest.mark.parametrize("name", ["A", "B", "C1", "C2", "D"])
def test_choosing_the_gear_without_cost_or_limit_never_burns_more(problem_of, name):
    fuel = [
        simulate(problem, solve(problem).control).total_fuel_kg
        for problem in (
            problem_of(name, "nedc"),
            build_problem(
                free(name, shift_fuel_kg=0.0, engine_speed_min_radps=0.0), load_cycle("nedc")
            ),
        )
    ]
    # The solver is certified to 0.05 %.
    assert fuel[1] <= fuel[0] * 1.0005


@pytest.mark.parametrize("name", ["A", "C2"])
def test_lowest_engine_speed_and_cost_of_a_change_are_kept(name):
    car = free(name)
    problem = build_problem(car, load_cycle("wltc_class3b"))
    trajectory = simulate(problem, solve(problem).control)
    labels = [problem.table.controls[c] for c in trajectory.control]
    gears = np.array([label.engine_gear for label in labels])
    speed = trajectory.flows["engine_speed_radps"] / RPM
    wheel_rpm = problem.table.signals.speed_mps / car.vehicle.tyre_radius_m / RPM
    driven = (gears > 1) & (speed > 0) & np.isclose(speed, car.gearbox.ratios[gears] * wheel_rpm)
    assert driven.any() and speed[driven].min() >= 1000 - 1e-6
    changes = np.count_nonzero(np.diff([1, *gears]))
    on = np.array([True, *(label.engine_on for label in labels)])
    starts = np.sum(on[1:] & ~on[:-1])
    raised_kg = trajectory.flows["spin_fuel_j"].sum() / car.engine.heating_value_jpkg
    expected = 0.05e-3 * changes + 0.2e-3 * starts + raised_kg
    assert 5 < changes < 400
    assert trajectory.switch_fuel_kg.sum() == pytest.approx(expected, rel=1e-9)


def test_first_gear_at_120_kmh_is_rejected_without_a_warning():
    table = build_problem(free("D"), load_cycle("nedc")).table
    k = int(np.argmax(table.signals.speed_mps))
    first = [i for i, c in enumerate(table.controls) if c.engine_on and c.engine_gear == 1]
    assert (table.reject[k, first] != 0).all()


@pytest.mark.parametrize("name", ["C1", "D"])
def test_every_strategy_and_the_certificate_take_a_free_gear(name, beginnings):
    problem = build_problem(free(name), load_cycle(beginnings / "nedc.csv"))
    rollout = simulate(problem, solve(problem).control)
    certificate = certify(problem, rollout)
    for strategy in fitting(load_architecture(name).functions):
        trajectory = simulate(problem, STRATEGIES[strategy].solve(problem).control)
        bound, _ = certificate.bound_kg(trajectory.end_j)
        assert bound <= trajectory.cost_kg * (1 + 1e-12)
        residual = trajectory.residuals["whole car"]
        assert np.abs(residual).max() < 1e-5
