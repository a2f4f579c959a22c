"""Loops compile whatever the disk holds; that they give the same bits is shown in test_uncompiled.py."""

import importlib.util
import os
import pickle
import subprocess
import sys
from pathlib import Path
from types import ModuleType
from typing import get_type_hints

import numpy as np
import pytest
from numba.core.caching import CacheImpl
from numba.core.dispatcher import Dispatcher

import hevopt
from hevopt import _compile
from hevopt._compile import compiled
from hevopt.forward._rows_kernels import Inputs, State

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


def bare_loops():
    """Name -> every loop of the package that counts no references."""
    folder, found = Path(hevopt.__file__).parent, {}
    for path in folder.rglob("_*kernels.py"):
        name = ".".join(path.relative_to(folder.parent).with_suffix("").parts)
        for loop in vars(importlib.import_module(name)).values():
            if isinstance(loop, Dispatcher) and loop.targetoptions.get("_nrt") is False:
                found[f"{name}.{loop.__name__}"] = loop.py_func
    return found


def inlined(function):
    loop = vars(importlib.import_module(function.__module__))[function.__name__]
    return loop.targetoptions.get("inline") == "always"


def has_arrays(kind):
    if isinstance(kind, type) and hasattr(kind, "_fields"):
        return any(has_arrays(of) for of in get_type_hints(kind).values())
    return "ndarray" in str(kind)


def test_a_loop_that_counts_no_references_gives_back_no_array():
    """Whoever calls it would hand back one reference too many."""
    loops = bare_loops()
    assert len(loops) > 50
    for name, function in loops.items():
        known = [function.__globals__]
        known += [vars(of) for of in function.__globals__.values() if isinstance(of, ModuleType)]
        called = [names.get(word) for names in known for word in function.__code__.co_names]
        own = [loop.py_func for loop in called if isinstance(loop, Dispatcher)]
        for one in (function, *own):
            # What is inlined as text counts as its caller does.
            if one is function or not inlined(one):
                assert not has_arrays(get_type_hints(one)["return"]), (name, one.__name__)
    assert has_arrays(Inputs) and not has_arrays(State)


BROUGHT = """
import sys
import hevopt.cli

before = set(sys.modules)
import numpy as np
from hevopt._compile import compiled

@compiled()
def first(x):
    return x[0]

found = first(np.arange(3.0)), first(np.ones((2, 2), dtype=bool)[:, :1])
print(*{"coverage", "scipy", "yaml", "numpy.ma"} & (sys.modules.keys() - before))
import numba, scipy, yaml

assert numba.njit(lambda matrix: np.linalg.solve(matrix, matrix))(np.eye(2))[1, 1] == 1
"""


def test_the_command_line_takes_along_nothing_that_its_loops_never_use_and_loads_it_when_asked(
    tmp_path,
):
    (tmp_path / "brought.py").write_text(BROUGHT)
    for _ in range(2):
        done = subprocess.run(
            [sys.executable, "brought.py"], cwd=tmp_path, capture_output=True, text=True
        )
        assert done.returncode == 0, done.stderr
    assert done.stdout.split() == []


HOST = """
import sys
import numba
from numba.core.typing.typeof import typeof_impl
import numpy as np

own = typeof_impl.dispatch(np.ndarray)
import hevopt._compile

assert typeof_impl.dispatch(np.ndarray) is own
assert numba.core.config._HAVE_YAML
"""


def test_another_program_that_loads_hevopt_keeps_its_numba_as_it_was():
    done = subprocess.run([sys.executable, "-c", HOST], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def test_arrays_are_of_the_type_that_numba_gives_them(monkeypatch):
    square = np.arange(9.0).reshape(3, 3)
    kept = np.arange(3)
    kept.flags.writeable = False
    record = np.zeros(2, dtype=[("a", float), ("b", np.int32)])
    arrays = [
        square,
        square.T,
        square[::2, ::2],
        kept,
        np.array(1.0),
        square > 2,
        record,
        record["b"],
    ]
    known = [_compile._type_of_any_array(array, None) for array in arrays]
    monkeypatch.delitem(sys.modules, "numpy.ma", raising=False)
    assert [_compile._type_of_array(array, None) for array in arrays] == known
