"""Before and after in one run: a commit beside the code as it stands, written to reports/benchmarks_against.md:

    python tests/benchmarks/against.py COMMIT

Both are run by turns, the first of which compiles: its comparison is the first run of a user. Figures are seconds
of processor time, of the process and those it starts, which a busy machine stretches less than the clock; least of
all turns.
"""

import os
import resource
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parents[2]
OUT = ROOT / "reports" / "benchmarks_against.md"
TURNS = 3
STUDY = """architecture = "C2"
cycles = ["nedc"]
strategies = ["dp"]
[parameters]
battery.cells_in_series = { from = 40, to = 130, count = 6 }
machine.power_max_w = { from = 9e3, to = 27e3, count = 4 }
"""
DESIGNS = 24
KERNEL = """
from time import process_time
import numpy as np
from hevopt import build_problem, load_architecture, load_cycle
from hevopt.problem.choices import choices_of, without_dominated
from hevopt.strategies import _backward_kernels as kernels
from hevopt.strategies._rollout_kernels import Grid

problem = build_problem(load_architecture("E"), load_cycle("nedc"))
choices, (low, high) = without_dominated(choices_of(problem)), problem.window_j
cell = (high - low) / {cells}
grid = Grid(np.full(choices.steps + 1, low), cell)
terminal = np.zeros((choices.modes, {cells} + 1))
times = []
for _ in range(8):
    began = process_time()
    penalty = kernels.Penalty(1e-7 * cell, 0.0, 1.0)
    kernels.backward(choices, terminal, grid, grid.low_j[:-1], penalty, problem.battery.arrays)
    times.append(process_time() - began)
print(min(times))
"""


class Code(NamedTuple):
    """A package's folder, and where what is compiled of it is kept."""

    folder: Path
    kept: Path

    def environment(self) -> dict[str, str]:
        """Where Python finds the package, and may keep what it compiles of it."""
        own = {"PYTHONPATH": str(self.folder), "NUMBA_CACHE_DIR": str(self.kept)}
        return os.environ | own | {"PYTHONDONTWRITEBYTECODE": ""}


def processor_s(code: Code, *words: str) -> float:
    """Processor time of a command on the package in a folder."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(
        [sys.executable, "-m", "hevopt.cli", *words],
        env=code.environment(), cwd=code.folder, check=True, capture_output=True,
    )  # fmt: skip
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def kernel_s(code: Code, cells: int) -> float:
    """Processor time of one recursion of dp on E."""
    done = subprocess.run(
        [sys.executable, "-c", KERNEL.format(cells=cells)],
        env=code.environment(), cwd=code.folder, check=True, capture_output=True, text=True,
    )  # fmt: skip
    return float(done.stdout)


def measured(code: Code, scratch: Path) -> dict[str, float]:
    """One turn: name of a figure -> seconds."""
    compare_s = processor_s(code, "compare")
    study, store = scratch / "study.toml", scratch / "store.sqlite"
    study.write_text(STUDY)
    store.unlink(missing_ok=True)
    sweep_s = processor_s(code, "sweep", str(study), "--store", str(store), "--jobs", "1")
    return {
        "`hevopt compare`": compare_s,
        "`hevopt compare --cycle wltc_class3b`": processor_s(
            code, "compare", "--cycle", "wltc_class3b"
        ),
        "`hevopt --help`": processor_s(code, "--help"),
        f"a sweep of {DESIGNS} designs by dp, one worker, per design": sweep_s / DESIGNS,
        "dp recursion, E, 1001 nodes": kernel_s(code, 1000),
        "dp recursion, E, 6001 nodes": kernel_s(code, 6000),
    }


def main() -> None:
    """Measure both and write."""
    commit = sys.argv[1]
    short = subprocess.run(
        ["git", "rev-parse", "--short", commit],
        cwd=ROOT,
        check=True,
        capture_output=True,
        text=True,
    ).stdout.strip()
    with tempfile.TemporaryDirectory() as folder:
        scratch, old = Path(folder), Path(folder) / "code"
        subprocess.run(["git", "worktree", "add", "--detach", old, commit], cwd=ROOT, check=True)
        try:
            codes = Code(old, scratch / "of old"), Code(ROOT, scratch / "of new")
            turns = [[measured(code, scratch) for code in codes] for _ in range(TURNS + 1)]
        finally:
            subprocess.run(["git", "worktree", "remove", "--force", old], cwd=ROOT, check=True)
    first = [turn["`hevopt compare`"] for turn in turns[0]]
    found = {"`hevopt compare`, compiling": first}
    found |= {
        name: [min(turn[n][name] for turn in turns[1:]) for n in (0, 1)] for name in turns[0][0]
    }
    lines = [
        f"| {name} | {before:.3f} | {after:.3f} | {after / before:.2f} |"
        for name, (before, after) in found.items()
    ]
    text = [
        "# Benchmarks: before and after", "",
        f"Made by `python tests/benchmarks/against.py {short}`: that commit and what follows it, by turns; seconds",
        f"of processor time, least of {TURNS} turns with compiled parts in the cache. Read the ratio: the machine",
        "is shared.", "", f"| what | {short} | after | ratio |", "|---|---|---|---|", *lines, "",
    ]  # fmt: skip
    OUT.write_text("\n".join(text))
    print("\n".join(text))


if __name__ == "__main__":
    main()
