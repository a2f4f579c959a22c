"""Drivelines that can be driven in some of their clutches' combinations alone, which their files list."""

import numpy as np
import pytest
from split_cars import short

from hevopt import DataError, load_architecture
from hevopt.car.driveline import State
from hevopt.studies.case import prepare

K, FINAL_DRIVE = 2.24, 2.16
CAR = """name = "own"
car = "car_prius_1998"
engine = "engine_petrol_1500_atkinson"
battery = "battery_nimh_40"
functions = ["start_stop", "e_boost", "regenerative_braking", "power_management"]
machine = { file = "machine_generator_15kw", scale = { power = 3.0 } }
machine_2 = { file = "machine_motor_30kw", scale = { power = 2.0 } }
[coupling]
kind = "parts"
engine_shaft = "crank"
machine_shaft = "generator"
machine_2_shaft = "sun"
parts = [
  { kind = "planetary", name = "set", sun = "sun", ring = "ring", carrier = "carrier", ratio = 2.24, \
efficiency = 0.98 },
  { kind = "shaft_brake", name = "C1", first = "ring" },
  { kind = "clutch", name = "C2", first = "ring", second = "generator", operation = "strategy" },
  { kind = "clutch", name = "C3", first = "crank", second = "generator", operation = "strategy" },
  { kind = "gear", name = "final drive", first = "carrier", second = "wheel", ratio = 2.16, efficiency = 0.97 },
]
"""
# Ring held: electric, or a series car; ring on the engine's shaft: an output split.
STATES = """states = [
  { closed = ["C1"], engine = "off" },
  { closed = ["C1", "C3"], engine = "on" },
  { closed = ["C3", "C2"], engine = "on" },
]
"""


def car_of(folder, states):
    path = folder / "own.toml"
    path.write_text(CAR + states)
    return load_architecture(path)


def test_what_may_be_closed_together_is_what_the_file_lists(tmp_path):
    states = list(car_of(tmp_path, STATES).driveline.states())
    assert states == [
        State(True, closed=frozenset({"C2", "C3"})),
        State(True, closed=frozenset({"C1", "C3"})),
        State(False, closed=frozenset({"C1"})),
    ]
    both = STATES.replace('["C1", "C3"], engine = "on"', '["C1", "C3"]')
    assert State(False, closed=frozenset({"C1", "C3"})) in car_of(tmp_path, both).driveline.states()


def test_a_range_extender_with_three_clutches_is_solved_and_proven(tmp_path):
    case = prepare(car_of(tmp_path, STATES), short("udds", 330), levels=20)
    plan, found = case.dp_trajectory, case.dp_trajectory.flows
    bound_kg, _ = case.certificate.bound_of(plan)
    assert 0 <= plan.cost_kg / bound_kg - 1 < 2e-3
    assert max(np.max(np.abs(residual)) for residual in plan.residuals.values()) < 1e-6
    on = np.array([case.problem.table.controls[c].engine_on for c in plan.control])
    engine, sun = found["engine_speed_radps"], found["machine_2_speed_radps"]
    carrier = case.problem.table.signals.speed_mps / 0.287 * FINAL_DRIVE
    ring = ((1 + K) * carrier - sun) / K
    held, joined = np.abs(ring) < 1e-9, on & (np.abs(ring - engine) < 1e-9)
    assert (held | joined).all() and held[~on].all()
    assert (joined & ~held).any() and (held & on & (engine > 0)).any()
    np.testing.assert_allclose(found["machine_speed_radps"][on], engine[on], atol=1e-9)


@pytest.mark.parametrize(
    ("states", "words"),
    [
        ("", "nothing determines the speed of sun, ring.*coupling.states"),
        (STATES.replace('"C3", "C2"', '"C3"'), "with the engine on, C3 closed, nothing determines"),
        (STATES.replace('"C3", "C2"', '"C3", "C4"'), "C4 is nothing that the strategy closes; allowed: C1, C2, C3"),
        (STATES.replace('"on"', '"off"'), "the engine is off in all of them"),
        ("states = []\n", "states"),
        ('states = [{ closed = ["C1"], engine = "idle" }]\n', "engine"),
    ],
    ids=["none listed", "one too loose", "a name of no part", "no engine", "empty", "a third way"],
)  # fmt: skip
def test_states_that_cannot_be_are_one_message(tmp_path, states, words):
    with pytest.raises(DataError, match=words):
        car_of(tmp_path, states)
