"""The engine as a whole: balances, steady states, scaling laws, limits, and the guard on the step."""

from math import exp, pi

import numpy as np
import pytest
from diesels import RAMP, cruising, in_gear, shipped
from hypothesis import given, settings
from hypothesis import strategies as draw
from plain_engine import PlainCar

from hevopt import DataError, SolverError
from hevopt.files.lookup import shipped_folder
from hevopt.mean_value import settle
from hevopt.mean_value import states as s
from hevopt.mean_value._cylinder_kernels import work_per_fuel
from hevopt.mean_value._run_kernels import TABLEAUX, march, observe, rates
from hevopt.mean_value.balances import balances
from hevopt.mean_value.car import BENCH, cruise, model_of
from hevopt.mean_value.parameters import FULL_LOAD, SMOKE, Drive, Gas, curve_of, with_curve
from hevopt.mean_value.run import simulate
from hevopt.mean_value.scaling import scaled
from hevopt.mean_value.settle import held, steady_state
from hevopt.mean_value.stability import eigenvalues, longest_step_s, scales

RPM = 2 * pi / 60
NAMES = ("compact_1300", "A")


def told(model, y) -> dict[str, float]:
    """Signals of one state."""
    return dict(zip(s.SIGNALS, observe(np.zeros(1), y[None], model)[0], strict=True))


def bench(name="compact_1300"):
    return held(model_of(shipped(name).diesel, BENCH))


def with_engine(model, **parts):
    return model._replace(engine=model.engine._replace(**parts))


def test_a_second_implementation_in_plain_python_gives_the_same_tip_in():
    engine = shipped_folder("architectures") / "components" / "engine_diesel_1300.toml"
    plain = PlainCar(engine, 1300.0, 2.4, 0.3054, 0.011, 5e-5, 0.71, 1.19, 0.96 * 3.74, 0.95)
    y = cruising("compact_1300", 4, 40.0)
    plain.hold = plain.road(40 / 3.6) / plain.k / plain.eta
    at_rest = np.array(plain.rates(0.0, list(y[: s.DYNAMIC])))
    assert np.abs(at_rest / scales(y)).max() < 1e-9
    times = np.arange(0.0, 0.41, 0.1)
    ours = simulate(in_gear("compact_1300", 4)._replace(drive=RAMP), y, 0.4)
    theirs = plain.tip_in(list(y[: s.DYNAMIC]), times, 10.0)
    accel = np.array([plain.accel(state) for state in theirs])
    assert np.abs(ours["accel_mps2"][::20] - accel).max() < 2e-5
    turbo = np.array([state["turbo"] for state in theirs])
    assert ours.states[::20, s.TURBO] == pytest.approx(turbo, rel=2e-5)


def test_what_goes_in_comes_out_or_stays_whatever_the_step():
    model, y = in_gear("compact_1300", 4)._replace(drive=RAMP), cruising("compact_1300", 4, 40.0)
    for step_s in (0.25e-3, 0.05e-3):
        for balance in balances(simulate(model, y, 1.0, step_s=step_s)):
            assert abs(balance.residual) < 1e-10, balance


def test_a_balance_tells_what_is_missing():
    run = simulate(
        in_gear("compact_1300", 4)._replace(drive=RAMP), cruising("compact_1300", 4, 40.0), 0.1
    )
    run.states[-1, 8] *= 1.001
    run.states[-1, s.TURBO] *= 1.001
    off = {balance.name: abs(balance.residual) for balance in balances(run)}
    assert off["energy of the gas"] > 1e-6 and off["work of the rotor"] > 1e-4
    assert off["mass"] < 1e-10


def test_a_steady_state_knows_neither_volumes_nor_inertia_nor_lags():
    base = bench()
    other = with_engine(
        base,
        volumes=base.engine.volumes._make(1.7 * v for v in base.engine.volumes),
        rotor=base.engine.rotor._replace(inertia_kgm2=2.5e-5),
        wall=base.engine.wall._replace(capacity_jpk=300.0),
    )
    other = other._replace(
        control=other.control._replace(vanes_lag_s=0.3, egr_lag_s=0.2, meter_lag_s=0.1)
    )
    for load in (0.3, 1.0):
        one, two = (told(m, steady_state(m, 2000 * RPM, pedal=load)) for m in (base, other))
        for name, value in one.items():
            assert two[name] == pytest.approx(value, rel=1e-8, abs=1e-8), name


def test_thinner_air_and_less_fuel_leave_ratios_and_speeds_and_torque_less_friction_follows():
    k, base, speed = 0.8, bench(), 2000 * RPM
    cylinders, control, engine = base.engine.cylinders, base.control, base.engine
    friction = 1.2e5 + 680 * (cylinders.stroke_m * speed / pi) ** 2
    assumed = friction + control.pumping_pa + control.pumping_pa_1000rpm * 4
    per_pa = cylinders.displacement_m3 / 4 / pi
    speeds, torques = curve_of(base.curves, FULL_LOAD)
    thin = base._replace(
        ambient=base.ambient._replace(pressure_pa=k * base.ambient.pressure_pa),
        curves=with_curve(base.curves, FULL_LOAD, speeds, k * torques + (k - 1) * assumed * per_pa),
        control=control._replace(
            boost_gain_ppa=control.boost_gain_ppa / k,
            boost_integral_ppas=control.boost_integral_ppas / k,
            exhaust_pressure_max_pa=k * control.exhaust_pressure_max_pa,
        ),
        engine=engine._replace(
            restrictions=engine.restrictions._replace(linear_below_pa=k * 1000.0),
            rotor=engine.rotor._make(k * value for value in engine.rotor),
            wall=engine.wall._make(k * value for value in engine.wall),
            cylinders=cylinders._replace(gas_exchange_pa=k * cylinders.gas_exchange_pa),
        ),
    )
    one, two = (steady_state(model, speed) for model in (base, thin))
    a, b = told(base, one), told(thin, two)
    assert two[s.TURBO] == pytest.approx(one[s.TURBO], rel=1e-8)
    for name in ("t2_k", "t4_k", "excess_air", "flow_number", "vanes_asked"):
        assert b[name] == pytest.approx(a[name], rel=1e-8), name
    for name in ("p3_pa", "p4_pa", "air_kgps", "fuel_kgps"):
        assert b[name] == pytest.approx(k * a[name], rel=1e-8), name
    lost = friction * per_pa
    assert b["torque_nm"] + lost == pytest.approx(k * (a["torque_nm"] + lost), rel=1e-8)


def test_an_engine_of_twice_the_cylinders_has_the_same_pressures_over_time_and_twice_the_torque():
    """With a rotor of four times the inertia; a similar rotor has sqrt(2) times that, and lags more."""
    one = shipped("compact_1300").diesel
    two = scaled(one, 2.0)
    alike = two._replace(
        engine=two.engine._replace(
            rotor=two.engine.rotor._replace(inertia_kgm2=4 * one.engine.rotor.inertia_kgm2)
        )
    )
    runs = []
    for diesel in (one, alike, two):
        model = held(model_of(diesel, BENCH))
        y = steady_state(model, 1750 * RPM, pedal=0.15)
        loaded = model._replace(drive=Drive(held=1.0, pedal_rate_ps=10.0))
        runs.append(simulate(loaded, y, 2.0))
    small, large, similar = runs
    for name, factor in (
        ("p3_pa", 1),
        ("p4_pa", 1),
        ("t4_k", 1),
        ("torque_nm", 2),
        ("air_kgps", 2),
    ):
        assert large[name] == pytest.approx(factor * small[name], rel=1e-7), name
    k = np.argmax(small["p3_pa"] > 1.8e5)
    assert similar["p3_pa"][k] < 1.75e5


def test_closed_off_the_manifold_empties_into_the_cylinders_as_its_time_constant_says():
    speed, plain = 2000 * RPM, Gas(287.0, 1005.0, 0.0, 1005.0, 0.0)
    base = bench()
    cylinders = base.engine.cylinders._replace(compression_ratio=1e9)
    shut = with_engine(
        base,
        cylinders=cylinders,
        restrictions=base.engine.restrictions._replace(intercooler_h=1e40),
        recirculation=base.engine.recirculation._replace(area_m2=0.0),
    )._replace(gas=plain)
    y = steady_state(base, speed)
    for n in range(5):  # at rest, at 300 K, all air
        mass = 2e5 * base.engine.volumes[n] / 287.0 / 300.0
        y[3 * n : 3 * n + 3] = mass, 0.0, mass * (1005.0 - 287.0) * 300.0
    first = told(shut, y)["p3_pa"]
    found = march(0.0, y, 1e-4, 10, 100, *TABLEAUX[4], shut)
    filled = 0.9 - 0.06 * (2000 / 2400 - 1) ** 2
    tau = 4 * pi * base.engine.volumes.intake_manifold_m3 / (filled * 1248e-6 * speed)
    assert 1.0 / tau == pytest.approx(1 / 0.162, rel=0.01)
    for n in (1, 5, 10):
        left = exp(-0.01 * n / tau)
        assert found[n, 6] == pytest.approx(left * y[6], rel=1e-6)
        # What stays behind expands without heat: p falls as m to the ratio of heat capacities.
        p = told(shut, found[n])["p3_pa"]
        assert p == pytest.approx(first * left ** (1005 / 718), rel=1e-6)


def test_a_rotor_without_gas_spins_down_with_its_bearing_alone():
    base = bench()
    bare = with_engine(
        base,
        compressor=base.engine.compressor._replace(wheel_diameter_m=1e-9),
        rotor=base.engine.rotor._replace(bearing_nms=5e-6),
    )._replace(ambient=base.ambient)
    y = np.zeros(s.SIZE)
    for n in range(5):
        mass = (
            bare.ambient.pressure_pa * bare.engine.volumes[n] / 287.0 / bare.ambient.temperature_k
        )
        t = bare.ambient.temperature_k
        y[3 * n : 3 * n + 3] = mass, 0.0, mass * t * (943.0 - 287.0 + 0.103 * t)
    y[s.TURBO], y[s.WALL], y[s.VANES] = 1e4, bare.ambient.temperature_k, 0.3
    found = march(0.0, y, 1e-3, 1, 1000, *TABLEAUX[4], bare)
    expected = 1e4 * exp(-5e-6 / base.engine.rotor.inertia_kgm2)
    assert found[-1, s.TURBO] == pytest.approx(expected, rel=1e-9)


def test_the_orders_of_the_integrators_are_one_two_and_four():
    """On a smooth piece: full load at 2000 rpm, the turbocharger 2 % too slow."""
    model = bench()
    y = steady_state(model, 2000 * RPM)
    y[s.TURBO] *= 0.98
    seconds = 0.0192

    def at_end(order: int, h: float) -> float:
        return float(march(0.0, y, h, 1, round(seconds / h), *TABLEAUX[order], model)[-1, s.TURBO])

    exact = at_end(4, 1e-5)
    for order in (1, 2, 4):
        errors = [abs(at_end(order, step) - exact) for step in (2e-4, 1e-4)]
        assert np.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.2)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize(("gear", "kmh"), [(4, 40.0), (6, 60.0)])
def test_runge_kutta_agrees_with_lsoda_on_every_shipped_tip_in(name, gear, kmh):
    model, y = in_gear(name, gear)._replace(drive=RAMP), cruising(name, gear, kmh)
    fixed, free = (simulate(model, y, 5.0, integrator=which) for which in ("rk4", "lsoda"))
    assert np.abs(fixed["accel_mps2"] - free["accel_mps2"]).max() < 1e-4


def test_the_guard_refuses_a_millisecond_and_without_it_the_turbocharger_settles_to_a_wrong_speed():
    model = held(in_gear("compact_1300", 4))
    y = cruising("compact_1300", 4, 40.0)
    assert eigenvalues(0.0, y, model)[0].real < -3000
    with pytest.raises(DataError, match=r"step 1 ms at t = 0 s is too long.*0\.\d+ ms or less"):
        simulate(model, y, 0.1, step_s=1e-3)
    assert 0.25e-3 < longest_step_s(0.0, y, model) < 1e-3
    right, astray, wrong = (
        march(0.0, y, h, 5, round(1 / h), *TABLEAUX[4], model)[:, s.TURBO]
        for h in (0.25e-3, 1e-3, 1.25e-3)
    )
    assert right == pytest.approx(y[s.TURBO], rel=1e-6)
    # At 1 ms it wanders, where to depends on the machine's rounding; at 1.25 ms it is always low.
    assert np.isfinite(astray).all() and np.abs(astray / y[s.TURBO] - 1).max() > 1e-3
    assert np.isfinite(wrong).all() and wrong[-1] < 0.98 * y[s.TURBO]


@pytest.mark.parametrize("step_ms", [0.3, 7.0, 0.0, -1.0, float("nan"), 1e-9])
def test_a_step_that_does_not_divide_the_samples_is_refused(step_ms):
    with pytest.raises(DataError, match=r"step .* ms; allowed: 5 ms divided by a whole number"):
        simulate(bench(), cruising("compact_1300", 4, 40.0), 0.1, step_s=step_ms / 1e3)


STATE = draw.tuples(
    *[draw.floats(0.3, 5.0)] * 5,  # pressures, bar
    *[draw.floats(220.0, 1400.0)] * 5,
    *[draw.floats(0.0, 1.0)] * 5,
    draw.sampled_from([0.0, 1.0, 100.0, 3e3, 2.5e4]) | draw.floats(0.0, 2.5e4),  # turbocharger
    draw.sampled_from([0.0, 90.0]) | draw.floats(0.0, 600.0),  # engine
    *[draw.floats(0.0, 1.0)] * 3,  # vanes, valve, pedal
)


@settings(max_examples=300, deadline=None, derandomize=True)
@given(STATE, draw.booleans())
def test_every_state_has_finite_rates(values, equal):
    """At no flow, no speed, equal pressures and flow backwards too."""
    bars, kelvins, burnt = values[:5], values[5:10], values[10:15]
    bars = (bars[0],) * 5 if equal else bars
    model = bench()
    y = np.zeros(s.SIZE)
    for n, (bar, kelvin, x) in enumerate(zip(bars, kelvins, burnt, strict=True)):
        mass = bar * 1e5 * model.engine.volumes[n] / 287.0 / kelvin
        a, b = 943 + 42 * x, 0.206 + 0.084 * x
        y[3 * n : 3 * n + 3] = mass, mass * x, mass * kelvin * (a - 287 + b * kelvin / 2)
    y[s.TURBO], y[s.ENGINE], y[s.VANES], y[s.EGR], y[s.PEDAL] = values[15:20]
    y[s.VANES] = max(y[s.VANES], model.control.vanes_least)
    y[s.WALL] = 500.0
    moving = model._replace(drive=Drive())
    assert np.isfinite(rates(0.0, y, moving)).all()
    assert np.isfinite(observe(np.zeros(1), y[None], moving)).all()


def test_standstill_of_everything_stays_at_rest():
    model = bench()
    y = np.zeros(s.SIZE)
    kelvin = model.ambient.temperature_k
    for n in range(5):
        mass = model.ambient.pressure_pa * model.engine.volumes[n] / 287.0 / kelvin
        y[3 * n : 3 * n + 3] = mass, 0.0, mass * kelvin * (943.0 - 287.0 + 0.103 * kelvin)
    y[s.WALL], y[s.VANES] = kelvin, 0.22
    found = rates(0.0, y, model)
    assert found[s.TURBO] == pytest.approx(0.0, abs=1e-3)
    later = march(0.0, y, 1e-4, 1, 2000, *TABLEAUX[4], model)[-1]
    assert told(model, later)["p2_pa"] == pytest.approx(model.ambient.pressure_pa, abs=1.0)


@pytest.mark.parametrize("name", NAMES)
def test_efficiency_over_speed_is_that_of_the_files_fuel_law(name):
    law = shipped(name).car.contents["engine"]["fuel_coefficients"]
    cylinders = shipped(name).diesel.engine.cylinders
    speed = np.array([800, 1500, 2500, 4000, 5000]) * RPM
    cm = cylinders.stroke_m * speed / pi
    of_law = law["a"] + law["b"] * cm + law["c"] * cm**2
    ours = np.array([work_per_fuel(x, cylinders) for x in speed]) / cylinders.heating_value_jpkg
    assert ours / cylinders.efficiency == pytest.approx(
        of_law / (law["a"] - law["b"] ** 2 / 4 / law["c"]), rel=1e-4
    )
    assert work_per_fuel(1e4, cylinders) > 0


@pytest.mark.parametrize(("name", "top_rpm"), [("compact_1300", 5000), ("A", 4500)])
def test_settled_full_load_is_the_files_from_1000_rpm_on_and_its_fuel_the_maps(name, top_rpm):
    """The 1.6 l engine's last point, 100 Nm at 5000 rpm, is 8 % above: the documentation says why."""
    model, engine = bench(name), shipped(name).car.engine
    for rpm in (1000, 1500, 2000, 3000, 4000, top_rpm):
        y = steady_state(model, rpm * RPM)
        at = told(model, y)
        assert at["torque_nm"] == pytest.approx(at["full_load_nm"], rel=0.04)
        map_kgps = engine.fuel_kgps(np.array([at["torque_nm"]]), np.array([rpm * RPM]))[0]
        assert at["fuel_kgps"] == pytest.approx(map_kgps, rel=0.06)
        assert 1.0 < at["p4_pa"] / at["p3_pa"] < 1.6
        assert at["t4_k"] < 1055 and y[s.TURBO] / RPM < 230e3
        assert at["flow_number"] > at["surge_number"]


@pytest.mark.parametrize("rpm", [1500, 3000])
def test_part_load_burns_what_the_map_says_within_6_percent(rpm):
    model, engine = bench("A"), shipped("A").car.engine
    for load in (0.2, 0.5, 0.8):
        at = told(model, steady_state(model, rpm * RPM, pedal=load))
        map_kgps = engine.fuel_kgps(np.array([at["torque_nm"]]), np.array([rpm * RPM]))[0]
        assert at["fuel_kgps"] == pytest.approx(map_kgps, rel=0.06)


def test_a_smoke_limit_that_no_steady_point_can_meet_is_one_message():
    model = in_gear("compact_1300", 4)
    lean = model._replace(curves=with_curve(model.curves, SMOKE, [0.0, 1e3], [9.0, 9.0]))
    with pytest.raises(
        DataError, match=r"40 km/h needs \d+ Nm at 12\d\d rpm, and the engine settles to"
    ):
        cruise(lean, 40 / 3.6)


@pytest.mark.parametrize(
    ("gear", "kmh", "words"),
    [(4, 20.0, "too high"), (4, 250.0, "too low"), (5, 185.0, "needs"), (1, 40.0, "released")],
)
def test_a_speed_that_the_gear_does_not_fit_is_one_message(gear, kmh, words):
    with pytest.raises(DataError, match=f"{kmh:g} km/h.*{words}.*choose"):
        cruise(in_gear("compact_1300", gear), kmh / 3.6)


def test_an_engine_that_is_slow_to_settle_settles_and_one_that_never_does_is_one_message(
    monkeypatch,
):
    model = bench()
    control = model.control
    slow = model._replace(
        control=control._replace(boost_integral_ppas=control.boost_integral_ppas / 30)
    )
    y = steady_state(held(slow), 2000 * RPM)
    usual = told(model, steady_state(held(model), 2000 * RPM))
    assert told(slow, y)["p3_pa"] == pytest.approx(usual["p3_pa"], rel=1e-6)
    monkeypatch.setattr(settle, "_STEPS_MAX", 5_000)
    monkeypatch.setattr(settle, "_MARCH_S", 0.01)
    losses = model.engine.restrictions._replace(filter_h=2.5)
    with pytest.raises(
        SolverError, match=r"gas path asks for steps of .* µs; check units and size"
    ):
        steady_state(held(with_engine(model, restrictions=losses)), 2000 * RPM)
    monkeypatch.undo()
    wild = control._replace(boost_gain_ppa=50 * control.boost_gain_ppa, vanes_lag_s=1.0)
    swinging = model._replace(control=wild)
    with pytest.raises(
        SolverError, match="does not settle at 2000 rpm: it swings about its steady state"
    ):
        steady_state(held(swinging), 2000 * RPM)
