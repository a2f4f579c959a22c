"""Volumes of the whole model against closed forms, and the order of what is between them."""

import numpy as np
import pytest
from diesels import cruising, in_gear, shipped
from plain_engine import SECOND_PIPE, PlainCar

from hevopt.files.lookup import shipped_folder
from hevopt.mean_value import states as s
from hevopt.mean_value._run_kernels import TABLEAUX, march, observe
from hevopt.mean_value.car import BENCH, car_in_gear, cruise, model_of
from hevopt.mean_value.parameters import Drive, Gas
from hevopt.mean_value.paths import paths
from hevopt.mean_value.run import simulate
from hevopt.mean_value.settle import held, steady_state
from hevopt.tipin.assist import assisted, help_of

RPM = 2 * np.pi / 60
RAMP = Drive(pedal_rate_ps=10.0)
R, CP = 287.0, 1005.0
PLAIN = Gas(R, CP, 0.0, CP, 0.0)


def told(model, y) -> dict[str, float]:
    """Signals of one state."""
    return dict(zip(s.SIGNALS, observe(np.zeros(1), y[None], model)[0], strict=True))


def test_a_volume_blows_down_through_a_choked_valve_as_its_closed_form_says():
    """T = T0 (1 + (g - 1)/2 A sqrt(R T0)/V t)^-2, p as T to g / (g - 1): of the manifold, all else shut."""
    base = held(model_of(shipped("compact_1300").diesel, BENCH))
    engine = base.engine
    shut = base._replace(
        gas=PLAIN,
        control=base.control._replace(egr_lag_s=1e12),
        engine=engine._replace(
            volumes=engine.volumes._replace(intake_manifold_m3=1e3),
            turbine=engine.turbine._replace(area_m2=0.0),
            wall=engine.wall._replace(gas_wpk=0.0),
        ),
    )
    y = np.zeros(s.SIZE)
    kelvin, bars = (
        (298.15, 298.15, 298.15, 600.0, 298.15),
        (1.01325, 1.01325, 1.01325, 5.0, 1.01325),
    )
    for n, volume in enumerate(shut.engine.volumes):
        mass = 1e5 * bars[n] * volume / R / kelvin[n]
        y[3 * n : 3 * n + 3] = mass, 0.0, mass * (CP - R) * kelvin[n]
    y[s.EGR], y[s.WALL], y[s.VANES] = 1.0, 298.15, 0.3
    found = march(0.0, y, 1e-4, 5, 20, *TABLEAUX[4], shut)
    g = CP / (CP - R)
    rate = (g - 1) / 2 * 1.6e-4 * np.sqrt(R * 600.0) / 0.9e-3
    for n in (1, 3, 5):
        at, left = told(shut, found[n]), 1 + rate * 2e-3 * n
        assert at["t4_k"] == pytest.approx(600.0 * left**-2, rel=1e-7)
        assert at["p4_pa"] == pytest.approx(5e5 * left ** (-2 * g / (g - 1)), rel=1e-7)
        assert at["p4_pa"] * 0.65 > at["p3_pa"]


def test_what_two_streams_make_has_the_temperature_that_their_enthalpies_say():
    """Charge and recirculated gas in the intake manifold, at rest, heat capacity constant."""
    model = held(model_of(shipped("compact_1300").diesel, BENCH))._replace(gas=PLAIN)
    at = told(model, steady_state(model, 2000 * RPM, pedal=0.3))
    charge = at["t2_k"] - 0.75 * (at["t2_k"] - 298.0)
    exhaust = at["t4_k"] - 0.75 * (at["t4_k"] - 360.0)
    fresh, again = at["air_kgps"], at["egr_kgps"]
    assert again > 0.1 * fresh and exhaust > charge + 30
    mixed = (fresh * charge + again * exhaust) / (fresh + again)
    assert at["t3_k"] == pytest.approx(mixed, rel=1e-8)


def reached_90(time_s, boost_pa, target_pa) -> float:
    """Seconds to 90 % of the way to the boost target, as the tip-in's figures have it."""
    share = (boost_pa - boost_pa[0]) / (target_pa - boost_pa[0])
    k = int(np.argmax((share >= 0.9) & (time_s >= 0.3)))
    assert k > 0
    return float(np.interp(0.9, share[k - 1 : k + 1], time_s[k - 1 : k + 1]))


def test_a_charge_pipe_in_two_halves_lags_as_one():
    """In the second implementation, a loss of less than 1 kPa between them."""
    engine = shipped_folder("architectures") / "components" / "engine_diesel_1300.toml"
    plain = PlainCar(engine, 1300.0, 2.4, 0.3054, 0.011, 5e-5, 0.71, 1.19, 0.96 * 3.74, 0.95)
    plain.join = 2.4e5
    y = cruising("compact_1300", 4, 40.0)
    run = simulate(in_gear("compact_1300", 4)._replace(drive=RAMP), y, 2.5)
    whole = reached_90(run.time_s, run["p3_pa"], run["target_pa"])
    halves = np.concatenate([y[: s.DYNAMIC], y[3:6] / 2])
    halves[3:6] /= 2
    plain.mv["volumes"]["charge_pipe_l"] /= 2
    times = np.arange(0.0, 2.51, 0.02)
    states = plain.tip_in(list(halves), times, 10.0)
    boost = np.array([plain.boost(state) for state in states])
    target = np.interp(times, run.time_s, run["target_pa"])
    assert len(states[0]) == s.DYNAMIC + len(SECOND_PIPE)
    assert reached_90(times, boost, target) == pytest.approx(whole, rel=0.02)


@pytest.mark.parametrize(("name", "gear", "kmh"), [("C2", 4, 40.0), ("D", 6, 60.0), ("E", 4, 40.0)])
def test_runge_kutta_agrees_with_lsoda_where_a_machine_helps(name, gear, kmh):
    car = shipped(name)
    found = paths(car.car, gear, kmh / 3.6)
    model = model_of(car.diesel, car_in_gear(car.car, car.diesel, found))
    y = cruise(model, kmh / 3.6)
    helped = assisted(model, help_of(car.car, found, kmh / 3.6))._replace(drive=RAMP)
    fixed, free = (simulate(helped, y, 5.0, integrator=which) for which in ("rk4", "lsoda"))
    assert fixed["assist_nm"].max() > 10
    assert np.abs(fixed["accel_mps2"] - free["accel_mps2"]).max() < 1e-4
