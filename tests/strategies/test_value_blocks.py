"""A value function by blocks is the whole one, to the last bit, in little memory."""

import numpy as np
import pytest
from problems import random_problem

from hevopt import Battery, ControlTable, Problem
from hevopt.errors import HevoptError
from hevopt.strategies import _rollout_kernels as kernels
from hevopt.strategies import _value_blocks, dp


def control_or_error(problem):
    try:
        return list(dp.solve(problem, nodes=61).control)
    except HevoptError as error:
        return str(error)


@pytest.mark.parametrize("seed", range(40))
def test_dp_by_blocks_takes_the_plan_of_the_whole_table(seed, monkeypatch):
    problem = random_problem(seed)
    whole = control_or_error(problem)
    monkeypatch.setattr(_value_blocks, "_WHOLE_BYTES", 0)
    assert control_or_error(problem) == whole


def test_a_rollout_turns_back_over_the_edges_of_blocks(monkeypatch):
    """The last step moves three quarters of the window, up or down: a start in its middle must leave it, and only
    the first step can, at a cost that the rollout would rather not pay."""
    steps, window_j = 30, 100.0 * 3600 * 0.8
    power = np.zeros((steps, 2))
    power[0, 1], power[-1] = -0.26 * window_j, (0.75 * window_j, -0.75 * window_j)
    fuel, usable = np.zeros_like(power), np.ones(power.shape, dtype=bool)
    fuel[0, 1], usable[1:-1, 1] = 1.0, False
    battery = Battery([0, 1], [100, 100], [0, 0], [0, 0], 3600.0, 1.0, 0.1, 0.9)
    problem = Problem(ControlTable.from_arrays(fuel, power, usable), battery, 0.5, 0.1)
    monkeypatch.setattr(_value_blocks, "_WHOLE_BYTES", 0)
    begun, compiled = [], kernels.rollout
    monkeypatch.setattr(kernels, "rollout", lambda *a: (begun.append(a[1]), compiled(*a)))
    assert list(dp.solve(problem, nodes=61).control) == [1] + [0] * (steps - 1)
    assert begun[:9] == [0, 6, 12, 18, 24, 18, 12, 6, 0]


@pytest.mark.parametrize("steps", [1, 2, 3, 15, 16, 17, 99, 1000])
def test_every_step_is_in_one_block_and_little_is_held(steps, monkeypatch):
    monkeypatch.setattr(_value_blocks, "_WHOLE_BYTES", 0)
    asked = []

    def backward(begin, end, after):
        asked.append((begin, end))
        return np.stack([after + (end - k) for k in range(begin, end + 1)])

    values = _value_blocks.ValueBlocks(steps, np.zeros((2, 5)), backward)
    assert sum(end - begin for begin, end in asked) == steps
    asked.clear()
    for step in range(steps):
        begin, value = values.block_of(step)
        assert (value[step - begin] == steps - step).all()
        assert (value[step + 1 - begin] == steps - step - 1).all()
    assert len(asked) <= np.sqrt(steps) + 1
    assert max((end - begin for begin, end in asked), default=0) <= np.sqrt(steps) + 1
