"""Loops compile whatever the disk holds, and give the same bits however they came about."""

import importlib.util
import os
import pickle
import subprocess
import sys

import numpy as np
import pytest
from numba.core.caching import CacheImpl
from problems import random_problem

from hevopt import simulate
from hevopt._compile import compiled
from hevopt.bounds.lower_dp import lower_bound_kg
from hevopt.bounds.prices import one_price_dual
from hevopt.bounds.step_prices import costate_dual
from hevopt.problem.choices import choices_of
from hevopt.strategies import _backward_kernels, _rollout_kernels, dp

TWICE = """
from hevopt._compile import compiled

@compiled()
def twice(x):
    return 2 * x
"""


def loop_of(path):
    """The compiled loop of a module file, imported afresh."""
    spec = importlib.util.spec_from_file_location(path.stem, path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.twice


def halved(file):
    file.write_bytes(file.read_bytes()[: file.stat().st_size // 2])


def one_bit_off(file):
    contents = bytearray(file.read_bytes())
    contents[len(contents) // 2] ^= 1
    file.write_bytes(contents)


def another_pickle(file):
    file.write_bytes(pickle.dumps(("no", "loop")))


def a_folder(file):
    file.unlink()
    file.mkdir()
    (file / "within").touch()


def a_dead_link(file):
    file.unlink()
    file.symlink_to("nowhere")


def a_pipe(file):
    file.unlink()
    os.mkfifo(file)


@pytest.mark.parametrize(
    "spoil",
    [
        lambda file: file.write_bytes(b""), halved, one_bit_off, another_pickle, a_folder, a_dead_link, a_pipe,
    ],
    ids=["empty", "halved", "one bit off", "another pickle", "a folder", "a dead link", "a pipe"],
)  # fmt: skip
def test_a_spoilt_cache_is_replaced_by_what_is_compiled_afresh(tmp_path, spoil):
    path = tmp_path / "loops.py"
    path.write_text(TWICE)
    loop = loop_of(path)
    assert loop(21) == 42
    (kept,) = (file for file in tmp_path.rglob("loops.twice*.nbc"))
    spoil(kept)
    spoilt = loop_of(path)
    assert spoilt(21) == 42
    assert not spoilt.stats.cache_hits
    mended = loop_of(path)
    assert mended(21) == 42
    assert mended.stats.cache_hits


def test_a_cache_that_can_be_neither_read_nor_written_stops_nothing(tmp_path, monkeypatch):
    path = tmp_path / "loops.py"
    path.write_text(TWICE)
    assert loop_of(path)(21) == 42

    def refuse(*_, **__):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr("pathlib.Path.read_bytes", refuse)
    monkeypatch.setattr("os.replace", refuse)
    assert loop_of(path)(21) == 42
    assert not list(tmp_path.rglob("*.tmp.*"))


def test_a_loop_is_compiled_afresh_when_one_that_it_may_call_changes(tmp_path, monkeypatch):
    path = tmp_path / "loops.py"
    path.write_text(TWICE)
    assert loop_of(path)(21) == 42
    monkeypatch.setattr("hevopt._compile._loops_digest", lambda: "of other text")
    changed = loop_of(path)
    assert changed(21) == 42
    assert not changed.stats.cache_hits


def test_without_a_place_for_the_cache_a_loop_is_compiled_all_the_same(monkeypatch):
    monkeypatch.setattr(CacheImpl, "_locator_classes", [])

    @compiled()
    def twice(x):
        return 2 * x

    assert twice(21) == 42


def figures() -> str:
    """Every bit of what the loops find on small problems: costs, paths and bounds."""
    found = []
    for seed in (4, 5, 7):
        problem = random_problem(seed)
        rollout = simulate(problem, dp.solve(problem, nodes=41).control)
        worth = one_price_dual(problem)[-1]
        bounds = [
            worth.value_kg,
            costate_dual(problem, rollout)[-1].value_kg,
            lower_bound_kg(problem, worth.price_kgpj, nodes=101),
        ]
        choices, low_high = choices_of(problem), np.array(problem.window_j)
        terminal = np.tile(np.linspace(1e-3, 0.0, 31), (choices.modes, 1))
        grid = _rollout_kernels.Grid(np.full(choices.steps + 1, low_high[0]), np.ptp(low_high) / 30)
        penalty = _backward_kernels.Penalty(1e-4, 0.0, 1.0)
        value = _backward_kernels.backward(
            choices, terminal, grid, grid.low_j[:-1], penalty, problem.battery.arrays
        )
        found += [rollout.cost_kg, rollout.end_j, *bounds, *value[0].flat]
    return " ".join(float(figure).hex() for figure in found)


def test_compiled_loops_compute_what_their_text_says_to_the_last_bit():
    """So it cannot matter whether a loop was compiled just now, or which of those it calls came from the disk."""
    code = "from test_compile import figures; print(figures())"
    plain = subprocess.run(
        [sys.executable, "-c", code],
        env=os.environ | {"NUMBA_DISABLE_JIT": "1", "PYTHONPATH": os.pathsep.join(sys.path)},
        check=True, capture_output=True, text=True,
    )  # fmt: skip
    assert figures().split() == plain.stdout.split()


SUMS = """
import sys
import numpy as np
from hevopt._compile import compiled

@compiled()
def sums(x):
    if len(x) == 0:
        raise ValueError("nothing to add up")
    return np.sum(x) + np.sort(x)[0]

@compiled()
def mean(x):
    return np.mean(x)

x = np.arange(5.0)
print(sums(x), "numba.np.arraymath" in sys.modules, sum(sums.stats.cache_hits.values()))
try:
    sums(x[:0])
except ValueError as error:
    print(error)
if sys.argv[1:]:
    print(mean(x), sums(x.astype(np.float32)))
"""


def test_a_kept_loop_is_loaded_without_the_parts_of_numba_that_only_compiling_needs(tmp_path):
    (tmp_path / "sums.py").write_text(SUMS)

    def said(*arguments: str) -> list[str]:
        done = subprocess.run(
            [sys.executable, "sums.py", *arguments],
            cwd=tmp_path, capture_output=True, text=True, check=True,
        )  # fmt: skip
        return done.stdout.splitlines()

    assert said() == ["10.0 True 0", "nothing to add up"]
    assert said() == ["10.0 False 1", "nothing to add up"]
    # And compiling after loading, with other types and another loop, still works.
    assert said("more") == ["10.0 False 1", "nothing to add up", "2.0 10.0"]
