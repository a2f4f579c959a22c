"""A measured engine map in the car: beyond its speeds nothing is used, neither fired, dragged nor idling."""

import json
from dataclasses import replace

import numpy as np
import pytest

from hevopt import DataError, InfeasibleError, build_problem, load_architecture
from hevopt.car.engine_laws import EngineMap
from hevopt.car.machine_laws import LossMap
from hevopt.driving.cycle import Cycle
from hevopt.pages.comparison.maps import engine_map
from hevopt.problem.reject import Reject

RPM = np.pi / 30
TORQUE = np.arange(-60, 281, 10.0)


def sampled(car, low_rpm: float, high_rpm: float, *, nox_to_nm: float = np.inf):
    """The car with its engine's formula as a map of some speeds, NOx known up to a torque."""
    speed = np.arange(low_rpm, high_rpm + 1, 50.0) * RPM
    mesh = np.meshgrid(speed, TORQUE, indexing="ij")[::-1]
    nox = np.where(mesh[0] <= nox_to_nm, car.engine.nox_kgps(*mesh), np.nan)
    drag = car.engine.drag_nm(speed)
    grid = EngineMap(speed, TORQUE, car.engine.fuel_kgps(*mesh), nox, drag)
    return replace(car, engine=replace(car.engine, law=grid))


def test_a_map_in_other_units_is_one_message():
    fuel = load_architecture("p2_petrol_dct").contents["engine"]["fuel_map"]["fuel_gps"]
    for factor, words in ((3600, "the best is 0.0"), (1 / 60, "most are above")):
        changed = {"engine.fuel_map.fuel_gps": [[factor * value for value in row] for row in fuel]}
        with pytest.raises(DataError, match=words) as found:
            load_architecture("p2_petrol_dct", changed)
        assert "allowed: 1 to 100 %; fuel_map.fuel_gps is in g/s" in str(found.value)


def braking(car, rpm: float, gear: int = 2) -> Cycle:
    """Slowing down in a gear, the engine at a speed in the middle of the step."""
    ratio = car.gearbox.ratios[gear]
    speed = rpm * RPM / ratio * car.vehicle.tyre_radius_m
    return driven(speed + np.array([0.5, -0.5]), gear)


def driven(speed_mps, gear: int, grade: float = 0.0) -> Cycle:
    """A speed for every second, in one gear."""
    count = len(speed_mps)
    closed = np.zeros(count, dtype=bool)
    slope, gears = np.full(count, grade), np.full(count, gear)
    return Cycle("drive", np.arange(float(count)), speed_mps, slope, gears, closed)


@pytest.mark.parametrize("name", ["A", "B", "C1", "C2", "D", "E"])
def test_an_engine_is_not_dragged_beyond_the_speeds_of_its_map(name):
    car = sampled(load_architecture(name), 800, 2500)
    problem = build_problem(car, braking(car, 2490))
    on = np.array([control.engine_on for control in problem.table.controls])
    assert (problem.table.reject[0, on] == 0).any()
    cycle = braking(car, 3841)
    try:
        table = build_problem(car, cycle).table
    except InfeasibleError as error:
        assert name in ("A", "B", "C1") and "outside the engine map" in str(error)
        return
    turning = table.flows["engine_speed_radps"][0] > 2501 * RPM
    assert turning.any() and (table.reject[0, turning] & Reject.ENGINE_MAP > 0).all()
    for values in (table.fuel_kg, table.battery_power_w, *table.flows.values()):
        assert np.isfinite(values).all()


@pytest.mark.parametrize("rpm", [3841, 1000])
def test_drag_and_fuel_cut_are_unknown_beyond_the_map(rpm):
    car = sampled(load_architecture("A"), 1200, 2500)
    at = np.array(rpm * RPM)
    assert np.isnan(car.engine.drag_nm(at))
    for torque in (-500.0, -30.0, 0.0, 50.0):
        assert np.isnan(car.engine.fuel_kgps(np.array(torque), at))
    ends = np.array([1200, 1200 * (1 - 1e-13), 2500, 2500 * (1 + 1e-13)]) * RPM
    by_formula = load_architecture("A").engine.drag_nm(ends)
    assert car.engine.drag_nm(ends) == pytest.approx(by_formula)


def test_an_engine_whose_map_begins_above_idle_neither_idles_nor_is_dragged_there():
    car = sampled(load_architecture("A"), 1200, 5000)
    with pytest.raises(InfeasibleError, match="outside the engine map"):
        build_problem(car, braking(car, 1100))
    with pytest.raises(InfeasibleError, match="outside the engine map"):
        build_problem(car, driven(np.zeros(3), 0))


def test_no_fuel_is_burnt_where_nox_is_not_known():
    car = sampled(load_architecture("C2"), 800, 5000, nox_to_nm=100)
    table = build_problem(car, driven(10 + np.arange(40) * 0.3, 3, grade=0.02)).table
    beyond = table.flows["engine_torque_nm"] > 100 + 1e-6
    assert beyond.any() and (table.reject[beyond] & Reject.ENGINE_MAP > 0).all()
    assert np.isfinite(table.nox_kg).all()


def test_the_best_torque_is_one_that_the_map_knows():
    car = sampled(load_architecture("A"), 1200, 2500)
    whole = load_architecture("A").engine
    inside = np.linspace(1300, 2400, 12) * RPM
    found = car.engine.best_nm(inside)
    assert found == pytest.approx(whole.best_nm(inside), rel=0.1)
    # Just inside the map's ends too, where the next speed looked at lies outside.
    ends = car.engine.best_nm(np.array([1201, 2499]) * RPM)
    assert ends == pytest.approx(found[[0, -1]], rel=0.2)


def test_the_page_draws_no_drag_beyond_the_map():
    drawn = engine_map(sampled(load_architecture("A"), 800, 2500))
    speed = np.array(drawn.speed_radps)
    gone = np.array([torque is None for torque in drawn.least_nm])
    assert gone.any() and (gone == (speed > 2500 * RPM)).all()
    assert json.loads(drawn.model_dump_json())["least_nm"] == drawn.least_nm


@pytest.mark.parametrize("allow", [False, True])
def test_an_alternator_outside_its_map_is_said_in_numbers(allow):
    car = load_architecture("A")
    axis = np.linspace(0, 300, 4), np.linspace(-40, 40, 5)
    loss = LossMap(*axis, np.full((4, 5), 50.0))
    car = replace(car, machines=(replace(car.machines[0], loss=loss),))
    with pytest.raises(InfeasibleError) as found:
        build_problem(car, braking(car, 4500), allow_shortfall=allow)
    assert "outside the machine map" in str(found.value) and "nan" not in str(found.value)
