"""A measured loss map of a machine: the formula at its points, its inverse, and nothing outside it."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from hevopt import DataError, build_problem, load_architecture, load_cycle, simulate, solve
from hevopt.car.grid import highest_known, interpolated
from hevopt.car.machine_laws import LossMap
from hevopt.files.lookup import shipped_folder
from hevopt.problem.reject import Reject

SHIPPED = shipped_folder("architectures")
SPEED = np.linspace(0, 650, 27)
TORQUE = np.linspace(-120, 120, 49)


@pytest.fixture(scope="module")
def formula():
    return load_architecture("C2").machines[0]


def sampled(machine, *, beyond_w: float = 30e3):
    """The machine with its loss as a map, cells beyond a power not measured."""
    speed, torque = np.meshgrid(SPEED, TORQUE, indexing="ij")
    loss = machine.loss_w(torque, speed)
    loss[np.abs(speed * torque) > beyond_w] = np.nan
    return replace(machine, loss=LossMap(SPEED, TORQUE, loss))


def test_a_cell_with_three_corners_is_used_on_their_triangle_alone():
    axis = np.array([0.0, 1.0])
    for missing in [(0, 0), (0, 1), (1, 0), (1, 1)]:
        values = np.array([[1.0, 2.0], [5.0, 6.0]])  # 1 + 4 x + y
        values[missing] = np.nan
        x, y = np.random.default_rng(1).random((2, 500))
        found = interpolated(axis, axis, values, y, x)
        towards = np.abs(x - missing[0]) + np.abs(y - missing[1])
        assert_allclose(found[towards > 1], (1 + 4 * x + y)[towards > 1])
        assert np.isnan(found[towards < 1]).all()


def test_two_corners_are_their_edge_and_nothing_beside_it():
    axis = np.array([0.0, 1.0])
    values = np.array([[1.0, 2.0], [np.nan, np.nan]])
    assert interpolated(axis, axis, values, np.array(0.25), np.array(0.0)) == 1.25
    assert np.isnan(interpolated(axis, axis, values, np.array(0.25), np.array(1e-6)))


def test_the_highest_known_torque_is_where_a_scan_finds_the_end_of_the_map():
    rng = np.random.default_rng(0)
    for _ in range(40):
        speed, torque = np.cumsum(rng.uniform(1, 3, (2, 7)), axis=1)
        values = rng.random((7, 7))
        for row in values:
            row[rng.integers(1, 8) :] = np.nan
        at = np.append(rng.uniform(speed[0], speed[-1], 30), speed)
        found = highest_known(speed, torque, values, at)
        assert not np.isnan(interpolated(speed, torque, values, found, at)).any()
        scan = np.linspace(torque[0], torque[-1], 401)
        known = ~np.isnan(interpolated(speed, torque, values, scan, at[:, None]))
        assert_allclose(found, np.where(known, scan, 0).max(axis=1), atol=scan[1] - scan[0])
        assert np.isnan(highest_known(speed, torque, values, speed[-1:] + 1)).all()


def test_the_map_is_the_formula_at_its_points_and_close_between_them(formula):
    machine = sampled(formula)
    speed, torque = np.meshgrid(SPEED[1:], TORQUE, indexing="ij")
    known = np.abs(speed * torque) <= 30e3
    at_points = machine.loss_w(torque, speed)
    assert_allclose(at_points[known], formula.loss_w(torque, speed)[known])
    rng = np.random.default_rng(2)
    speed, torque = rng.uniform(25, 650, 2000), rng.uniform(-120, 120, 2000)
    inside = np.abs(speed * torque) < 25e3
    between = machine.loss_w(torque, speed)[inside]
    # Linear between torques 5 Nm apart: c3 (2.5 Nm)² above the parabola, and less for the speed.
    off = between - formula.loss_w(torque, speed)[inside]
    assert off.min() > -1e-9 and off.max() < 0.194 * 2.5**2 + 0.00204 * 12.5**2


def test_nothing_is_known_outside_the_map(formula):
    machine = sampled(formula)
    for torque, speed in [(121.0, 100.0), (-121.0, 100.0), (10.0, 651.0), (110.0, 600.0)]:
        assert np.isnan(machine.loss_w(np.array(torque), np.array(speed)))
    assert machine.loss_w(np.array(0.0), np.array(0.0)) == 0


@pytest.mark.parametrize("power_w", [0.0, 250.0, 4000.0])
def test_the_generating_torque_gives_the_power_exactly(formula, power_w):
    machine = sampled(formula)
    speed = np.random.default_rng(3).uniform(0, 650, 500)
    torque = machine.generating_nm(power_w, speed)
    known = ~np.isnan(torque)
    assert known.sum() > 300 and (torque[known] <= 0).all()
    electric = torque * speed + machine.loss_w(torque, speed)
    assert_allclose(electric[known], -power_w, atol=1e-8)
    by_formula = formula.generating_nm(power_w, speed)
    assert_allclose(torque[known & (speed > 80)], by_formula[known & (speed > 80)], atol=0.5)
    # Where the map has no answer, neither it nor any torque of it generates that much.
    for s in speed[~known]:
        tried = np.linspace(-120, 0, 2001)
        loss = machine.loss_w(tried, np.full_like(tried, s))
        assert not (tried * s + loss < -power_w - 1).any()


def machine_file(folder: Path, loss_map: str) -> Path:
    """C2 with a machine of kind map, in a folder of its own."""
    text = (SHIPPED / "C2.toml").read_text(encoding="utf-8")
    path = folder / "x.toml"
    path.write_text(text.replace('"machine_flywheel_18kw"', '"m.toml"'), encoding="utf-8")
    for part in ("car_compact", "engine_diesel_1600", "gearbox_manual_6", "battery_liion_64"):
        path.write_text(
            path.read_text().replace(f'"{part}"', f'"{SHIPPED}/components/{part}.toml"')
        )
    keys = 'name = "m"\nkind = "map"\npower_max_w = 18000.0\ntorque_max_nm = 120.0\nspeed_max_rpm = 6000.0\n'
    (folder / "m.toml").write_text(keys + loss_map)
    return path


def test_a_symmetric_map_loses_the_same_at_the_opposite_torque(tmp_path):
    loss = (
        "[loss_map]\nsymmetric = true\nspeed_rpm = [0, 6000]\ntorque_nm = [0, 120]\n"
        "loss_w = [[50, 900], [200, nan]]\n"
    )
    machine = load_architecture(machine_file(tmp_path, loss)).machines[0]
    assert_allclose(machine.loss.torque_nm, [-120, 0, 120])
    torque, speed = np.array([60.0, -60.0, 120.0, -120.0]), np.full(4, 1e-9)
    assert_allclose(machine.loss_w(torque, speed), [475, 475, 900, 900])


@pytest.mark.parametrize(
    ("loss_map", "said"),
    [
        ("", "kind 'map' needs loss_map"),
        ("[loss_map]\nspeed_rpm = [0, 1]\ntorque_nm = [0, 1]\nloss_w = [[0, 1]]\n", "2 rows of 2"),
        ("[loss_map]\nspeed_rpm = [0, 1]\ntorque_nm = [1, 0]\nloss_w = [[0, 1], [1, 2]]\n", "must increase"),
        ("[loss_map]\nspeed_rpm = [0, 1]\ntorque_nm = [0, 1]\nloss_w = [[0, -1], [1, 2]]\n", "0 to 1e+06"),
        (
            "[loss_map]\nspeed_rpm = [0, 1]\ntorque_nm = [-1, 1]\nloss_w = [[0, 1], [1, 2]]\nsymmetric = true\n",
            "needs torque_nm from 0 up",
        ),
        ("loss_c0_w = 9\n[loss_map]\nspeed_rpm = [0, 1]\ntorque_nm = [0, 1]\nloss_w = [[0, 1], [1, 2]]\n",
         "kind 'map' does not use loss_c0_w"),
    ],
)  # fmt: skip
def test_a_wrong_loss_map_is_one_clear_message(tmp_path, loss_map, said):
    with pytest.raises(DataError, match=r"m\.toml") as found:
        load_architecture(machine_file(tmp_path, loss_map))
    assert said in str(found.value)


def test_a_car_is_kept_inside_its_machine_map(formula):
    car = load_architecture("C2", {"gearbox.shift_gap_s": 0.0})
    small = replace(car, machines=(sampled(formula, beyond_w=6e3),))
    problem = build_problem(small, load_cycle("nedc"))
    rejected = problem.table.reject & Reject.MACHINE_MAP > 0
    speed = problem.table.flows["machine_speed_radps"]
    torque = problem.table.flows["machine_torque_nm"]
    assert rejected.any() and np.isfinite(problem.table.battery_power_w).all()
    turning = (speed > 0) | (torque != 0)
    loss = small.machines[0].loss_w(torque, speed)
    assert (rejected == (turning & np.isnan(loss))).all()
    driven = simulate(problem, solve(problem, "dp").control)
    assert (
        np.abs(driven.flows["machine_torque_nm"] * driven.flows["machine_speed_radps"]).max() <= 8e3
    )


def test_optimum_on_a_map_is_that_of_the_formula_it_was_sampled_from(formula):
    car, cycle = load_architecture("C2"), load_cycle("nedc")
    fuel = []
    for machine in (formula, sampled(formula)):
        problem = build_problem(replace(car, machines=(machine,)), cycle)
        fuel.append(simulate(problem, solve(problem, "dp").control).total_fuel_kg)
    assert fuel[1] == pytest.approx(fuel[0], rel=5e-3)
