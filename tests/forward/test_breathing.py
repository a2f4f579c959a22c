"""The mean-value engine in the driven car: against the map, against the tip-in's own car, against itself."""

from functools import cache

import numpy as np
import pytest
from forward.drives import constant, follow, ramp

from hevopt import DataError, build_problem, drive, load_architecture, load_cycle, performance
from hevopt.driving.cycle import Cycle
from hevopt.forward import _pull_kernels as pulling
from hevopt.forward.breathing import Breathing
from hevopt.forward.forces import by_gear
from hevopt.forward.lines import line_of
from hevopt.forward.performance import _Floored, _pulled
from hevopt.forward.plans import replay_of
from hevopt.forward.run import loop_car, shifting_of
from hevopt.mean_value import states as s
from hevopt.mean_value._model_kernels import combustion_now
from hevopt.mean_value.parameters import Drive
from hevopt.problem.battery import energy_j
from hevopt.problem.simulation import simulate
from hevopt.strategies import baseline
from hevopt.tipin.case import BASE
from hevopt.tipin.drive import tip_in
from hevopt.tipin.study import manoeuvre_of


def driven(cycle, **how):
    """A, its usual plan driven with the mean-value engine."""
    car = load_architecture("A")
    problem = build_problem(car, cycle, allow_shortfall=True)
    plan = replay_of(simulate(problem, baseline.solve(problem).control), line_of(car))
    return follow(car, cycle, plan, engine_model="mean_value", **how)


@cache
def piece():
    """The first minute of the NEDC."""
    whole, steps = load_cycle("nedc"), slice(0, 66)
    return Cycle(
        "piece", whole.time_s[steps], whole.speed_mps[steps], whole.grade[steps], whole.gear[steps],
        whole.clutch_open[steps],
    )  # fmt: skip


def test_where_the_cycle_is_smooth_fuel_is_the_maps_within_its_tolerance():
    """6 % is what steady fuel may differ from the map's at equal torque; idle is no part of that."""
    run = driven(piece())
    assert run.quality.violations == () and max(run.residual.values()) < 1e-9
    flows, turns = run.books.flows, run.engine == 2
    speed = flows["speed_mps"]
    drives = (speed > 1) & (np.gradient(speed, run.step_s) > -0.05)
    own, by_map = (flows[name][drives].sum() for name in ("fuel_kgps", "map_fuel_kgps"))
    assert drives.mean() > 0.3 and abs(own / by_map - 1) < 0.06
    every = flows["fuel_kgps"].sum() / flows["map_fuel_kgps"].sum()
    assert run.against_map_percent == pytest.approx(100 * (every - 1))
    assert flows["excess_air"][turns].min() > 1.15
    lacking = np.abs(flows["gas_lacking_nm"] * flows["engine_speed_radps"]).sum()
    assert lacking < 0.01 * np.abs(flows["engine_torque_nm"] * flows["engine_speed_radps"]).sum()
    assert (flows["fuel_kgps"] >= 0).all() and run.fuel_kg > 0


def test_at_constant_speed_it_settles_to_what_the_model_burns_there():
    run = driven(constant(70, 40))
    late = run.books.flows["fuel_kgps"][-500:]
    assert np.ptp(late) < 1e-3 * late.mean()
    last = {name: float(values[-1]) for name, values in run.books.flows.items()}
    settled = Breathing(run.car, last["engine_speed_radps"], last["engine_torque_nm"])
    burning = combustion_now(settled._gas, settled._model._replace(
        drive=Drive(held=1.0, torque_nm=last["engine_torque_nm"])))  # fmt: skip
    assert burning.torque == pytest.approx(last["engine_torque_nm"], rel=1e-9)
    assert last["fuel_kgps"] == pytest.approx(burning.fuel, rel=2e-3)


def test_shorter_steps_change_fuel_little():
    fine, coarse = (driven(ramp(12, 12, 25), step_s=h).fuel_kg for h in (0.005, 0.02))
    assert coarse == pytest.approx(fine, rel=5e-3)


def floored(name, **help_):
    car = load_architecture(name)
    line = line_of(car)
    driven_ = loop_car(car, line, car.handling._replace(shifting=shifting_of(car)))
    foot = pulling.Foot(
        188.5, 440.0, np.full(6, np.inf), bool(help_), help_.get("fills", False), 0.0, 0.45
    )
    start_j = float(energy_j(car.battery, car.soc_start))
    return _Floored(car, driven_, by_gear(line), foot, start_j, "mean_value", None)


def to_80(of):
    """Seconds from 40 to 80 km/h in fourth gear, and J from the battery."""
    trace = _pulled(of, 40 / 3.6, 3, 80)
    k = int(np.argmax(trace[:, pulling.SPEED] >= 80 / 3.6))
    return 0.01 * (k + 1), of.start_j - trace[k, pulling.ENERGY]


def test_a_tip_in_is_that_of_the_tip_ins_own_car():
    """Another clutch, lag and integrator: speed gained after three seconds."""
    own = floored("compact_1300")
    trace = _pulled(own, 40 / 3.6, 3, 60)
    gained = trace[299, pulling.SPEED] - 40 / 3.6
    run = tip_in(manoeuvre_of("compact_1300", 40 / 3.6, 4), BASE).run
    assert gained == pytest.approx(run.states[600, s.ROAD] - 40 / 3.6, rel=0.05)


def test_a_machine_fills_the_hole_and_all_of_it_is_more():
    alone, filled, boosted = (
        to_80(floored("C2")),
        to_80(floored("C2", fills=True)),
        to_80(floored("C2", boosts=True)),
    )
    by_map = to_80(floored("C2")._replace(engine_model="map"))
    assert alone[0] > by_map[0] + 0.5
    assert filled[0] == pytest.approx(by_map[0], abs=0.25) and boosted[0] < filled[0] - 0.5
    assert 5e3 < filled[1] < boosted[1]


def test_the_study_s_car_is_as_quick_as_published_and_in_gear_as_another_program_has_it():
    """Opel Corsa and Fiat Punto with this engine: 0 to 100 km/h in 12.0 to 12.7 s, driver and load unknown.

    Shipped with two people and luggage. In gear, a prototype with the same parameters but for efficiency over
    speed: launch and changes of gear are none of it.
    """
    found = performance(load_architecture("compact_1300"), engine_model="mean_value")
    assert 0.9 * 12.0 < found.to_speed_s[100] < 1.1 * 12.7
    for case, seconds in {
        (4, 60, 100): 8.8, (4, 80, 120): 10.1, (5, 80, 120): 12.8, (6, 80, 120): 17.0, (4, 40, 80): 9.1,
        (6, 60, 100): 18.2,
    }.items():  # fmt: skip
        assert found.in_gear_s[case] == pytest.approx(seconds, rel=0.03), case


@pytest.mark.long
def test_the_turbochargers_lag_costs_time_from_rest_and_in_gear():
    car = load_architecture("A")
    by_map, lagging = performance(car), performance(car, engine_model="mean_value")
    assert by_map.to_speed_s[100] < lagging.to_speed_s[100] < by_map.to_speed_s[100] + 2.0
    for case, time in lagging.in_gear_s.items():
        # Settled, its torque may be 4 % above the file's curve.
        assert by_map.in_gear_s[case] is None or time > 0.96 * by_map.in_gear_s[case]


@pytest.mark.parametrize(
    ("run", "message"),
    [
        (
            lambda: performance(load_architecture("A"), engine_model="maps"),
            "engine model 'maps'; allowed: map, mean_value",
        ),
        (
            lambda: performance(load_architecture("A"), engine_model="mean_value", boost_lag_s=0.7),
            "has a lag of its own",
        ),
        (lambda: drive(load_architecture("A"), piece(), "baseline", engine_model=""), "engine model ''"),
        (
            lambda: Breathing(load_architecture("series_1500"), 90.0),
            "no .mean_value. part",
        ),
    ],
)  # fmt: skip
def test_bad_input_is_refused(run, message):
    with pytest.raises(DataError, match=message):
        run()
