"""The list of slow tests names tests, and is read from what the runner prints."""

from pathlib import Path

from slow import measured, slow

TESTS = Path(__file__).parent


def test_every_slow_test_is_there():
    for name in slow():
        path, function = name.split("::")
        assert f"def {function}(" in (TESTS / path).read_text(), name


def test_what_takes_more_than_two_seconds_with_its_setup_is_slow():
    log = """
1.70s call     tests/cars/test_car.py::test_it_rolls[A]
0.20s setup    tests/cars/test_car.py::test_it_rolls[B]
0.30s call     tests/cars/test_car.py::test_it_rolls[B]
1.90s call     tests/cars/test_car.py::test_it_stops
70.00s call     tests/test_types.py::test_types_hold
"""
    assert measured(log) == ["cars/test_car.py::test_it_rolls"]
