"""A car under commands: the driven trace to the bit where it is asked the same, and what is refused."""

from dataclasses import replace

import numpy as np
import pytest
from forward.commands import asked_on_the_hill

from hevopt import DataError, load_architecture
from hevopt.forward.commanded import CommandedCar, Commands
from hevopt.problem.battery import power_limits_w

STEP_S = 0.1


CARS = (
    "A", "C2", "E", "p0_p4_diesel", "p4_diesel", "camry_2018", "s60_b5_2022", "electric_compact", "prius_1998",
    "series_1500", "series_parallel_1500",
)  # fmt: skip


@pytest.mark.parametrize("name", CARS)
def test_what_a_driven_trace_asked_drives_it_again_to_the_bit(name):
    run, record, commands = asked_on_the_hill(name, STEP_S)
    car = CommandedCar(run.car, step_s=STEP_S)
    for k, asked in enumerate(commands):
        moved = car.advance(asked)
        assert np.array_equal(moved.record[0], record[k]), k
        if k % 5 > 0 and k > 100:
            continue
        for flow in ("fuel_kgps", "battery_power_w", "machine_inertia_w", "clutch_loss_w"):
            assert moved.books.flows[flow][0] == run.books.flows[flow][k]
        assert car.standing.stored_j == run.energy_j[k + 1] and car.soc == run.soc[k + 1]
        assert moved.gear == run.gear[k]
    assert (
        car.standing.distance_m == pytest.approx(run.distance_m, rel=1e-12) and run.distance_m > 300
    )
    assert car.standing.fuel_kg == pytest.approx(run.fuel_kg, rel=1e-12)
    assert car.standing.nox_kg == pytest.approx(run.nox_kg, rel=1e-12)
    if run.starts:
        assert run.starts > 0 and car.standing.fuel_kg > run.start_fuel_kg


def pulled(car, seconds=3.0, steps=1):
    asked = Commands(1500.0)
    for _ in range(round(seconds / (steps * car.step_s))):
        moved = car.advance(asked, steps)
    return moved


def test_many_steps_at_once_are_as_many_one_by_one():
    one, many = (CommandedCar(load_architecture("C2")) for _ in range(2))
    pulled(one), pulled(many, steps=50)
    for name, value in one.standing._asdict().items():
        other = getattr(many.standing, name)
        if name == "row":
            assert np.array_equal(value, other)
        elif name in ("distance_m", "fuel_kg", "nox_kg"):
            assert value == pytest.approx(other, rel=1e-12)
        else:
            assert value == other
    assert one.speed_mps > 2


def test_a_car_is_put_back_where_it_stood():
    car = CommandedCar(load_architecture("E"))
    pulled(car, 2.0)
    kept = car.standing
    pulled(car, 2.0)
    first = car.standing
    car.standing = kept
    assert car.speed_mps < first.loop.state.speed_mps
    pulled(car, 2.0)
    assert car.standing.loop == first.loop and car.standing.stored_j == first.stored_j


def test_a_car_without_an_engine_begins_at_speed_and_charges_when_braked():
    car = CommandedCar(load_architecture("electric_compact"), speed_mps=15.0, soc_start=0.5)
    for _ in range(100):
        moved = car.advance(Commands(-1000.0))
        assert max(abs(r[0]) for r in moved.books.residuals.values()) < 1e-6
    assert 13 < car.speed_mps < 15 and car.soc > 0.5 and car.standing.fuel_kg == 0


def test_held_a_car_stands_on_a_slope_and_let_go_does_not_roll_back():
    car = CommandedCar(load_architecture("A"))
    car.advance(Commands(hold=True, grade=0.1), 100)
    assert car.speed_mps == 0
    car.advance(Commands(grade=-0.1), 300)
    assert car.speed_mps > 0.5


@pytest.mark.parametrize(
    ("asked", "fault"),
    [
        (Commands(gear=7), "gear 7; allowed: 1 to 6"),
        (Commands(gear=0), "gear 0; allowed"),
        (Commands(float("nan")), "force_n nan; allowed: finite"),
        (Commands(machines_nm=(("machine", float("inf")),)), "machine inf"),
        (Commands(grade=float("nan")), "grade nan"),
        (Commands(gears=(("no box", 1),)), "no box 1; C2 has none such"),
    ],
)
def test_a_command_that_is_none_is_refused_and_the_car_stays_as_it_was(asked, fault):
    car = CommandedCar(load_architecture("C2"))
    pulled(car, 0.5)
    kept = car.standing
    with pytest.raises(DataError, match=fault):
        car.advance(asked)
    assert car.standing is kept


@pytest.mark.parametrize(
    ("given", "fault"),
    [
        ({"soc_start": 0.2}, "soc_start 0.2; allowed for C2: 0.4 to 0.8"),
        ({"soc_start": float("nan")}, "soc_start nan"),
        ({"speed_mps": -1.0}, "start speed -1 m/s"),
        ({"step_s": 0.2}, "step 0.2 s; allowed: 0.001 to 0.1"),
    ],
)
def test_a_start_that_is_none_is_refused(given, fault):
    with pytest.raises(DataError, match=fault):
        CommandedCar(load_architecture("C2"), **given)


def test_an_empty_battery_is_told():
    car = load_architecture("C2", {"car.auxiliary_power_w": 6000.0})
    small = replace(car, battery=replace(car.battery, capacity_as=car.battery.capacity_as / 100))
    one = CommandedCar(small)
    with pytest.raises(DataError, match="the battery is empty at t = "):
        for _ in range(100):
            one.advance(Commands(hold=True, engine_on=False), 100)


@pytest.mark.parametrize("name", ["prius_1998", "prius_2016"])
def test_a_battery_gives_no_more_than_it_has_however_much_is_asked(name):
    """The engine is started on the way, as the generator would turn too fast beside one at rest."""
    car = CommandedCar(load_architecture(name), step_s=0.1)
    most_w, drawn_w = power_limits_w(car.car.battery)[1], []
    for _ in range(200):
        moved = car.advance(Commands(2e4, engine_on=False))
        drawn_w.append(moved.books.flows["battery_power_w"][0])
        assert max(abs(r[0]) for r in moved.books.residuals.values()) < 1e-6
    assert max(drawn_w) < most_w * (1 + 1e-4) and drawn_w[100] > 0.9 * most_w
    assert car.soc > car.car.battery.soc_min - 0.003 and car.speed_mps > 15 and moved.full


def test_an_empty_window_leaves_the_machines_what_the_engine_gives():
    car = CommandedCar(load_architecture("prius_2016"), step_s=0.1, soc_start=0.4)
    for _ in range(20):
        moved = car.advance(Commands(3000.0, engine_on=False))
    assert car.speed_mps == 0 and moved.full
    for _ in range(50):
        car.advance(Commands(3000.0, engine_radps=200.0, engine_nm=80.0))
    assert car.speed_mps > 1 and car.soc > 0.399


@pytest.mark.parametrize(
    ("name", "asked", "fault"),
    [
        ("prius_1998", Commands(clutch_open=True), "clutch_open True; prius_1998 has no such thing"),
        ("prius_1998", Commands(clutch_closed=True), "clutch_closed True"),
        ("prius_1998", Commands(machines_nm=(("machine", 5.0),)), "machine is asked for a torque; .* may be: none"),
        ("C2", Commands(engine_radps=200.0), "engine_radps 200.0; C2 has no such thing"),
        ("p0_p4_diesel", Commands(machines_nm=(("belt", 5.0),)), "may be: machine, machine_2"),
    ],
)  # fmt: skip
def test_what_a_car_has_not_is_not_asked_of_it(name, asked, fault):
    with pytest.raises(DataError, match=fault):
        CommandedCar(load_architecture(name)).advance(asked)


def test_steps_of_a_first_call_are_those_of_as_many_calls():
    asked = Commands(force_n=2000.0, engine_radps=400.0, engine_nm=60.0, engine_on=True)
    at_once = CommandedCar(load_architecture("prius_1998"), step_s=0.1)
    one_by_one = CommandedCar(load_architecture("prius_1998"), step_s=0.1)
    records = [one_by_one.advance(asked).record for _ in range(20)]
    assert np.array_equal(at_once.advance(asked, 20).record, np.concatenate(records))


def test_an_engine_begins_no_faster_than_its_generator_may_turn():
    car = CommandedCar(load_architecture("prius_1998"), step_s=0.1)
    moved = car.advance(Commands(engine_radps=400.0, engine_nm=20.0))
    top = car.car.machines[0].speed_max_radps
    assert 0.9 * top < moved.books.flows["machine_speed_radps"][0] <= top
