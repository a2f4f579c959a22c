"""Torque converter: its curves, operating points by hand and in plain scalars, energy, topologies and messages."""

from dataclasses import replace
from math import pi, sqrt

import numpy as np
import pytest
from split_cars import short

from hevopt import DataError, InfeasibleError, build_problem, load_architecture, simulate
from hevopt.car.torque_converter import HydraulicConverter
from hevopt.driving.cycle import Cycle
from hevopt.strategies import STRATEGIES, dp, fitting
from hevopt.studies.case import prepare
from hevopt.studies.settings import Settings

AUTOMATIC = {"gearbox": "gearbox_automatic_4"}
# Typed in from the source, not read from the file.
RATIO = [0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.85, 0.9, 0.95, 1]
MULTIPLE = [2, 1.88, 1.77, 1.66, 1.55, 1.43, 1.32, 1.21, 1.10, 1.04, 1, 1, 1]
TAKEN = [191.8, 186.1, 179.2, 172.0, 161.5, 149.3, 134.9, 119.1, 102.8, 90.10, 77.49, 43.17, 0]
GEARS = [0, 2.91 * 3.08, 1.64 * 3.08, 1.07 * 3.08, 0.78 * 3.08]
RADIUS, IDLE, LOCKS, ETA = 0.3132, 850 * pi / 30, 1200 * pi / 30, 0.93


def between(x, xs, ys):
    """A curve in plain numbers, held beyond its ends."""
    if x >= xs[-1]:
        return ys[-1]
    i = max(n for n in range(len(xs) - 1) if xs[n] <= x)
    return ys[i] + (ys[i + 1] - ys[i]) * (x - xs[i]) / (xs[i + 1] - xs[i])


def torques(impeller, turbine):
    taken = between(turbine / impeller, RATIO, TAKEN) * (impeller / (2000 * pi / 30)) ** 2
    return taken, taken * between(turbine / impeller, RATIO, MULTIPLE)


def impeller_speed(wanted, turbine):
    """By bisection."""
    low, high = 1e-3, 2000.0
    for _ in range(200):
        middle = (low + high) / 2
        low, high = (middle, high) if torques(middle, turbine)[1] < wanted else (low, middle)
    return high


def wheel_torque(mass, speed, accel):
    rolling, air = mass * 9.80665 * (0.009 + 5e-5 * speed), 0.5 * 1.2 * 0.672 * speed**2
    return (rolling + air + (mass + 2.8 / RADIUS**2) * accel) * RADIUS if speed > 0 else 0.0


def fuel_kgps(torque, speed):
    """The diesel's law; none below its drag."""
    piston = 2 * 0.0805 * speed / (2 * pi)
    a, b = -0.0013733, 0.39902 + 0.031510 * piston - 0.0022991 * piston**2
    c = -1.55291 - 0.0076 * piston**2 - 4 * pi * torque / 1598e-6 / 1e5
    p_mf = (-b + sqrt(b * b - 4 * a * c)) / (2 * a)
    return max(p_mf, 0.0) * 1e5 * 1598e-6 * speed / (4 * pi) / 42.9e6


def curves(file_like=True):
    square = (2000 * pi / 30) ** 2
    return HydraulicConverter(np.array(RATIO), np.array(MULTIPLE), np.array(TAKEN) / square)


def test_a_point_by_hand():
    # Half the speed at 3000/min: 149.3 Nm (3000/2000)^2 = 335.925 Nm taken, 1.43 times that given, 71.5 % passed.
    speed = 3000 * pi / 30
    taken, given = curves().torques_nm(np.array([speed]), np.array([speed / 2]))
    assert taken[0] == pytest.approx(335.925, rel=1e-12)
    assert given[0] == pytest.approx(480.37275, rel=1e-12)
    # Stall with 200 Nm at the turbine: half of it taken, at 2000/min sqrt(100 / 191.8).
    stall = curves().impeller_radps(np.array([200.0]), np.array([0.0]))
    assert stall[0] * 30 / pi == pytest.approx(2000 * sqrt(100 / 191.8), rel=1e-12)
    assert curves().torques_nm(np.array([90.0]), np.array([100.0]))[1][0] == 0


def test_the_impeller_s_speed_is_exact_at_the_points_and_the_only_one_between():
    data, turbine = curves(), np.full(len(RATIO) - 2, 150.0)
    impeller = turbine / np.array(RATIO[1:-1])
    _, given = data.torques_nm(impeller, turbine)
    np.testing.assert_allclose(data.impeller_radps(given, turbine), impeller, rtol=1e-14)
    rng = np.random.default_rng(5)
    wanted, turbine = 10 ** rng.uniform(-6, 3, 4000), rng.uniform(0, 500, 4000)
    found = data.impeller_radps(wanted, turbine)
    np.testing.assert_allclose(data.torques_nm(found, turbine)[1], wanted, rtol=1e-9, atol=1e-10)
    for n in range(0, 4000, 40):
        assert found[n] == pytest.approx(impeller_speed(wanted[n], turbine[n]), rel=1e-9)
    # More is only given by a faster impeller, and never more power than is taken.
    rising = np.linspace(1, 900, 3000)
    for turbine in (0.0, 80.0, 300.0):
        taken, given = data.torques_nm(rising, np.full(3000, turbine))
        assert (np.diff(taken) >= 0).all() and (np.diff(given) >= 0).all()
        assert (given * turbine <= taken * rising + 1e-9).all()
    assert (data.impeller_radps(np.array([0.0, -5.0]), np.array([100.0, 0.0])) == 0).all()


@pytest.fixture(scope="module")
def conventional():
    car, cycle = load_architecture("A", AUTOMATIC), short("udds", 400)
    problem = build_problem(car, replace(cycle, gear=None, clutch_open=None))
    return problem, simulate(problem, dp.solve(problem).control)


def test_every_step_of_a_conventional_car_in_plain_scalars(conventional):
    problem, run = conventional
    table, f = problem.table, run.flows
    signals, seen = table.signals, set()
    accel = np.diff(short("udds", 400).speed_mps) / table.step_s
    for k in range(len(table.time_s)):
        speed, gear = float(signals.speed_mps[k]), int(signals.gear[k])
        wheel, turbine = wheel_torque(1300, speed, accel[k]), GEARS[gear] * speed / RADIUS
        locked = gear >= 2 and turbine >= LOCKS
        asked = wheel / GEARS[gear] / ETA if wheel > 0 else wheel * ETA / GEARS[gear] if gear else 0
        brake = 0.0
        if locked:
            how, engine = "locked", turbine
            own = asked + 0.18 * GEARS[gear] * accel[k] / RADIUS
            heat = 0.0
        elif speed == 0:
            how, engine = "standing", IDLE
            own, heat = torques(IDLE, 0)[0], torques(IDLE, 0)[0] * IDLE
        else:
            how = "drives" if asked > 0 else "coasts"
            engine = max(impeller_speed(asked, turbine), IDLE) if asked > 0 else IDLE
            own, given = torques(engine, turbine)
            if engine == IDLE and wheel > 0:
                how = "creeps"
            through = given * GEARS[gear] * ETA
            brake = through - wheel if engine == IDLE else 0.0
            heat = own * engine - given * turbine
        seen.add(how)
        load = 250 / 0.60 / engine
        drag = (
            (-1.55291 - 0.0076 * (2 * 0.0805 * engine / (2 * pi)) ** 2) * 1e5 * 1598e-6 / (4 * pi)
        )
        torque = max(own + load, drag) if locked else own + load
        assert f["engine_speed_radps"][k] == pytest.approx(engine, rel=1e-9), (k, how)
        burnt = (run.fuel_kg[k] - run.switch_fuel_kg[k]) / table.step_s[k]
        if not (locked and own + load < drag + 1e-6):
            assert burnt == pytest.approx(fuel_kgps(torque, engine), rel=1e-8), (k, how)
        assert f["clutch_loss_w"][k] == pytest.approx(heat, rel=1e-7, abs=1e-6), (k, how)
        if not locked:
            assert f["brake_power_w"][k] == pytest.approx(
                brake * speed / RADIUS, rel=1e-7, abs=1e-5
            )
    assert seen == {"locked", "standing", "drives", "coasts", "creeps"}


def test_engine_speed_that_rises_takes_fuel_and_one_that_falls_is_lost(conventional):
    _, run = conventional
    f = run.flows
    slips = f["clutch_loss_w"] > 1
    both = slips[1:] & slips[:-1]
    energy = 0.18 * f["engine_speed_radps"] ** 2 / 2
    rise = np.diff(energy)
    assert (run.switch_fuel_kg[1:][both & (rise > 1)] > 0).all() and (both & (rise > 1)).any()
    assert (run.switch_fuel_kg[1:][both & (rise < -1)] == 0).all() and (both & (rise < -1)).any()
    assert max(np.max(np.abs(r)) for r in run.residuals.values()) < 1e-6


def test_at_rest_a_gear_costs_the_torque_of_the_stalled_impeller():
    standing = Cycle("rest", np.arange(4.0), np.zeros(4), np.zeros(4), None, None)
    found = {}
    for at_rest in ("in_gear", "neutral"):
        change = AUTOMATIC | {"gearbox.torque_converter.at_rest": at_rest}
        table = build_problem(load_architecture("A", change), standing).table
        found[at_rest] = table.fuel_kg[0, 0] / table.step_s[0]
    load = 250 / 0.60 / IDLE
    assert found["neutral"] == pytest.approx(fuel_kgps(load, IDLE), rel=1e-9)
    stalled = 191.8 * (850 / 2000) ** 2
    assert found["in_gear"] == pytest.approx(fuel_kgps(load + stalled, IDLE), rel=1e-9)


@pytest.mark.parametrize("name", ["B", "C1"])
def test_a_hybrid_with_a_converter_is_solved_proven_and_keeps_its_energy(name):
    car = load_architecture(name, AUTOMATIC)
    case = prepare(car, replace(short("udds", 330), gear=None, clutch_open=None), Settings())
    plan = case.dp_trajectory
    bound_kg, _ = case.certificate.bound_of(plan)
    assert 0 <= plan.cost_kg / bound_kg - 1 < 1e-3
    assert case.certificate.scope == "continuous split"
    for strategy in fitting(car.marks):
        run = simulate(case.problem, STRATEGIES[strategy].solve(case.problem).control)
        assert max(np.max(np.abs(r)) for r in run.residuals.values()) < 1e-6, strategy
        assert run.cost_kg > bound_kg - 1e-3 or run.end_j < case.problem.start_j


def test_a_chosen_gear_takes_no_more_than_the_shift_speeds():
    cycle = replace(short("udds", 130), gear=None, clutch_open=None)
    fuel = []
    for gear in ("cycle", "free"):
        problem = build_problem(load_architecture("A", AUTOMATIC | {"gear": gear}), cycle)
        run = simulate(problem, dp.solve(problem).control)
        assert max(np.max(np.abs(r)) for r in run.residuals.values()) < 1e-6
        fuel.append(run.total_fuel_kg)
    assert fuel[1] < fuel[0] + 4 * 0.02e-3


def test_what_the_wheels_cannot_have_is_told_and_driven_with_what_there_is():
    steep = Cycle(
        "steep",
        np.arange(6.0),
        np.full(6, 8.0),
        np.full(6, 0.75),
        np.ones(6, int),
        np.zeros(6, bool),
    )
    car = load_architecture("A", AUTOMATIC)
    with pytest.raises(InfeasibleError, match="Nm missing at the wheels"):
        build_problem(car, steep)
    table = build_problem(car, steep, allow_shortfall=True).table
    assert (table.reject == 0).any(axis=1).all() and (table.missing_torque_nm > 0).all()
    # The most that the engine gives: where full load meets what the impeller takes, tried on a fine grid by hand.
    rpm = [800, 1000, 1250, 1500, 2000, 2250, 2500, 2750, 3000, 3500, 4000, 4500, 5000]
    full = [100, 150, 220, 290, 290, 285, 272, 256, 238, 209, 184, 148, 100]
    turbine, best = GEARS[1] * 8.0 / RADIUS, 0.0
    for n in range(851, 5000):
        taken, given = torques(n * pi / 30, turbine)
        if taken + 250 / 0.60 / (n * pi / 30) <= between(n, rpm, full):
            best = max(best, given)
    weight = 1300 * 9.80665 * (0.6 + (0.009 + 4e-4) * 0.8)  # a slope of 3 in 4
    asked = (weight + 0.5 * 1.2 * 0.672 * 64) * RADIUS
    assert asked - table.missing_torque_nm[0] == pytest.approx(best * GEARS[1] * ETA, rel=2e-3)


PARTS = """name = "own"
car = "car_compact"
engine = "engine_diesel_1600"
gearbox = "gearbox_automatic_4"
machine = "machine_flywheel_18kw"
battery = "battery_liion_64"
hybrid_mass_kg = 60.0
functions = ["start_stop", "e_boost", "regenerative_braking", "nox_cut", "power_management"]
[coupling]
kind = "parts"
engine_shaft = "crankshaft"
machine_shaft = "MACHINE"
parts = [
  { kind = "torque_converter", name = "converter", first = "FIRST", second = "input" },
  { kind = "gearbox", name = "gearbox", first = "input", second = "wheel" },
  MORE
]
"""


def own_car(folder, machine="crankshaft", first="crankshaft", more=""):
    path = folder / "own.toml"
    path.write_text(PARTS.replace("MACHINE", machine).replace("FIRST", first).replace("MORE", more))
    return load_architecture(path)


def test_parts_say_the_same_as_the_kind(tmp_path):
    cycle = replace(short("udds", 130), gear=None, clutch_open=None)
    tables = [
        build_problem(car, cycle).table
        for car in (own_car(tmp_path), load_architecture("C1", AUTOMATIC))
    ]
    np.testing.assert_array_equal(tables[0].fuel_kg, tables[1].fuel_kg)
    np.testing.assert_array_equal(tables[0].reject, tables[1].reject)


def test_where_no_converter_can_stand_it_is_named(tmp_path):
    belt = '{ kind = "gear", name = "belt", first = "pulley", second = "crankshaft", ratio = 2.5 }'
    assert own_car(tmp_path, machine="pulley", more=belt).driveline.converter is not None
    clutch = (
        '{ kind = "clutch", name = "k0", first = "crankshaft", second = "x", operation = "driver" }'
    )
    for options, words in (
        ({"machine": "input"}, "machine turns behind it"),
        ({"machine": "wheel"}, "machine turns behind it"),
        ({"first": "x", "more": clutch}, "its first shaft is 'x'"),
        (
            {"more": belt.replace("pulley", "input")},
            "does not lead to the wheels, or its first does",
        ),
    ):
        with pytest.raises(DataError, match=words):
            own_car(tmp_path, **options)
    for name in ("C2", "D", "E"):
        with pytest.raises(DataError, match="torque_converter, and no part"):
            load_architecture(name, AUTOMATIC)
    with pytest.raises(DataError, match="machine_2 turns behind it or apart"):
        load_architecture("p0_p4_diesel", AUTOMATIC)
    with pytest.raises(DataError, match="has no table torque_converter"):
        path = tmp_path / "own.toml"
        own_car(tmp_path)
        path.write_text(path.read_text().replace("gearbox_automatic_4", "gearbox_manual_6"))
        load_architecture(path)


@pytest.mark.parametrize(
    ("key", "value", "words"),
    [
        ("speed_ratio", [0.1, *RATIO[1:]], "must rise from 0"),
        ("speed_ratio", [*RATIO[:-1], 1.2], "allowed: 0 to 1"),
        ("torque_ratio", [*MULTIPLE[:-1], 1.01], "of the power"),
        ("torque_ratio", MULTIPLE[:-1], "has 12 values; speed_ratio has 13"),
        ("impeller_torque_nm", [*TAKEN[:-1], 20.0], "0 at the last speed_ratio"),
        (
            "impeller_torque_nm",
            [*TAKEN[:8], 10.0, *TAKEN[9:]],
            "rises so fast between speed_ratio 0.8 and 0.85",
        ),
        ("impeller_torque_nm", [float("nan"), *TAKEN[1:]], "impeller_torque_nm"),
        ("lock_up_gear_min", 5, "allowed: 1 to 4"),
        ("at_rest", "park", "at_rest"),
    ],
)
def test_curves_that_cannot_be_are_one_message(key, value, words):
    with pytest.raises(DataError) as found:
        load_architecture("A", AUTOMATIC | {f"gearbox.torque_converter.{key}": value})
    assert words in str(found.value), str(found.value)


def test_a_gap_at_changes_of_gear_is_refused():
    with pytest.raises(DataError, match="gears change under load"):
        load_architecture("A", AUTOMATIC | {"gearbox.shift_gap_s": 0.5})
