"""Torque converters driven: their launch against solve_ivp, energy, steady speed, lock-up, creep and stall."""

from functools import cache
from math import pi

import numpy as np
import pytest
from forward.drives import constant, ramp
from forward.plants import ENGINE_KGM2, RADIUS_M, RATIO, body, inputs, one_gear, run, standing
from forward.test_free import OPEN_LOOP, hill
from powertrain.test_torque_converter import (
    AUTOMATIC,
    GEARS,
    IDLE,
    LOCKS,
    MULTIPLE,
    RADIUS,
    TAKEN,
    between,
    torques,
)
from powertrain.test_torque_converter import RATIO as SPEED_RATIO
from scipy.integrate import solve_ivp

from hevopt import build_problem, load_architecture, simulate
from hevopt.car._converter_kernels import passed
from hevopt.car.handling import Handling, Tyre
from hevopt.car.torque_converter import HydraulicConverter
from hevopt.driving.cycle import Cycle
from hevopt.forward._rows_kernels import Fluid
from hevopt.forward.commanded import CommandedCar, Commands
from hevopt.forward.lines import line_of
from hevopt.forward.performance import performance
from hevopt.forward.plans import replay_of
from hevopt.forward.run import follow
from hevopt.strategies import STRATEGIES
from hevopt.studies.driven import drive

MASS_KG, LAG_S, R0_N, R2, EFFICIENCY, END_S = 1328.0, 0.03, 115.0, 0.4, 0.95, 8.0
DATA = HydraulicConverter(
    np.array(SPEED_RATIO, dtype=float), np.array(MULTIPLE, dtype=float),
    np.array(TAKEN) / (2000 * pi / 30) ** 2,
)  # fmt: skip
REAL = ("camry_2018", "colorado_diesel_2019", "s60_b5_2022")


def automatic(name="A", **changes):
    return load_architecture(name, (AUTOMATIC if name in ("A", "B", "C1") else {}) | changes)


@cache
def planned(name, cycle=None):
    """(car, cycle, trajectory, plan) on the hill or on another cycle."""
    car, cycle = automatic(name), cycle or hill()
    problem = build_problem(car, cycle, allow_shortfall=True)
    strategy = "baseline" if name in ("A", *REAL[:2]) else "ecms"
    trajectory = simulate(problem, STRATEGIES[strategy].solve(problem).control)
    return car, cycle, trajectory, replay_of(trajectory, line_of(car))


@cache
def run_of(name, step_s=0.05):
    car, cycle, _, plan = planned(name)
    return follow(car, cycle, plan, step_s=step_s)


def engine_nm(time_s):
    """Pulling, lifted so far that the turbine overruns the impeller, pulling again."""
    return 42.0 if time_s < 4.0 else -40.0 if time_s < 5.5 else 35.0


def by_solve_ivp(at_s):
    """Speed of the car at some times, by curves in plain numbers, parted where the engine's torque jumps."""

    def slope(time_s, y, engine):
        v, force, n = y
        turbine = max(RATIO * v / RADIUS_M, 0.0)
        taken, given = torques(n, turbine) if turbine < n else (0.0, 0.0)
        wheel = given * RATIO * EFFICIENCY
        road = R0_N + R2 * v * v if v > 0 or force > R0_N else force
        return [
            (force - road) / MASS_KG,
            (wheel / RADIUS_M - force) / LAG_S,
            (engine - taken) / ENGINE_KGM2,
        ]

    y, found = [0.0, 0.0, IDLE], []
    for begin, end in ((0.0, 4.0), (4.0, 5.5), (5.5, END_S)):
        done = solve_ivp(slope, (begin, end), y, args=(engine_nm(begin),), rtol=1e-9, atol=1e-10, max_step=0.01,
                         dense_output=True, method="LSODA")  # fmt: skip
        found.append((begin, end, done.sol))
        y = done.y[:, -1]
    return np.array([next(sol(s)[0] for a, b, sol in found if a <= s <= b) for s in at_s])


def test_a_launch_an_overrun_and_a_pull_agree_with_solve_ivp():
    fluid = Fluid(DATA.pieces, np.array([False]), np.inf, True)
    ways = one_gear(EFFICIENCY)._replace(fluid=fluid)
    car = body((R0_N, 0, 0, 0), (0, 0, R2, 0), lag_s=LAG_S)._replace(equivalent_kg=MASS_KG)

    def acting(time_s, state):
        return inputs(engine_nm=engine_nm(time_s + 1e-9), flows=True)

    at_s = np.linspace(0.1, END_S - 0.01, 60)
    theirs = by_solve_ivp(at_s)
    for step_s, within in ((0.001, 1e-3), (0.01, 1e-2)):
        states, outputs = run(
            car, ways, standing(side_radps=IDLE), acting, step_s, round(END_S / step_s)
        )
        ours = np.interp(at_s, step_s * np.arange(len(states)), [s.speed_mps for s in states])
        assert np.abs(ours - theirs).max() < within and ours[-1] > 5
    # It multiplies first, and passes nothing where the turbine is the faster one.
    assert outputs[5].turbine_nm > 1.8 * outputs[5].impeller_nm > 0
    assert outputs[round(5.4 / 0.01)].turbine_nm == 0 < states[-1].side_radps


def test_the_compiled_torques_are_those_of_the_curves_and_their_slopes():
    pieces, step = DATA.pieces, 1e-5
    for impeller, ratio in (
        (90.0, 0.0),
        (150.0, 0.33),
        (300.0, 0.72),
        (200.0, 0.97),
        (200.0, 0.999),
    ):
        turbine = ratio * impeller
        found = passed(pieces, impeller, turbine)
        taken, given = DATA.torques_nm(np.array([impeller]), np.array([turbine]))
        assert found.taken_nm == pytest.approx(taken[0], rel=1e-12)
        assert found.given_nm == pytest.approx(given[0], rel=1e-12)
        around = [passed(pieces, impeller + d, turbine) for d in (-step, step)]
        slope = (around[1].taken_nm - around[0].taken_nm) / (2 * step)
        assert found.taken_per_p == pytest.approx(slope, rel=1e-5)
        slope = (around[1].given_nm - around[0].given_nm) / (2 * step)
        assert found.given_per_p == pytest.approx(slope, rel=1e-5)
        if ratio > 0:
            around = [passed(pieces, impeller, turbine + d) for d in (-step, step)]
            slope = (around[1].given_nm - around[0].given_nm) / (2 * step)
            assert found.given_per_t == pytest.approx(slope, rel=1e-5)
    assert passed(pieces, 100.0, 100.0) == passed(pieces, 0.0, 10.0) == (0.0,) * 6


@pytest.mark.parametrize("name", ["A", "C1", *REAL])
def test_every_component_balances_and_the_trace_is_kept(name):
    driven, (car, _, trajectory, _) = run_of(name), planned(name)
    assert max(driven.residual.values()) < 1e-9
    assert driven.quality.violations == () and 3.6 * driven.quality.speed_error_mps < 0.25
    flows = driven.books.flows
    assert flows["torque_converter_loss_w"].min() > -1e-9 < flows["torque_converter_loss_w"].max()
    assert flows["brake_power_w"].min() > -1e-6
    parts = [flows[f"clutch_{cause}_w"] for cause in ("launch", "change", "start", "other")]
    whole = sum(parts) + flows["torque_converter_loss_w"]
    assert whole == pytest.approx(flows["clutch_loss_w"], abs=1e-6)
    price = 7e-8 * (driven.energy_j[-1] - trajectory.end_j)  # [E] an engine of a third
    # A free gear is changed every second by the plan, which no lever is: 34 changes of 47 are driven.
    within = 0.05 if car.gear == "free" else 0.01
    assert driven.fuel_kg - price == pytest.approx(trajectory.total_fuel_kg, rel=within)


@pytest.mark.parametrize(("step_s", "within"), [(0.1, 1e-3), (0.05, 1e-3), (0.01, 2e-4)])
def test_the_length_of_the_step_hardly_moves_fuel(step_s, within):
    assert run_of("A", step_s).fuel_kg == pytest.approx(run_of("A", 0.02).fuel_kg, rel=within)
    assert max(run_of("A", step_s).residual.values()) < 1e-9


@pytest.mark.parametrize(
    ("name", "speed_kmh"), [("A", 12), ("A", 22), ("A", 100), ("camry_2018", 40)]
)
def test_at_constant_speed_all_flows_are_those_of_the_backward_step(name, speed_kmh):
    """Creeping, slipping, locked."""
    car, cycle, trajectory, plan = planned(name, constant(speed_kmh, 90))
    driven = follow(car, cycle, plan, step_s=0.05, handling=OPEN_LOOP)
    backward = trajectory.flows
    for flow in (
        "engine_torque_nm", "engine_speed_radps", "fuel_power_w", "machine_torque_nm", "gearbox_loss_w",
        "clutch_loss_w", "brake_power_w", "wheel_power_w",
    ):  # fmt: skip
        found, expected = driven.books.flows[flow][-1], backward[flow][-1]
        assert found == pytest.approx(expected, rel=1e-9, abs=1e-6), flow


def test_it_is_locked_where_gear_and_speed_say_so():
    driven, car = run_of("A", 0.02), planned("A")[0]
    flows = driven.books.flows
    wheel = flows["speed_mps"] / RADIUS
    ratio = np.array(GEARS)[driven.gear]
    locked = np.abs(flows["engine_speed_radps"] - ratio * wheel) < 1e-6
    asked = (driven.gear >= 2) & (ratio * wheel > LOCKS)
    # Away from changes, and from the ends of each stretch.
    calm = np.convolve(np.abs(np.diff(asked, prepend=False)) + np.abs(np.diff(driven.gear, prepend=1)) > 0,
                       np.ones(121), "same") < 0.5  # fmt: skip
    assert (locked == asked)[calm & (driven.engine == 2)].all()
    assert locked[calm].any() and not locked[calm & (flows["speed_mps"] > 1)].all()
    assert car.driveline.converter.data.lock_up_gear == 2


def test_standing_in_gear_takes_what_the_turbine_at_rest_takes():
    stands = Cycle("stands", np.arange(11.0), np.zeros(11), np.zeros(11))
    burnt = {}
    for at_rest in ("in_gear", "neutral"):
        car = automatic("A", **{"gearbox.torque_converter.at_rest": at_rest})
        problem = build_problem(car, stands)
        control = STRATEGIES["baseline"].solve(problem).control
        plan = replay_of(simulate(problem, control), line_of(car))
        driven = follow(car, stands, plan, step_s=0.05)
        assert driven.time_s[-1] == 10.0
        flows, burnt[at_rest] = driven.books.flows, driven.fuel_kg
        taken = flows["torque_converter_loss_w"][-1] / IDLE
        expected = torques(IDLE, 0.0)[0] if at_rest == "in_gear" else 0.0
        assert taken == pytest.approx(expected, rel=1e-9)
        assert (
            np.abs(driven.books.residuals["driveline"]).max() < 1e-9 and not driven.speed_mps.any()
        )
    assert burnt["in_gear"] > 1.2 * burnt["neutral"]


def test_full_pedal_starts_at_the_stall_of_engine_and_converter():
    car = automatic()
    found = performance(car)
    side = np.linspace(IDLE, 400.0, 200_001)
    load_nm = -car.machines[0].generating_nm(car.vehicle.auxiliary_power_w, side)
    over = TAKEN[0] * (side / (2000 * pi / 30)) ** 2 - car.engine.covered_nm(side) + load_nm
    stall = side[np.argmax(over >= 0)]
    force = 0.93 * GEARS[1] / RADIUS * MULTIPLE[0] * TAKEN[0] * (stall / (2000 * pi / 30)) ** 2
    assert found.curves.by_gear_n[0, 0] == pytest.approx(force, rel=0.01)
    # At rest the engine has run up to near the stall before the car is fast.
    assert found.trace[40, 4] == pytest.approx(stall, rel=0.1)
    by_clutch = performance(load_architecture("A"))
    assert (
        found.curves.by_gear_n[0, 0] > 1.3 * by_clutch.curves.by_gear_n[0, 0] * GEARS[1] / 13.8244
    )
    assert 8.0 < found.to_speed_s[100] < 12.0 and found.start_slope > 0.3


@pytest.mark.parametrize("name", REAL)
def test_real_automatics_are_floored(name):
    found = performance(automatic(name))
    assert found.to_speed_s[100] is not None and max(found.top_mps.values()) > 40
    assert (np.nan_to_num(found.curves.by_gear_n, nan=1.0) > 0).any(axis=1).all()


def test_a_car_under_commands_creeps_off_and_is_held():
    unit = CommandedCar(automatic())
    unit.advance(Commands(hold=True), 100)
    assert unit.speed_mps == 0
    unit.advance(Commands(force_n=600.0), 200)
    assert unit.speed_mps > 0.3


def test_it_drives_on_tyres_that_slip():
    car, cycle, plan = (planned("A", ramp(8.0, 10.0, 25))[n] for n in (0, 1, 3))
    driven = follow(car, cycle, plan, step_s=0.02, handling=Handling(Tyre(slips=True)))
    rolls = follow(car, cycle, plan, step_s=0.02)
    assert max(driven.residual.values()) < 1e-9 and driven.quality.violations == ()
    assert driven.fuel_kg == pytest.approx(rolls.fuel_kg, rel=0.02)


def test_a_strategy_that_decides_is_asked_on_the_way():
    found = drive(automatic("C1"), hill(), "a_ecms", step_s=0.05)
    assert found.asked is not None and max(found.run.residual.values()) < 1e-9
    assert found.run.quality.violations == ()


def test_a_gear_chosen_to_coast_is_no_change_of_gear():
    """Backward a free gear may be the first one at any speed, in which the converter is overrun: the car coasts."""
    car, _, trajectory, plan = planned("camry_2018")
    coasts = plan.open_while == 3
    assert coasts.any()
    gear = line_of(car).gears[plan.way]
    assert (gear[coasts] >= 1).all() and gear[coasts].mean() > 2
    assert between(1.0, SPEED_RATIO, TAKEN) == 0
    assert np.allclose(trajectory.flows["engine_speed_radps"][coasts], car.engine.idle_radps)
