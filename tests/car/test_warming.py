"""A warming engine: its heat balance closes, and the fuel factor does what it says."""

from itertools import pairwise

import numpy as np
import pytest

from hevopt import DataError, load_architecture
from hevopt.car.warming import DIESEL, PETROL, fuel_factor, warmed, warming_of

ENGINE = load_architecture("C2").engine


def driven(start_c, steps=1500, power_w=8e3, fuel_kgps=6e-4):
    step_s = np.ones(steps)
    return warmed(ENGINE, fuel_kgps * step_s, power_w * step_s, step_s, start_c)


@pytest.mark.parametrize(("of", "cold"), [(PETROL, 2.0), (DIESEL, 1.1)])
def test_the_factor_is_the_sources_at_20_degrees_and_one_where_it_is_hot(of, cold):
    assert fuel_factor(20.0, of) == pytest.approx(cold)
    assert fuel_factor(of.hot_c, of) == fuel_factor(120.0, of) == 1.0
    factors = [fuel_factor(t, of) for t in range(10, 96, 5)]
    assert all(a > b for a, b in pairwise(factors))


def test_the_factors_are_those_printed_for_two_diesels_and_for_petrol():
    """Normalised temperatures 0.985 and 0.837: 1.1 and 1.09 chosen from the maps, 1.95 and 1.58 before."""
    for share, diesel, petrol in ((0.985, 1.10, 1.95), (0.837, 1.09, 1.58)):
        at_c = 95.0 - 75.0 * share
        assert fuel_factor(at_c, DIESEL) == pytest.approx(diesel, abs=5e-3)
        assert fuel_factor(at_c, PETROL) == pytest.approx(petrol, abs=5e-3)


def test_fuel_tells_which_factor():
    assert warming_of(ENGINE) is DIESEL
    assert warming_of(load_architecture("prius_1998").engine) is PETROL


def test_heat_kept_and_lost_is_heat_given():
    """Below the thermostat: share x waste = C x rise + what leaves, added up in small steps of another rule."""
    coolant_c, burnt_kg = driven(20.0, steps=200)
    power_w = float(np.max(ENGINE.full_load_torque_nm * ENGINE.full_load_speed_radps))
    heat_jpk = 2.6e-3 * power_w * 500.0
    assert coolant_c.max() < 90.0
    waste_j = ENGINE.heating_value_jpkg * burnt_kg - 8e3
    lost_j = 10.0 * ((coolant_c[1:] + coolant_c[:-1]) / 2 - 20.0)
    kept_j = heat_jpk * (coolant_c[-1] - coolant_c[0])
    assert 0.6 * waste_j.sum() == pytest.approx(kept_j + lost_j.sum(), rel=1e-5)


def test_a_hot_engine_burns_what_it_burns_and_stays_hot():
    coolant_c, burnt_kg = driven(PETROL.hot_c)
    assert np.array_equal(burnt_kg, np.full(1500, 6e-4)) and coolant_c.max() == PETROL.hot_c


def test_it_warms_faster_under_load_and_cools_at_rest():
    light, heavy = driven(20.0, fuel_kgps=4e-4)[0], driven(20.0)[0]
    assert np.all(heavy[1:] >= light[1:])
    rest = np.zeros(600)
    coolant_c, burnt_kg = warmed(ENGINE, rest, rest, rest + 1, 20.0)
    assert not burnt_kg.any() and np.allclose(coolant_c, 20.0)


@pytest.mark.parametrize("start_c", [-20.0, 96.0, float("nan")])
def test_a_start_that_the_factor_does_not_cover_is_refused(start_c):
    with pytest.raises(DataError, match="allowed: 10 to 95"):
        driven(start_c)
