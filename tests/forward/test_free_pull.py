"""Full pedal of cars whose engine has a speed of its own."""

from functools import cache

import numpy as np
import pytest

from hevopt import load_architecture, performance
from hevopt.forward._pull_kernels import ENERGY, FORCE, SIDE, SPEED

CARS = ("prius_1998", "series_1500", "series_parallel_1500")


@cache
def figures(name, **options):
    return performance(load_architecture(name), **options)


@pytest.mark.parametrize("name", CARS)
def test_with_the_battery_no_time_is_longer(name):
    alone, helped = figures(name), figures(name, boosts=True)
    for kmh, time in helped.to_speed_s.items():
        if alone.to_speed_s[kmh] is not None:
            assert time <= alone.to_speed_s[kmh] + 1e-6
    for case, time in helped.in_gear_s.items():
        assert time is not None and time < (alone.in_gear_s[case] or np.inf)
    assert helped.to_100_j > 100e3 and helped.repeats > 1
    assert abs(alone.to_100_j) < 0.1 * helped.to_100_j
    assert set(alone.in_gear_s) == {(1, 60, 100), (1, 80, 120)}
    assert helped.start_slope >= alone.start_slope and alone.slope[50] > alone.slope[90] > 0


@pytest.mark.parametrize("name", CARS)
@pytest.mark.parametrize("boosts", [False, True])
def test_the_car_gains_no_more_than_engine_and_battery_give(name, boosts):
    """Energy from the trace alone: what the wheels did, against full load of the engine and what was stored."""
    found = figures(name, boosts=boosts)
    car, trace = found.car, found.trace[:2000]
    work = np.cumsum(trace[:, FORCE] * trace[:, SPEED]) * 0.01
    best_w = np.max(
        car.engine.covered_nm(
            speeds := np.linspace(car.engine.idle_radps, car.engine.speed_max_radps, 200)
        )
        * speeds
    )
    stored = trace[0, ENERGY] - trace[:, ENERGY]
    assert np.all(work <= best_w * 0.01 * np.arange(1, 2001) + stored + 3e4)
    assert trace[:, SIDE].max() <= car.engine.speed_max_radps * (1 + 1e-9)


def test_top_speed_of_a_series_car_is_where_the_generators_power_ends():
    """Second way: the best engine point through both machines at that speed against the road load."""
    found = figures("series_1500")
    car, top = found.car, found.top_mps[1]
    generator = car.machines[0]
    speeds = np.linspace(car.engine.idle_radps, car.engine.speed_max_radps, 400)
    engine_nm = np.minimum(car.engine.covered_nm(speeds), generator.limit_nm(speeds))
    electric = engine_nm * speeds - generator.loss_w(-engine_nm, speeds)
    most_w = float(np.max(electric)) - car.vehicle.load_w(engine_on=True)
    road_n = float(np.interp(top, found.curves.speed_mps, found.curves.resistance_n))
    assert 0.75 * most_w < road_n * top < most_w


def test_the_prius_is_as_fast_as_its_kind():
    """Published for the Prius of 1998: about 14 s to 60 mph; this one with the mass of its file."""
    found = figures("prius_1998", boosts=True)
    assert 11 < found.to_speed_s[100] < 18
