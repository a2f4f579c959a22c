"""The compiled step against closed forms: coasting, constant force, launch, lock, grip, stop."""

from math import atan, exp, inf, sqrt, tan

import numpy as np
import pytest
from forward.plants import (
    ENGINE_KGM2,
    IDLE_RADPS,
    RADIUS_M,
    RATIO,
    body,
    inputs,
    one_gear,
    run,
    standing,
)

from hevopt.car.handling import Clutch, Tyre
from hevopt.forward._contact_kernels import clutch_capacity_nm, pacejka_share

STEPS_S = (0.1, 0.01, 0.001)


def launch(car, ways, torque, step_s, seconds=4.0, engine_radps=IDLE_RADPS):
    """A launch with the engine held at its speed; clutch torque over time, locked where both sides meet."""

    def acting(time_s, state):
        return inputs(
            engine_nm=torque(time_s), governed_radps=engine_radps, low_nm=-100.0, high_nm=400.0,
            capacity_nm=torque(time_s),
        )  # fmt: skip

    start = standing(side_radps=engine_radps)
    return run(car, ways, start, acting, step_s, round(seconds / step_s))


def slip_loss_j(states, outputs, step_s):
    """Energy lost in the clutch."""
    slip = np.array([s.side_radps - RATIO * s.speed_mps / RADIUS_M for s in states])
    torque = np.array([o.clutch_nm for o in outputs])
    return float(np.sum(torque * (slip[1:] + slip[:-1]) / 2) * step_s)


@pytest.mark.parametrize("step_s", STEPS_S)
def test_a_coasting_car_follows_the_arctangent_law(step_s):
    r0, r2 = 115.0, 0.4
    car = body((r0, 0, 0, 0), (0, 0, r2, 0))
    states, _ = run(
        car, one_gear(), standing(30.0), lambda t, s: inputs(), step_s, round(20 / step_s)
    )
    rate = sqrt(r0 * r2) / car.equivalent_kg
    exact = sqrt(r0 / r2) * tan(atan(30 * sqrt(r2 / r0)) - rate * 20)
    assert states[-1].speed_mps == pytest.approx(exact, rel=1e-4)


@pytest.mark.parametrize("step_s", STEPS_S)
@pytest.mark.parametrize("lag_s", [0.0, 0.03, 0.2])
def test_speed_under_a_constant_torque_is_that_of_the_lag(lag_s, step_s):
    car = body(lag_s=lag_s)
    states, _ = launch(car, one_gear(), lambda t: 60.0, step_s, 2.0, engine_radps=500.0)
    force = 60 * RATIO / RADIUS_M
    exact = force / car.equivalent_kg * (2 - lag_s * (1 - exp(-2 / lag_s) if lag_s else 0))
    assert states[-1].speed_mps == pytest.approx(exact, rel=1e-12)


@pytest.mark.parametrize("step_s", [0.01, 0.001])
@pytest.mark.parametrize("torque", [lambda t: 40.0, lambda t: 20 + 40 * t], ids=["even", "rising"])
def test_clutch_loss_of_a_launch_is_half_the_cars_energy_at_the_clutch_whatever_the_torque(
    torque, step_s
):
    """Equation (15), where its assumptions hold: engine speed constant, no resistance, no loss in the gear."""
    car = body()
    states, outputs = launch(car, one_gear(), torque, step_s)
    assert outputs[-1].locked
    inertia = car.equivalent_kg * (RADIUS_M / RATIO) ** 2
    assert slip_loss_j(states, outputs, step_s) == pytest.approx(
        inertia * IDLE_RADPS**2 / 2, rel=1e-4
    )


def test_a_gear_that_loses_makes_the_launch_dearer_by_its_efficiency():
    """Design: 2843.6 J of 2701.4 J at 0.95, 850 rpm in first gear."""
    states, outputs = launch(body(), one_gear(0.95), lambda t: 45.0, 0.01)
    inertia = body().equivalent_kg * (RADIUS_M / RATIO) ** 2
    assert slip_loss_j(states, outputs, 0.01) == pytest.approx(
        inertia * IDLE_RADPS**2 / 2 / 0.95, rel=1e-4
    )


@pytest.mark.parametrize("step_s", STEPS_S)
def test_a_sudden_lock_keeps_momentum_and_loses_the_energy_of_the_difference(step_s):
    car, ways = body(friction=1e3, height_share=0.0), one_gear()
    start = standing(5.0, 400.0)
    states, outputs = run(car, ways, start, lambda t, s: inputs(capacity_nm=1e9), step_s, 1)
    inertia = car.equivalent_kg * (RADIUS_M / RATIO) ** 2
    before, after = [(s.side_radps, RATIO * s.speed_mps / RADIUS_M) for s in (start, states[-1])]
    assert after[0] == pytest.approx(after[1], rel=1e-14)
    momentum = ENGINE_KGM2 * before[0] + inertia * before[1]
    assert after[0] == pytest.approx(momentum / (ENGINE_KGM2 + inertia), rel=1e-12)
    reduced = ENGINE_KGM2 * inertia / (ENGINE_KGM2 + inertia)
    lost = reduced * (before[0] - before[1]) ** 2 / 2
    assert slip_loss_j([start, states[-1]], outputs, step_s) == pytest.approx(lost, rel=1e-12)


def test_a_clutch_too_weak_to_lock_slips_at_its_capacity():
    _, outputs = run(
        body(), one_gear(), standing(5.0, 400.0), lambda t, s: inputs(capacity_nm=50.0), 0.01, 3
    )
    assert [o.clutch_nm for o in outputs] == [50.0] * 3
    assert not any(o.locked for o in outputs)


def test_the_clutchs_highest_torque_is_equation_17():
    clutch = Clutch(slipping_nm=420, sticking_nm=380, slip_scale_radps=20)
    assert clutch_capacity_nm(0.0, clutch) == 380
    assert clutch_capacity_nm(20.0, clutch) == pytest.approx(420 - 40 / np.e)
    assert clutch_capacity_nm(1e9, clutch) == 420
    assert clutch_capacity_nm(-20.0, clutch) == clutch_capacity_nm(20.0, clutch)


def test_the_driven_axle_holds_what_friction_and_its_moved_load_hold():
    """Design: 4.28 m/s² = friction x share x g / (1 + friction x height over wheelbase)."""
    car = body()
    states, outputs = launch(car, one_gear(), lambda t: 399.0, 0.01, 0.5)
    car_mps2 = np.diff([s.speed_mps for s in states]) / 0.01
    held = 0.85 * 0.6 * 9.80665 / (1 + 0.85 * 0.2)
    assert held == pytest.approx(Tyre().grip_mps2) == pytest.approx(4.28, abs=0.01)
    # Rotating wheels need force as well: the car itself accelerates a little less.
    share = car.mass_kg / car.equivalent_kg
    expected = 0.85 * 0.6 * 9.80665 * share / (1 + 0.85 * 0.2 * share)
    assert car_mps2 == pytest.approx(np.full(50, expected), rel=1e-9)
    assert outputs[10].brake_nm > 0


@pytest.mark.parametrize("step_s", STEPS_S)
@pytest.mark.parametrize("lag_s", [0.0, 0.03])
def test_a_braked_car_stops_and_stands(lag_s, step_s):
    car = body((115, 0, 0, 0), lag_s=lag_s)
    states, outputs = run(
        car,
        one_gear(),
        standing(5.0),
        lambda t, s: inputs(brake_nm=900.0),
        step_s,
        round(4 / step_s),
    )
    speed = np.array([s.speed_mps for s in states])
    assert (speed >= 0).all() and (np.diff(speed) <= 0).all() and speed[-1] == 0
    assert all(o.brake_nm >= 0 and o.held_nm >= 0 for o in outputs)
    stop_s = np.argmax(speed == 0) * step_s
    assert stop_s == pytest.approx(5 * car.equivalent_kg / (900 / RADIUS_M + 115), abs=0.1 + step_s)


def test_a_car_that_stopped_can_start_again_at_a_step_of_a_thousandth():
    car = body((115, 0, 0, 0), lag_s=0.03)
    states, _ = run(
        car, one_gear(), standing(1.0), lambda t, s: inputs(brake_nm=900.0), 0.001, 1000
    )
    moved, _ = run(
        car, one_gear(), states[-1], lambda t, s: inputs(
            engine_nm=30.0, governed_radps=IDLE_RADPS, low_nm=0.0, high_nm=100.0, capacity_nm=30.0
        ), 0.001, 1000,
    )  # fmt: skip
    assert states[-1].speed_mps == 0 and moved[-1].speed_mps > 0.5


def test_a_car_on_a_slope_is_held_and_moves_off_when_the_clutch_pulls_enough():
    slope = np.arctan(0.10)
    car = body((115, 0, 0, 0))
    needed_nm = (car.mass_kg * 9.80665 * np.sin(slope) + 115 * np.cos(slope)) * RADIUS_M / RATIO

    def acting(time_s, state):
        torque = 1.2 * needed_nm * min(time_s / 2, 1.0)
        return inputs(
            slope_rad=slope, engine_nm=torque, governed_radps=IDLE_RADPS, low_nm=0.0, high_nm=400.0,
            capacity_nm=torque,
        )  # fmt: skip

    states, outputs = run(car, one_gear(), standing(), acting, 0.01, 300)
    speed = np.array([s.speed_mps for s in states])
    assert (speed >= 0).all() and speed[-1] > 0.2
    moves_s = np.argmax(speed > 0) * 0.01
    assert moves_s == pytest.approx(2 / 1.2, abs=0.03)
    assert outputs[0].held_nm == pytest.approx(car.mass_kg * 9.80665 * np.sin(slope) * RADIUS_M)


@pytest.mark.parametrize("machine_nm", [90.0, -90.0])
@pytest.mark.parametrize("step_s", STEPS_S)
def test_what_units_give_is_in_kinetic_energy_losses_and_the_road(machine_nm, step_s):
    car, ways = (
        body((115, 0.6, 0, 0), (0, 0, 0.4, 0), lag_s=0.03),
        one_gear(0.95, machine_kgm2=0.07),
    )
    rate = RATIO / RADIUS_M

    def acting(time_s, state):
        return inputs(
            machine_nm=np.array([machine_nm]), engine_nm=40.0 - 60 * time_s, capacity_nm=30.0,
            brake_nm=100.0,
        )  # fmt: skip

    states, outputs = run(car, ways, standing(8.0, 300.0), acting, step_s, round(1 / step_s))
    v = np.array([s.speed_mps for s in states])
    n = np.array([s.side_radps for s in states])
    v_mean, n_mean = (v[1:] + v[:-1]) / 2, (n[1:] + n[:-1]) / 2
    of = {name: np.array([getattr(o, name) for o in outputs]) for name in outputs[0]._fields}
    kinetic = (car.equivalent_kg * v**2 + ENGINE_KGM2 * n**2 + 0.07 * (rate * v) ** 2) / 2
    net = machine_nm - 0.07 * rate * np.diff(v) / step_s
    into_gear = (net + of["clutch_nm"]) * rate * v_mean
    gear = np.where(into_gear > 0, 0.05 * into_gear, into_gear * (1 - 1 / 0.95))
    slip = of["clutch_nm"] * (n_mean - rate * v_mean)
    brake = of["brake_nm"] * v_mean / RADIUS_M
    lag = (of["wheel_nm"] / RADIUS_M - of["force_n"]) * v_mean
    given = of["engine_nm"] * n_mean + machine_nm * rate * v_mean
    rest = given - gear - slip - brake - lag - of["road_n"] * v_mean - np.diff(kinetic) / step_s
    assert np.abs(rest).max() < 1e-9 * np.abs(given).max()
    assert slip.min() > -1e-9 and gear.min() >= 0


def test_twice_the_car_with_twice_the_torques_drives_the_same_trace():
    one, _ = launch(body((115, 0, 0, 0)), one_gear(), lambda t: 40.0, 0.01)
    double = body((230, 0, 0, 0), mass_kg=2600.0)._replace(equivalent_kg=2 * body().equivalent_kg)
    two, _ = launch(double, one_gear(engine_kgm2=2 * ENGINE_KGM2), lambda t: 80.0, 0.01)
    assert [s.speed_mps for s in two] == pytest.approx([s.speed_mps for s in one], rel=1e-12)


def test_the_magic_formula_rises_peaks_and_is_odd():
    tyre = Tyre()
    slips = np.linspace(0, 1, 401)
    force = np.array([pacejka_share(s, tyre) for s in slips])
    slope = tyre.stiffness * tyre.shape
    assert force[1] == pytest.approx(slope * slips[1], rel=0.01)
    assert force.max() == pytest.approx(1, abs=1e-3) and force[-1] < 1
    assert pacejka_share(-0.1, tyre) == -pacejka_share(0.1, tyre)


def test_a_governed_engine_gives_no_more_than_its_limits():
    states, outputs = run(
        body(), one_gear(), standing(0.0, IDLE_RADPS), lambda t, s: inputs(
            governed_radps=3 * IDLE_RADPS, low_nm=-20.0, high_nm=100.0
        ), 0.01, 10,
    )  # fmt: skip
    assert outputs[0].engine_nm == 100
    assert states[1].side_radps == pytest.approx(IDLE_RADPS + 0.01 * 100 / ENGINE_KGM2)
    _, slowing = run(
        body(), one_gear(), standing(0.0, 300.0), lambda t, s: inputs(
            governed_radps=IDLE_RADPS, low_nm=-20.0, high_nm=inf
        ), 0.01, 1,
    )  # fmt: skip
    assert slowing[0].engine_nm == -20
