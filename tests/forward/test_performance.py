"""Full pedal: bands of the real car, order of what helps and what does not, closed forms of grip and forces."""

from functools import cache

import numpy as np
import pytest

from hevopt import DataError, load_architecture, performance
from hevopt.car.handling import Handling, Shifting, Tyre
from hevopt.files.lookup import groups_of, shipped_names
from hevopt.forward import performance as floored


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


@pytest.mark.parametrize(
    "name", [*shipped_names("architectures", ".toml"), *groups_of("architectures", ".toml")["hybrids"],
             *groups_of("architectures", ".toml")["real"]],
)  # fmt: skip
def test_every_shipped_car_is_plausible_and_no_slower_with_its_machine(name):
    car, found = load_architecture(name), figures(name)
    times = [time for time in found.to_speed_s.values() if time is not None]
    # Without its battery a car whose engine has a speed of its own has what the generator gives.
    slowest = 30 if car.driveline.free_engine_speed else 17
    assert len(times) >= 7 and times == sorted(times) and 6 < found.to_speed_s[100] < slowest
    assert 130 < 3.6 * max(found.top_mps.values()) < 260 and 0.2 < found.start_slope < 0.44
    if not (car.electric or car.driveline.free_engine_speed):
        changes = np.flatnonzero(np.diff(found.trace[:, 2]))
        assert len(changes) > 1 and np.diff(found.trace[changes, 0]).min() > 3, (
            "a change for each gear"
        )
    if "e_boost" in car.functions:
        boosted = figures(name, boosts=True)
        for kmh, time in found.to_speed_s.items():
            assert time is None or boosted.to_speed_s[kmh] <= time + 1e-6, kmh
        for case, time in found.in_gear_s.items():
            assert time is None or boosted.in_gear_s[case] <= time + 1e-6, case


def test_a_petrol_car_is_as_fast_as_the_real_one():
    """Car and Driver measured 7.9 s to 60 mph, by thetruthaboutcars.com of 2017-09-21."""
    trace = figures("camry_2018").trace
    to_60_mph = 0.01 * int(np.argmax(trace[:, 0] >= 26.82))
    assert to_60_mph == pytest.approx(7.9, rel=0.1)


@pytest.mark.parametrize(("name", "boosts"), [("A", False), ("C2", True), ("E", False)])
def test_no_other_changes_up_are_faster(name, boosts, monkeypatch):
    """Without gaps, the changes are those of the greatest acceleration: sooner or later costs time."""
    quick = Handling(shifting=Shifting(gap_s=0.0))
    car, at_once = load_architecture(name), floored.change_up_mps
    times = {}
    for factor in (0.85, 0.95, 1.0, 1.05, 1.15):
        monkeypatch.setattr(floored, "change_up_mps", lambda *of, x=factor: x * at_once(*of))
        found = performance(car, boosts=boosts, handling=quick)
        times[factor] = found.to_distance[1000.0][0]
    assert times[1.0] <= min(times.values()) + 0.02
    assert times[0.85] > times[1.0] + 0.1


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
