"""Fuel of an engine off the pedal, where its map has none."""

import numpy as np
import pytest

from hevopt import load_architecture
from hevopt.forward.burning import burnt_kgps

SPEED = np.full(5, 210.0)


def test_between_drag_and_the_maps_lowest_torque_fuel_is_that_of_both_for_shares_of_the_time():
    engine = load_architecture("p0_48v").engine
    drag = float(engine.drag_nm(SPEED[:1])[0])
    torque = np.array([1.5 * drag, drag, 0.75 * drag, 0.25 * drag, 0.0])
    assert np.isnan(engine.fuel_kgps(torque, SPEED)[2:4]).all()
    fuel, nox = burnt_kgps(engine, torque, SPEED)
    idling = engine.fuel_kgps(torque, SPEED)[-1]
    assert fuel == pytest.approx([0.0, 0.0, 0.25 * idling, 0.75 * idling, idling])
    assert not nox.any()


def test_what_a_map_lacks_elsewhere_stays_unknown_and_a_law_without_ends_as_it_is():
    mapped, law = (load_architecture(name).engine for name in ("p0_48v", "A"))
    high = 1.2 * mapped.covered_nm(SPEED)
    assert np.isnan(burnt_kgps(mapped, high, SPEED)[0]).all()
    torque = np.linspace(-60, 250, 5)
    fuel, nox = burnt_kgps(law, torque, SPEED)
    assert (fuel == law.fuel_kgps(torque, SPEED)).all()
    assert (nox[fuel > 0] == law.nox_kgps(torque, SPEED)[fuel > 0]).all()
