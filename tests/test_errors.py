"""A message that lists faults is made of them; nothing takes it apart again."""

import pickle

import pytest

from hevopt.errors import DataError, Fault, InfeasibleError, UnknownNoxError


def test_one_fault_is_one_line():
    error = DataError.of("car.toml", ["mass_kg: missing"])
    assert str(error) == error.headline == "car.toml: mass_kg: missing"
    assert error.faults == (Fault("car.toml", "mass_kg: missing"),)
    assert error.listed == ["car.toml: mass_kg: missing"]


def test_several_faults_are_counted_and_stand_below_each_other():
    error = DataError.of("car.toml", ["a: x\n  y", "b: z"])
    assert str(error) == "car.toml: 2 faults\n  a: x\n  y\n  b: z"
    assert error.headline == "car.toml: 2 faults"
    assert error.listed == ["car.toml: a: x\n  y", "car.toml: b: z"]


def test_faults_that_are_not_given_are_counted():
    error = DataError.of("c: d.toml", ["a: x", "b: z"], 7)
    assert str(error) == "c: d.toml: 7 faults\n  a: x\n  b: z\n  and 5 more"
    assert error.listed == ["c: d.toml: a: x", "c: d.toml: b: z", "c: d.toml: and 5 more"]


@pytest.mark.parametrize("kind", [DataError, UnknownNoxError, InfeasibleError])
def test_a_message_of_its_own_is_one_thing(kind):
    error = kind("A cannot follow:\n  t = 3 s")
    assert str(error) == "A cannot follow:\n  t = 3 s" and error.headline == "A cannot follow"
    assert error.listed == [str(error)]


def test_errors_travel_between_processes():
    for error in (DataError.of("a.toml", ["x", "y"], 3), DataError("x"), InfeasibleError("y\n  z")):
        again = pickle.loads(pickle.dumps(error))
        assert type(again) is type(error)
        assert (str(again), again.listed) == (str(error), error.listed)
