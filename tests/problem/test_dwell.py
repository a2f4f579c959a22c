"""A least time on and off of the engine: kept by every plan and in every bound, against trying every plan."""

from dataclasses import replace

import numpy as np
import pytest
from proofs.check import faults_of
from proofs.draw import draw
from proofs.exact import every_plan

from hevopt import Battery, ControlTable, DataError, InfeasibleError, Problem, simulate
from hevopt.problem.dwell import with_dwell
from hevopt.problem.table import Control
from hevopt.strategies import dp


def keeps(problem, modes, least_on_s, least_off_s) -> bool:
    """Whether the engine (on in every mode but 0) was as long on and off as it must, whenever it changes."""
    table, since = problem.table, -np.inf
    on = problem.start_mode > 0
    for k, mode in enumerate(modes):
        if (mode > 0) != on:
            if table.time_s[k] - since < (least_on_s if on else least_off_s) * (1 - 1e-9):
                return False
            on, since = mode > 0, table.time_s[k]
    return True


def plans_with_modes(problem):
    """(cost, end) of every plan, and its modes: exact.py tells no modes, so each control brings its own cost."""
    steps, controls = problem.table.reject.shape
    found = []
    for plan in np.ndindex(*(controls,) * steps):
        try:
            run = simulate(problem, np.array(plan))
        except InfeasibleError:
            continue
        found.append((run.cost_kg, run.end_j, problem.table.mode[list(plan)]))
    return found


def small_problems(count):
    for seed in range(1000):
        problem = draw(seed)
        led_to = problem.start_mode in problem.table.mode
        if problem.table.modes > 1 and problem.table.reject.size <= 15 and led_to:
            yield seed, problem
            count -= 1
        if not count:
            return


@pytest.mark.parametrize(("seed", "problem"), list(small_problems(12)))
def test_the_plans_of_the_table_are_those_that_keep_the_dwell(seed, problem):
    mean_s = float(problem.table.step_s.mean())
    least = (1.4 + seed % 2) * mean_s, (1.2 + seed % 3) * mean_s
    dwelling = with_dwell(problem, *least)
    kept = [plan[:2] for plan in plans_with_modes(problem) if keeps(problem, plan[2], *least)]
    found = [plan[:2] for plan in every_plan(dwelling)]
    assert len(found) == len(kept)
    found, kept = (sorted((float(f"{cost:.9e}"), end) for cost, end in p) for p in (found, kept))
    np.testing.assert_allclose(found, kept, rtol=1e-8, atol=1e-12)


@pytest.mark.parametrize("seed", range(40_000, 40_030))
def test_bounds_and_strategies_keep_it_without_knowing_of_it(seed):
    problem = draw(seed)
    mean_s = float(problem.table.step_s.mean())
    assert faults_of(with_dwell(problem, 2.1 * mean_s, 1.3 * mean_s), nodes=301) == []


def table_of(step_s, labels=(False, True), steps=6) -> ControlTable:
    fuel = np.tile([0.0, 1e-3], (steps, 1))
    table = ControlTable.from_arrays(
        fuel, np.tile([400.0, -400.0], (steps, 1)), step_s=step_s, mode=[0, 1]
    )
    return replace(table, controls=tuple(Control(on, 0, "") for on in labels))


def problem_of(step_s=1.0, **labels) -> Problem:
    pack = Battery([0, 1], [100, 100], [0, 0], [0, 0], 360.0)
    return Problem(table_of(step_s, **labels), pack, 0.5, 0.5)


def test_by_hand_three_steps_on_and_two_off():
    problem = problem_of()
    free = simulate(problem, dp.solve(problem).control)
    assert free.fuel_kg.sum() == pytest.approx(3e-3)
    dwelling = with_dwell(problem, 3.0, 2.0)
    assert dwelling.table.modes == 2 + 3 and dwelling.start_mode == 1
    assert [c.engine_on for c in dwelling.table.controls] == [False] * 2 + [True] * 3
    run = simulate(dwelling, dp.solve(dwelling).control)
    assert run.fuel_kg.sum() == pytest.approx(3e-3)
    on = np.flatnonzero(run.fuel_kg)
    assert np.ptp(on) == 2
    with pytest.raises(InfeasibleError, match="forbidden switch"):
        simulate(dwelling, [2, 0, 0, 0, 0, 0])


def test_steps_of_different_lengths_count_by_their_time():
    problem = problem_of(np.array([1.0, 1.0, 3.0, 1.0, 1.0, 1.0]))
    dwelling = with_dwell(problem, 3.0, 0.0)
    for start in range(6):
        length = {0: 3, 1: 2, 2: 1, 3: 3, 4: 2, 5: 1}[start]
        for steps in range(1, 7 - start):
            on = [start <= k < start + steps for k in range(6)]
            plan = plan_of(dwelling, on)
            if plan is None:
                assert steps < length
            else:
                assert steps >= length
                simulate(replace(dwelling, soc_end_min=0.0), plan)


def plan_of(problem, on):
    """Controls that drive with the engine on and off as said, going along allowed switches; None where none do."""
    table, mode, plan = problem.table, problem.start_mode, []
    for k, wanted in enumerate(on):
        allowed = (
            table.switch_allowed[k] if table.switch_allowed.ndim == 3 else table.switch_allowed
        )
        ways = [
            c
            for c, label in enumerate(table.controls)
            if label.engine_on == wanted and allowed[mode, table.mode[c]]
        ]
        if not ways:
            return None
        assert len(ways) == 1
        plan.append(ways[0])
        mode = table.mode[ways[0]]
    return plan


def test_no_dwell_is_the_same_problem_and_wrong_ones_are_named():
    problem = problem_of()
    assert with_dwell(problem, 1.0, 0.0) is problem
    with pytest.raises(DataError, match=r"least_on_s -1; allowed: 0 s or more"):
        with_dwell(problem, -1.0, 0.0)
    mixed = replace(problem.table, mode=np.array([0, 0]))
    with pytest.raises(DataError, match="mode 0 has controls with the engine on and off"):
        with_dwell(replace(problem, table=mixed), 3.0, 0.0)
    long = problem_of(0.01, labels=(False, True))
    many = replace(long.table, switch_fuel_kg=np.zeros((400, 400)), switch_energy_j=np.zeros((400, 400)),
                   switch_allowed=np.ones((400, 400), bool))  # fmt: skip
    with pytest.raises(DataError, match="modes of 400; allowed: 1000"):
        with_dwell(replace(long, table=many), 1.0, 1.0)


def test_flows_and_labels_are_those_of_the_controls_that_stand_several_times():
    flows = {"wheel_power_w": np.arange(12.0).reshape(6, 2)}
    table = replace(table_of(1.0), flows=flows)
    problem = with_dwell(replace(problem_of(), table=table), 3.0, 2.0)
    np.testing.assert_array_equal(
        problem.table.flows["wheel_power_w"][:, [0, 1, 2, 4]],
        flows["wheel_power_w"][:, [0, 0, 1, 1]],
    )
    along = problem.table.flows.along(np.array([0, 1, 2, 3, 4, 0]))
    np.testing.assert_array_equal(along["wheel_power_w"], [0, 2, 5, 7, 9, 10])
