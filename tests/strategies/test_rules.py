"""The rules: thresholds calibrated together or given by the file, load shifted up and down."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from hevopt import build_problem, load_architecture, load_cycle, simulate
from hevopt.errors import DataError
from hevopt.strategies import _family_kernels as family
from hevopt.strategies import _neutral_kernels as neutral
from hevopt.strategies import _rule_kernels as kernels
from hevopt.strategies import conventional
from hevopt.strategies._rules import (
    ElectricLimits,
    corrected_kg,
    eligible,
    engine_entries,
    figures_of,
    rule_for,
    rules_of,
)


@pytest.fixture(scope="module")
def problem():
    return build_problem(load_architecture("C2"), load_cycle("nedc"), levels=9)


@pytest.fixture(scope="module")
def plan(problem):
    return conventional.solve(problem)


def taken(plan):
    return plan.notes["calibration"][plan.notes["chosen"]]


def test_it_drives_electrically_within_all_three_thresholds_and_nowhere_else(problem, plan):
    run, member, signals = simulate(problem, plan.control), taken(plan), problem.table.signals
    on = np.array([problem.table.controls[c].engine_on for c in run.control])
    driving = (signals.speed_mps > 0) & (signals.wheel_power_w >= 0)
    within = (
        (signals.wheel_power_w <= member["threshold_w"])
        & (signals.speed_mps <= member["threshold_mps"])
        & (run.soc[:-1] > member["threshold_soc"])
    )
    possible = ((problem.table.fuel_kg == 0) & problem.table.feasible).any(axis=1)
    assert np.array_equal(~on[driving], (within & possible)[driving])
    assert 50 < np.sum(driving & ~on) < np.sum(driving) - 50


def test_a_calibration_tells_of_its_plan(problem, plan):
    run, member = simulate(problem, plan.control), taken(plan)
    assert member["cost_kg"] == pytest.approx(run.cost_kg, rel=1e-12)
    assert member["nox_kg"] == pytest.approx(run.total_nox_kg, rel=1e-12)
    assert member["surplus_j"] == pytest.approx(run.end_j - problem.end_min_j, abs=1e-3)
    assert member["inside"] and member["eligible"] and member["surplus_j"] >= 0


def test_no_member_on_a_line_through_the_one_taken_burns_less(plan):
    best = taken(plan)
    keys = "threshold_w", "threshold_mps", "threshold_soc"
    for member in plan.notes["calibration"]:
        assert sum(member[key] != best[key] for key in keys) <= 1
        assert member["corrected_kg"] >= best["corrected_kg"] or not member["eligible"]
    for key in keys:
        assert len({member[key] for member in plan.notes["calibration"]}) > 9


@pytest.mark.parametrize(("car", "cycle"), [("p4_diesel", "udds"), ("prius_prime_2017", "udds")])
def test_of_the_whole_family_hardly_any_member_burns_less(car, cycle):
    rules = rules_of(build_problem(load_architecture(car), load_cycle(cycle)))
    family_of = [ElectricLimits(*limits) for limits in product(*conventional._axes(rules))]
    figures = figures_of(rules, family_of, engine_entries(rules))
    least = np.min(corrected_kg(rules, figures)[eligible(rules, figures)])
    assert taken(conventional.solve(rules.problem))["corrected_kg"] <= least * 1.002


def test_three_thresholds_burn_less_than_one(problem, plan):
    one = conventional.solve(problem, thresholds_mps=[np.inf], thresholds_soc=[0.5])
    assert taken(plan)["corrected_kg"] < 0.99 * taken(one)["corrected_kg"]


def test_load_is_shifted_down_where_braking_gives_more_than_electric_driving_uses(problem):
    never = conventional.solve(problem, thresholds_w=[0.0])
    run = simulate(problem, never.control)
    assert taken(never)["eligible"]
    driving = problem.table.signals.wheel_power_w > 0
    assert np.sum(run.battery_power_w[driving & (run.fuel_kg > 0)] > 300.0) > 50


def test_thresholds_of_the_file_are_kept(problem):
    given = {
        "rules.electric_power_w": 3000,
        "rules.electric_speed_kmh": 45,
        "rules.electric_soc": 0.5,
    }
    car = load_architecture("C2", given)
    asked = build_problem(car, load_cycle("nedc"), levels=9)
    (member,) = conventional.solve(asked).notes["calibration"]
    assert (member["threshold_w"], member["threshold_soc"]) == (3000, 0.5)
    assert member["threshold_mps"] == pytest.approx(12.5)
    again = conventional.solve(
        problem, thresholds_w=[3000], thresholds_mps=[12.5], thresholds_soc=[0.5]
    )
    assert taken(again)["cost_kg"] == member["cost_kg"]


def test_a_charge_outside_the_window_is_a_message():
    car = load_architecture("C2", {"rules.electric_soc": 0.9})
    with pytest.raises(
        DataError, match=r"electric_soc 0.9 lies outside the SOC window; allowed: 0.4"
    ):
        build_problem(car, load_cycle("nedc"), levels=3)


def test_a_level_found_from_any_hint_is_the_lowest_that_is_enough(problem):
    rules = rules_of(problem)
    engine = engine_entries(rules)
    row = np.array([problem.window_j[0], 4000.0, 20.0])
    rule, battery = family.rule_of(rules.steps, row), problem.battery.arrays
    driven = kernels.at_rest(rules.choices.steps, rules.span.start)
    ends = [
        kernels.drive_on(rule, entries, 0, rules.choices, battery, driven) for entries in engine
    ]
    lowest = next(n for n, end in enumerate(ends) if end >= problem.end_min_j)
    assert 0 < lowest < len(ends) - 1
    drives = neutral.abreast_at_rest(3, rules.choices.steps, rules.span.start)
    for hint in (0, lowest - 1, lowest, lowest + 7, len(ends)):
        found, of_level, of_below = neutral.enough(
            rule, engine, hint, rules.choices, rules.span, battery, drives
        )
        assert found == lowest
        # Driven abreast or alone, a drive is the same to the bit.
        assert drives.energy_j[of_level, -1] == ends[lowest]
        assert drives.energy_j[of_below, -1] == ends[lowest - 1]


@pytest.mark.parametrize("share", [0.1, 0.4, 0.9])
def test_the_charging_power_changes_at_the_first_step_that_leaves_enough(problem, share):
    rules = rules_of(problem)
    engine, steps = engine_entries(rules), rules.choices.steps
    row = np.array([problem.window_j[0], 4000.0, 20.0])
    rule, battery = family.rule_of(rules.steps, row), problem.battery.arrays
    span = rules.span
    driven = kernels.at_rest(steps, span.start)

    def end_of(level, until):
        kernels.drive_on(rule, engine[level], 0, rules.choices, battery, driven)
        return kernels.drive_on(rule, engine[level - 1], until, rules.choices, battery, driven)

    # Ends asked from just above that of a level to just below that of the next one.
    level = 30
    ends = end_of(level, 0), end_of(level, steps - 1)
    span = span._replace(end_j=ends[0] + share * (ends[1] - ends[0]))
    found, entries, (kept, until) = neutral.neutral_drive(
        rule, engine, 7, rules.choices, span, battery
    )
    assert kept == level
    assert end_of(level, until) >= span.end_j > end_of(level, until - 1)
    assert found.energy_j[-1] == end_of(level, until)
    assert np.array_equal(found.energy_j, driven.energy_j)
    assert np.array_equal(found.entry, driven.entry)
    assert np.array_equal(entries, np.append(engine[level, :until], engine[level - 1, until:]))


def test_members_do_not_depend_on_who_is_judged_before_them(problem):
    rules = rules_of(problem)
    engine = engine_entries(rules)
    limits = [
        ElectricLimits(0.42, 5000.0, 20.0),
        ElectricLimits(0.5, 0.0, 30.0),
        ElectricLimits(0.45, 9000.0, 12.0),
    ]
    forth, back = (figures_of(rules, some, engine) for some in (limits, limits[::-1]))
    assert np.array_equal(forth, back[::-1])


def test_load_points_are_those_of_least_cost_that_charge_enough(problem):
    rules = rules_of(problem)
    choices, charge_w, nox = rules.choices, rules.charge_w, rules.steps.nox_kg
    cap = float(np.median(nox / choices.spread(choices.step_s)))
    # Costs in coarse steps, so that many are the same: of these the first counts.
    choices = choices._replace(cost_kg=np.round(choices.cost_kg, 4))
    found = kernels.load_point_choices(choices, nox, rules.fired, charge_w, cap)
    for k in range(0, choices.steps, 37):
        mine = [i for i in range(*choices.first[k, [0, -1]]) if rules.fired[i]]
        within = [i for i in mine if nox[i] <= cap * choices.step_s[k]]
        for level, charge in enumerate(charge_w):
            able = [i for i in within if choices.power_w[i] <= -charge]
            if able:
                expected = min(able, key=lambda i: choices.cost_kg[i])
            elif within:
                expected = min(within, key=lambda i: (choices.power_w[i], choices.cost_kg[i]))
            else:
                expected = min(mine, key=lambda i: (nox[i], choices.cost_kg[i]), default=-1)
            assert found[level, k] == expected


def test_members_that_drive_electrically_at_the_same_steps_are_driven_once(problem, monkeypatch):
    rules = rules_of(problem)
    engine, driven = engine_entries(rules), []
    limits = [
        ElectricLimits(soc, power, speed)
        for soc, power, speed in product((0.45, 0.5), (2000.0, 8000.0, 8000.1, 1e9), (9.9, 30.0))
    ]
    every = figures_of(rules, limits, engine)

    def counted(rules, members, engine, *, quick):
        driven.extend(members)
        return figures_of(rules, members, engine, quick=quick)

    monkeypatch.setattr(conventional, "figures_of", counted)
    judged = conventional._Judged(rules, engine, quick=False)
    assert np.array_equal(judged.figures(limits), every)
    assert np.array_equal(judged.figures(limits[3:5]), every[3:5])
    assert len(np.unique(every, axis=0)) <= len(driven) < len(limits)


@pytest.mark.parametrize("missing_j", [0.0, 1e9], ids=["reached", "out of reach"])
def test_screened_members_keep_the_lowest_level_that_leaves_enough(problem, missing_j):
    rules = rules_of(problem)
    rules = replace(rules, span=rules.span._replace(end_j=rules.span.end_j + missing_j))
    engine, choices, battery = engine_entries(rules), rules.choices, problem.battery.arrays
    limits = [
        ElectricLimits(soc, power, speed)
        for soc, power, speed in product((0.42, 0.5), (0.0, 3000.0, 9000.0), (9.0, 30.0))
    ]
    driven = kernels.at_rest(choices.steps, rules.span.start)
    for own, figures in zip(limits, figures_of(rules, limits, engine, quick=True), strict=True):
        rule, every = rule_for(rules, own), []
        for level in engine:
            kernels.drive_on(rule, level, 0, choices, battery, driven)
            every.append(family.result_of(driven, rules.steps.nox_kg, choices, rules.span))
        level, beyond_j = every.index(tuple(figures)), [result[2] for result in every]
        if missing_j:
            assert every[level] == every[-1]
        else:
            assert beyond_j[level] >= 0
            assert level == 0 or beyond_j[level - 1] < 0
