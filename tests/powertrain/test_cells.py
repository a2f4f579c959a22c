"""What is claimed of the torques between levels, against tables of many more levels."""

from dataclasses import replace

import numpy as np
import pytest
from between import DRIVES, below_lines, drains_w, part, samples_of

from hevopt import build_problem, certify, load_architecture, simulate, solve
from hevopt.bounds import step_prices, virtual
from hevopt.bounds.claim import Scope

WEIGHTS = (0.0, 10.0, 50.0)


@pytest.fixture(scope="module", params=DRIVES)
def between(request):
    """A problem, its cells, and controls of a finer table that lie in them."""
    car, cycle = load_architecture(request.param), part(*DRIVES[request.param])
    problem = build_problem(car, cycle)
    return problem, *samples_of(car, cycle, problem, 161)


def test_fuel_nox_and_power_between_levels_lie_above_their_lines(between):
    _, cells, samples = between
    slack = cells.slack_kg[cells.step[samples.cell]]
    assert len(samples.cell) > 2000
    for lines, values, rounding in (
        (cells.fuel_kg, samples.fuel_kg, slack),
        (cells.nox_kg, samples.nox_kg, slack),
        (cells.power_w, samples.power_w, 1e-8),
    ):
        assert below_lines(lines, samples.place, samples.cell, values + rounding) <= 0


def test_slopes_that_are_two_per_cent_wrong_would_be_noticed(between):
    _, cells, samples = between
    for lines, values in ((cells.power_w, samples.power_w), (cells.fuel_kg, samples.fuel_kg)):
        if np.ptp(lines) == 0:
            continue
        wrong = lines.copy()
        wrong[0, 1] += 0.02 * np.abs(lines[0, 1] - lines[0, 0])
        scale = np.abs(values).max()
        assert below_lines(wrong, samples.place, samples.cell, values) > 1e-6 * scale


def worst_below(problem, cells, samples, weight, lower=0.0):
    """By how much a control between levels falls below its cell's points at most, as a share of the greatest."""
    cost = cells.fuel_kg + weight * cells.nox_kg
    worst = virtual.worst_of(problem.battery)
    kg, watts, there = virtual.nodes_of(cost, cells.power_w, worst)
    kg = np.where(there, kg, np.inf)
    step_s, mine_kg = problem.table.step_s[cells.step], samples.fuel_kg + weight * samples.nox_kg
    slack = (1 + weight) * cells.slack_kg[cells.step[samples.cell]]
    found = []
    for own, points in zip(
        drains_w(problem.battery, samples.power_w),
        drains_w(problem.battery, watts + lower * np.array([[0], [1], [1], [0]])),
        strict=True,
    ):
        for price in (1e-12, 1e-8, 4e-8, 7e-8, 3e-7, 1e-4):
            least = np.min(kg + price * step_s * points, axis=0)[samples.cell]
            value = mine_kg + price * step_s[samples.cell] * own
            allowed = slack + price * step_s[samples.cell] * 1e-8
            found.append(np.max((least - value - allowed) / np.abs(value).max()))
    return max(found)


@pytest.mark.parametrize("weight", WEIGHTS)
def test_no_torque_costs_less_than_its_cells_points_at_any_price_and_charge(between, weight):
    assert worst_below(*between, weight) <= 0


@pytest.mark.parametrize("between", ["C2", "D", "E"], indirect=True)
def test_points_two_watts_too_high_would_be_noticed(between):
    assert worst_below(*between, 0.0, lower=2.0) > 1e-9


@pytest.mark.parametrize("name", ["C2", "E"])
def test_a_bound_lies_below_that_of_many_levels_at_the_same_prices(name):
    """And within what 41 levels leave, a few hundredths of a per cent."""
    car, cycle = load_architecture(name), part(*DRIVES[name])
    problem, fine = (build_problem(car, cycle, levels=levels) for levels in (41, 641))
    rollout = simulate(problem, solve(problem).control)
    certificate = certify(problem, rollout)
    assert certificate.scope is Scope.CONTINUOUS
    for lines in certificate.proofs.values():
        line = lines[-1]
        again = step_prices.dual_of_shape(fine, rollout, line.shape)
        dense_kg = max(found.value_kg for found in again)
        assert line.value_kg <= dense_kg
        assert line.value_kg > dense_kg * (1 - 1e-3)


def test_a_car_whose_parts_show_no_convexity_is_certified_by_its_levels():
    car = load_architecture("C2")
    law = car.engine.law
    concave = replace(law, fuel=replace(law.fuel, a2=0.001))
    car = replace(car, engine=replace(car.engine, law=concave))
    assert build_problem(car, part("nedc", 110, 130)).table.cells() is None


def test_what_electricity_counts_is_counted_between_levels_too():
    problem = build_problem(load_architecture("C2"), part("nedc", 110, 150))
    priced = replace(problem, electricity_kgpj=4e-8)
    split, fine = virtual.split_of(priced), virtual.split_of(problem)
    table, own = problem.table, split.virtual
    dear = own.cost_kg - 4e-8 * own.power_w * table.step_s[own.step]
    assert len(own.step) and abs(dear.mean() / fine.virtual.cost_kg.mean() - 1) < 0.1
    rollout = simulate(priced, solve(priced).control)
    certificate = certify(priced, rollout)
    assert certificate.scope is Scope.CONTINUOUS
    assert 0 <= rollout.cost_kg - certificate.bound_of(rollout)[0] < 1e-3 * rollout.cost_kg


def test_cells_of_a_table_that_was_changed_are_not_those_of_the_car():
    table = build_problem(load_architecture("C2"), part("nedc", 110, 130)).table
    assert len(table.cells().step)
    assert replace(table, fuel_kg=1.01 * table.fuel_kg).cells() is None


@pytest.mark.parametrize("name", ["C2", "p2_plug_in"])
def test_without_a_weight_on_nox_cells_say_the_same_of_all_else(name):
    problem = build_problem(load_architecture(name), part("nedc", 110, 150))
    whole, without = problem.table.cells(), problem.table.cells(nox=False)
    assert not without.nox_kg.any()
    for what in ("step", "low", "high", "fuel_kg", "power_w", "apart"):
        assert np.array_equal(getattr(whole, what), getattr(without, what))
    assert (without.slack_kg <= whole.slack_kg).all()
