"""The input power split as a shipped file: by hand at points, as parts, and solved with a proof."""

from itertools import pairwise
from math import pi

import numpy as np
import pytest
from split_cars import short, table_value

from hevopt import load_architecture, load_cycle
from hevopt.car.driveline import State
from hevopt.car.parts import WHEEL
from hevopt.driving.demand import Demand
from hevopt.files.lookup import shipped_folder
from hevopt.pages.comparison.energy import LEFT_OUT, energy_of
from hevopt.powertrain import packing
from hevopt.powertrain.evaluated import evaluated
from hevopt.powertrain.operation import completed, setting
from hevopt.powertrain.phases import driver_of, stretches
from hevopt.powertrain.powertrain import build_problem
from hevopt.powertrain.shafts import shafts_of
from hevopt.studies.case import prepare
from hevopt.studies.settings import Settings
from hevopt.units import litres_per_100km

PRIUS = load_architecture("prius_1998")
RADIUS_M, FINAL_DRIVE, K, MASS_KG = 0.287, 3.93, 2.6, 1368.0
PARTS = """
kind = "parts"
engine_shaft = "carrier"
machine_shaft = "sun"
machine_2_shaft = "ring"
parts = [
  { kind = "planetary", name = "planetary set", sun = "sun", ring = "ring", carrier = "carrier", ratio = 2.6 },
  { kind = "gear", name = "final drive", first = "ring", second = "wheel", ratio = 3.93 },
]
"""


def by_hand(kmh: float, rpm: float, engine_nm: float) -> tuple[float, float, float]:
    """Torque of both machines and battery power at constant speed, one number after the other."""
    mps = kmh / 3.6
    force_n = 0.010837 * MASS_KG * 9.80665 + 0.5 * 1.2 * 0.5238 * mps * mps
    ring_rpm = mps / RADIUS_M * FINAL_DRIVE * 30 / pi
    sun_rpm = (1 + K) * rpm - K * ring_rpm
    sun_nm = -engine_nm / (1 + K)
    motor_nm = force_n * RADIUS_M / FINAL_DRIVE - engine_nm * K / (1 + K)
    electric_w = 700.0
    for machine, speed, torque in (
        ("machine_generator_15kw", sun_rpm, sun_nm),
        ("machine_motor_30kw", ring_rpm, motor_nm),
    ):
        if speed < 0:
            speed, torque = -speed, -torque
        electric_w += torque * speed * pi / 30 + table_value(machine, speed, torque)
    return sun_nm, motor_nm, electric_w


def at_point(kmh: float, rpm: float, engine_nm: float) -> tuple[float, float, float]:
    """The same by the evaluator."""
    mps, one = kmh / 3.6, np.ones(1)
    vehicle = PRIUS.vehicle
    force = np.polyval(np.add(vehicle.rolling_n, vehicle.air_n)[::-1], mps)
    demand = Demand(
        0 * one, one, mps * one, force * RADIUS_M * one, mps / RADIUS_M * one, 0 * one,
        np.zeros(1, int), np.zeros(1, bool),
    )  # fmt: skip
    state, driver = State(engine_on=True), driver_of(PRIUS, demand)
    (stretch,) = stretches(PRIUS, driver, state)
    shafts = shafts_of(PRIUS, demand, stretch.way, stretch.step, one, rpm * pi / 30 * one)
    here = setting(PRIUS, stretch.way, shafts)
    given = {"engine": np.array([[engine_nm]])}
    torques = completed(here, given)
    battery = evaluated(here, state, given, one).battery_w
    return tuple(float(t[0, 0]) for t in (torques["machine"], torques["machine_2"], battery))


@pytest.mark.parametrize(
    ("kmh", "rpm", "engine_nm"),
    [(80.0, 1800.0, 60.0), (40.0, 1300.0, 50.0), (110.0, 3000.0, 85.0), (30.0, 1000.0, 0.0)],
)
def test_points_are_those_computed_by_hand(kmh, rpm, engine_nm):
    assert at_point(kmh, rpm, engine_nm) == pytest.approx(by_hand(kmh, rpm, engine_nm), abs=1e-6)


def test_the_first_point_is_that_of_an_earlier_code():
    # Of the same data with g = 9.81 m/s2: -16.66666667 Nm, -21.37952503 Nm, -2719.037 W.
    found = at_point(80.0, 1800.0, 60.0)
    assert found == pytest.approx((-16.66666667, -21.37952503, -2719.037), abs=3.0)
    assert found[0] == pytest.approx(-50 / 3, abs=1e-8) and found[1] == pytest.approx(-21.38, 1e-3)


@pytest.fixture(scope="module")
def highway():
    return prepare(PRIUS, load_cycle("hwfet"))


def test_the_highway_is_solved_proven_and_close_to_an_earlier_code(highway):
    # 3.646 l/100 km with 20 speeds by 20 torques, the battery limited by its voltage alone.
    plan = highway.dp_trajectory
    bound_kg, _ = highway.certificate.bound_of(plan)
    assert plan.cost_kg / bound_kg - 1 < 5e-4
    litres = litres_per_100km(plan.total_fuel_kg, 749.0, highway.cycle.distance_m)
    assert litres == pytest.approx(3.646, rel=3e-3)


def test_power_is_balanced_and_speeds_are_those_of_willis(highway):
    flows = highway.dp_trajectory.flows
    for name, residual in highway.dp_trajectory.residuals.items():
        assert np.max(np.abs(residual)) < 1e-6, name
    on = flows["engine_speed_radps"] > 0
    sun, ring = flows["machine_speed_radps"], flows["machine_2_speed_radps"]
    willis = sun + K * ring - (1 + K) * flows["engine_speed_radps"]
    moving = ring > 0
    assert np.max(np.abs(willis[on | moving])) < 1e-9
    assert (sun[on] < 0).any() and (sun[on] > 0).any()


def test_what_changes_of_the_free_speed_would_take_is_told(highway):
    run, problem = highway.dp_trajectory, highway.problem
    f, on = run.flows, np.array([problem.table.controls[c].engine_on for c in run.control])
    engine, sun, ring = (f[f"{n}_speed_radps"] for n in ("engine", "machine", "machine_2"))
    whole_j = 0.5 * (0.18 * engine**2 + 0.0226 * (sun**2 + ring**2))
    booked_j = 0.5 * 0.0226 * ((K * ring) ** 2 + ring**2) + on * 0.5 * 0.18 * (1000 * pi / 30) ** 2
    held_j = whole_j - booked_j
    np.testing.assert_allclose(f["shafts_left_out_j"], held_j, rtol=1e-9, atol=1e-6)
    assert np.max(np.abs(held_j[~on])) < 1e-6
    items = energy_of(run, problem.table.step_s, PRIUS.engine.heating_value_jpkg).of_which
    (told,) = (item.energy_j for item in items if item.name == LEFT_OUT)
    up_j = sum(max(after - before, 0.0) for before, after in pairwise([0.0, *held_j, 0.0]))
    assert told == pytest.approx(up_j, rel=1e-6) and 5e4 < told < 5e5


def test_parts_listed_one_by_one_are_the_same_car(tmp_path):
    text = (shipped_folder("architectures") / "hybrids" / "prius_1998.toml").read_text()
    path = tmp_path / "mine.toml"
    path.write_text(text.split("[coupling]")[0] + "[coupling]" + PARTS)
    cycle = short("udds", 60)
    mine, shipped = (build_problem(load_architecture(c), cycle).table for c in (path, "prius_1998"))
    assert np.array_equal(mine.fuel_kg, shipped.fuel_kg)
    assert np.array_equal(mine.battery_power_w, shipped.battery_power_w)


def test_what_is_left_out_is_in_no_optimum(monkeypatch):
    cycle = short("udds", 140)
    few = prepare(PRIUS, cycle, levels=20)
    monkeypatch.setattr(packing, "_unbeaten", lambda points, steps: np.ones(len(points.step), bool))
    every = prepare(PRIUS, cycle, levels=20)
    assert every.problem.table.feasible.sum() > 3 * few.problem.table.feasible.sum()
    assert every.dp_trajectory.cost_kg == pytest.approx(few.dp_trajectory.cost_kg, rel=1e-9)
    bounds = [case.certificate.bound_of(case.dp_trajectory)[0] for case in (every, few)]
    assert bounds[0] == pytest.approx(bounds[1], rel=1e-9)


def test_points_close_to_the_plan_make_it_no_dearer():
    plain, closer = (
        prepare(PRIUS, short("udds", 140), Settings(refine=refine)) for refine in (False, True)
    )
    costs = [case.dp_trajectory.cost_kg for case in (closer, plain)]
    assert 0.98 * costs[1] < costs[0] < costs[1]
    bound_kg, _ = closer.certificate.bound_of(closer.dp_trajectory)
    assert bound_kg <= costs[0]


def test_kinetic_energy_is_that_of_shafts_whose_speed_is_not_chosen():
    line, wheel = PRIUS.driveline, 50.0
    demand = Demand(
        np.zeros(1), np.ones(1), np.array([10.0]), np.zeros(1), np.array([wheel]), np.array([2.0]),
        np.zeros(1, int), np.zeros(1, bool),
    )  # fmt: skip
    state, driver = State(engine_on=True), driver_of(PRIUS, demand)
    (stretch,) = stretches(PRIUS, driver, state)
    for rpm in (1200.0, 3000.0):
        free = np.array([rpm * pi / 30])
        shafts = shafts_of(PRIUS, demand, stretch.way, stretch.step, np.ones(1), free)
        assert set(shafts.acting_nm) == {WHEEL} and line.free_engine_speed
        lumped = 0.0226 * ((K * FINAL_DRIVE) ** 2 + FINAL_DRIVE**2)
        assert shafts.acting_nm[WHEEL] == pytest.approx([lumped * 2.0])


def test_a_step_that_cannot_be_followed_is_driven_with_what_there_is():
    table = build_problem(PRIUS, short("us06", 150), allow_shortfall=True, levels=20).table
    short_steps = table.missing_torque_nm > 0
    assert 0 < short_steps.sum() < 20 and table.feasible.any(axis=1).all()
