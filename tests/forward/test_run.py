"""Whole runs: what a driver makes of a cycle, against the backward model and against themselves."""

from dataclasses import replace

import numpy as np
import pytest
from forward.drives import STIFF, constant, driven, follow, plan_of, ramp

from hevopt import DataError, drive, load_architecture
from hevopt.car.handling import Clutch, DriverGains, Handling, Shifting, Tyre
from hevopt.forward.stability import spectral_radius
from hevopt.problem.battery import soc

CARS = ("A", "B", "C1", "C2", "D", "E", "electric_compact")


@pytest.mark.parametrize("name", CARS)
def test_every_car_follows_nedc_with_little_difference_in_fuel_and_charge(name):
    found = driven(name)
    run = found.run
    assert run.quality.violations == () and found.marks == ()
    assert 3.6 * run.quality.speed_error_mps < 0.1
    assert abs(found.change_percent) < (0.5 if name == "A" else 1.0)
    assert run.starts == found.backward.engine_starts
    assert abs(run.distance_m - run.cycle.distance_m) < 1.0


@pytest.mark.parametrize("name", ["C2", "E"])
def test_a_replayed_plan_keeps_its_charge_on_the_way(name):
    run = driven(name).run
    assert np.abs(run.soc - soc(run.car.battery, run.planned_j)).max() < 0.003


@pytest.mark.parametrize(
    ("name", "cycle"),
    [(name, "nedc") for name in CARS]
    + [("C1", "us06"), ("D", "udds")]
    + [pytest.param(name, "ftp75", marks=pytest.mark.long) for name in CARS],
)
def test_every_component_balances_to_rounding(name, cycle):
    run = driven(name, cycle).run
    assert max(run.residual.values()) < 1e-9
    flows = run.books.flows
    scale = np.abs(flows["wheel_power_w"]).max()
    for loss in ("clutch_loss_w", "brake_power_w", "machine_loss_w", "battery_loss_w"):
        # While a ratio moves a clutch that holds slips by what it moves, in either direction.
        assert flows[loss].min() > -(2e-3 if loss == "clutch_loss_w" else 1e-9) * scale, loss
    assert (run.speed_mps >= 0).all() and np.isfinite(run.speed_mps).all()
    parts = sum(flows[f"clutch_{cause}_w"] for cause in ("launch", "change", "start", "other"))
    assert parts == pytest.approx(flows["clutch_loss_w"])


@pytest.mark.parametrize("step_s", [0.1, 0.05, 0.002])
def test_the_length_of_the_step_moves_fuel_by_less_than_a_fiftieth_of_a_per_cent(step_s):
    assert driven("A", step_s=step_s).run.fuel_kg == pytest.approx(
        driven("A").run.fuel_kg, rel=2e-4
    )


@pytest.mark.parametrize(
    ("name", "speed_kmh"), [("A", 50), ("A", 120), ("C2", 50), ("C2", 120), ("D", 90), ("E", 120),
     ("electric_compact", 50), ("electric_compact", 120)],
)  # fmt: skip
def test_at_constant_speed_all_flows_are_those_of_the_backward_step(name, speed_kmh):
    car, cycle = load_architecture(name), constant(speed_kmh)
    open_loop = Handling(driver=DriverGains(charge_per_s=0.0))
    strategy = "baseline" if name == "A" else "dp"
    run = drive(car, cycle, strategy, handling=open_loop).run
    from hevopt.studies.case import prepare
    from hevopt.studies.solved import run_case

    backward = run_case(prepare(car, cycle), strategy)[2].flows
    for flow in (
        "engine_torque_nm", "fuel_power_w", "machine_torque_nm", "machine_electric_w", "gearbox_loss_w",
        "gear_loss_w", "wheel_power_w",
    ):  # fmt: skip
        assert run.books.flows[flow][-1] == pytest.approx(backward[flow][-1], rel=1e-9, abs=1e-9)


def test_without_inertia_of_the_engine_lag_and_gap_both_models_burn_the_same():
    car, cycle, plan, trajectory = plan_of(
        "A", changes=(("engine.inertia_kgm2", 0.0), ("gearbox.shift_gap_s", 0.0))
    )
    run = follow(car, cycle, plan, handling=STIFF)
    assert run.fuel_kg == pytest.approx(trajectory.total_fuel_kg, rel=1e-3)


def test_the_tyres_lag_gives_what_its_law_says():
    """Equation (2) with a rigid wheel: energy lag x integral of F dv, which is not passive."""
    flows = driven("A").run.books.flows
    given = float(np.sum(flows["tyre_lag_w"])) * 0.01
    force = flows["road_w"] / np.maximum(flows["speed_mps"], 1e-9)
    force += flows["kinetic_w"] / np.maximum(flows["speed_mps"], 1e-9)
    change = np.gradient(flows["speed_mps"])
    assert given == pytest.approx(-0.03 * float(np.sum(force * change)), rel=0.02)


def test_ten_seconds_more_at_rest_cost_idling_only():
    car, cycle, plan, _ = plan_of("A")
    from hevopt.driving.cycle import Cycle

    later = Cycle(
        "later", np.append(cycle.time_s, cycle.time_s[-1] + 10.0),
        np.append(cycle.speed_mps, cycle.speed_mps[-1]), np.append(cycle.grade, 0.0),
    )  # fmt: skip
    longer = replace(
        plan,
        **{name: np.append(getattr(plan, name), getattr(plan, name)[-1:])
           for name in ("way", "engine_on", "open_while", "machine_nm", "energy_j")},
    )  # fmt: skip
    first, second = follow(car, cycle, plan), follow(car, later, longer)
    idle = first.books.flows["fuel_kgps"][-1]
    assert second.fuel_kg - first.fuel_kg == pytest.approx(10 * idle, rel=1e-6)


@pytest.mark.parametrize("lag_s", [0.0, 0.03])
def test_a_change_of_gear_takes_off_the_trace_what_a_car_loses_in_its_gap(lag_s):
    """Half a second without torque up a slope: speed lacks what was to be gained, and what the road takes.

    Neither the tyres' lag nor the step makes it, as both keep less than a tenth of it.
    """
    run = drive(
        load_architecture("A"),
        ramp(10, 10, 40, grade=0.01),
        "baseline",
        handling=Handling(Tyre(lag_s)),
    ).run
    lacking = run.wanted_mps - run.speed_mps
    k = int(np.argmax(lacking))
    against_n = run.books.flows["road_w"][k] / run.books.flows["speed_mps"][k]
    lost = run.handling.shifting.gap_s * (1.0 + against_n / run.car.vehicle.equivalent_mass_kg)
    assert 0.5 < lacking[k] == pytest.approx(lost, rel=0.05)


def test_a_lazy_driver_leaves_the_trace_and_the_run_says_where():
    car, cycle, plan, _ = plan_of("A")
    lazy = DriverGains(proportional=0.5, integral=0.05, feed_forward=0.0)
    run = follow(car, cycle, plan, handling=Handling(driver=lazy))
    assert run.missed and run.quality.outside_s > 20
    assert all(0 <= one.start_s <= 1180 and one.beyond_mps > 0 for one in run.quality.violations)


def test_a_cycle_that_asks_for_more_than_the_car_has_is_driven_on_and_marked():
    found = driven("A", "us06")
    assert found.run.missed and found.run.full.any()
    assert any("trace missed" in mark for mark in found.marks)
    assert max(found.run.residual.values()) < 1e-9


def test_a_clutch_does_not_slip_for_torque_once_the_gears_are_faster_than_idle_speed():
    run = drive(load_architecture("A"), ramp(50.0, 20.0, 30), "baseline", step_s=0.05).run
    launching = np.abs(run.books.flows["clutch_launch_w"]) > 0
    assert launching.any() and run.gear.max() > 3
    # Every gear after the first begins above idle speed: full load at that speed, not a launch for more of it.
    assert run.gear[launching].max() == 1


def test_gains_that_make_the_speed_swing_are_refused_with_the_factor():
    tyre = Tyre()
    assert (
        spectral_radius(DriverGains(), tyre, 0.01)
        < 1
        < spectral_radius(DriverGains(250.0), tyre, 0.01)
    )
    car, cycle, plan, _ = plan_of("A")
    with pytest.raises(DataError, match=r"swings ever more.*lower proportional"):
        follow(car, cycle, plan, handling=Handling(driver=DriverGains(250.0)))
    with pytest.raises(DataError, match="integral -1; allowed"):
        follow(car, cycle, plan, handling=Handling(driver=DriverGains(integral=-1.0)))


@pytest.mark.parametrize("step_s", [0.0, 0.2, float("nan")])
def test_a_step_out_of_range_is_refused(step_s):
    car, cycle, plan, _ = plan_of("A")
    with pytest.raises(DataError, match=r"allowed: 0.001 to 0.1 s"):
        follow(car, cycle, plan, step_s=step_s)


def test_a_car_that_cannot_move_off_is_told_with_the_reason():
    weak = Handling(clutch=Clutch(slipping_nm=1.0, sticking_nm=1.0))
    with pytest.raises(DataError, match=r"does not move off at t = 5.*check mass"):
        drive(load_architecture("A"), ramp(10, 10, 40, grade=0.1), "baseline", handling=weak)


def test_a_battery_that_empties_on_the_way_is_told_with_the_time():
    car, cycle, plan, _ = plan_of("C2")
    hungry = replace(car, vehicle=replace(car.vehicle, auxiliary_power_w=20_000.0))
    with pytest.raises(DataError, match=r"the battery is empty at t = .* raise soc_start"):
        follow(hungry, cycle, plan)


def test_a_gap_without_torque_costs_a_car_that_brakes_by_its_gearbox():
    """C2 on FTP-75: some per cent for half a second."""
    car, cycle, plan, _ = plan_of("C2", "ftp75")
    fuels = []
    for gap_s in (0.0, 0.5):
        run = follow(car, cycle, plan, handling=Handling(shifting=Shifting(gap_s=gap_s)))
        fuels.append(run.fuel_kg - 6.2e-8 * (run.energy_j[-1] - run.energy_j[0]))
    assert 1.005 < fuels[1] / fuels[0] < 1.08


def test_random_cars_and_cycles_stay_finite_and_lose_energy():
    rng = np.random.default_rng(7)
    for _ in range(6):
        mass = float(rng.uniform(900, 2500))
        car = load_architecture("A", {"car.mass_kg": mass})
        from hevopt import build_problem
        from hevopt.driving.cycle import Cycle
        from hevopt.forward.lines import line_of
        from hevopt.forward.plans import replay_of
        from hevopt.problem.simulation import simulate
        from hevopt.strategies import STRATEGIES

        speed = np.clip(np.cumsum(rng.normal(0, 1.2, 200)), 0, 30)
        speed[0] = 0
        cycle = Cycle("random", np.arange(200.0), speed, rng.uniform(-0.05, 0.05, 200))
        problem = build_problem(car, cycle, allow_shortfall=True)
        trajectory = simulate(problem, STRATEGIES["baseline"].solve(problem).control)
        run = follow(car, cycle, replay_of(trajectory, line_of(car)), step_s=0.02)
        assert np.isfinite(run.speed_mps).all() and (run.speed_mps >= 0).all()
        assert run.books.flows["clutch_loss_w"].min() > -50
        assert run.books.flows["brake_power_w"].min() > -1e-6
        assert max(run.residual[name] for name in ("driveline", "road", "machines")) < 1e-9
