"""Topologies beside the shipped couplings: random graphs in balance, cars from one file, the shipped hybrids."""

from dataclasses import replace
from math import pi

import numpy as np
import pytest
from split_cars import short, table_value

from hevopt import build_problem, load_architecture, load_cycle, simulate
from hevopt.car.balance import joints_of
from hevopt.car.driveline import BRAKE, ENGINE, Driveline, State
from hevopt.car.parts import WHEEL, Clutch, Gear, Planetary, ShaftBrake
from hevopt.car.ways import way
from hevopt.driving.demand import Demand
from hevopt.files.lookup import shipped_folder
from hevopt.powertrain.evaluated import evaluated
from hevopt.powertrain.operation import setting
from hevopt.powertrain.phases import Phase, driver_of, stretches
from hevopt.powertrain.shafts import shafts_of
from hevopt.strategies import STRATEGIES, fitting
from hevopt.studies.case import prepare

PRIUS = load_architecture("prius_1998")
HYBRIDS = sorted(path.stem for path in (shipped_folder("architectures") / "hybrids").glob("*.toml"))
MOVING, POINTS = Phase(standing=False), 100


def demand_of(speed, accel, torque) -> Demand:
    steps = len(speed)
    none = np.zeros(steps)
    return Demand(
        none, none + 1, speed * 0.3, torque, speed, accel, np.zeros(steps, int), np.zeros(steps, bool)
    )  # fmt: skip


def random_graph(rng: np.random.Generator) -> Driveline:
    """One of five families, with random ratios and losses."""
    eta = rng.uniform(0.7, 0.99, 4)
    k, ratio = rng.uniform(1.5, 3.5, 2), rng.uniform(1.5, 8.0, 3)
    split = Planetary("split", "sun", "ring", "carrier", k[0], eta[0])
    final = Gear("final", "ring", WHEEL, ratio[0], eta[1])
    match rng.integers(5):
        case 0:  # input split
            return Driveline(
                "parts", (split, final), "carrier", (("a", "sun"), ("b", "ring")), True
            )
        case 1:  # output split
            out = Gear("final", "carrier", WHEEL, ratio[0], eta[1])
            return Driveline("parts", (split, out), "ring", (("a", "ring"), ("b", "sun")), True)
        case 2:  # two planetary sets, the second a reduction of the second machine
            second = Planetary("reduction", "sun 2", "case", "ring", k[1], eta[2])
            parts = (split, second, ShaftBrake("case brake", "case"), final)
            return Driveline("parts", parts, "carrier", (("a", "sun"), ("b", "sun 2")), True)
        case 3:  # series with a lock-up gear
            lock = (Clutch("lock", "crank", "lock shaft", "strategy"),
                    Gear("lock gear", "lock shaft", WHEEL, ratio[1], eta[2]))  # fmt: skip
            return Driveline(
                "parts", (final, *lock), "crank", (("a", "crank"), ("b", "ring")), True
            )
    rear = Gear("rear", "rear", WHEEL, ratio[2], eta[3])
    return Driveline("parts", (final, rear), "ring", (("a", "ring"), ("b", "rear")), True)


@pytest.mark.parametrize("seed", range(100))
def test_every_shaft_of_a_random_graph_is_in_balance(seed):
    rng = np.random.default_rng(seed)
    line = random_graph(rng)
    closed = frozenset(p.name for p in line.parts if isinstance(p, Clutch | ShaftBrake))
    found, state = way(line, State(True, closed=closed), MOVING), np.arange(POINTS)
    speed, accel = rng.uniform(1, 120, POINTS), rng.uniform(-8, 8, POINTS)
    demand = demand_of(speed, accel, rng.uniform(-900, 900, POINTS))
    car = replace(PRIUS, driveline=line, machines=PRIUS.machines[:2])
    free = rng.uniform(100, 400, POINTS)
    here = setting(car, found, shafts_of(car, demand, found, state, free, free))
    given = {name: rng.uniform(-80, 80, (POINTS, 1)) for name in found.chosen}
    names = [name for name in found.active if name not in given]
    joints = joints_of(found)
    solved = here.torques.solve(here.unbraked(given), [*(j.name for j in joints), *names])
    torques = {**given, **solved, BRAKE: np.zeros((POINTS, 1))}
    w = here.shafts.speed_radps
    left = {shaft: -here.shafts.acting_nm.get(shaft, np.zeros(POINTS)) for shaft in found.shafts}
    lost = np.zeros(POINTS)
    for joint in joints:
        entering = torques[joint.name][:, 0] * sum(c * w[s] for s, c in joint.sense.items())
        h = np.where(entering > 0, joint.efficiency, 1 / joint.efficiency)
        lost += np.where(entering > 0, 1 - joint.efficiency, 1 - 1 / joint.efficiency) * entering
        for shaft, (c0, c1) in joint.reaction.items():
            left[shaft] = left[shaft] + (c0 + c1 * h) * torques[joint.name][:, 0]
        assert np.max(np.abs(sum(c * w[s] for s, c in joint.speed.items()))) < 1e-9
    power = np.zeros(POINTS)
    for name, shaft in found.active.items():
        left[shaft] = left[shaft] + torques[name][:, 0]
        power += torques[name][:, 0] * w[shaft]
    taken = sum(torque * w[shaft] for shaft, torque in here.shafts.acting_nm.items())
    assert max(np.max(np.abs(rest)) for rest in left.values()) < 1e-9
    assert np.max(np.abs(power - taken - lost)) < 1e-9 * max(1.0, np.max(np.abs(power)))
    assert (lost > -1e-9).all()


def test_a_series_point_is_that_computed_by_hand():
    car = load_architecture("series_1500")
    mps, rpm, engine_nm, k = 50 / 3.6, 2000.0, 60.0, 2.5
    force_n = 0.010837 * (1368 + 72) * 9.80665 + 0.5 * 1.2 * 0.5238 * mps * mps
    motor_rpm = mps / 0.287 * 3.93 * 30 / pi
    motor_nm = force_n * 0.287 / 3.93 / 0.97
    generator = -engine_nm * rpm * pi / 30 + k * table_value(
        "machine_generator_15kw", rpm, -engine_nm / k
    )
    motor = motor_nm * motor_rpm * pi / 30 + 1.5 * table_value(
        "machine_motor_30kw", motor_rpm, motor_nm / 1.5
    )
    one = np.ones(1)
    demand = demand_of(mps / 0.287 * one, 0 * one, force_n * 0.287 * one)
    driver, state = driver_of(car, demand), State(engine_on=True)
    (stretch,) = stretches(car, driver, state)
    shafts = shafts_of(car, demand, stretch.way, stretch.step, one, rpm * pi / 30 * one)
    here = setting(car, stretch.way, shafts)
    done = evaluated(here, state, {ENGINE: np.array([[engine_nm]])}, one)
    assert done.battery_w == pytest.approx(np.array([[generator + motor + 700.0]]), abs=1e-6)


HEAD = """name = "own"
car = "car_prius_1998"
engine = "engine_petrol_1500_atkinson"
battery = "battery_nimh_40"
functions = ["start_stop", "e_boost", "regenerative_braking", "power_management"]
machine = { file = "machine_motor_30kw", scale = { power = 1.5 } }
"""
OUTPUT_SPLIT = """machine_2 = { file = "machine_motor_30kw", scale = { power = 1.5 } }
[coupling]
kind = "parts"
engine_shaft = "ring"
machine_shaft = "ring"
machine_2_shaft = "sun"
parts = [
  { kind = "planetary", name = "set", sun = "sun", ring = "ring", carrier = "carrier", ratio = 2.0, \
efficiency = 0.98 },
  { kind = "gear", name = "final drive", first = "carrier", second = "wheel", ratio = 2.6, efficiency = 0.97 },
]
"""
THROUGH_THE_ROAD = """gearbox = { file = "gearbox_dual_clutch_6", final_drive_ratio = 3.3 }
[coupling]
kind = "parts"
engine_shaft = "crankshaft"
machine_shaft = "rear machine"
parts = [
  { kind = "clutch", name = "clutch", first = "crankshaft", second = "input", operation = "driver" },
  { kind = "gearbox", name = "gearbox", first = "input", second = "wheel" },
  { kind = "gearbox", name = "rear axle", first = "rear machine", second = "wheel", ratios = [7.0, 3.5], \
efficiency = 0.96, shift_fuel_g = 0.05 },
]
"""
BRAKED_SPLIT = """machine_2 = "machine_motor_30kw"
[coupling]
kind = "parts"
engine_shaft = "carrier"
machine_shaft = "sun"
machine_2_shaft = "ring"
parts = [
  { kind = "planetary", name = "set", sun = "sun", ring = "ring", carrier = "carrier", ratio = 2.6 },
  { kind = "shaft_brake", name = "sun brake", first = "sun" },
  { kind = "gear", name = "final drive", first = "ring", second = "wheel", ratio = 3.93 },
]
"""


@pytest.mark.parametrize(
    "own", [OUTPUT_SPLIT, THROUGH_THE_ROAD, BRAKED_SPLIT],
    ids=["output split", "through the road, two speeds", "power split with a brake"],
)  # fmt: skip
def test_one_file_is_another_topology(tmp_path, own):
    path = tmp_path / "own.toml"
    path.write_text(HEAD + own)
    case = prepare(load_architecture(path), short("udds", 330), levels=20)
    plan = case.dp_trajectory
    bound_kg, _ = case.certificate.bound_of(plan)
    assert 0 <= plan.cost_kg / bound_kg - 1 < 2e-3
    assert max(np.max(np.abs(residual)) for residual in plan.residuals.values()) < 1e-6
    on = plan.flows["engine_speed_radps"] > 0
    assert on.any() and not on.all()


@pytest.mark.parametrize("name", [name for name in HYBRIDS if name != "prius_1998"])
def test_a_shipped_hybrid_is_solved_and_proven(name):
    # What a plug-in car may draw on a whole cycle would leave hardly any fuel on a part of it.
    part = {"battery.soc.end": 0.49} if name == "p2_plug_in" else {}
    case = prepare(load_architecture(name, part), short("udds", 330))
    plan = case.dp_trajectory
    bound_kg, _ = case.certificate.bound_of(plan)
    assert 0 <= plan.cost_kg / bound_kg - 1 < 1e-3
    assert max(np.max(np.abs(residual)) for residual in plan.residuals.values()) < 1e-6


# A part of a cycle is enough for every way to drive; whole cycles, with all strategies, are the long test.
@pytest.mark.parametrize(
    ("name", "cycle"),
    [("prius_1998", "udds 200"), ("p0_p4_diesel", "udds 200")]
    + [
        pytest.param(name, cycle, marks=pytest.mark.long)
        for name in HYBRIDS
        for cycle in ("nedc", "wltc_class3b", "udds", "us06")
    ],
)
def test_energy_closes_with_every_strategy(name, cycle):
    """Fuel, charge and what shafts hold at the start against everything spent, to 1e-9 of what was taken."""
    car, (cycle, *part) = load_architecture(name), cycle.split()
    trace = short(cycle, int(part[0])) if part else load_cycle(cycle)
    problem = build_problem(car, trace, allow_shortfall=True)
    for strategy in fitting(car.marks, every=not part):
        learnt = {"training": [problem]} if strategy == "sdp" else {}
        run = simulate(problem, STRATEGIES[strategy].solve(problem, **learnt).control)
        f, heat = run.flows, car.engine.heating_value_jpkg
        taken = (
            heat * run.total_fuel_kg + f["shafts_before_j"][0] + run.energy_j[0] - run.energy_j[-1]
        )
        on = np.array([True, *(problem.table.controls[c].engine_on for c in run.control)])
        spent = car.engine.start_fuel_kg * heat * np.sum(on[1:] & ~on[:-1])
        changed = run.switch_fuel_kg * heat - f["spin_fuel_j"]
        changed -= car.engine.start_fuel_kg * heat * (on[1:] & ~on[:-1])
        spent += np.sum(changed) + np.sum(f["spin_loss_j"]) + f["shafts_end_j"][-1]
        for flow in (
            "engine_loss_w", "clutch_loss_w", "gearbox_loss_w", "gear_loss_w", "machine_loss_w",
            "brake_power_w", "battery_loss_w", "auxiliary_power_w", "wheel_power_w",
        ):  # fmt: skip
            spent += np.sum(f[flow] * problem.table.step_s)
        assert abs(taken - spent) < 1e-9 * (abs(taken) + 1e6), strategy
        for component, residual_w in run.residuals.items():
            assert np.max(np.abs(residual_w)) < 1e-6, (strategy, component)


@pytest.mark.parametrize(
    ("parts", "words"),
    [
        ('{ kind = "gear", name = "g", first = "ring", second = "wheel", ratio = 3.0 }', "engine on 'carrier'"),
        ('{ kind = "gear", name = "g", first = "ring", second = "wheel" }', "needs ratio"),
        ('{ kind = "planetary", name = "p", first = "a", sun = "s", ring = "r", carrier = "c", ratio = 2.0 }',
         "does not use first"),
        (BRAKED_SPLIT.split("parts = [")[1].split("]")[0] + '{ kind = "gear", name = "idler", first = "a", '
         'second = "b", ratio = 3.0 }', "idler turns nothing"),
    ],
    ids=["a shaft that nothing turns", "a gear without ratio", "a key of another part", "a part apart"],
)  # fmt: skip
def test_a_wrong_topology_names_its_parts(tmp_path, parts, words):
    from hevopt import DataError

    path = tmp_path / "own.toml"
    text = HEAD + BRAKED_SPLIT.split("parts = [")[0] + f"parts = [{parts}]\n"
    path.write_text(text)
    with pytest.raises(DataError) as found:
        load_architecture(path)
    assert words in str(found.value), str(found.value)
