"""Rules that start and stop the engine by a power or a charge: what they do, step by step, in plain numbers."""

import numpy as np
import pytest
from split_cars import short

from hevopt import DataError, build_problem, certify, load_architecture, simulate
from hevopt.strategies import fitting, power_follower, thermostat


@pytest.fixture(scope="module")
def problem():
    return build_problem(load_architecture("series_1500"), short("udds", 400), levels=7)


def entries(problem, k):
    """Usable controls of a step: index -> (cost, battery power, burns)."""
    table = problem.table
    usable = np.flatnonzero(table.reject[k] == 0)
    return {c: (table.fuel_kg[k, c], table.battery_power_w[k, c]) for c in usable}


def without_fuel(problem, k):
    """Least battery power of the controls that burn nothing, None where all burn."""
    powers = [power for fuel, power in entries(problem, k).values() if fuel == 0]
    return min(powers, default=None)


def drain_w(problem, power):
    """Fall of stored energy at the start's charge, of a battery's two terminals in plain numbers."""
    pack = problem.battery
    volt = np.interp(problem.soc_start, pack.soc, pack.open_circuit_v)
    ohm = np.interp(
        problem.soc_start, pack.soc, pack.charge_ohm if power < 0 else pack.discharge_ohm
    )
    current = (volt - (volt**2 - 4 * ohm * power) ** 0.5) / (2 * ohm)
    return volt * current * (pack.coulombic_efficiency if current < 0 else 1.0)


def held_on(asked, on_above, off_below):
    """Whether an engine is held on after each of some powers, at rest before the first."""
    on, held = False, []
    for value in asked:
        on = value > on_above or (on and value >= off_below)
        held.append(on)
    return held


def test_the_thermostat_charges_at_its_best_point_from_one_charge_to_the_other(problem):
    plan = thermostat.solve(problem)
    run, limits = simulate(problem, plan.control), plan.notes["thresholds"]
    low, high = limits["thermostat_on_soc"], limits["thermostat_off_soc"]
    assert problem.battery.soc_min < low < high < problem.battery.soc_max
    held = held_on(-run.soc[:-1], -low, -high)
    assert 20 < sum(held) < len(held) - 20
    for k, on in enumerate(held):
        alone_w, found = without_fuel(problem, k), entries(problem, k)
        fuel, power = found[plan.control[k]]
        if alone_w is None:
            continue
        if not on:
            assert (fuel, power) == (0.0, alone_w)
            continue
        stored = {p: drain_w(problem, alone_w) - drain_w(problem, p) for _, p in found.values()}
        ratios = [f / stored[p] for f, p in found.values() if f > 0 and stored[p] > 0]
        assert not ratios or fuel / stored[power] == pytest.approx(min(ratios), rel=1e-9)


def test_the_power_follower_runs_above_a_power_and_charges_with_what_is_missing(problem):
    plan = power_follower.solve(problem)
    run, limits = simulate(problem, plan.control), plan.notes["thresholds"]
    pack = problem.battery
    missing = limits["reference_soc"] - run.soc[:-1]
    # Voltage rises with charge: energy is not quite proportional to it.
    mean_v = np.interp(limits["reference_soc"], pack.soc, pack.open_circuit_v)
    half_j = 0.5 * (problem.window_j[1] - problem.window_j[0])
    charge_w = limits["charge_power_w"] * missing * pack.capacity_as * mean_v / half_j
    asked_w = problem.table.signals.wheel_power_w + charge_w
    held = held_on(asked_w, limits["engine_on_power_w"], limits["engine_off_power_w"])
    on = [
        problem.table.controls[c].engine_on and run.fuel_kg[k] > 0
        for k, c in enumerate(run.control)
    ]
    possible = [without_fuel(problem, k) is not None for k in range(len(on))]
    differs = sum(a != b for a, b, free in zip(on, held, possible, strict=True) if free)
    assert differs <= 0.01 * len(on) and 20 < sum(held) < len(held) - 20


@pytest.mark.parametrize("rule", [thermostat, power_follower])
def test_a_calibrated_rule_is_neutral_inside_the_window_and_above_its_bound(problem, rule):
    run = simulate(problem, rule.solve(problem).control)
    fuel_j = run.total_fuel_kg * 42.6e6
    assert abs(run.end_j - problem.end_min_j) < 0.01 * fuel_j
    assert problem.battery.soc_min <= run.soc.min() and run.soc.max() <= problem.battery.soc_max
    bound_kg, _ = certify(problem, run).bound_kg(run.end_j)
    assert bound_kg <= run.cost_kg < 1.2 * bound_kg


def test_thresholds_of_the_file_are_kept():
    given = {
        "thermostat_on_soc": 0.52,
        "thermostat_off_soc": 0.6,
        "engine_on_power_w": 7000.0,
        "engine_off_power_w": 5000.0,
        "charge_power_w": 6000.0,
        "reference_soc": 0.55,
    }
    car = load_architecture("series_1500", {f"rules.{key}": value for key, value in given.items()})
    asked = build_problem(car, short("udds", 120), levels=5)
    found = {
        **thermostat.solve(asked).notes["thresholds"],
        **power_follower.solve(asked).notes["thresholds"],
    }
    assert found == pytest.approx(given, rel=1e-9)


@pytest.mark.parametrize(
    "rules, message",
    [
        ({"thermostat_on_soc": 0.6, "thermostat_off_soc": 0.5}, "is not below thermostat_off_soc"),
        ({"engine_on_power_w": 4e3, "engine_off_power_w": 5e3}, "lies above engine_on_power_w"),
        ({"thermostat_off_soc": 0.05}, "thermostat_off_soc 0.05 lies outside the SOC window"),
        ({"reference_soc": "full"}, "reference_soc"),
    ],
)
def test_thresholds_that_make_no_sense_are_one_message(rules, message):
    with pytest.raises(DataError, match=message):
        car = load_architecture("series_1500", {f"rules.{key}": own for key, own in rules.items()})
        build_problem(car, short("udds", 20), levels=3)


def test_they_are_usual_where_the_engine_has_a_speed_of_its_own():
    kinds = {
        name: set(fitting(load_architecture(name).marks)) & {"power_follower", "thermostat"}
        for name in ("A", "B", "C1", "C2", "D", "E", "p0_p4_diesel", "electric_compact")
    }
    assert not any(kinds.values())
    for name, own in {
        "series_1500": {"power_follower", "thermostat"},
        "series_parallel_1500": {"power_follower", "thermostat"},
        "prius_1998": {"power_follower"},
    }.items():
        assert own == {"power_follower", "thermostat"} & set(fitting(load_architecture(name).marks))
