"""Tyres that slip: peak, relaxation, books, the limit of stiff tyres, and every step from 1 to 100 ms."""

from math import exp

import numpy as np
import pytest
from forward.drives import follow, ramp
from forward.plants import RADIUS_M, body, inputs, one_gear, run, standing
from hypothesis import given, settings
from hypothesis import strategies as st

from hevopt import DataError, build_problem, load_architecture, performance
from hevopt.car.handling import Handling, Tyre
from hevopt.forward._contact_kernels import grip_n, pacejka_share, pacejka_slope
from hevopt.forward._slip_kernels import DRIVEN_SHARE, ground_of, tyre_force_n
from hevopt.forward.commanded import CommandedCar, Commands
from hevopt.forward.lines import line_of
from hevopt.forward.plans import replay_of
from hevopt.forward.run import loop_car
from hevopt.problem.simulation import simulate
from hevopt.strategies import STRATEGIES

STEPS_S = (0.1, 0.01, 0.001)
SLIPS = Handling(Tyre(slips=True))


def test_the_formulas_slope_is_its_derivative():
    tyre = Tyre(stiffness=8.0, shape=1.6, curvature=-0.5)
    for slip in (-0.4, -0.05, 0.0, 0.02, 0.13, 0.9):
        by_difference = pacejka_share(slip + 1e-6, tyre) - pacejka_share(slip - 1e-6, tyre)
        assert pacejka_slope(slip, tyre) == pytest.approx(by_difference / 2e-6, abs=1e-6)


def test_the_peak_of_the_force_is_the_grip_limit():
    """Equation (4), load transfer included; the masses differ by the driven wheels, which turn apart."""
    car = body((115, 0, 0, 0), slips=True)
    ground = ground_of(standing(), inputs(), car)
    peak = max(tyre_force_n(slip, ground, car)[0] for slip in np.linspace(0, 1, 4001))
    apart = car._replace(equivalent_kg=ground.free_kg)
    assert peak == pytest.approx(grip_n(115.0, 0.0, apart), rel=1e-6)
    assert peak == pytest.approx(grip_n(115.0, 0.0, car), rel=2e-3)


def pulls(torque_nm, car, step_s, seconds=3.0, start=None):
    """A slipping clutch that passes a torque, the engine held at a speed."""

    def acting(time_s, state):
        return inputs(
            engine_nm=torque_nm, governed_radps=500.0, low_nm=-100.0, high_nm=900.0, capacity_nm=torque_nm
        )  # fmt: skip

    begins = start or standing(side_radps=500.0)
    return run(car, one_gear(), begins, acting, step_s, round(seconds / step_s))


@pytest.mark.parametrize("step_s", STEPS_S)
def test_a_steady_pull_settles_at_the_slip_that_its_force_asks_for(step_s):
    car = body(slips=True)
    states, outputs = pulls(60.0, car, step_s)
    last, force = states[-1], outputs[-1].force_n
    spin = last.spin_radps * RADIUS_M / last.speed_mps
    # Slip holds while the car speeds up: what the relaxation still lacks is length x change of slip.
    assert last.slip == pytest.approx(spin, rel=2e-3)
    assert force == pytest.approx(tyre_force_n(last.slip, ground_of(last, inputs(), car), car)[0])
    per_s = (states[-1].speed_mps - states[-2].speed_mps) / step_s
    assert force == pytest.approx((car.equivalent_kg - DRIVEN_SHARE * 28.0) * per_s, rel=1e-9)


def test_slip_builds_up_in_the_relaxation_length():
    """At constant speed and spin  slip = spin/v (1 - exp(-way/length)); without friction both stay."""
    car = body(slips=True, friction=1e-9)
    spin = 0.02 * 10.0 / RADIUS_M
    start = standing(10.0, 500.0)._replace(spin_radps=spin)
    states, _ = run(car, one_gear(), start, lambda t, s: inputs(), 0.0001, 200)
    for k in (50, 200):
        way = 10.0 * 0.0001 * k
        assert states[k].slip == pytest.approx(0.02 * (1 - exp(-way / 0.25)), rel=0.02)


@pytest.mark.parametrize("step_s", STEPS_S)
def test_powers_add_up_and_what_slides_is_lost(step_s):
    car = body((115, 0.6, 0, 0), (0, 0, 0.4, 0), slips=True)
    states, outputs = pulls(95.0, car, step_s)
    braked, more = run(
        car, one_gear(), states[-1], lambda t, s: inputs(brake_nm=1500.0), step_s, round(4 / step_s)
    )
    states, outputs = states + braked[1:], outputs + more
    v = np.array([s.speed_mps for s in states])
    w = v / RADIUS_M + np.array([s.spin_radps for s in states])
    of = {name: np.array([getattr(o, name) for o in outputs]) for name in outputs[0]._fields}
    v_mean, w_mean = (v[1:] + v[:-1]) / 2, (w[1:] + w[:-1]) / 2
    driven = DRIVEN_SHARE * 28.0
    kinetic = ((car.equivalent_kg - driven) * v**2 + driven * (RADIUS_M * w) ** 2) / 2
    tyre = of["force_n"] * (RADIUS_M * w_mean - v_mean)
    brake = (of["brake_nm"] - of["held_nm"]) * v_mean / RADIUS_M
    rest = (
        of["wheel_nm"] * w_mean - tyre - brake - of["road_n"] * v_mean - np.diff(kinetic) / step_s
    )
    assert np.abs(rest).max() < 1e-8 * np.abs(of["wheel_nm"] * w_mean).max()
    slides = v[1:] * of["force_n"] * np.array([s.slip for s in states[1:]])
    assert slides.min() >= 0 and v[-1] == 0 and (v >= 0).all()
    # Bent tyres give back what they took, but for what the implicit step damps.
    bent = np.sum(tyre - slides) * step_s
    assert -0.05 * np.sum(slides) * step_s < bent < 0.25 * np.sum(slides) * step_s


def test_a_wheel_that_gets_too_much_spins_and_the_car_goes_on_by_less_than_the_peak():
    car = body(slips=True)
    states, outputs = pulls(399.0, car, 0.01, 1.0)
    peak = grip_n(0.0, 0.0, car)
    assert outputs[-1].force_n < 0.95 * peak and max(o.force_n for o in outputs) < 1.003 * peak
    assert states[-1].slip > 0.5 and states[-1].speed_mps > 2


@settings(max_examples=40, deadline=None)
@given(
    step_s=st.floats(0.001, 0.1), torque=st.floats(-300, 400), brake=st.floats(0, 4000), slope=st.floats(-0.2, 0.2),
    stiffness=st.floats(5, 100), length=st.floats(0.01, 2), speed=st.floats(0, 50), spin=st.floats(-5, 20),
)  # fmt: skip
def test_whatever_comes_the_step_is_finite_and_never_slides_for_nothing(
    step_s, torque, brake, slope, stiffness, length, speed, spin
):
    car = body(
        (115, 0.6, 0, 0), (0, 0, 0.4, 0), slips=True, stiffness=stiffness, relaxation_m=length
    )
    begins = standing(speed, 200.0)._replace(spin_radps=max(spin, -speed / RADIUS_M))

    def acting(time_s, state):
        off = time_s > 15 * step_s
        return inputs(engine_nm=0.0 if off else torque, capacity_nm=0.0 if off else 300.0, brake_nm=brake * off,
                      slope_rad=slope)  # fmt: skip

    states, outputs = run(car, one_gear(0.95), begins, acting, step_s, 30)
    for state, out in zip(states[1:], outputs, strict=True):
        assert np.isfinite([*state, *out]).all() and state.speed_mps >= 0
        assert out.force_n * state.slip >= 0 and out.brake_nm >= 0 and out.held_nm >= 0


@pytest.fixture(scope="module")
def planned():
    """(car, road, plan) of C2 by name."""

    def plan_of(name, road):
        car = load_architecture(name)
        problem = build_problem(car, road, allow_shortfall=True)
        strategy = "baseline" if name == "A" else "dp"
        control = STRATEGIES[strategy].solve(problem).control
        return car, road, replay_of(simulate(problem, control), line_of(car))

    road = ramp(18, 12, 40, grade=0.01)
    return {name: plan_of(name, road) for name in ("A", "D", "E")}


@pytest.mark.parametrize("name", ["A", "D", "E"])
def test_a_driven_trace_closes_its_books_at_every_step(planned, name):
    fuels = []
    for step_s in (0.1, 0.02, 0.002):
        run_ = follow(*planned[name], step_s=step_s, handling=SLIPS)
        flows = run_.books.flows
        assert max(run_.residual.values()) < 1e-9 and not run_.missed
        assert flows["tyre_slip_w"].min() >= 0 and not flows["tyre_lag_w"].any()
        assert np.sum(flows["tyre_slip_w"] + flows["tyre_spring_w"]) > 0
        fuels.append(run_.fuel_kg - 6.2e-8 * (run_.energy_j[-1] - run_.energy_j[0]))
    assert fuels[1] == pytest.approx(fuels[2], rel=2e-3)
    assert fuels[0] == pytest.approx(fuels[2], rel=1e-2)


def test_ever_stiffer_tyres_drive_as_those_that_roll(planned):
    rolls = follow(*planned["A"], step_s=0.01, handling=Handling(Tyre(lag_s=0.0)))
    off = []
    for stiffness, length in ((10.0, 0.25), (30.0, 0.1), (100.0, 0.01)):
        tyre = Tyre(slips=True, stiffness=stiffness, relaxation_m=length)
        slips = follow(*planned["A"], step_s=0.01, handling=Handling(tyre))
        off.append(slips.fuel_kg / rolls.fuel_kg - 1)
    assert off[0] > off[1] > off[2] > 0 and off[2] < 1e-3


def test_a_floored_car_is_slower_on_tyres_that_slip():
    rolls = performance(load_architecture("A"))
    slips = performance(load_architecture("A", {"tyre.law": "pacejka"}))
    assert 1.0 < slips.to_speed_s[100] / rolls.to_speed_s[100] < 1.08
    assert slips.top_mps == rolls.top_mps and slips.start_slope == rolls.start_slope


def test_a_car_under_commands_slips_as_well():
    car = CommandedCar(load_architecture("A", {"tyre.law": "pacejka"}))
    for _ in range(100):
        moved = car.advance(Commands(1500.0), 2)
        assert max(abs(r).max() for r in moved.books.residuals.values()) < 1e-6
    assert 0.005 < moved.record[-1, 22] < 0.1 and car.speed_mps > 1


@pytest.mark.parametrize(
    ("changes", "fault"),
    [
        ({"tyre.law": "slip"}, "tyre.law = 'slip'.*allowed: 'lag' or 'pacejka'"),
        (
            {"tyre.stiffness": 12},
            "stiffness: not read with law 'lag'; leave it out, or give law = \"pacejka\"",
        ),
        ({"tyre.law": "pacejka", "tyre.lag_s": 0.1}, "lag_s: not read with law 'pacejka'"),
        ({"tyre.law": "pacejka", "tyre.shape": 0.9}, "no peak up to a slip of 1; raise shape"),
        ({"tyre.law": "pacejka", "tyre.relaxation_m": 0}, "tyre.relaxation_m = 0.*0.01"),
    ],
)
def test_a_file_says_what_its_law_reads(changes, fault):
    with pytest.raises(DataError, match=fault):
        load_architecture("A", changes)


def test_tyres_slip_only_where_clutch_and_gears_drive_them():
    with pytest.raises(
        DataError, match="prius_1998: tyres that slip are for an engine behind clutch and gears"
    ):
        loop_car(load_architecture("prius_1998"), line_of(load_architecture("prius_1998")), SLIPS)


def test_tyres_without_a_peak_are_refused_from_python_too(planned):
    with pytest.raises(DataError, match="no peak up to a slip of 1"):
        follow(*planned["A"], handling=Handling(Tyre(slips=True, stiffness=0.5)))
