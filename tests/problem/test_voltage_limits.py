"""Lowest and highest voltage of a battery: the power that they let through, by search over charge and current."""

from dataclasses import replace

import numpy as np
import pytest

from hevopt import DataError, load_architecture
from hevopt.problem.battery import Battery, power_limits_w


def drawn(rng):
    soc = np.array([0.0, 0.3, 0.6, 1.0])
    voltage = 200 + np.cumsum(rng.uniform(0, 25, 4))
    ohm = rng.uniform(0.1, 1.5, (2, 4))
    low, high = np.interp([0.2, 0.9], soc, voltage)
    return Battery(
        soc, voltage, *ohm, 2e4, soc_min=0.2, soc_max=0.9,
        voltage_min_v=float(rng.uniform(0.2, 0.999) * low),
        voltage_max_v=float(high * rng.uniform(1.01, 1.5)),
    )  # fmt: skip


def searched_w(battery):
    """Least over the window of the most that each state of charge lets through."""
    soc = np.linspace(battery.soc_min, battery.soc_max, 701)
    open_v, discharge, charge = (
        np.interp(soc, battery.soc, curve)
        for curve in (battery.open_circuit_v, battery.discharge_ohm, battery.charge_ohm)
    )
    share = np.linspace(0, 1, 2001)[:, None]
    given_a = share * (open_v - battery.voltage_min_v) / discharge
    delivered = np.max((open_v - discharge * given_a) * given_a, axis=0).min()
    taken_a = share * (battery.voltage_max_v - open_v) / charge
    return -np.max((open_v + charge * taken_a) * taken_a, axis=0).min(), delivered


def test_limits_are_those_of_a_search():
    rng = np.random.default_rng(3)
    for _ in range(30):
        battery = drawn(rng)
        for found, searched in zip(power_limits_w(battery), searched_w(battery), strict=True):
            assert found == pytest.approx(searched, rel=2e-5)


def test_without_limits_nothing_changes():
    battery = load_architecture("C2").battery
    free = replace(battery, voltage_min_v=0.0, voltage_max_v=np.inf)
    assert power_limits_w(battery) == power_limits_w(free)


def test_a_files_limits_are_those_of_a_cell():
    keys = {"battery.voltage_min_v": 2.8, "battery.voltage_max_v": 4.1}
    battery = load_architecture("C2", keys).battery
    least, greatest = power_limits_w(battery)
    low_v, high_v = 64 * (3.3 + 0.57 * 0.4), 64 * (3.3 + 0.57 * 0.8)
    ohm = 64 * 0.0038
    assert greatest == pytest.approx(64 * 2.8 * (low_v - 64 * 2.8) / ohm)
    assert least == pytest.approx(-64 * 4.1 * (64 * 4.1 - high_v) / ohm)


@pytest.mark.parametrize("key", [{"battery.voltage_min_v": 3.6}, {"battery.voltage_max_v": 3.7}])
def test_a_limit_within_the_open_circuit_voltage_is_a_message(key):
    with pytest.raises(DataError, match=r"open-circuit voltage runs from 225\.792 to 240\.384 V"):
        load_architecture("C2", key)
