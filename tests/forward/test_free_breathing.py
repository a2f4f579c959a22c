"""The mean-value engine in cars whose engine has a speed of its own: a diesel in a power split and a series car."""

from functools import cache

import numpy as np
import pytest
from forward.drives import constant, follow
from forward.test_free import hill

from hevopt import build_problem, drive, load_architecture, performance, simulate
from hevopt.forward.breathing import Breathing
from hevopt.forward.lines import line_of
from hevopt.forward.plans import replay_of
from hevopt.mean_value._model_kernels import combustion_now
from hevopt.mean_value.parameters import Drive
from hevopt.strategies import STRATEGIES

CARS = ("prius_1998", "series_1500", "series_parallel_1500")


def diesel(name):
    """A shipped car with an engine that has a mean-value part."""
    return load_architecture(name, {"engine": "engine_diesel_1600"})


@cache
def driven(name, speed_kmh=None, engine_model="mean_value", step_s=0.02):
    """The plan of ecms on the hill, or at a constant speed."""
    car, cycle = diesel(name), hill() if speed_kmh is None else constant(speed_kmh, 40)
    problem = build_problem(car, cycle, allow_shortfall=True)
    plan = replay_of(simulate(problem, STRATEGIES["ecms"].solve(problem).control), line_of(car))
    return follow(car, cycle, plan, step_s=step_s, engine_model=engine_model)


@pytest.mark.parametrize("name", CARS)
def test_every_component_balances_and_fuel_is_the_maps_within_its_tolerance(name):
    """6 % is what steady fuel may differ from the map's at equal torque."""
    run, by_map = driven(name), driven(name, engine_model="map")
    assert max(run.residual.values()) < 1e-9
    assert run.quality.violations == () and run.starts == by_map.starts > 0
    flows, turns = run.books.flows, run.engine == 2
    assert all(np.isfinite(values).all() for values in flows.values())
    assert run.against_map_percent == pytest.approx(0, abs=6)
    assert flows["excess_air"][turns].min() > 1.15
    lacking = np.abs(flows["gas_lacking_nm"] * flows["engine_speed_radps"]).sum()
    assert lacking < 0.01 * np.abs(flows["engine_torque_nm"] * flows["engine_speed_radps"]).sum()


@pytest.mark.parametrize(("name", "speed_kmh"), [("prius_1998", 100), ("series_1500", 70)])
def test_at_constant_speed_the_car_is_the_maps_and_burns_what_the_model_settles_to(name, speed_kmh):
    run, by_map = driven(name, speed_kmh), driven(name, speed_kmh, "map")
    last = {flow: float(values[-1]) for flow, values in run.books.flows.items()}
    for flow in ("engine_torque_nm", "engine_speed_radps", "machine_torque_nm", "machine_2_torque_nm",
                 "machine_electric_w", "wheel_power_w"):  # fmt: skip
        assert last[flow] == pytest.approx(float(by_map.books.flows[flow][-1]), rel=1e-6), flow
    late = run.books.flows["fuel_kgps"][-200:]
    assert late.min() > 0 and np.ptp(late) < 1e-3 * late.mean()
    settled = Breathing(run.car, last["engine_speed_radps"], last["engine_torque_nm"])
    torque = Drive(held=1.0, torque_nm=last["engine_torque_nm"])
    burning = combustion_now(settled._gas, settled._model._replace(drive=torque))
    assert burning.torque == pytest.approx(last["engine_torque_nm"], rel=1e-9)
    assert last["fuel_kgps"] == pytest.approx(burning.fuel, rel=2e-3)


def test_shorter_steps_change_fuel_little():
    fine, coarse = driven("series_1500"), driven("series_1500", step_s=0.05)
    assert coarse.fuel_kg == pytest.approx(fine.fuel_kg, rel=5e-3)


def test_a_strategy_that_decides_is_asked_and_the_air_limits_what_it_gets():
    found = drive(
        diesel("series_1500"), hill(), "power_follower", step_s=0.05, engine_model="mean_value"
    )
    flows, turns = found.run.books.flows, found.run.engine == 2
    assert found.asked is not None and max(found.run.residual.values()) < 1e-9
    beyond = flows["engine_torque_nm"] - np.maximum(flows["engine_available_nm"], 0.0)
    assert beyond[turns].max() < 1e-6


def test_floored_the_turbochargers_lag_costs_time():
    by_map, lagging = (
        performance(diesel("series_1500"), engine_model=model) for model in ("map", "mean_value")
    )
    assert by_map.to_speed_s[100] < lagging.to_speed_s[100] < by_map.to_speed_s[100] + 3.0
    for case, seconds in lagging.in_gear_s.items():
        assert seconds > 0.96 * by_map.in_gear_s[case]
