"""Loops compute what their text says: run by Python, without compilation, small problems give the same bits.

So it cannot matter whether a loop was compiled just now, or which of those it calls came from the disk.
"""

import os
import subprocess
import sys

import numpy as np
from diesels import RAMP, cruising, in_gear
from forward.plants import body, inputs, one_gear, run, standing
from problems import random_problem

from hevopt import HevoptError, build_problem, load_architecture, simulate
from hevopt.bounds import virtual
from hevopt.bounds.lower_dp import lower_bound_kg
from hevopt.bounds.prices import one_price_dual
from hevopt.bounds.step_prices import costate_dual
from hevopt.driving.cycle import Cycle
from hevopt.mean_value._run_kernels import TABLEAUX, march
from hevopt.problem.choices import choices_of
from hevopt.strategies import STRATEGIES, _backward_kernels, _rollout_kernels, dp

SPEEDS_MPS = np.array([0.0, 0.0, 2.0, 5.0, 9.0, 12.0, 12.0, 12.0, 11.0, 8.0, 4.0, 0.0, 0.0])
STATE = "HEVOPT_TEST_STATE"


def bits(values) -> list[str]:
    return [float(value).hex() for value in np.ravel(values)]


def of_bounds() -> list[str]:
    """Costs, paths, bounds and values of small problems."""
    found = []
    for seed in (4, 5, 7):
        problem = random_problem(seed)
        rollout = simulate(problem, dp.solve(problem, nodes=41).control)
        worth = one_price_dual(problem)[-1]
        found += bits([rollout.cost_kg, rollout.end_j, worth.value_kg])
        found += bits(costate_dual(problem, rollout)[-1].value_kg)
        lines = np.random.default_rng(seed).normal(size=(2, 2, 2, 40)) * [[[[1.0]]], [[[2e4]]]]
        kg, watts, there = virtual.nodes_of(*lines, virtual.worst_of(problem.battery))
        found += bits(kg[there]) + bits(watts[there])
        found += bits(lower_bound_kg(problem, worth.price_kgpj, nodes=101))
        choices, low_high = choices_of(problem), np.array(problem.window_j)
        terminal = np.tile(np.linspace(1e-3, 0.0, 31), (choices.modes, 1))
        grid = _rollout_kernels.Grid(np.full(choices.steps + 1, low_high[0]), np.ptp(low_high) / 30)
        penalty = _backward_kernels.Penalty(1e-4, 0.0, 1.0)
        value = _backward_kernels.backward(
            choices, terminal, grid, grid.low_j[:-1], penalty, problem.battery.arrays
        )
        found += bits(value[0])
    return found


def of_strategies() -> list[str]:
    """What every strategy does with a car of few levels in a few seconds."""
    time_s = np.arange(float(len(SPEEDS_MPS)))
    drive = Cycle("drive", time_s, SPEEDS_MPS, 0 * time_s)
    problem = build_problem(load_architecture("C2"), drive, levels=3)
    found = bits(problem.table.fuel_kg)
    for name, strategy in STRATEGIES.items():
        settings = {"training": [problem]} if strategy.learns else {}
        settings |= {"nodes": 31} if name == "dp" else {}
        try:
            trajectory = simulate(problem, strategy.solve(problem, **settings).control)
        except HevoptError as error:
            found.append(f"{name}: {type(error).__name__}")
        else:
            found += [name, *bits([trajectory.cost_kg, trajectory.end_j])]
    return found


def of_plants(state: np.ndarray) -> list[str]:
    """The mean-value engine's first steps from a state, and a coasting car's."""
    model = in_gear("compact_1300", 4)._replace(drive=RAMP)
    found = bits(march(0.0, state, 0.25e-3, 1, 4, *TABLEAUX[4], model))
    states, _ = run(body((100.0, 0, 0, 0)), one_gear(), standing(9.0), lambda *_: inputs(), 0.1, 4)
    return found + bits([each.speed_mps for each in states])


def figures(state: np.ndarray) -> str:
    return " ".join([*of_bounds(), *of_strategies(), *of_plants(state)])


def test_loops_give_the_same_bits_without_compilation():
    # Settling at 40 km/h without compilation would take minutes.
    state = cruising("compact_1300", 4, 40.0)
    handed = " ".join(bits(state))
    code = (
        "import os, numpy; from test_uncompiled import STATE, figures; "
        "print(figures(numpy.array([float.fromhex(word) for word in os.environ[STATE].split()])))"
    )
    plain = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True,
        env=os.environ | {"NUMBA_DISABLE_JIT": "1", "PYTHONPATH": os.pathsep.join(sys.path), STATE: handed},
    )  # fmt: skip
    assert plain.returncode == 0, plain.stderr
    assert figures(state).split() == plain.stdout.split()
