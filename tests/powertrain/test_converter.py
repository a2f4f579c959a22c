"""A converter between battery and bus: its loss by hand, energy that closes, and what does not know of it."""

import numpy as np
import pytest
from split_cars import short

from hevopt import DataError, build_problem, certify, load_architecture, simulate
from hevopt.car.storing import storing_kgpj
from hevopt.strategies import dp

CURVE = {"power_w": [0, 4000, 30000], "efficiency": [0.9, 0.96, 0.94]}


def with_converter(car, table):
    return load_architecture(car, {f"converter.{key}": value for key, value in table.items()})


@pytest.fixture(scope="module")
def solved():
    problem = build_problem(with_converter("series_1500", CURVE), short("udds", 130), levels=5)
    return problem, simulate(problem, dp.solve(problem).control)


def test_the_battery_gives_more_and_takes_less_than_the_bus(solved):
    _, run = solved
    bus_w = run.flows["machine_electric_w"] + run.flows["auxiliary_power_w"]
    share = np.interp(np.abs(bus_w), *CURVE.values())
    by_hand = [p / s if p > 0 else p * s for p, s in zip(bus_w, share, strict=True)]
    np.testing.assert_allclose(run.battery_power_w, by_hand, rtol=1e-9, atol=1e-6)
    assert (bus_w > 1e3).any() and (bus_w < -1e3).any()
    np.testing.assert_allclose(
        run.flows["converter_loss_w"], run.battery_power_w - bus_w, atol=1e-6
    )


def test_energy_closes_and_the_bound_holds(solved):
    problem, run = solved
    for name, residual_w in run.residuals.items():
        assert np.max(np.abs(residual_w)) < 1e-6, name
    bound_kg, _ = certify(problem, run).bound_kg(run.end_j)
    plain = build_problem(load_architecture("series_1500"), short("udds", 130), levels=5)
    without = simulate(plain, dp.solve(plain).control)
    assert "converter_loss_w" not in without.flows
    assert without.cost_kg < bound_kg <= run.cost_kg


def test_nothing_is_said_of_what_lies_between_torques_behind_a_converter():
    cycle = short("udds", 60)
    plain = build_problem(load_architecture("C2"), cycle, levels=5)
    behind = build_problem(with_converter("C2", {"efficiency": 0.96}), cycle, levels=5)
    assert plain.table.cells() is not None and behind.table.cells() is None


def test_a_converter_of_no_loss_changes_nothing():
    cycle = short("udds", 60)
    plain = build_problem(load_architecture("C2"), cycle, levels=5)
    ideal = build_problem(with_converter("C2", {"efficiency": 1.0}), cycle, levels=5)
    np.testing.assert_array_equal(plain.table.battery_power_w, ideal.table.battery_power_w)


@pytest.mark.parametrize("car", ["series_1500", "prius_1998"])
def test_storing_a_joule_takes_what_the_converter_loses_as_well(car):
    behind = with_converter(car, {"efficiency": 0.8})
    assert 0.8 * storing_kgpj(behind) == pytest.approx(storing_kgpj(load_architecture(car)))


@pytest.mark.parametrize(
    "table, message",
    [
        ({"efficiency": 1.2}, "efficiency"),
        ({"efficiency": [0.9, 0.95]}, "power_w needs as many"),
        ({"efficiency": 0.9, "power_w": [0, 1]}, "one efficiency needs no power_w"),
        ({"efficiency": [0.9, 0.95], "power_w": [5, 5]}, "power_w must increase"),
        ({"efficiency": [0.2, 0.9], "power_w": [1000, 1100]}, "more power at the bus is less"),
        (
            {"efficiency": [0.9, 0.9, 0.5, 0.5], "power_w": [0, 1000, 2000, 1e9]},
            "near 2000 W .* more power at the bus is less",
        ),
        ({"efficiency": [0.9, float("nan")], "power_w": [0, 1]}, "efficiency"),
    ],
)
def test_figures_that_make_no_sense_are_one_message(table, message):
    with pytest.raises(DataError, match=message):
        with_converter("C2", table)
