"""From where the end can be reached: never less than there is, whatever the battery."""

import numpy as np
import pytest

from hevopt import Battery, ControlTable, Problem, certify, simulate, solve
from hevopt.problem.choices import choices_of
from hevopt.strategies._rollout import _why_unreachable, reach_of, roll
from hevopt.strategies._rollout_kernels import Grid


def charged_once(charge_ohm, asked: float, start: float = 0.0) -> Problem:
    """One step that charges a small battery with 1000 W for 50 s."""
    battery = Battery([0, 1], [100, 100], [0, 0], charge_ohm, capacity_as=1000)
    table = ControlTable.from_arrays(np.ones((1, 1)), np.full((1, 1), -1000.0), step_s=50.0)
    return Problem(table, battery, start, asked)


@pytest.mark.parametrize("strategy", ["dp", "ecms"])
@pytest.mark.parametrize("rise_ohm, asked", [(100, 0.499), (100, 0.45), (30, 0.499)])
def test_a_fuller_battery_that_ends_emptier_does_not_hide_a_plan(strategy, rise_ohm, asked):
    # Resistance rises so steeply that from SOC 0.1 less is left after the step than from 0.
    problem = charged_once([0, rise_ohm], asked)
    trajectory = simulate(problem, solve(problem, strategy).control)
    assert trajectory.soc[-1] >= asked
    assert certify(problem, trajectory).bound_of(trajectory)[0] <= trajectory.cost_kg


@pytest.mark.parametrize("start", np.linspace(0.0, 0.3, 7))
def test_resistance_that_falls_steeply_does_not_either(start):
    problem = charged_once([100, 0], 0.0, start)
    ended = simulate(problem, np.zeros(1, np.int64)).soc[-1]
    for asked in (0.999 * ended, 0.7 * ended):
        reached = charged_once([100, 0], float(asked), start)
        assert simulate(reached, solve(reached).control).soc[-1] == ended


def test_what_is_said_where_no_path_is_found_does_not_contradict_itself():
    problem = charged_once([100, 0], 0.0)
    choices = choices_of(problem)
    asked_j = float(simulate(problem, np.zeros(1, np.int64)).end_j)
    within = str(_why_unreachable(problem, choices, 0.5 * asked_j))
    beyond = str(_why_unreachable(problem, choices, 1.01 * asked_j))
    assert "no path was found that keeps within the SOC window 0 to 1" in within
    assert "the most any plan" not in within and "the most any plan" in beyond


@pytest.mark.parametrize("seed", range(8))
def test_a_straight_value_on_two_nodes_or_many_is_followed_alike_round_dead_ends(seed):
    rng = np.random.default_rng(seed)
    shape = 30, 6
    table = ControlTable.from_arrays(
        rng.uniform(0.0, 1.0, shape),
        rng.uniform(-2000.0, 2000.0, shape),
        mode=rng.integers(0, 2, shape[1]),
        switch_fuel_kg=np.array([[0.0, 0.2], [0.1, 0.0]]),
    )
    # A window of a few steps' energy, in which greed runs into dead ends.
    problem = Problem(table, Battery([0, 1], [100, 100], [0, 0], [0, 0], 40.0), 0.5, 0.5)
    choices, (low, high) = choices_of(problem), problem.window_j
    reach = reach_of(problem, problem.end_min_j)
    followed = []
    for nodes in (2, 5):
        stored = np.linspace(low, high, nodes)
        value = np.broadcast_to(-2e-4 * stored, (choices.steps + 1, choices.modes, nodes)).copy()
        grid = Grid(np.full(choices.steps + 1, low), (high - low) / (nodes - 1))
        followed.append(roll(problem, choices, reach, value, grid))
    assert np.array_equal(followed[0][0], followed[1][0])
    assert np.array_equal(followed[0][1], followed[1][1])
    assert followed[0][1][-1] >= problem.end_min_j * (1 - 1e-12)
