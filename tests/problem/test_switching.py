"""Switching takes fuel and stored energy, before the step, at every step alike or not."""

from dataclasses import replace

import numpy as np
import pytest

from hevopt import Battery, ControlTable, DataError, InfeasibleError, Problem, certify, simulate
from hevopt.problem.choices import choices_of
from hevopt.problem.switching import joined_switching, switching_of
from hevopt.strategies import STRATEGIES, dp

# Two modes, three steps of 1 s: at rest for nothing, and on for 1 g.
FUEL = np.array([[0.0, 1e-3]] * 3)
POWER = np.array([[600.0, -600.0]] * 3)


def problem_of(switch_j, *, ohm=0.0, soc=(0.5, 0.5), window=(0.1, 0.9), **more) -> Problem:
    table = ControlTable.from_arrays(FUEL, POWER, mode=[0, 1], switch_energy_j=switch_j, **more)
    pack = Battery([0, 1], [100, 100], [ohm] * 2, [ohm] * 2, 36.0, 1.0, *window)
    return Problem(table, pack, *soc)


def test_the_energy_is_taken_before_the_step_by_hand():
    """100 V, 2 Ohm: I = (100 - sqrt(1e4 - 8 P)) / 4, a step of 1 s drains 100 I; switching takes 60 J, gives 24."""
    problem = problem_of([[0.0, 60.0], [-24.0, 0.0]], ohm=2.0)
    run = simulate(problem, [1, 0, 0])
    charging = 100 * (100 - np.sqrt(1e4 + 8 * 600)) / 4
    drawing = 100 * (100 - np.sqrt(1e4 - 8 * 600)) / 4
    stored = 1800 + np.cumsum([0, -60 - charging, 24 - drawing, -drawing])
    np.testing.assert_allclose(run.energy_j, stored, rtol=1e-12)
    np.testing.assert_array_equal(run.switch_energy_j, [60, -24, 0])
    np.testing.assert_allclose(run.flows["battery_chemical_w"], [charging, drawing, drawing])
    np.testing.assert_allclose(run.residuals["battery"], 0, atol=1e-9)
    assert run.to_frame()["switch_energy_j"].tolist() == [60, -24, 0]


def test_a_voltage_that_falls_with_charge_is_that_after_switching():
    table = ControlTable.from_arrays(FUEL, POWER, mode=[0, 1], switch_energy_j=[[0, 900], [0, 0]])
    pack = Battery([0, 1], [80, 120], [2, 2], [2, 2], 36.0, 1.0, 0.1, 0.9)
    problem = Problem(table, pack, 0.5, 0.1)
    run = simulate(problem, [1, 1, 1])
    squared = 80**2 + 2 * 40 * (run.energy_j[0] - 900) / 36
    current = (np.sqrt(squared) - np.sqrt(squared + 8 * 600)) / 4
    assert run.energy_j[1] - run.energy_j[0] == pytest.approx(-900 - np.sqrt(squared) * current)


def test_what_depends_on_the_step_is_told_by_step():
    switch_j = np.zeros((3, 2, 2))
    switch_j[:, 0, 1] = [10, 20, 30]
    fuel = np.zeros((3, 2, 2))
    fuel[:, 1, 0] = [1e-3, 2e-3, 3e-3]
    problem = problem_of(switch_j, switch_fuel_kg=fuel, soc=(0.5, 0.1))
    run = simulate(problem, [1, 0, 1])
    assert run.switch_energy_j.tolist() == [10, 0, 30]
    assert run.switch_fuel_kg.tolist() == [0, 2e-3, 0]
    switching = choices_of(problem).switching
    assert switching.case.tolist() == [0, 1, 2] and switching.kg.shape == (3, 2, 2)
    part = choices_of(problem).part(1, 3).switching
    assert part.energy_j[part.case, 0, 1].tolist() == [20, 30]


def test_without_a_step_of_its_own_one_matrix_serves_all():
    switching = switching_of(problem_of([[0, 5], [5, 0]]).table)
    assert switching.case.tolist() == [0, 0, 0] and switching.kg.shape == (1, 2, 2)
    other = switching_of(problem_of(np.full((3, 2, 2), 7.0)).table)
    both = joined_switching([switching, other])
    assert both.case.tolist() == [0, 0, 0, 1, 2, 3]
    assert both.energy_j[both.case, 0, 1].tolist() == [5, 5, 5, 7, 7, 7]


@pytest.mark.parametrize("taken", [900.0, -900.0])
def test_between_switching_and_step_the_window_is_kept_too(taken):
    """Of 3600 J 720 up or down may be used; what a step moves is less."""
    small = np.array([[60.0, -60.0]] * 3)
    table = ControlTable.from_arrays(FUEL, small, mode=[0, 1], switch_energy_j=[[0, taken], [0, 0]])
    pack = Battery([0, 1], [100, 100], [0, 0], [0, 0], 36.0, 1.0, 0.3, 0.7)
    problem = Problem(table, pack, 0.5, 0.3)
    with pytest.raises(InfeasibleError, match=f"switching takes {taken:g} J, before step 0"):
        simulate(problem, [1, 1, 1])
    for strategy in ("dp", "ecms", "a_ecms", "mpc"):
        run = simulate(problem, STRATEGIES[strategy].solve(problem).control)
        assert run.mode.tolist() == [0, 0, 0]


@pytest.mark.parametrize("wrong, said", [
    (np.zeros((2, 2, 2)), r"switch_energy_j has shape \(2, 2, 2\), expected \(3, 2, 2\)"),
    (np.zeros(2), r"switch_energy_j has shape \(2,\), expected \(2, 2\)"),
    ([[0, np.inf], [0, 0]], "switch_energy_j holds NaN or infinite"),
])  # fmt: skip
def test_wrong_energies_are_named(wrong, said):
    with pytest.raises(DataError, match=said):
        problem_of(wrong)


def long_problem(switch_j) -> Problem:
    """60 steps of changing demand: engine on at three loads or off, battery giving the rest."""
    demand = 3000.0 + 2500.0 * np.sin(np.arange(60) / 1.5)
    engine = np.array([0.0, 2000.0, 4000.0, 7000.0])
    fuel = np.where(engine > 0, 0.1e-3 + engine / 43e6 / 0.4, 0.0) + 0 * demand[:, None]
    table = ControlTable.from_arrays(
        fuel, demand[:, None] - engine, mode=[0, 1, 1, 1], switch_energy_j=switch_j,
        switch_fuel_kg=[[0, 2e-5], [0, 0]],
    )  # fmt: skip
    pack = Battery([0, 1], [95, 105], [0.3] * 2, [0.3] * 2, 3600.0, 0.98, 0.3, 0.8)
    return Problem(table, pack, 0.5, 0.5)


@pytest.mark.parametrize("strategy", ["dp", "ecms", "convex", "a_ecms", "mpc"])
def test_every_strategy_drives_with_them_and_none_is_below_the_bound(strategy):
    step = np.linspace(0.5, 1.5, 60)[:, None, None]
    problem = long_problem(step * np.array([[0.0, 3000.0], [-800.0, 0.0]]))
    best = simulate(problem, dp.solve(problem).control)
    certificate = certify(problem, best)
    run = simulate(problem, STRATEGIES[strategy].solve(problem).control)
    assert run.switch_energy_j.any()
    bound, _ = certificate.bound_of(run)
    assert bound <= run.cost_kg
    assert (best.cost_kg / certificate.bound_of(best)[0] - 1) < 5e-3
    if strategy == "ecms":
        assert run.cost_kg < 1.05 * best.cost_kg


def test_dear_switches_are_made_less_often():
    starts = []
    for taken in (0.0, 3000.0, 30_000.0):
        problem = long_problem([[0.0, taken], [0.0, 0.0]])
        run = simulate(problem, dp.solve(problem).control)
        starts.append(int(np.sum(np.diff(run.mode, prepend=0) == 1)))
        free = replace(problem, table=replace(problem.table, switch_energy_j=np.zeros((2, 2))))
        assert run.cost_kg >= simulate(free, dp.solve(free).control).cost_kg - 1e-12
    assert starts[0] > starts[1] > starts[2] > 0
