"""Table entries against hand calculations: scalars, numbers typed in, no physics of the package."""

from dataclasses import replace
from math import atan, cos, exp, pi, sin, sqrt

import numpy as np
import pytest

from hevopt import STRATEGIES, build_problem, load_architecture, load_cycle, simulate
from hevopt.driving.cycle import Cycle

RADIUS, GRAVITY, AUXILIARY = 0.3132, 9.80665, 250.0
RATIO = [0.0] + [3.40 * gear for gear in (4.066, 2.219, 1.402, 1.026, 0.813, 0.676)]
IDLE = 850 * pi / 30
DISPLACEMENT, ENGINE_INERTIA, HEATING_VALUE = 1598e-6, 0.18, 42.9e6
EXTRA_MASS = {"A": 0, "B": 10, "C1": 60, "C2": 70, "D": 60, "E": 90}
FLYWHEEL = (54.7, 0.296, 0.00204, 0.194, 0.074)  # loss coefficients, inertia
GEARED = (40.9, 0.0741, 1.70e-4, 2.32, 0.0074)


def wheel_torque(name, speed, accel=0.0, grade=0.0):
    mass, slope = 1300 + EXTRA_MASS[name], atan(grade)
    rolling = mass * GRAVITY * cos(slope) * (0.009 + 5e-5 * speed)
    air = 0.5 * 1.2 * 0.672 * speed**2
    inertia = (mass + 2.8 / RADIUS**2) * accel
    return (rolling + air + mass * GRAVITY * sin(slope) + inertia) * RADIUS


def through(torque, ratio, efficiency=0.95):
    """Torque before a gear for a torque at the wheels."""
    return torque / ratio / efficiency if torque > 0 else torque / ratio * efficiency


def drag_torque(speed):
    piston = 2 * 0.0805 * speed / (2 * pi)
    return (-1.55291 - 0.0076 * piston**2) * 1e5 * DISPLACEMENT / (4 * pi)


def fuel_kgps(torque, speed):
    piston = 2 * 0.0805 * speed / (2 * pi)
    p_me = 4 * pi * torque / DISPLACEMENT / 1e5
    a, b = -0.0013733, 0.39902 + 0.031510 * piston - 0.0022991 * piston**2
    c = -1.55291 - 0.0076 * piston**2 - p_me
    p_mf = (-b + sqrt(b * b - 4 * a * c)) / (2 * a)
    return p_mf * 1e5 * DISPLACEMENT * speed / (2 * pi) / 2 / HEATING_VALUE


def nox_kgps(torque, speed):
    rpm = speed * 30 / pi
    p_me = max(4 * pi * torque / DISPLACEMENT / 1e5, 0.0)
    rise = 1 + exp(-(p_me - 8.498 - 0.223 * (rpm / 1000 - 2)) / 1.471)
    mg = 0.02 + (1.216 + (3.938 - 1.216) / rise) * p_me * (rpm / 2000) ** 0.19 / 36
    return mg * 1e-6 * 1.598 * rpm / 120


def electric_power(machine, torque, speed):
    c0, c1, c2, c3, _ = machine
    return torque * speed + c0 + c1 * speed + c2 * speed**2 + c3 * torque**2


def full_load(speed):
    rpm = [800, 1000, 1250, 1500, 2000, 2250, 2500, 2750, 3000]
    return np.interp(speed * 30 / pi, rpm, [100, 150, 220, 290, 290, 285, 272, 256, 238])


def trace(*speed_mps, gear=0, clutch_open=False, grade=0.0, step_s=1.0):
    n = len(speed_mps)
    return Cycle(
        "by hand", step_s * np.arange(n), np.array(speed_mps, dtype=float),
        np.full(n, grade), np.full(n, gear), np.full(n, clutch_open),
    )  # fmt: skip


def table_of(name, cycle, functions=None):
    architecture = load_architecture(name)
    if functions is not None:
        architecture = replace(architecture, functions=frozenset(functions))
    return build_problem(architecture, cycle).table


def usable(table, step=0, *, engine_on=None, machine_gear=None, level=None):
    """Indices of the feasible controls with these labels."""
    wanted = (engine_on, machine_gear, level)
    return [
        int(i)
        for i in np.flatnonzero(table.reject[step] == 0)
        if all(w is None or w == g for w, g in zip(wanted, table.controls[i], strict=False))
    ]


def least_power(table, controls, step=0):
    return min(controls, key=lambda i: table.battery_power_w[step, i])


def with_and_without(function, cycle):
    """Tables of each full hybrid with all functions and with one dropped."""
    every = load_architecture("C2").functions
    for name in ("C1", "C2", "D", "E"):
        yield table_of(name, cycle), table_of(name, cycle, every - {function})


def machine_paths(gear):
    """Architecture, label of the machine's gear, machine, ratio and efficiency to the wheels."""
    yield "C2", 0, FLYWHEEL, RATIO[gear], 0.95
    yield "D", 0, GEARED, 5 * 3.40, 0.97
    for own in (2, 4, 6):
        yield "E", own, FLYWHEEL, RATIO[own], 0.95


def test_wheel_power_is_road_load_plus_inertia_plus_grade():
    for start, end, grade in ((20, 20, 0), (20, 21, 0), (20, 18, 0), (15, 15, 0.06)):
        table = table_of("A", trace(start, end, gear=4, grade=grade))
        speed = (start + end) / 2
        power = wheel_torque("A", speed, end - start, grade) * speed / RADIUS
        assert table.signals.wheel_power_w[0] == pytest.approx(power, rel=1e-12)


def test_idling_car_of_a_burns_the_idle_fuel_of_its_alternator_load():
    table = table_of("A", trace(0, 0, 1, gear=1))
    (i,) = usable(table)
    torque = AUXILIARY / 0.60 / IDLE
    assert table.fuel_kg[0, i] == pytest.approx(fuel_kgps(torque, IDLE), rel=1e-9)
    assert table.nox_kg[0, i] == pytest.approx(nox_kgps(torque, IDLE), rel=1e-9)
    assert table.battery_power_w[0, i] == 0
    assert 3600 * fuel_kgps(0, IDLE) / 0.835 == pytest.approx(0.4, abs=0.05)  # l/h unloaded


def test_a_at_50_kmh_in_fourth_burns_the_map_at_road_load_alternator_and_own_inertia():
    v = 50 / 3.6
    for accel in (0.0, 1.0):
        table = table_of("A", trace(v - accel / 2, v + accel / 2, gear=4))
        (i,) = usable(table)
        speed = RATIO[4] * v / RADIUS
        torque = through(wheel_torque("A", v, accel), RATIO[4]) + AUXILIARY / 0.60 / speed
        torque += ENGINE_INERTIA * RATIO[4] * accel / RADIUS
        assert table.fuel_kg[0, i] == pytest.approx(fuel_kgps(torque, speed), rel=1e-9)
        assert table.nox_kg[0, i] == pytest.approx(nox_kgps(torque, speed), rel=1e-9)
        assert accel or 2.5 < table.fuel_kg[0, i] / 0.835 / v * 1e5 < 4.0  # l/100 km


def test_overrun_cuts_fuel_and_nox_and_still_carries_the_alternator():
    table = table_of("A", trace(15, 14, gear=4))
    (i,) = usable(table)
    speed, accel = RATIO[4] * 14.5 / RADIUS, -RATIO[4] / RADIUS
    shaft = drag_torque(speed) - AUXILIARY / 0.60 / speed - ENGINE_INERTIA * accel
    braking = shaft / 0.95 * RATIO[4] - wheel_torque("A", 14.5, -1)
    assert table.fuel_kg[0, i] == 0 and table.nox_kg[0, i] == 0
    assert table.flows["brake_power_w"][0, i] == pytest.approx(braking * 14.5 / RADIUS, rel=1e-9)


def test_electric_driving_draws_wheel_torque_inertia_loss_and_auxiliaries():
    for accel in (0.0, 0.3):
        for name, gear, machine, ratio, efficiency in machine_paths(2):
            table = table_of(name, trace(8.0, 8.0 + accel, gear=2))
            (i,) = usable(table, engine_on=False, machine_gear=gear)
            v = 8.0 + accel / 2
            torque = through(wheel_torque(name, v, accel), ratio, efficiency)
            torque += machine[4] * ratio * accel / RADIUS
            power = electric_power(machine, torque, ratio * v / RADIUS) + AUXILIARY
            assert table.battery_power_w[0, i] == pytest.approx(power, rel=1e-9)
            assert table.fuel_kg[0, i] == 0 and table.nox_kg[0, i] == 0


def test_electric_driving_of_c1_drags_the_engine_with_its_fuel_cut():
    table = table_of("C1", trace(8.0, 8.3, gear=2))
    i, *_ = [i for i in usable(table) if table.fuel_kg[0, i] == 0]
    speed, accel = RATIO[2] * 8.15 / RADIUS, RATIO[2] * 0.3 / RADIUS
    torque = through(wheel_torque("C1", 8.15, 0.3), RATIO[2]) - drag_torque(speed)
    torque += (ENGINE_INERTIA + 0.074) * accel
    power = electric_power(FLYWHEEL, torque, speed) + AUXILIARY
    assert table.battery_power_w[0, i] == pytest.approx(power, rel=1e-9)
    assert usable(table, engine_on=False) == []


def test_full_regeneration_recovers_the_machines_share_of_braking_less_gear_and_machine_loss():
    # Half of the braking at 16.1 km/h, 0.8 of it at 96.6 km/h.
    share = 0.5 + 0.3 * (9.7 * 3.6 - 16.1) / (96.6 - 16.1)
    for name, gear, machine, ratio, efficiency in machine_paths(3):
        table = table_of(name, trace(10.0, 9.4, gear=3))
        i = least_power(table, usable(table, engine_on=False, machine_gear=gear))
        asked = wheel_torque(name, 9.7, -0.6)
        torque = through(share * asked, ratio, efficiency)
        torque -= machine[4] * ratio * 0.6 / RADIUS
        power = electric_power(machine, torque, ratio * 9.7 / RADIUS) + AUXILIARY
        assert table.battery_power_w[0, i] == pytest.approx(power, rel=1e-9)
        friction = -(1 - share) * asked * 9.7 / RADIUS
        assert table.flows["brake_power_w"][0, i] == pytest.approx(friction, rel=1e-9)


def test_regeneration_fades_out_at_low_speed():
    for name, gear, machine, ratio, _ in machine_paths(1):
        if name == "C2":
            table = table_of(name, trace(0.9, 0.7, gear=1))
            i = least_power(table, usable(table, engine_on=False, machine_gear=gear))
            share = 0.5 * 0.8 * 3.6 / 16.1
            torque = through(share * wheel_torque(name, 0.8, -0.2), ratio, 0.95)
            torque -= machine[4] * ratio * 0.2 / RADIUS
            power = electric_power(machine, torque, ratio * 0.8 / RADIUS) + AUXILIARY
            assert share < 0.1
            assert table.battery_power_w[0, i] == pytest.approx(power, rel=1e-9)


def test_hard_braking_of_c1_is_shared_by_drag_machine_limit_and_friction_brakes():
    table = table_of("C1", trace(15.0, 12.0, gear=3))
    i = least_power(table, [i for i in usable(table) if table.fuel_kg[0, i] == 0])
    speed, accel = RATIO[3] * 13.5 / RADIUS, -3 * RATIO[3] / RADIUS
    torque = -18000 / speed
    shaft = torque + drag_torque(speed) - (ENGINE_INERTIA + 0.074) * accel
    braking = shaft / 0.95 * RATIO[3] - wheel_torque("C1", 13.5, -3)
    power = electric_power(FLYWHEEL, torque, speed) + AUXILIARY
    assert table.battery_power_w[0, i] == pytest.approx(power, rel=1e-9)
    assert table.flows["brake_power_w"][0, i] == pytest.approx(braking * 13.5 / RADIUS, rel=1e-9)


# Second gear at 4.5 m/s turns the input at 1035 rpm: above idle, locked but for the open clutch.
CLUTCH_OPEN = trace(5.0, 4.0, gear=2, clutch_open=True)


def test_clutch_open_deceleration_parts_the_engine_which_idles():
    for name in ("A", "C1", "C2", "D", "E"):
        table = table_of(name, CLUTCH_OPEN)
        on = usable(table, engine_on=True)
        assert np.allclose(table.flows["engine_speed_radps"][0, on], IDLE, rtol=1e-12)
        if name in ("A", "C1", "D"):
            assert (table.flows["gearbox_loss_w"][0, on] == 0).all()
        least = AUXILIARY / 0.60 / IDLE if name == "A" else 0.0
        assert table.fuel_kg[0, on].min() == pytest.approx(fuel_kgps(least, IDLE), rel=1e-9)


def test_clutch_open_deceleration_still_regenerates_behind_the_clutch():
    for name in ("C2", "D", "E"):
        table = table_of(name, CLUTCH_OPEN)
        for on in (True, False):
            i = least_power(table, usable(table, engine_on=on))
            assert table.battery_power_w[0, i] < -1000
            assert table.fuel_kg[0, i] == pytest.approx(fuel_kgps(0, IDLE) if on else 0, rel=1e-9)


def test_clutch_open_deceleration_of_c1_leaves_all_braking_to_friction():
    table = table_of("C1", CLUTCH_OPEN)
    controls = np.array(usable(table))
    friction = -wheel_torque("C1", 4.5, -1) * 4.5 / RADIUS
    assert np.allclose(table.flows["brake_power_w"][0, controls], friction, rtol=1e-9)
    charging = controls[table.battery_power_w[0, controls] < 0]  # by the idling engine, on fuel
    assert (table.fuel_kg[0, charging] > fuel_kgps(0, IDLE)).all()


def test_launch_of_c2_slips_the_clutch_and_loses_torque_times_slip():
    table = table_of("C2", trace(0, 1, gear=1))
    (i,) = usable(table, engine_on=True, level="zero torque")
    ratio, v = RATIO[1] / RADIUS, 0.5
    torque = through(wheel_torque("C2", v, 1.0), RATIO[1]) + 0.074 * ratio
    assert table.flows["engine_speed_radps"][0, i] == pytest.approx(IDLE, rel=1e-12)
    assert table.flows["engine_torque_nm"][0, i] == pytest.approx(torque, rel=1e-9)
    loss = torque * (IDLE - ratio * v)
    assert table.flows["clutch_loss_w"][0, i] == pytest.approx(loss, rel=1e-9)
    assert table.fuel_kg[0, i] == pytest.approx(fuel_kgps(torque, IDLE), rel=1e-9)


def test_launch_of_c1_joins_the_machine_before_the_clutch():
    table = table_of("C1", trace(0, 1, gear=1))
    controls, f = usable(table), table.flows
    torque = through(wheel_torque("C1", 0.5, 1.0), RATIO[1])
    loss = torque * (IDLE - RATIO[1] * 0.5 / RADIUS)
    both = (f["engine_torque_nm"] + f["machine_torque_nm"])[0, controls]
    assert np.allclose(both, torque, rtol=1e-9)
    assert np.allclose(f["clutch_loss_w"][0, controls], loss, rtol=1e-9)


def test_launch_loses_the_integral_of_torque_times_slip():
    accel, step_s, steps = 1.0, 0.05, 80
    cycle = trace(*(accel * step_s * np.arange(steps + 1)), gear=1, step_s=step_s)
    table = table_of("A", cycle)
    loss = sum(step_s * table.flows["clutch_loss_w"][k, usable(table, k)[0]] for k in range(steps))
    end_s = IDLE * RADIUS / RATIO[1] / accel
    # Torque is a polynomial in time, slip falls linearly: t^n gives idle end^(n+1) / ((n+1)(n+2)).
    to_input = RADIUS / RATIO[1] / 0.95
    constant = wheel_torque("A", 0, accel) / RADIUS * to_input
    linear = 1300 * GRAVITY * 5e-5 * accel * to_input
    square = 0.6 * 0.672 * accel**2 * to_input
    closed = IDLE * (constant * end_s / 2 + linear * end_s**2 / 6 + square * end_s**3 / 12)
    assert end_s < steps * step_s
    assert loss == pytest.approx(closed, rel=0.02)


def test_standing_engine_can_charge_except_in_d():
    cycle = trace(0, 0, 1, gear=1)
    for name in ("B", "C1", "C2", "E"):
        table = table_of(name, cycle)
        i = least_power(table, usable(table))
        torque = 2000 / IDLE if name == "B" else full_load(IDLE)
        power = -2000 * 0.75 if name == "B" else electric_power(FLYWHEEL, -torque, IDLE)
        assert table.battery_power_w[0, i] == pytest.approx(power + AUXILIARY, rel=1e-9)
        assert table.fuel_kg[0, i] == pytest.approx(fuel_kgps(torque, IDLE), rel=1e-9)
    table = table_of("D", cycle)
    assert (table.battery_power_w[0, usable(table)] == AUXILIARY).all()


def test_machine_of_e_is_free_beside_an_odd_gear_and_bound_to_an_even_one():
    for gear, machine_gears in ((3, {2, 4, 6}), (4, {4}), (5, {2, 4, 6}), (6, {6})):
        table = table_of("E", trace(14, 14, gear=gear))
        found = {table.controls[i].machine_gear for i in usable(table, engine_on=True)}
        assert found == machine_gears
        electric = {table.controls[i].machine_gear for i in usable(table, engine_on=False)}
        assert electric == {2, 4, 6}


def test_machine_of_d_turns_up_to_125_kmh_and_stands_still_above():
    for kmh, turns in ((124.9, True), (125.2, False)):
        table = table_of("D", trace(kmh / 3.6, kmh / 3.6, gear=6))
        controls = usable(table)
        speed = 17 * kmh / 3.6 / RADIUS if turns else 0.0
        assert np.allclose(table.flows["machine_speed_radps"][0, controls], speed, rtol=1e-12)
        assert (len(controls) > 1) == turns
        if not turns:
            assert table.battery_power_w[0, controls[0]] == AUXILIARY


def test_without_regenerative_braking_nothing_charges_while_braking():
    for full, less in with_and_without("regenerative_braking", trace(15, 14, gear=4)):
        assert full.battery_power_w[0, usable(full)].min() < -2000
        assert less.battery_power_w[0, usable(less)].min() >= -1e-6


def test_without_start_stop_the_engine_runs_at_standstill():
    for full, less in with_and_without("start_stop", trace(0, 0, 1, gear=1)):
        assert usable(full, engine_on=False) and not usable(less, engine_on=False)
        assert less.fuel_kg[0, usable(less)].min() >= fuel_kgps(0, IDLE) * (1 - 1e-9)


def test_without_power_management_nothing_drives_electrically():
    for full, less in with_and_without("power_management", trace(8, 8.2, gear=2)):
        assert full.fuel_kg[0, usable(full)].min() == 0
        assert less.fuel_kg[0, usable(less)].min() > 0


def test_e_boost_alone_assists_only_where_the_engine_falls_short():
    at_input = {"C1": 0.074, "C2": 0.074, "E": 0.074, "D": 0.0074 * (17 / RATIO[4]) ** 2}
    for name, rotor in at_input.items():
        table = table_of(name, trace(10, 10.2, 12, gear=4), {"e_boost"})
        torque = table.flows["machine_torque_nm"]
        for k, (v, accel, short) in enumerate([(10.1, 0.2, False), (11.1, 1.8, True)]):
            alone = through(wheel_torque(name, v, accel), RATIO[4])
            alone += (ENGINE_INERTIA + rotor) * RATIO[4] * accel / RADIUS
            assert (alone > full_load(RATIO[4] * v / RADIUS)) == short
            assisted = torque[k, usable(table, k)] > 1e-6
            assert len(assisted) and (assisted == short).all()


def changed_gear(problem):
    gear = problem.table.signals.gear
    return 1 + np.flatnonzero((gear[1:] != gear[:-1]) & (gear[1:] > 0) & (gear[:-1] > 0))


def test_a_change_of_gear_leaves_half_of_the_step_to_give_all_of_its_torque():
    v, speed = 12.0, RATIO[3] * 12.0 / RADIUS
    cycle = replace(trace(v, v, v, gear=3), gear=np.array([2, 3, 3]))
    torque = through(wheel_torque("C2", v), RATIO[3])
    table = table_of("C2", cycle)
    (off,) = usable(table, 1, engine_on=False)
    power = (electric_power(FLYWHEEL, 2 * torque, speed) + electric_power(FLYWHEEL, 0, speed)) / 2
    assert table.battery_power_w[1, off] == pytest.approx(power + AUXILIARY, rel=1e-9)
    (alone,) = usable(table, 1, engine_on=True, level="zero torque")
    burnt = (fuel_kgps(2 * torque, speed) + fuel_kgps(0, speed)) / 2
    assert table.fuel_kg[1, alone] == pytest.approx(burnt, rel=1e-9)
    (idle,) = usable(table, 1, engine_on=True, level="battery idle")
    assert table.battery_power_w[1, idle] == pytest.approx(0, abs=1e-9)
    strongest = max(usable(table, 1, engine_on=True), key=lambda i: -table.battery_power_w[1, i])
    assert -table.flows["machine_torque_nm"][1, strongest] <= 60 + 1e-6


def test_a_change_of_gear_while_braking_is_left_to_the_friction_brakes():
    cycle = replace(trace(10.3, 10.0, 9.4, gear=3), gear=np.array([4, 3, 3]))
    share = 0.5 + 0.3 * (9.7 * 3.6 - 16.1) / (96.6 - 16.1)
    for name, lasting in (("C2", 0.5), ("D", 1.0), ("E", 1.0)):
        table = table_of(name, cycle)
        i = least_power(table, usable(table, 1, engine_on=False), 1)
        friction = -(1 - lasting * share) * wheel_torque(name, 9.7, -0.6) * 9.7 / RADIUS
        assert table.flows["brake_power_w"][1, i] == pytest.approx(friction, rel=1e-9)


def test_a_driver_who_needs_full_load_changes_gear_faster():
    cycle = replace(trace(14, 16.4, 18.8, gear=3), gear=np.array([2, 3, 3]))
    table = table_of("A", cycle)
    torque = table.flows["engine_torque_nm"][1, 0]
    speed = table.flows["engine_speed_radps"][1, 0]
    assert 0.5 * full_load(speed) < torque < full_load(speed)
    assert usable(table, 1) == [0]


@pytest.mark.parametrize("name", ["C1", "E"])
def test_plan_of_dynamic_programming_balances_and_burns_what_torques_and_speeds_say(name):
    problem = build_problem(load_architecture(name), load_cycle("nedc"), levels=15)
    run = simulate(problem, STRATEGIES["dp"].solve(problem).control)
    f = run.flows
    scale = np.max(np.abs([flow for key, flow in f.items() if key.endswith("_w")]), axis=0)
    for component, residual in run.residuals.items():
        assert (np.abs(residual) < 1e-9 * scale).all(), component
    # The balances of engine, machine and bus hold by definition; these do not.
    for k, burnt in enumerate(run.fuel_kg - run.switch_fuel_kg):
        torque, speed = f["engine_torque_nm"][k], f["engine_speed_radps"][k]
        if name == "C1" and np.isin(k, changed_gear(problem)):
            continue  # a change of gear, by hand below
        firing = speed > 0 and torque > drag_torque(speed) + 1e-6
        expected = fuel_kgps(torque, speed) if firing else 0
        assert burnt == pytest.approx(expected, rel=1e-9, abs=1e-12)
        torque, speed = f["machine_torque_nm"][k], f["machine_speed_radps"][k]
        power = electric_power(FLYWHEEL, torque, speed) if speed > 0 else 0
        assert run.battery_power_w[k] == pytest.approx(power + AUXILIARY, rel=1e-9, abs=1e-6)
    labels = [problem.table.controls[c] for c in run.control]
    on = np.array([True, *(label.engine_on for label in labels)])
    starts, raised_j = np.sum(on[1:] & ~on[:-1]), np.sum(f["spin_fuel_j"])
    assert starts > 0
    burnt = 0.2e-3 * starts + raised_j / HEATING_VALUE
    assert np.sum(run.switch_fuel_kg) == pytest.approx(burnt, rel=1e-12)
