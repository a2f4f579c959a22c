"""The list of slow tests names tests, and is read from what the runner prints."""

from pathlib import Path

from slow import measured, slow

TESTS = Path(__file__).parent


def test_every_slow_test_is_there():
    for name in slow():
        path, _, function = name.partition("::")
        assert f"def {function}" in (TESTS / path).read_text(), name


def test_what_takes_more_than_two_seconds_is_slow_and_so_is_a_file_that_is_set_up_as_long():
    log = """
1.70s call     tests/cars/test_car.py::test_it_rolls[A]
0.40s call     tests/cars/test_car.py::test_it_rolls[B]
0.40s setup    tests/cars/test_car.py::test_it_rolls[B]
1.90s call     tests/cars/test_car.py::test_it_stops
2.10s setup    tests/pages/test_page.py::test_it_opens
9.00s call     tests/pages/test_page.py::test_it_opens
70.00s call     tests/test_types.py::test_types_hold
"""
    assert measured(log) == ["cars/test_car.py::test_it_rolls", "pages/test_page.py"]
