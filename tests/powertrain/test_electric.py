"""A car without an engine: by hand, its objective electricity, and what does not apply to it."""

from math import pi

import numpy as np
import pytest
from split_cars import short, table_value

from hevopt import DataError, compare, load_architecture
from hevopt.strategies import fitting
from hevopt.studies.case import prepare
from hevopt.studies.settings import Settings

CAR = load_architecture("electric_compact")
CYCLE = short("udds", 330)


@pytest.fixture(scope="module")
def case():
    return prepare(CAR, CYCLE)


def by_hand_w(k: int) -> float:
    """Power at the battery in plain numbers, from the files of the parts; no friction brake."""
    dt = CYCLE.time_s[k + 1] - CYCLE.time_s[k]
    v = (CYCLE.speed_mps[k + 1] + CYCLE.speed_mps[k]) / 2
    a = (CYCLE.speed_mps[k + 1] - CYCLE.speed_mps[k]) / dt
    car = CAR.contents["car"]
    road, radius = car["road_load"], car["tyre_radius_m"]
    rolling = road["rolling_c0"] + road.get("rolling_c1_spm", 0.0) * v
    weight = car["mass_kg"] * 9.80665
    air = road.get("air_density_kgpm3", 1.2) / 2 * road["drag_area_m2"] * v**2
    mass = car["mass_kg"] + car["wheel_inertia_kgm2"] / radius**2
    size, ratio, eta = 2.6, 3.93, 0.97
    wheel_nm = (rolling * weight + air + mass * a) * radius
    speed, spin = v / radius * ratio, a / radius * ratio
    nm = wheel_nm / ratio / eta if wheel_nm > 0 else wheel_nm / ratio * eta
    inertia = size * 0.0226 * spin
    nm = nm + inertia
    loss = size * table_value("machine_motor_30kw", speed * 30 / pi, nm / size)
    return nm * speed + loss + car["auxiliary_power_w"]


def test_driving_is_what_plain_numbers_say(case):
    table, plan = case.problem.table, case.dp_trajectory
    driving = np.flatnonzero(table.signals.wheel_power_w > 500)
    assert len(driving) > 100
    for k in driving[:: len(driving) // 25]:
        assert plan.battery_power_w[k] == pytest.approx(by_hand_w(int(k)), rel=1e-9)


def test_the_least_electricity_is_taken_and_proven(case):
    table, plan = case.problem.table, case.dp_trajectory
    usable = np.where(table.feasible, table.battery_power_w, np.inf)
    assert np.array_equal(plan.battery_power_w, usable.min(axis=1))
    bound_kg, _ = case.certificate.bound_of(plan)
    assert bound_kg <= plan.cost_kg <= bound_kg * (1 + 1e-6)
    terminal_j = float(np.sum(plan.battery_power_w * table.step_s))
    assert plan.cost_kg == pytest.approx(terminal_j / 42.9e6)
    assert plan.total_fuel_kg == 0.0
    for name, residual in plan.residuals.items():
        assert np.abs(residual).max() < 1e-6, name


def test_its_rows_tell_electricity():
    rows = compare(CYCLE, CAR).rows
    assert [row.strategy for row in rows] == ["ecms", "dp"]
    for row in rows:
        assert row.status.ok and row.fuel_l_per_100km == row.co2_g_per_km == 0.0
        assert row.fuel_corrected_l_per_100km is None and row.bound_l_per_100km is None
        assert 8 < row.electricity_kwh_per_100km < 20 and abs(row.gap_percent) < 1e-3
        assert row.engine_starts == 0


def test_rules_for_engines_do_not_fit_it():
    assert set(fitting(CAR.marks, every=True)) == {"ecms", "dp"}
    assert "conventional" in fitting(load_architecture("C2").marks)


def test_two_motors_are_parts_without_an_engine_and_share_the_work(tmp_path, case):
    path = tmp_path / "own.toml"
    text = (
        CAR.source.read_text().split("[coupling]")[0].replace('"electric_compact"', '"two motors"')
    )
    half = 'machine_2 = { file = "machine_motor_30kw", scale = { power = 1.3 } }\n'
    axle = '{ kind = "gear", name = "NAME", first = "NAME motor", second = "wheel", ratio = 3.93 }'
    axles = ", ".join(axle.replace("NAME", name) for name in ("front", "rear"))
    path.write_text(
        text.replace("power = 2.6", "power = 1.3") + half + '[coupling]\nkind = "parts"\n'
        f'machine_shaft = "front motor"\nmachine_2_shaft = "rear motor"\nparts = [{axles}]\n'
    )
    both = prepare(load_architecture(path), CYCLE)
    bound_kg, _ = both.certificate.bound_of(both.dp_trajectory)
    assert bound_kg <= both.dp_trajectory.cost_kg <= bound_kg * (1 + 5e-4)
    # Two halves of one motor lose as much at equal torques, and may do better at unequal ones; axles without loss.
    assert 0.85 < both.dp_trajectory.cost_kg / case.dp_trajectory.cost_kg < 0.99


def test_gears_to_choose_are_refused(tmp_path):
    path = tmp_path / "own.toml"
    text = CAR.source.read_text().split("[coupling]")[0]
    path.write_text(
        text
        + '[coupling]\nkind = "parts"\nmachine_shaft = "motor"\nparts = [{ kind = "gearbox", name = "gears", '
        'first = "motor", second = "wheel", ratios = [6.0, 3.0] }]\n'
    )
    with pytest.raises(DataError, match="without an engine gears may not be chosen: gears"):
        load_architecture(path)


def test_what_needs_an_engine_says_so(tmp_path):
    path = tmp_path / "own.toml"
    text = CAR.source.read_text().replace(
        'battery = "', 'gearbox = "gearbox_manual_6"\nbattery = "'
    )
    path.write_text(text)
    with pytest.raises(DataError, match="a gearbox with listed gears needs an engine"):
        load_architecture(path)
    with pytest.raises(DataError, match="NOx data"):
        prepare(CAR, CYCLE, Settings(nox_weight=1.0))
