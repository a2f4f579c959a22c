"""Cars with several machines beside clutch and gears, driven: a belt machine and one on the other axle."""

from functools import cache

import numpy as np
import pytest
from forward.drives import constant
from forward.test_free import OPEN_LOOP, hill

from hevopt import build_problem, load_architecture, simulate
from hevopt.forward.lines import line_of
from hevopt.forward.performance import performance
from hevopt.forward.plans import replay_of
from hevopt.forward.run import follow
from hevopt.problem.battery import power_limits_w
from hevopt.strategies import STRATEGIES
from hevopt.studies.driven import drive

P0_P4 = "p0_p4_diesel"
TORQUES = ("machine_torque_nm", "machine_2_torque_nm")


@cache
def planned(changes=()):
    """(car, cycle, trajectory, plan) of ecms on the hill."""
    car, cycle = load_architecture(P0_P4, dict(changes)), hill()
    problem = build_problem(car, cycle, allow_shortfall=True)
    trajectory = simulate(problem, STRATEGIES["ecms"].solve(problem).control)
    return car, cycle, trajectory, replay_of(trajectory, line_of(car))


@pytest.fixture(scope="module")
def run():
    car, cycle, _, plan = planned()
    return follow(car, cycle, plan, step_s=0.05)


def test_every_component_balances_and_the_trace_is_kept(run):
    assert max(run.residual.values()) < 1e-9
    assert run.quality.violations == () and 3.6 * run.quality.speed_error_mps < 0.2
    flows, (_, most) = run.books.flows, power_limits_w(run.car.battery)
    assert flows["battery_power_w"].max() <= most * (1 + 1e-3)
    assert flows["brake_power_w"].min() > -1e-6 and flows["machine_2_torque_nm"].min() < -10.0
    # With the engine at rest nothing turns the machine on its belt.
    rests = run.engine == 0
    assert rests.any() and not flows["machine_torque_nm"][rests].any()


def test_the_machine_on_the_axle_has_what_the_others_leave():
    assert line_of(load_architecture(P0_P4)).order == (1, 0)


def test_a_plan_is_kept_but_for_what_its_engine_takes_to_start(run):
    trajectory = planned()[2]
    corrected = run.fuel_kg - 7e-8 * (
        run.energy_j[-1] - trajectory.end_j
    )  # [E] an engine of a third
    assert corrected == pytest.approx(trajectory.total_fuel_kg, rel=0.02)


@pytest.mark.parametrize("signs", [(-1, 1), (-1, -1)])
def test_at_constant_speed_all_flows_are_those_of_the_backward_step(signs):
    """Controls in which both machines act, the belt machine's torque and the axle's of given signs."""
    car, cycle = load_architecture(P0_P4), constant(70, 60)
    problem = build_problem(car, cycle, levels=9)
    flows, table = problem.table.flows, problem.table
    torques = [flows[name][-1] for name in TORQUES]
    fits = np.array(table.feasible[-1])
    for sign, torque in zip(signs, torques, strict=True):
        fits &= sign * torque > 2.0
    control = int(np.flatnonzero(fits)[0])
    trajectory = simulate(problem, np.full(len(table.step_s), control))
    found = follow(car, cycle, replay_of(trajectory, line_of(car)), step_s=0.05, handling=OPEN_LOOP)
    for flow in (
        "engine_torque_nm", "fuel_power_w", *TORQUES, "machine_2_speed_radps", "machine_electric_w",
        "gearbox_loss_w", "gear_loss_w", "wheel_power_w",
    ):  # fmt: skip
        expected = trajectory.flows[flow][-1]
        assert found.books.flows[flow][-1] == pytest.approx(expected, rel=1e-9, abs=1e-6), flow


def test_a_strategy_that_decides_is_asked_on_the_way():
    found = drive(load_architecture(P0_P4), hill(), "a_ecms", step_s=0.05)
    assert found.asked is not None and max(found.run.residual.values()) < 1e-9
    assert found.run.quality.violations == ()


def test_two_machines_are_faster_than_none_and_share_one_battery():
    car = load_architecture(P0_P4)
    alone, boosted = performance(car), performance(car, boosts=True)
    assert boosted.to_speed_s[100] < alone.to_speed_s[100] - 0.5
    assert (boosted.curves.by_gear_n >= alone.curves.by_gear_n)[
        ~np.isnan(alone.curves.by_gear_n)
    ].all()
    assert boosted.to_100_j > 0
