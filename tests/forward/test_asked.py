"""Strategies that are asked while the car is driven."""

from dataclasses import replace

import numpy as np
import pytest

from hevopt import DataError, InfeasibleError, build_problem, drive, load_architecture, load_cycle
from hevopt.car.vehicle import tractive_force_n
from hevopt.driving.cycle import Cycle
from hevopt.forward._drive_kernels import Look
from hevopt.forward.asked import Asking, Decider, follow_asked
from hevopt.forward.lines import line_of
from hevopt.powertrain.points import points_of
from hevopt.problem.holding import turning_modes, with_holding
from hevopt.problem.simulation import simulate
from hevopt.strategies import a_ecms, conventional
from hevopt.studies.deciding import decides


@pytest.fixture(scope="module")
def urban():
    """The first of the NEDC's urban cycles."""
    whole = load_cycle("nedc")
    steps = slice(0, 196)
    return Cycle(
        "urban", whole.time_s[steps], whole.speed_mps[steps], whole.grade[steps],
        whole.gear[steps], whole.clutch_open[steps],
    )  # fmt: skip


@pytest.fixture(scope="module")
def solved(urban):
    """(car, problem, points, trajectory of the rule)."""
    car = load_architecture("C2")
    problem = build_problem(car, urban)
    plan = conventional.solve(problem)
    return car, problem, points_of(car, problem, levels=11), simulate(problem, plan.control)


@pytest.mark.parametrize(
    "strategy",
    ["conventional", "nox_cut", "a_ecms", "mpc", pytest.param("sdp", marks=pytest.mark.long)],
)
def test_a_strategy_that_decides_on_the_way_drives_like_its_backward_twin(urban, strategy):
    found = drive(load_architecture("C2"), urban, strategy, step_s=0.05)
    run = found.run
    assert found.asked == Asking(1.0 if strategy == "mpc" else 0.5)
    assert run.quality.violations == () and max(run.residual.values()) < 1e-9
    assert abs(found.change_percent) < 10
    # A rule calibrated for a whole cycle may leave its charge in the loop; then the run is marked.
    assert abs(found.charge_error) < 0.01 or any("end charge" in str(m) for m in found.marks)
    assert 0 < run.starts <= 2 * found.backward.engine_starts + 2
    assert sum(found.difference_percent.values()) == pytest.approx(found.change_percent, abs=1e-6)


def test_what_it_decides_follows_from_what_is_stored(urban):
    car = load_architecture("C2")
    rich, poor = (
        drive(replace(car, soc_start=soc, soc_end=0.6), urban, "a_ecms", step_s=0.05).run
        for soc in (0.65, 0.55)
    )
    assert rich.soc[-1] < rich.soc[0] - 0.002 and poor.soc[-1] > poor.soc[0] + 0.002
    assert rich.fuel_kg < poor.fuel_kg


def test_only_strategies_that_need_not_know_the_cycle_decide():
    able = ("conventional", "nox_cut", "power_follower", "thermostat", "a_ecms", "sdp", "mpc")
    assert all(decides(name) for name in able)
    assert not any(decides(name) for name in ("dp", "ecms", "convex", "baseline", "start_stop"))


def test_a_row_is_found_by_where_it_stands(solved):
    _, problem, points, _ = solved
    signals, radius = points.problem.table.signals, solved[0].vehicle.tyre_radius_m
    for row in (0, 1, 57, len(signals.gear) - 1):
        speed = float(signals.speed_mps[row])
        torque = float(signals.wheel_power_w[row]) * radius / speed if speed else 0.0
        gear = int(signals.gear[row]) or min(points.by_gear)
        assert points.row(gear, speed, torque) == row
    assert points.row(99, 1e3, 1e6) == len(signals.gear) - 1
    assert set(points.by_gear) == set(
        problem.table.signals.gear[problem.table.signals.speed_mps > 0]
    )


def test_every_step_of_the_cycle_is_an_operating_point(solved):
    _, problem, points, _ = solved
    asked, rows = problem.table.signals, points.problem.table.signals
    for k in np.flatnonzero(asked.speed_mps > 0).tolist():
        torque = asked.wheel_power_w[k] / asked.speed_mps[k] * solved[0].vehicle.tyre_radius_m
        row = points.row(int(asked.gear[k]), float(asked.speed_mps[k]), float(torque))
        assert rows.wheel_power_w[row] == pytest.approx(asked.wheel_power_w[k], abs=1e-3)


def test_an_operating_point_is_the_step_of_a_cycle_at_that_speed_and_torque(solved):
    """Driven with the point's speed and acceleration for a hundredth of a second, in third gear."""
    car, _, points, _ = solved
    row, table = points.row(3, 12.0, 150.0), points.problem.table
    mean = float(table.signals.speed_mps[row])
    torque = table.signals.wheel_power_w[row] / mean * car.vehicle.tyre_radius_m
    at_rest = tractive_force_n(car.vehicle, np.array([mean]), np.zeros(1), np.zeros(1))[0]
    accel = (torque / car.vehicle.tyre_radius_m - at_rest) / car.vehicle.equivalent_mass_kg
    speed = mean + accel * np.array([-0.005, 0.005])
    short = Cycle(
        "short", np.array([0.0, 0.01]), speed, np.zeros(2), np.array([3, 3]), np.zeros(2, bool)
    )
    alone = build_problem(car, short, levels=11).table
    usable = alone.feasible[0]
    assert (table.feasible[row] == usable).all() and usable.any()
    for name in ("fuel_kg", "nox_kg"):
        one, other = getattr(table, name)[row] / table.step_s[row], getattr(alone, name)[0] / 0.01
        assert one[usable] == pytest.approx(other[usable], rel=1e-6, abs=1e-9)
    power = table.battery_power_w[row][usable]
    assert power == pytest.approx(alone.battery_power_w[0][usable], rel=1e-6, abs=1e-3)


def test_a_start_at_an_operating_point_takes_the_engines_energy_there(solved):
    car, _, points, _ = solved
    table, turning = points.problem.table, turning_modes(points.problem)
    off, on = np.flatnonzero(~turning)[0], np.flatnonzero(turning)[0]
    row = points.row(3, 12.0, 100.0)
    speed = float(table.signals.speed_mps[row])
    ratio = car.gearbox.ratios[3] * speed / car.vehicle.tyre_radius_m
    taken = 0.5 * car.engine.inertia_kgm2 * ratio**2 / car.machines[0].spin_efficiency
    assert table.switch_energy_j[row, off, on] == pytest.approx(taken, rel=0.01)
    assert table.switch_energy_j[row, on, on] == table.switch_energy_j[row, off, off] == 0


def test_a_held_row_is_its_point_without_starts_and_stops(solved):
    problem = solved[2].problem
    held, turning = with_holding(problem), turning_modes(problem)
    steps = len(problem.table.step_s)
    np.testing.assert_array_equal(held.table.fuel_kg[steps:], problem.table.fuel_kg)
    np.testing.assert_array_equal(held.table.reject[:steps], problem.table.reject)
    same = turning[:, None] == turning
    assert held.table.switch_allowed[:steps].all()
    assert (held.table.switch_allowed[steps:] == same).all()


class _Restless:
    """Wants the engine on, then off, and so on, wherever it may."""

    def __init__(self, problem):
        self.table, self.wants = problem.table, False

    def decide(self, k, energy_j, mode):
        self.wants = not self.wants
        on = np.array([control.engine_on for control in self.table.controls])
        may = self.table.feasible[k] & self.table.switch_allowed[k][mode, self.table.mode]
        wanted = np.flatnonzero(may & (on == self.wants))
        return int(wanted[0] if len(wanted) else np.flatnonzero(may)[0])


@pytest.mark.parametrize("dwell_s", [0.0, 3.0])
def test_the_engine_stays_on_and_off_as_long_as_it_is_to(urban, solved, dwell_s):
    car, _, points, trajectory = solved
    asking = Asking(0.5, dwell_s)
    decider = Decider("it", _Restless(with_holding(points.problem)), points.problem, points, asking)
    commands = []
    for n in range(60):
        look = Look(10.0, 200.0)
        commands.append(decider.decide(0.5 * n, n // 2, 3, look, 0.6 * 5e6).engine_on)
    changed = 0.5 * np.flatnonzero(np.diff(np.array(commands)))
    kept_s = np.diff(changed).min()
    assert len(changed) > 3 and max(dwell_s, 0.5) <= kept_s <= dwell_s + 0.5
    run = follow_asked(car, urban, decider, trajectory, step_s=0.1, line=line_of(car))
    assert np.isfinite(run.speed_mps).all() and run.starts > 0


def test_points_have_the_charge_of_a_plan_in_any_order(solved):
    """a_ecms asked for points out of order remembers what it was asked for last."""
    _, problem, points, _ = solved
    stepper = a_ecms.start_on(problem, points.problem, 0.5)
    first = [stepper.decide(row, problem.start_j, 0) for row in (5, 60, 5)]
    assert all(points.problem.table.feasible[r, c] for r, c in zip((5, 60, 5), first, strict=True))
    assert stepper.memory.row == 5


class Failing:
    """A stepper that fails at its third decision."""

    def __init__(self, stepper, fault):
        self.stepper, self.fault, self.asked = stepper, fault, 0

    def decide(self, k, energy_j, mode):
        self.asked += 1
        if self.asked == 3:
            raise self.fault
        return self.stepper.decide(k, energy_j, mode)


@pytest.mark.parametrize("engine_model", ["map", "mean_value"])
def test_what_goes_wrong_in_a_decision_ends_the_loop_and_comes_out_of_it(
    urban, solved, engine_model
):
    car, problem, points, trajectory = solved
    held = with_holding(points.problem)
    for fault in (InfeasibleError("nothing left"), KeyboardInterrupt(), ZeroDivisionError("own")):
        stepper = Failing(a_ecms.start_on(problem, held, 0.5), fault)
        decider = Decider("failing", stepper, points.problem, points, Asking())
        with pytest.raises(type(fault)) as told:
            follow_asked(car, urban, decider, trajectory, step_s=0.05, engine_model=engine_model)
        assert stepper.asked == 3
        if isinstance(fault, InfeasibleError):
            assert "failing: no decision at t = 1 s, gear 1" in str(told.value)


@pytest.mark.parametrize(
    ("asking", "words"),
    [
        (Asking(interval_s=0.0), "decisions every 0 s; allowed: 0.02 to 10 s"),
        (Asking(interval_s=float("nan")), "decisions every nan s"),
        (Asking(dwell_s=-1.0), "dwell -1 s; allowed: 0 to 60 s"),
    ],
)
def test_what_no_strategy_can_be_asked_is_refused(urban, asking, words):
    with pytest.raises(DataError, match=words):
        drive(load_architecture("C2"), urban, "a_ecms", asking=asking)
