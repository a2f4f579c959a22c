"""Full pedal: bands of the real car, order of what helps and what does not, closed forms of grip and forces."""

from functools import cache

import numpy as np
import pytest

from hevopt import DataError, load_architecture, performance
from hevopt.car.handling import Handling, Shifting, Tyre


@cache
def figures(name, **options):
    return performance(load_architecture(name), **options)


def test_the_conventional_car_is_as_fast_as_the_real_one():
    """Published for a car with this engine: 11.3 s and 187 km/h; 1395 kg as driven."""
    found = figures("A", added_kg=95.0)
    assert 10 < found.to_speed_s[100] < 12
    assert 185 < max(found.top_mps.values()) * 3.6 < 200
    assert 9 < found.in_gear_s[6, 80, 120] < 13.5


@pytest.mark.parametrize("name", ["C1", "C2", "D", "E"])
def test_e_boost_is_faster_everywhere_and_takes_its_energy_from_the_battery(name):
    alone, boosted = figures(name), figures(name, boosts=True)
    for kmh, time in boosted.to_speed_s.items():
        assert time <= alone.to_speed_s[kmh] + 1e-6
    for case, time in boosted.in_gear_s.items():
        assert time < alone.in_gear_s[case]
    assert 50e3 < boosted.to_100_j < 400e3 and 2 < boosted.repeats < 20
    assert boosted.top_mps == pytest.approx(alone.top_mps, rel=1e-3)


def test_a_car_without_an_engine_is_as_fast_as_its_machine_and_grip_let_it():
    """Second way: dv/dt of the force curve, cut by the grip of an accelerating car, the tyre's lag left out."""
    found = figures("electric_compact")
    car, curves = found.car, found.curves
    equivalent = (
        car.vehicle.equivalent_mass_kg
        + car.machines[0].inertia_kgm2 * (3.93 / car.vehicle.tyre_radius_m) ** 2
    )
    force = np.minimum(curves.by_gear_n[0], car.vehicle.mass_kg * Tyre().grip_mps2)
    force = force - curves.resistance_n
    speeds = np.linspace(0, 100 / 3.6, 20001)
    time = np.trapezoid(equivalent / np.interp(speeds, curves.speed_mps, force), speeds)
    assert found.to_speed_s[100] == pytest.approx(time, abs=0.15)
    assert 8 < time < 11
    kinetic = 0.5 * equivalent * (100 / 3.6) ** 2
    assert kinetic < found.to_100_j < 1.6 * kinetic
    assert set(found.in_gear_s) == {(1, 60, 100), (1, 80, 120)}
    assert found.in_gear_s[1, 60, 100] == pytest.approx(
        found.to_speed_s[100] - found.to_speed_s[60], abs=0.05
    )
    assert found.start_slope == pytest.approx(0.85 * 0.6 / (1 + 0.85 * 0.2), rel=0.01)


def test_no_mean_value_engine_where_there_is_none():
    with pytest.raises(DataError, match="it has no engine; leave --engine-model"):
        figures("electric_compact", engine_model="mean_value")


def test_mass_gap_and_lag_of_boost_cost_time_and_grip_gains_it():
    base = figures("A").to_speed_s[100]
    car = load_architecture("A")

    def with_(**parts):
        return performance(car, handling=Handling(**parts)).to_speed_s[100]

    assert figures("A", added_kg=165.0).to_speed_s[100] > base + 0.3
    assert (
        with_(shifting=Shifting(gap_s=0.8))
        > base + 0.3
        > base - 0.1
        > with_(shifting=Shifting(gap_s=0.3))
    )
    assert with_(tyre=Tyre(friction=1.0)) < base < with_(tyre=Tyre(friction=0.6))
    lagging = figures("A", boost_lag_s=1.2)
    assert lagging.in_gear_s[4, 40, 80] > figures("A").in_gear_s[4, 40, 80] + 0.3


def test_the_first_metres_are_at_the_limit_of_grip():
    trace = figures("A").trace
    accel = np.diff(trace[20:80, 0]) / 0.01
    assert accel == pytest.approx(np.full(59, Tyre().grip_mps2), rel=0.05)


def test_slopes_are_those_of_force_and_of_grip():
    found = figures("A")
    weight = 1300 * 9.80665
    curves, speed = found.curves, 90 / 3.6
    force = np.nanmax([np.interp(speed, curves.speed_mps, f) for f in curves.by_gear_n])
    spare = force - np.interp(speed, curves.speed_mps, curves.resistance_n)
    assert found.slope[90] == pytest.approx(np.tan(np.arcsin(spare / weight)))
    # In first gear force would do for more than the tyres hold.
    assert found.start_slope == pytest.approx(0.85 * 0.6 / (1 + 0.85 * 0.2))


def test_top_speed_is_where_force_meets_resistance_or_the_engine_ends():
    found, car = figures("A"), load_architecture("A")
    top = found.top_mps[6]
    force = np.interp(top, found.curves.speed_mps, found.curves.by_gear_n[5])
    assert force == pytest.approx(
        np.interp(top, found.curves.speed_mps, found.curves.resistance_n), rel=1e-3
    )
    limit = car.engine.speed_max_radps / car.gearbox.ratios[1] * car.vehicle.tyre_radius_m
    assert found.top_mps[1] == pytest.approx(limit, rel=0.01)


def test_half_the_mass_is_never_slower():
    light = performance(load_architecture("A", {"car.mass_kg": 650.0}))
    base = figures("A").to_speed_s  # at the limit of grip mass cancels out
    assert all(light.to_speed_s[kmh] < base[kmh] for kmh in base if kmh >= 60)


@pytest.mark.parametrize(
    ("name", "options", "message"),
    [
        ("A", {"boosts": True}, "e_boost is none of this car's functions"),
        ("A", {"added_kg": 1e5}, "allowed: -200 to 5000 kg"),
        ("A", {"boost_lag_s": float("nan")}, "0 to 10 s"),
    ],
)
def test_bad_input_is_refused(name, options, message):
    with pytest.raises(DataError, match=message):
        performance(load_architecture(name), **options)
