"""Kinetic energy of shafts where ways follow each other: by hand, closed, and never worth having more of."""

from math import pi

import numpy as np
import pytest
from split_cars import short

from hevopt import build_problem, certify, load_architecture, load_cycle, simulate, solve
from hevopt.driving.cycle import Cycle

RADIUS, IDLE = 0.3132, 850 * pi / 30
RATIO = [0.0] + [3.40 * gear for gear in (4.066, 2.219, 1.402, 1.026, 0.813, 0.676)]
ENGINE, ROTOR, GEARED_ROTOR = 0.18, 0.074, 0.0074


def trace(speed_mps, gear):
    n = len(speed_mps)
    return Cycle(
        "by hand", np.arange(n, dtype=float), np.array(speed_mps, dtype=float), np.zeros(n),
        np.array(gear), np.zeros(n, dtype=bool),
    )  # fmt: skip


def held(inertia, ratio, speed_mps):
    return inertia * (ratio * speed_mps / RADIUS) ** 2 / 2


def modes(table, *, engine_on, machine_gear=0):
    return next(
        int(table.mode[n]) for n, control in enumerate(table.controls)
        if control.engine_on == engine_on and control.machine_gear == machine_gear
    )  # fmt: skip


def test_a_start_while_driving_spins_the_engine_up_to_its_gears_speed_from_the_battery():
    table = build_problem(load_architecture("C2"), trace([10, 10.4, 10.6], [3, 3, 3])).table
    off, on = modes(table, engine_on=False), modes(table, engine_on=True)
    taken = table.switch_energy_j[1, off, on]
    assert taken == pytest.approx(held(ENGINE, RATIO[3], 10.4) / 0.85, rel=1e-12)
    assert table.switch_fuel_kg[off, on] == pytest.approx(0.2e-3, rel=1e-12)
    assert table.switch_energy_j[1, on, off] == 0 and table.switch_fuel_kg[on, off] == 0


def test_a_change_up_gives_the_rotors_energy_back_and_loses_the_engines():
    table = build_problem(load_architecture("C2"), trace([10, 10.4, 10.6], [2, 3, 3])).table
    on = modes(table, engine_on=True)
    rotor = held(ROTOR, RATIO[2], 10.4) - held(ROTOR, RATIO[3], 10.4)
    for m in (on, modes(table, engine_on=False)):
        assert table.switch_energy_j[1, m, m] == pytest.approx(-0.85 * rotor, rel=1e-12)
        assert table.switch_fuel_kg[m, m] == 0


def test_a_change_down_is_the_engines_work_and_the_rotors():
    car = load_architecture("C2")
    table = build_problem(car, trace([10.6, 10.4, 10.4], [3, 2, 2])).table
    on = modes(table, engine_on=True)
    rotor = held(ROTOR, RATIO[2], 10.4) - held(ROTOR, RATIO[3], 10.4)
    engine = held(ENGINE, RATIO[2], 10.4) - held(ENGINE, RATIO[3], 10.4)
    assert table.switch_energy_j[1, on, on] == pytest.approx(rotor / 0.85, rel=1e-12)
    # Best efficiency 40.5 %, near 2375 rpm and 190 Nm.
    assert 0.40 < car.engine.best_efficiency < 0.41
    fuel_kg = engine / car.engine.best_efficiency / 42.9e6
    assert table.switch_fuel_kg[1, on, on] == pytest.approx(fuel_kg, rel=1e-12)


def test_the_machines_own_gear_costs_what_its_rotor_gains_and_gives_back_less():
    table = build_problem(load_architecture("E"), trace([10, 10, 10], [3, 3, 3])).table
    second = modes(table, engine_on=True, machine_gear=2)
    fourth = modes(table, engine_on=True, machine_gear=4)
    rotor = held(ROTOR, RATIO[2], 10) - held(ROTOR, RATIO[4], 10)
    assert table.switch_energy_j[1, second, fourth] == pytest.approx(-0.85 * rotor, rel=1e-12)
    assert table.switch_energy_j[1, fourth, second] == pytest.approx(rotor / 0.85, rel=1e-12)
    assert table.switch_fuel_kg.max() == pytest.approx(0.2e-3, rel=1e-12)


def test_the_engine_of_c1_takes_the_rotor_along():
    table = build_problem(load_architecture("C1"), trace([0, 0, 2, 4], [0, 1, 1, 1])).table
    off, on = modes(table, engine_on=False), modes(table, engine_on=True)
    expected = (ENGINE + ROTOR) * IDLE**2 / 2 / 0.85
    assert table.switch_energy_j[1, off, on] == pytest.approx(expected, rel=1e-12)


def test_without_inertia_nothing_depends_on_the_step():
    changes = {"engine.inertia_kgm2": 0.0, "machine.inertia_kgm2": 0.0}
    table = build_problem(load_architecture("E", changes), trace([9, 10, 10], [2, 3, 3])).table
    assert table.modes == 2 and table.switch_fuel_kg.ndim == table.switch_energy_j.ndim == 2
    assert not table.switch_energy_j.any()


@pytest.mark.parametrize("name", ["A", "C2", "D", "E"])
def test_doubled_inertias_are_never_better(name, problem_of):
    inertias = {"engine.inertia_kgm2": 0.36, "machine.inertia_kgm2": 0.148}
    if name == "D":
        inertias["machine.inertia_kgm2"] = 2 * GEARED_ROTOR
    plain = problem_of(name, "nedc")
    heavy = build_problem(load_architecture(name, inertias), load_cycle("nedc"))
    burnt = simulate(plain, solve(plain).control)
    at_least, _ = certify(heavy).bound_kg(heavy.end_min_j)
    assert at_least > burnt.cost_kg * (1.001 if name != "D" else 1)


@pytest.mark.parametrize("name", ["prius_1998", "series_1500", "p0_p4_diesel", "p2_petrol_dct"])
def test_doubled_inertias_are_never_better_with_other_topologies(name):
    car = load_architecture(name)
    changes = {"engine.inertia_kgm2": 2 * car.engine.inertia_kgm2}
    for (key, _), machine in zip(car.driveline.machines, car.machines, strict=True):
        changes[f"{key}.inertia_kgm2"] = 2 * machine.inertia_kgm2
    cycle = short("udds", 330)
    plain, heavy = (build_problem(c, cycle) for c in (car, load_architecture(name, changes)))
    burnt = simulate(plain, solve(plain).control)
    at_least, _ = certify(heavy).bound_kg(heavy.end_min_j)
    assert at_least > burnt.cost_kg
