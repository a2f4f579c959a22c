"""Components against figures worked out by hand or published."""

from math import pi

import numpy as np
import pytest

from hevopt import load_architecture
from hevopt.car.engine_laws import EngineMap
from hevopt.car.transmission import input_torque_nm, output_torque_nm
from hevopt.car.vehicle import tractive_force_n
from hevopt.car_files.car import CarFile
from hevopt.car_files.components import vehicle_of
from hevopt.problem import battery as battery_model
from hevopt.problem._battery_kernels import chemical_power_at
from hevopt.problem.battery import Battery

RPM = 2 * pi / 60


def coastdown_car(mass_kg: float, **load: float) -> CarFile:
    """A car whose coast-downs gave 130 N, 2 N s/m and 0.38 N s²/m²."""
    load |= {"coastdown_c0_n": 130.0, "coastdown_c1_nspm": 2.0, "coastdown_c2_ns2pm2": 0.38}
    return CarFile(
        name="x", mass_kg=mass_kg, tyre_radius_m=0.3, wheel_inertia_kgm2=2.7, auxiliary_power_w=0.0,
        road_load=load,
    )  # fmt: skip


def test_coastdown_c0_grows_with_the_mass_over_that_of_the_test_by_hand():
    # 1000 kg tested, 1150 kg and 50 kg of hybrid parts: C0 = 130 x 1.2 = 156 N. 30 % climb at 20 m/s:
    # sqrt(1.09) = 1.0440307, so 156 / 1.0440307 = 149.4209 N rolling, 2 x 20 + 0.38 x 400 = 192 N air,
    # 1200 x 9.80665 x 0.3 / 1.0440307 = 3381.5046 N climbing.
    vehicle = vehicle_of(coastdown_car(1150.0, coastdown_mass_kg=1000.0), 50.0)
    force = tractive_force_n(vehicle, np.array([20.0]), np.zeros(1), np.array([0.3]))
    assert force[0] == pytest.approx(149.4209 + 192.0 + 3381.5046, abs=1e-3)
    level = tractive_force_n(vehicle, np.array([20.0]), np.zeros(1), np.zeros(1))
    assert level[0] == pytest.approx(348.0, rel=1e-14)


def test_without_its_mass_coastdown_c0_is_the_same_for_every_car():
    for mass_kg in (1000.0, 1800.0):
        vehicle = vehicle_of(coastdown_car(mass_kg), 50.0)
        assert vehicle.rolling_n == (0.0, 0.0, 0.0, 0.0)
        assert vehicle.air_n == (130.0, 2.0, 0.38, 0.0)


def test_at_the_mass_of_the_test_coastdown_c0_is_as_measured():
    vehicle = vehicle_of(coastdown_car(1000.0, coastdown_mass_kg=1000.0), 0.0)
    assert vehicle.rolling_n[0] == 130.0 and vehicle.air_n == (0.0, 2.0, 0.38, 0.0)


@pytest.fixture(scope="module")
def car():
    return load_architecture("C2")


def test_idle_burns_0_4_litres_per_hour(car):
    kgps = car.engine.fuel_kgps(np.array(0.0), np.array(850 * RPM))
    assert kgps * 3600 / 0.835 == pytest.approx(0.40, abs=0.005)


def test_peak_efficiency_is_40_5_percent_near_2375_rpm_and_190_nm(car):
    speed, torque = np.meshgrid(np.arange(850, 4500, 25) * RPM, np.arange(5, 290, 5.0))
    fuel = car.engine.fuel_kgps(torque, speed)
    efficiency = torque * speed / (fuel * 42.9e6)
    efficiency[torque > car.engine.full_load_nm(speed)] = 0
    best = np.unravel_index(efficiency.argmax(), efficiency.shape)
    assert efficiency.max() == pytest.approx(0.405, abs=0.002)
    assert speed[best] / RPM == pytest.approx(2375, abs=150)
    assert torque[best] == pytest.approx(190, abs=15)


def test_drag_is_22_nm_at_2000_rpm_and_there_the_fuel_is_cut(car):
    speed = np.array(2000 * RPM)
    drag = car.engine.drag_nm(speed)
    assert drag == pytest.approx(-22.5, abs=0.6)
    assert car.engine.fuel_kgps(drag, speed) == 0
    assert car.engine.fuel_kgps(drag + 1, speed) > 0


def test_fuel_mean_pressure_solves_its_equation(car):
    torque, speed = 100.0, 2000 * RPM
    power = car.engine.fuel_kgps(np.array(torque), np.array(speed)) * 42.9e6
    p_mf = power / (1598e-6 * speed / (4 * pi)) / 1e5
    p_me, cm = 4 * pi * torque / 1598e-6 / 1e5, 2 * 0.0805 * 2000 / 60
    slope = 0.39902 + 0.031510 * cm - 0.0022991 * cm**2
    assert slope * p_mf - 0.0013733 * p_mf**2 - 1.55291 - 0.0076 * cm**2 == pytest.approx(p_me)


def test_nox_at_2000_rpm_and_10_bar_by_hand(car):
    # BS = 1.216 + 2.722 / (1 + exp(-(10 - 8.498) / 1.471)) = 3.2172 g/kWh; 10 bar x 1.598 l x 16.667/s = 26.63 kW
    torque = 10e5 * 1598e-6 / (4 * pi)
    nox = car.engine.nox_kgps(np.array(torque), np.array(2000 * RPM))
    constant = 0.02e-6 * 1.598 * 2000 / 120
    assert nox - constant == pytest.approx(3.2172 * 26.633 / 3600 * 1e-3, rel=1e-4)


def test_a_measured_grid_is_exact_at_its_points_and_never_extrapolated(car):
    speeds, torques = np.array([100.0, 200.0, 300.0]), np.array([0.0, 50.0, 100.0])
    fuel = np.outer(speeds, 10 + torques) * 1e-8
    fuel[2, 2] = np.nan
    grid = EngineMap(speeds, torques, fuel, fuel / 100, np.array([-20.0, -22.0, -25.0]))
    from dataclasses import replace

    engine = replace(car.engine, law=grid)
    assert engine.fuel_kgps(np.array(50.0), np.array(200.0)) == fuel[1, 1]
    middle = engine.fuel_kgps(np.array(25.0), np.array(150.0))
    assert middle == pytest.approx(fuel[:2, :2].mean())
    outside = [(101.0, 150.0), (50.0, 99.0), (50.0, 301.0), (-5.0, 150.0), (90.0, 250.0)]
    for torque, speed in outside:
        assert np.isnan(engine.fuel_kgps(np.array(torque), np.array(speed)))
    assert engine.fuel_kgps(np.array(-22.0), np.array(200.0)) == 0


def test_machine_loss_and_its_inverse(car):
    torque, speed = np.array(-30.0), np.array(200.0)
    loss = 54.7 + 0.296 * 200 + 0.00204 * 200**2 + 0.194 * 30**2
    assert car.machines[0].loss_w(torque, speed) == pytest.approx(loss)
    electric = 30 * 200 - loss
    back = car.machines[0].generating_nm(electric, speed)
    assert back == pytest.approx(-30.0)
    assert car.machines[0].loss_w(np.array(0.0), np.array(0.0)) == 0


def test_torque_limit_follows_power_above_base_speed(car):
    limits = car.machines[0].limit_nm(np.array([0.0, 150.0, 300.0]))
    assert limits == pytest.approx([120, 120, 60])


def test_gearbox_loses_in_both_directions():
    assert output_torque_nm(np.array(100.0), 3.0, 0.95) == pytest.approx(285)
    assert output_torque_nm(np.array(-100.0), 3.0, 0.95) == pytest.approx(-300 / 0.95)
    torques = np.array([-50.0, 0.0, 70.0])
    assert input_torque_nm(output_torque_nm(torques, 4.1, 0.93), 4.1, 0.93) == pytest.approx(
        torques
    )


def test_cell_gives_730_w_at_2_5_v(car):
    # U = Uoc - R I = 2.5 V at I = (Uoc - 2.5) / R, so P = 2.5 I, at SOC 0.54: Uoc = 3.608 V.
    assert 2.5 * (3.30 + 0.57 * 0.54 - 2.5) / 0.0038 == pytest.approx(730, rel=2e-3)
    assert battery_model.within_limits(car.battery, np.array([64 * 729.0, 64 * 731.0])).tolist() == [
        True, False,
    ]  # fmt: skip


def test_pack_stores_1600_wh_and_ten_kw_round_trip_is_about_0_85(car):
    assert battery_model.energy_j(car.battery, 1.0) / 3600 == pytest.approx(1600, rel=0.01)
    middle = float(battery_model.energy_j(car.battery, 0.6))
    drained, stored = (chemical_power_at(p, middle, car.battery.arrays) for p in (10e3, -10e3))
    assert 10e3 / drained * -stored / 10e3 == pytest.approx(0.931 * 0.914, abs=2e-3)


def curved_battery():
    return Battery(
        np.array([0.0, 0.3, 0.7, 1.0]), np.array([200.0, 230.0, 240.0, 270.0]),
        np.array([0.5, 0.2, 0.25, 0.4]), np.array([0.4, 0.3, 0.3, 0.6]), 3600.0, 0.97, 0.1, 0.9,
    )  # fmt: skip


@pytest.mark.parametrize("soc", [0.05, 0.3, 0.5, 0.7, 0.95])
def test_energy_and_soc_are_inverse_and_energy_is_the_area_under_voltage(soc):
    pack = curved_battery()
    energy = battery_model.energy_j(pack, soc)
    assert battery_model.soc(pack, energy) == pytest.approx(soc, abs=1e-12)
    fine = np.linspace(0, soc, 20_001)
    area = np.trapezoid(np.interp(fine, pack.soc, pack.open_circuit_v), fine) * 3600
    assert energy == pytest.approx(area, rel=1e-7)


def test_discharge_drains_terminal_power_plus_current_heat():
    pack = curved_battery()
    for power in (5e3, -5e3):
        energy = float(battery_model.energy_j(pack, 0.45))
        voltage = np.interp(0.45, pack.soc, pack.open_circuit_v)
        ohm = np.interp(0.45, pack.soc, pack.discharge_ohm if power > 0 else pack.charge_ohm)
        current = (voltage - np.sqrt(voltage**2 - 4 * ohm * power)) / (2 * ohm)
        drained = power + ohm * current**2
        drained *= 1.0 if power > 0 else 0.97
        assert chemical_power_at(power, energy, pack.arrays) == pytest.approx(drained, rel=1e-12)
