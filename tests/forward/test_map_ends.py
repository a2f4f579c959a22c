"""Measured maps of driven engines at idle speed, and steps that leave a map on their way."""

import numpy as np
import pytest

from hevopt import load_architecture
from hevopt.forward._limits_kernels import by_map
from hevopt.forward.burning import burnt_kgps
from hevopt.forward.limits import limits_of
from hevopt.forward.map_ends import within_map

MAPPED = ("series_parallel_1500", "accord_hybrid_2019", "prius_2016", "insight_2000", "s60_b5_2022")


@pytest.mark.parametrize("name", MAPPED)
def test_drag_at_idle_speed_is_the_maps(name):
    car = load_architecture(name)
    engine = car.engine
    for over in (0.0, 0.01, 0.1, 0.24):
        speed = engine.idle_radps + over
        drag = float(engine.drag_nm(np.array([speed]))[0])
        assert by_map(speed, limits_of(car)).least_nm == pytest.approx(drag, rel=2e-3)


def read(engine, torque_nm, *side_radps):
    begins, ends = side_radps
    found = within_map(engine, np.array([torque_nm]), np.array([begins]), np.array([ends]))
    burnt = burnt_kgps(engine, found.torque_nm, found.speed_radps)
    assert np.array_equal([found.fuel_kgps, found.nox_kgps], burnt, equal_nan=True)
    return found.torque_nm[0], found.speed_radps[0]


def test_a_step_that_begins_or_ends_in_the_map_counts_at_its_end():
    engine = load_architecture("s60_b5_2022").engine
    idle = engine.idle_radps
    drag, most = engine.drag_nm(np.array([idle]))[0], engine.covered_nm(np.array([idle]))[0]
    assert read(engine, drag, idle, 0.98 * idle) == (drag, idle)
    assert read(engine, drag, 0.98 * idle, idle) == (drag, idle)
    # It lies below idle speed for good: no data.
    assert read(engine, drag, 0.98 * idle, 0.98 * idle) == (drag, 0.98 * idle)
    # Full load falls within the step, from what the loop knew.
    begins, mean = 180.0, 145.0
    known, left = (float(engine.covered_nm(np.array([w]))[0]) for w in (begins, mean))
    assert known > 1.01 * left
    assert read(engine, known, begins, 2 * mean - begins) == (left, mean)
    assert read(engine, 1.01 * known, begins, 2 * mean - begins) == (1.01 * known, mean)
    assert read(engine, 0.5 * most, begins, begins) == (0.5 * most, begins)
    # Nothing is read anew where the map knows it.
    assert np.isfinite(engine.fuel_kgps(left, mean))


def test_what_coefficients_know_stays_as_it_is():
    engine = load_architecture("C2").engine
    idle = engine.idle_radps
    for torque, begins, ends in ((500.0, 0.9, 1.0), (-30.0, 1.0, 0.9), (150.0, 2.0, 1.5)):
        mean = idle * (begins + ends) / 2
        assert read(engine, torque, begins * idle, ends * idle) == pytest.approx((torque, mean))
