"""Drivelines as graphs: what cannot be driven is named, and short kinds stand for parts."""

import numpy as np
import pytest

from hevopt import DataError
from hevopt.car.driveline import Driveline, Phase, State
from hevopt.car.linear import Row, SingularError, solved
from hevopt.car.parts import WHEEL, Clutch, Gear, Planetary, ShaftBrake
from hevopt.car.ways import way

MOVING = Phase(standing=False)
SPLIT = Planetary("power split", "sun", "ring", "carrier", 2.6)
FINAL = Gear("final drive", "ring", WHEEL, 3.93)
PRIUS = Driveline("parts", (SPLIT, FINAL), "carrier", (("mg1", "sun"), ("mg2", "ring")), True)


def test_equations_are_solved_for_all_values_of_their_coefficients_at_once():
    ratio = np.array([4.0, 2.0, 1.0])
    rows = [
        Row("mesh", {"a": 1.0, "b": -ratio}, {}),
        Row("wheels", {"b": 2.0}, {"v": 1.0}),
        Row("sum", {"a": 1.0, "b": 1.0, "c": -1.0}, {"t": 3.0}),
    ]
    found = solved(rows)
    assert np.allclose(found["a"]["v"], ratio / 2)
    assert np.allclose(found["c"]["v"], ratio / 2 + 0.5) and np.allclose(found["c"]["t"], -3)
    with pytest.raises(SingularError) as error:
        solved([*rows[1:], Row("again", {"b": -1.0}, {})])
    assert error.value.redundant == ("again",) and error.value.undetermined == ("c",)


def test_a_power_split_has_one_free_speed_and_one_free_torque_with_the_engine_and_none_without():
    on, off = way(PRIUS, State(True), MOVING), way(PRIUS, State(False), MOVING)
    assert on.held == {"carrier": "free"} and on.chosen == ("engine",) and on.slack == "mg2"
    assert on.closing == {"engine": ("mg1", "mg2")}
    assert off.held == {"carrier": "rest"} and off.chosen == () and off.slack == "mg2"


def test_a_series_car_is_two_halves():
    line = Driveline("parts", (FINAL,), "crank", (("mg1", "crank"), ("mg2", "ring")), True)
    on, off = way(line, State(True), MOVING), way(line, State(False), MOVING)
    assert on.chosen == ("engine",) and on.closing == {"engine": ("mg1",)} and on.slack == "mg2"
    assert dict(off.active) == {"mg2": "ring"} and off.slack == "mg2"


def test_standing_the_brake_holds_and_a_machine_on_the_wheels_gives_nothing():
    on = way(PRIUS, State(True), Phase(standing=True))
    assert on.slack is None and set(on.active) == {"engine", "mg1"} and on.chosen == ("engine",)
    assert on.closing == {"engine": ("mg1",)}


@pytest.mark.parametrize(
    ("parts", "machines", "words"),
    [
        ((SPLIT, FINAL, Gear("second final", "ring", WHEEL, 4.0)), PRIUS.machines, "locked by"),
        ((FINAL, Gear("twin", "ring", WHEEL, 3.93)), PRIUS.machines[1:], "final drive, twin"),
        ((SPLIT,), PRIUS.machines[:1], "the speed of sun, ring"),
        ((FINAL,), tuple((f"m{n}", "ring") for n in range(4)), "quantities are free"),
    ],
    ids=["two ratios", "the same gears twice", "no way to the wheels", "four machines"],
)
def test_a_driveline_that_cannot_be_solved_names_its_parts(parts, machines, words):
    engine = "carrier" if SPLIT in parts else "ring"
    line = Driveline("parts", parts, engine, machines, free_engine_speed=True)
    with pytest.raises(DataError) as error:
        way(line, State(True), MOVING)
    assert words in str(error.value) and "with the engine on" in str(error.value)


def test_a_brake_takes_the_freedom_of_a_power_split():
    line = Driveline(
        "parts", (*PRIUS.parts, ShaftBrake("b", "sun")), "carrier", PRIUS.machines, True
    )
    free = way(line, State(True), MOVING)
    held = way(line, State(True, closed=frozenset({"b"})), MOVING)
    assert "carrier" in free.held and not held.held and held.tied
    # MG1 at rest has a torque of its own that the brake takes: nothing to the car, but a choice.
    assert set(held.chosen) <= {"mg1", "mg2"}


def test_a_clutch_of_the_strategy_is_a_state():
    line = Driveline(
        "parts", (FINAL, Clutch("lock-up", "crank", "ring", "strategy")), "crank",
        (("mg1", "crank"), ("mg2", "ring")), True,
    )  # fmt: skip
    states = list(line.states())
    assert len(states) == 4
    shut = next(state for state in states if state.engine_on and state.closed)
    assert way(line, shut, MOVING).chosen == ("mg1", "mg2") and way(line, shut, MOVING).tied
