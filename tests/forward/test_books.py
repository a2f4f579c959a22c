"""The books' own passes over a record, each against the parts that it is made of."""

import numpy as np
import pytest
from forward.commands import asked_on_the_hill

from hevopt import load_architecture
from hevopt.forward import _drive_kernels as col
from hevopt.problem._battery_kernels import followed, trace
from hevopt.problem.battery import soc, states, step_flows


def test_a_battery_followed_is_traced_and_loses_what_its_current_does():
    pack = load_architecture("C2").battery
    power = np.random.default_rng(3).uniform(-4e3, 6e3, 400)
    start_j = 0.6 * pack.point_energy_j[-1]
    energy_j, charge, chemical_w, loss_w = followed(start_j, power, 0.1, pack.arrays)
    traced = trace(start_j, np.zeros(400), power, np.full(400, 0.1), pack.arrays)
    assert np.array_equal(energy_j, traced) and np.array_equal(charge, soc(pack, traced))
    _, voltage, discharge, charging = states(pack, traced[:-1])
    ohm = np.where(power < 0, charging, discharge)
    current = (voltage - np.sqrt(voltage**2 - 4 * ohm * power)) / (2 * ohm)
    uncharged = (1 - pack.coulombic_efficiency) * np.maximum(-voltage * current, 0)
    assert loss_w[:-1] == pytest.approx(ohm * current**2 + uncharged, rel=1e-9)
    assert chemical_w[:-1] == pytest.approx(power + loss_w[:-1], rel=1e-9)
    flows = step_flows(pack, traced[:-1], traced[1:], power, 0.1)
    assert np.array_equal(flows["battery_loss_w"], loss_w[:-1])
    assert flows["battery_current_a"] == pytest.approx(current, rel=1e-9)
    assert flows["battery_voltage_v"] * flows["battery_current_a"] == pytest.approx(power, rel=1e-9)


@pytest.mark.parametrize("name", ["A", "C2", "E"])
def test_the_books_speeds_and_powers_are_those_of_the_record(name):
    run, record, _ = asked_on_the_hill(name, 0.1)
    flows, radius = run.books.flows, run.car.vehicle.tyre_radius_m
    speed = (run.speed_mps[1:] + run.speed_mps[:-1]) / 2
    assert flows["speed_mps"] == pytest.approx(speed, abs=1e-12)
    gained_j = run.car.vehicle.equivalent_mass_kg * np.diff(run.speed_mps**2) / 2
    assert flows["kinetic_w"] * run.step_s == pytest.approx(gained_j, rel=1e-9, abs=1e-6)
    causes = sum(flows[f"clutch_{cause}_w"] for cause in ("launch", "change", "start", "other"))
    assert flows["clutch_loss_w"] == pytest.approx(causes, abs=1e-12)
    assert flows["clutch_loss_w"].sum() > 0 and flows["clutch_torque_nm"].max() > 10
    assert np.abs(flows["wheel_power_w"] - record[:, col.WHEEL] * speed / radius).max() < 1e-6


def test_gears_lose_their_share_of_what_passes_them():
    """A has one pair behind the clutch at a time: what enters less what the wheels get, driven and overrun."""
    run, record, _ = asked_on_the_hill("A", 0.1)
    flows = run.books.flows
    still = (record[1:, col.WAY] == record[:-1, col.WAY]) & (record[1:, col.BLEND] == 0)
    still = np.append(False, still & (record[:-1, col.BLEND] == 0))
    passed = flows["clutch_torque_nm"] * flows["engine_speed_radps"] - flows["clutch_loss_w"]
    lost = flows["gearbox_loss_w"] + flows["gear_loss_w"]
    share = 1 - run.car.gearbox.efficiency[run.gear]
    driven, overrun = still & (passed > 1e3), still & (passed < -500)
    assert driven.sum() > 50 and overrun.sum() > 50
    assert lost[driven] == pytest.approx((share * passed)[driven], rel=1e-9)
    assert lost[overrun] == pytest.approx((share * (lost - passed))[overrun], rel=1e-9)
