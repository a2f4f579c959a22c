"""The waist cannot change behind a proof's back, and says in one message what it does not take."""

import copy
import pickle
from dataclasses import fields, replace

import numpy as np
import pytest
from problems import random_problem

from hevopt import Battery, ControlTable, DataError, InfeasibleError, Problem, simulate
from hevopt.problem.reject import Reject
from hevopt.problem.table import Signals

FUEL = np.array([[1e-4, 2e-4], [1e-4, 2e-4], [1e-4, 2e-4]])
POWER = np.array([[500.0, -500.0]] * 3)


def small_problem() -> Problem:
    battery = Battery([0.0, 1.0], [100.0, 100.0], [0.0, 0.0], [0.0, 0.0], 3600.0, 1.0, 0.1, 0.9)
    return Problem(ControlTable.from_arrays(FUEL, POWER), battery, 0.5, 0.5)


def given_arrays() -> dict:
    """What a table with signals and flows is made of, as a caller has it: writable, in odd types."""
    steps, controls = 3, 2
    return {
        "time_s": np.arange(steps),
        "step_s": np.ones(steps, dtype=np.float32),
        "fuel_kg": np.asfortranarray(FUEL),
        "nox_kg": np.zeros_like(FUEL),
        "battery_power_w": POWER.copy(),
        "reject": np.zeros(FUEL.shape),
        "mode": np.array([0.0, 1.0]),
        "switch_fuel_kg": np.zeros((2, 2), dtype=int),
        "switch_allowed": np.ones((2, 2), dtype=int),
        "controls": ["a", "b"],
        "signals": Signals(np.ones(steps), np.ones(steps), np.ones(steps), np.zeros(steps)),
        "flows": {"wheel_power_w": np.ones((steps, controls))},
        "missing_torque_nm": np.zeros(steps),
    }


def arrays_of(table: ControlTable) -> dict[str, np.ndarray]:
    parts = {part.name: getattr(table, part.name) for part in fields(table)}
    parts |= {f"signals {part.name}": getattr(table.signals, part.name) for part in fields(Signals)}
    parts |= {f"flows {name}": values for name, values in table.flows.items()}
    return {name: values for name, values in parts.items() if isinstance(values, np.ndarray)}


def test_a_table_keeps_what_it_was_given_and_leaves_the_callers_arrays_alone():
    given = given_arrays()
    table = ControlTable(**given)
    for name in (
        "step_s",
        "fuel_kg",
        "battery_power_w",
        "mode",
        "switch_fuel_kg",
        "switch_allowed",
    ):
        given[name][...] = 7
    given["flows"]["wheel_power_w"][...] = 7.0
    given["flows"]["more"] = FUEL
    given["controls"].append("c")
    np.testing.assert_array_equal(table.fuel_kg, FUEL)
    np.testing.assert_array_equal(table.battery_power_w, POWER)
    assert table.step_s.tolist() == [1.0] * 3 and table.mode.tolist() == [0, 1]
    assert not table.switch_fuel_kg.any() and table.switch_allowed.all()
    assert list(table.flows) == ["wheel_power_w"] and (table.flows["wheel_power_w"] == 1).all()
    assert table.controls == ("a", "b")


def test_a_view_taken_before_does_not_write_to_the_table():
    fuel = FUEL.copy()
    view = fuel[:]
    fuel.flags.writeable = False
    table = ControlTable(**given_arrays() | {"fuel_kg": fuel})
    view[0, 0] = 9.0
    assert table.fuel_kg[0, 0] == FUEL[0, 0]


@pytest.mark.parametrize("made", [lambda t: t, copy.copy, copy.deepcopy, lambda t: replace(t, reject=t.reject),
                                  lambda t: pickle.loads(pickle.dumps(t))])  # fmt: skip
def test_nothing_in_a_table_can_be_changed(made):
    table = made(ControlTable(**given_arrays()))
    arrays = arrays_of(table)
    assert len(arrays) == 16
    for name, values in arrays.items():
        with pytest.raises(ValueError, match="read-only"):
            values[...] = 0
        with pytest.raises(ValueError, match="WRITEABLE"):
            values.flags.writeable = True
        assert values.dtype.kind in {"mode": "i", "signals gear": "i", "reject": "u"}.get(
            name, "fb"
        )
    with pytest.raises(TypeError):
        table.flows["wheel_power_w"] = FUEL


def test_what_cannot_change_is_not_copied_again():
    problem = random_problem(1)
    power = problem.table.battery_power_w
    limit = float(np.abs(power).max()) - 1.0
    limited = replace(problem, battery=replace(problem.battery, power_max_discharge_w=limit,
                                               power_max_charge_w=limit))  # fmt: skip
    assert (limited.table.reject & Reject.BATTERY_LIMIT).any()
    for name in ("fuel_kg", "battery_power_w", "mode", "switch_fuel_kg"):
        assert getattr(limited.table, name) is getattr(problem.table, name)


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"fuel_kg": np.zeros((3, 0)), "battery_power_w": np.zeros((3, 0))}, "a control at least"),
        ({"fuel_kg": np.zeros((0, 2)), "battery_power_w": np.zeros((0, 2))}, "with a step"),
        ({"fuel_kg": FUEL[0]}, "one shape"),
        ({"fuel_kg": [[1.0], [1.0, 2.0]]}, "fuel_kg must be an array of numbers"),
        ({"fuel_kg": FUEL.astype(str)}, "fuel_kg must hold numbers"),
        ({"fuel_kg": FUEL * 1j}, "fuel_kg must hold numbers"),
        ({"fuel_kg": None}, "fuel_kg must hold numbers"),
        ({"fuel_kg": np.full_like(FUEL, np.nan)}, "NaN"),
        ({"step_s": [1.0, 1.0]}, r"step_s has shape \(2,\); allowed: one number, or one per step, \(3,\)"),
        ({"step_s": np.ones((3, 1))}, "step_s has shape"),
        ({"step_s": 0.0}, "step_s must be > 0"),
        ({"step_s": np.nan}, "step_s holds NaN"),
        ({"nox_kg": [0.0]}, "shape of fuel_kg"),
        ({"feasible": [True]}, "shape of fuel_kg"),
        ({"mode": [0, 1, 2]}, r"mode has shape \(3,\), expected \(2,\)"),
        ({"mode": [[0, 1]]}, "mode has shape"),
        ({"mode": [0, 1.5]}, "mode holds 1.5; allowed: whole numbers"),
        ({"mode": [0, np.nan]}, "mode holds nan"),
        ({"mode": [0, -1]}, "mode runs from -1"),
        ({"mode": [-3, -2]}, "mode runs from -3"),
        ({"mode": [0, 10**9]}, "mode runs to 1000000000; allowed: 0 to 999"),
        ({"mode": [0, 2], "switch_fuel_kg": np.zeros((2, 2))}, "allowed: 0 to 1"),
        ({"switch_fuel_kg": [[0.0], [0.0, 1.0]]}, "switch_fuel_kg must be an array"),
        ({"switch_fuel_kg": 0.0}, "switch_fuel_kg has shape"),
        ({"switch_fuel_kg": [0.0, 1.0]}, "switch_fuel_kg has shape"),
        ({"switch_fuel_kg": np.zeros((1, 2))}, "switch_fuel_kg has shape"),
        ({"switch_fuel_kg": [[-1.0]]}, "must be >= 0"),
        ({"switch_allowed": [True, True]}, r"switch_allowed has shape \(2,\), expected \(1, 1\)"),
        ({"switch_allowed": "yes"}, "switch_allowed must hold numbers"),
    ],
)  # fmt: skip
def test_arrays_that_make_no_table_are_refused_in_one_message(wrong, said):
    with pytest.raises(DataError, match=said):
        ControlTable.from_arrays(**{"fuel_kg": FUEL, "battery_power_w": POWER} | wrong)


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"fuel_kg": FUEL[0]}, r"expected \(time, control\)"),
        ({"reject": np.full(FUEL.shape, 70_000)}, "reject holds 70000; allowed: whole numbers from 0 to 65535"),
        ({"missing_torque_nm": np.zeros(2)}, "missing_torque_nm has shape"),
        ({"flows": {"wheel_power_w": np.zeros(3)}}, "wheel_power_w has shape"),
        ({"signals": Signals(*np.ones((4, 2)))}, "signals.speed_mps has shape"),
        ({"controls": ("a",)}, "1 labels for 2 controls"),
    ],
)  # fmt: skip
def test_parts_that_do_not_fit_are_refused_in_one_message(wrong, said):
    with pytest.raises(DataError, match=said):
        ControlTable(**given_arrays() | wrong)


@pytest.mark.parametrize(
    ("plan", "said"),
    [
        ([5.7, 0, 0], r"control 5\.7 at step 0 .* allowed: whole numbers from 0 to 1"),
        ([0, 0.5, 0], r"control 0\.5 at step 1"),
        ([0, 0, np.nan], "control nan at step 2"),
        ([0, np.inf, 0], "control inf at step 1"),
        ([0, 1e300, 0], r"control 1e\+300 at step 1"),
        ([0, 2, 0], "control 2 at step 1"),
        ([-1, 0, 0], "control -1.* at step 0"),
        (np.array([0, 2**64 - 1, 0], dtype=np.uint64), "at step 1"),
        ([True, False, True], "not bool"),
        (["0", "1", "0"], "indices of controls"),
        ([None] * 3, "not object"),
        ([0, 1], r"one control per step, 3; found \(2,\)"),
        ([[0], [0, 1], [0]], "unequal rows"),
    ],
)
def test_what_is_no_index_is_not_driven(plan, said):
    with pytest.raises(InfeasibleError, match=said):
        simulate(small_problem(), plan)


def test_whole_numbers_of_any_type_are_indices():
    problem = small_problem()
    expected = simulate(problem, [0, 1, 1]).control
    for kind in (np.uint8, np.int32, np.float64):
        found = simulate(problem, np.array([0, 1, 1], dtype=kind)).control
        np.testing.assert_array_equal(found, expected)
        assert found.dtype == np.int64
