"""Cars whose engine has a speed of its own, driven: power split, series, with lock-up clutch, with a fuel cell."""

from functools import cache

import numpy as np
import pytest
from forward.drives import constant

from hevopt import DataError, build_problem, load_architecture, load_cycle, simulate
from hevopt.car.handling import DriverGains, Handling
from hevopt.driving.cycle import Cycle
from hevopt.forward import _drive_kernels as col
from hevopt.forward.lines import line_of
from hevopt.forward.performance import performance
from hevopt.forward.plans import replay_of
from hevopt.forward.run import check_charge, follow
from hevopt.problem.battery import power_limits_w
from hevopt.strategies import STRATEGIES
from hevopt.studies.driven import drive

CARS = ("prius_1998", "series_1500", "series_parallel_1500", "prius_2016")
OPEN_LOOP = Handling(driver=DriverGains(charge_per_s=0.0))


def hill():
    """The UDDS from 160 to 330 s: up to 91 km/h and back to rest."""
    udds = load_cycle("udds")
    cut = slice(160, 331)
    return Cycle("hill", udds.time_s[cut] - 160.0, udds.speed_mps[cut], udds.grade[cut])


@cache
def planned(name, speed_kmh=None):
    """(car, cycle, trajectory of ecms, plan) on the hill, or at a constant speed."""
    car, cycle = load_architecture(name), hill() if speed_kmh is None else constant(speed_kmh, 60)
    problem = build_problem(car, cycle, allow_shortfall=True)
    trajectory = simulate(problem, STRATEGIES["ecms"].solve(problem).control)
    return car, cycle, trajectory, replay_of(trajectory, line_of(car))


@cache
def run_of(name, step_s=0.05):
    """The hill, driven."""
    car, cycle, _, plan = planned(name)
    return follow(car, cycle, plan, step_s=step_s)


@pytest.mark.parametrize("name", CARS)
def test_units_turn_as_the_backward_balance_has_them(name):
    car, _, trajectory, _ = planned(name)
    ways, flows = line_of(car).ways, trajectory.flows
    assert line_of(car).free == (0, 1) and len(ways.wheel) == 1
    wheel = trajectory.problem.table.signals.speed_mps / car.vehicle.tyre_radius_m
    side, moving = flows["engine_speed_radps"], wheel > 0
    for n, machine in enumerate(("machine", "machine_2"), 1):
        own = ways.wheel[0, n] * wheel + ways.side[0, n] * side
        np.testing.assert_allclose(own[moving], flows[f"{machine}_speed_radps"][moving], atol=1e-9)


@pytest.mark.parametrize("name", CARS)
def test_every_component_balances_and_the_trace_is_kept(name):
    run = run_of(name)
    assert max(run.residual.values()) < 1e-9
    assert run.quality.violations == () and 3.6 * run.quality.speed_error_mps < 0.1
    assert not run.books.off_map.any()
    flows = run.books.flows
    for loss in ("brake_power_w", "machine_loss_w", "battery_loss_w", "gear_loss_w"):
        assert flows[loss].min() > -1e-6, loss
    for n, machine in enumerate(run.car.machines):
        speed = np.abs(flows[("machine", "machine_2")[n] + "_speed_radps"])
        assert speed.max() <= machine.speed_max_radps


@pytest.mark.parametrize(
    ("name", "speed_kmh"), [("prius_1998", 100), ("series_1500", 50), ("series_parallel_1500", 100)]
)
def test_at_constant_speed_all_flows_are_those_of_the_backward_step(name, speed_kmh):
    """The lock-up clutch is closed in the last of them."""
    car, cycle, trajectory, plan = planned(name, speed_kmh)
    run, backward = follow(car, cycle, plan, step_s=0.05, handling=OPEN_LOOP), trajectory.flows
    assert plan.course.closed[-1] == (name == "series_parallel_1500")
    for flow in (
        "engine_torque_nm", "engine_speed_radps", "fuel_power_w", "machine_torque_nm", "machine_2_torque_nm",
        "machine_2_speed_radps", "machine_electric_w", "gear_loss_w", "wheel_power_w",
    ):  # fmt: skip
        assert run.books.flows[flow][-1] == pytest.approx(backward[flow][-1], rel=1e-9, abs=1e-6)


def test_the_engines_speed_follows_its_plan_by_a_first_order_lag():
    car, cycle, _, plan = planned("series_1500")
    run = follow(car, cycle, plan, step_s=0.05, handling=OPEN_LOOP)
    step = np.minimum((run.time_s[:-1] + 1e-9).astype(int), len(plan.way) - 1)
    wanted, side = plan.course.engine_radps[step], np.zeros(len(step) + 1)
    mean = run.books.flows["engine_speed_radps"]
    for k in range(len(mean)):
        side[k + 1] = 2 * mean[k] - side[k]
    away, after = side[:-1] - wanted, side[1:] - wanted
    # Where the governor's push is enough, and rounding does not count.
    near = (run.engine == 2) & plan.engine_on[step] & (np.abs(away) < 1.0) & (np.abs(away) > 1e-3)
    assert near.sum() > 50
    lag = np.exp(-run.step_s / run.handling.driver.governor_s)
    np.testing.assert_allclose(after[near] / away[near], lag, rtol=1e-5)


def test_the_length_of_the_step_hardly_moves_fuel():
    long, short = run_of("prius_1998", 0.1), run_of("prius_1998", 0.02)
    assert long.fuel_kg == pytest.approx(short.fuel_kg, rel=2e-3)


def test_a_plan_is_kept_but_for_what_its_engine_takes_to_start():
    for name in CARS:
        run = run_of(name)
        _, _, trajectory, _ = planned(name)
        price_kgpj = 7e-8  # [E] of an engine of a third, by the fuel's energy
        corrected = run.fuel_kg - price_kgpj * (run.energy_j[-1] - trajectory.end_j)
        assert corrected == pytest.approx(trajectory.total_fuel_kg, rel=0.08)
        assert run.starts == int(np.sum(np.diff(planned(name)[3].engine_on.astype(int)) > 0))


def test_a_fuel_cell_gives_its_planned_power(tmp_path):
    from powertrain.test_source import written

    car, cycle = load_architecture(written(tmp_path)), hill()
    problem = build_problem(car, cycle, levels=21)
    trajectory = simulate(problem, STRATEGIES["ecms"].solve(problem).control)
    run = follow(car, cycle, replay_of(trajectory, line_of(car)), step_s=0.05, handling=OPEN_LOOP)
    assert max(run.residual.values()) < 1e-9 and not run.books.off_map.any()
    assert run.fuel_kg == pytest.approx(trajectory.total_fuel_kg, rel=0.02)


# The second machine turns five times as fast as the engine: to start one is to start the other.
COMPOUND = """
name = "compound"
car = "car_prius_1998"
engine = "engine_petrol_1500_atkinson"
battery = "battery_nimh_40"
machine = "machine_motor_30kw"
machine_2 = "machine_motor_30kw"
functions = ["start_stop", "e_boost", "regenerative_braking", "power_management"]

[coupling]
kind = "parts"
engine_shaft = "engine"
machine_shaft = "a"
machine_2_shaft = "b"
parts = [
  { kind = "planetary", name = "set 1", sun = "a", ring = "engine", carrier = "out", efficiency = 0.98, ratio = 2 },
  { kind = "planetary", name = "set 2", sun = "b", ring = "a", carrier = "out", efficiency = 0.98, ratio = 2.5 },
  { kind = "gear", name = "final drive", first = "out", second = "wheel", ratio = 2.6, efficiency = 0.97 },
]
"""


def test_a_start_takes_no_more_power_than_the_battery_gives(tmp_path):
    path = tmp_path / "compound.toml"
    path.write_text(COMPOUND)
    car, cycle = load_architecture(path), hill()
    problem = build_problem(car, cycle, allow_shortfall=True)
    trajectory = simulate(problem, STRATEGIES["ecms"].solve(problem).control)
    run = follow(car, cycle, replay_of(trajectory, line_of(car)), step_s=0.05)
    assert run.starts > 0 and np.isfinite(run.fuel_kg) and np.isfinite(run.energy_j).all()
    # In the one step that all shafts turn alike, no way that power goes through the teeth proves right.
    assert (
        np.abs(run.books.residuals["driveline"]).max()
        < 1e-9 * run.books.flows["wheel_power_w"].max()
    )
    assert max(run.residual.values()) < 1e-9
    started = run.books.flows["starter_electric_w"] > 0
    most_w = power_limits_w(car.battery)[1]
    assert run.books.flows["battery_power_w"][started].max() <= most_w * (1 + 1e-9)


@pytest.mark.parametrize("name", ["prius_1998", "prius_2001", "series_1500"])
@pytest.mark.parametrize("step_s", [0.1, 0.02])
def test_no_speed_gets_beyond_what_engine_and_machine_may_turn_at(name, step_s):
    """On the US06, where all are floored: beyond its highest speed a generator holds no engine, which runs away."""
    run = drive(load_architecture(name), load_cycle("us06"), "ecms", step_s=step_s).run
    flows = run.books.flows
    assert run.full.any() and max(run.residual.values()) < 1e-9
    for value in (run.speed_mps, run.energy_j, flows["fuel_kgps"]):
        assert np.isfinite(value).all()
    assert flows["engine_speed_radps"].max() <= run.car.engine.speed_max_radps
    for n, machine in enumerate(run.car.machines):
        speed = np.abs(flows[("machine", "machine_2")[n] + "_speed_radps"])
        assert speed.max() <= machine.speed_max_radps
    # Above what the plan has, for charge that lacks, it gives all that engine or generator can.
    turns = flows["engine_speed_radps"] > 0.99 * run.car.engine.speed_max_radps
    full = run.car.engine.covered_nm(flows["engine_speed_radps"][turns])
    most = run.car.machines[0].limit_nm(np.abs(flows["machine_speed_radps"][turns]))
    of_engine = flows["engine_torque_nm"][turns] / full
    of_generator = np.abs(flows["machine_torque_nm"][turns]) / most
    assert turns.any() and np.median(np.maximum(of_engine, of_generator)) > 0.95
    assert not run.books.off_map.any()


def test_power_that_no_battery_gives_is_told_with_its_time():
    car, run = planned("prius_1998")[0], run_of("prius_1998")
    record = np.zeros((len(run.time_s) - 1, col.COLUMNS + 1))
    record[7:, col.ENERGY] = np.nan
    with pytest.raises(DataError, match=r"cannot give the power that is asked of it at t = 0\.4 s"):
        check_charge(car, run.books, record, run.time_s)


def test_a_strategy_that_decides_is_asked_on_the_way():
    found = drive(load_architecture("series_1500"), hill(), "power_follower", step_s=0.05)
    assert found.asked is not None and max(found.run.residual.values()) < 1e-9
    assert found.run.quality.violations == ()


def test_what_such_a_car_is_not_driven_by_is_told():
    car = load_architecture("prius_1998")
    with pytest.raises(DataError, match=r"no \[mean_value\] part"):
        drive(car, hill(), "ecms", engine_model="mean_value")
    with pytest.raises(DataError, match=r"no \[mean_value\] part"):
        performance(car, engine_model="mean_value")
    with pytest.raises(DataError, match="has no lag; leave --boost-lag out"):
        performance(car, boost_lag_s=0.5)
    with pytest.raises(DataError, match="no machine turns with an engine"):
        performance(car, fills=True)
