"""Speed figures of this commit, to reports/track/NUMBER-COMMIT.json, beside those of the commits before:

    python tests/benchmarks/track.py

NUMBER counts commits, so that files sort by age. What it prints is each figure, and its ratio to the file before.
Figures of other machines do not compare: a file says on which it was made, and is compared with its own kind only.
"""

import argparse
import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path

if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).parents[1]))

from benchmarks.run import (
    backward_call,
    foreign_problem,
    machine,
    median_s,
    numpy_backward,
    process_s,
)

from hevopt import build_problem, certify, load_architecture, load_cycle, simulate
from hevopt.strategies import dp, ecms

ROOT = Path(__file__).resolve().parents[2]
FOLDER = ROOT / "reports" / "track"


def figures() -> dict[str, float]:
    """Figure by name with its unit at the end."""
    foreign = foreign_problem()
    call, count = backward_call(foreign, 1001)
    began = time.perf_counter()
    plain = numpy_backward(foreign, 1001, 100) / (time.perf_counter() - began)
    kernel = count / median_s(call)
    found = {"dp_kernel_per_s": kernel, "dp_kernel_over_numpy": kernel / plain}
    for car in ("C2", "E"):
        problem = build_problem(load_architecture(car), load_cycle("nedc"))
        rollout = simulate(problem, dp.solve(problem).control)
        found |= {
            f"{car}_nedc_dp_s": median_s(lambda p=problem: dp.solve(p)),
            f"{car}_nedc_ecms_s": median_s(lambda p=problem: ecms.solve(p)),
            f"{car}_nedc_certify_s": median_s(lambda p=problem, r=rollout: certify(p, r)),
        }
    with tempfile.TemporaryDirectory() as cache:
        found["compare_cold_s"] = process_s(["compare"], cache, 1)
        found["compare_warm_s"] = process_s(["compare"], cache, 5)
        found["help_s"] = process_s(["--help"], cache, 5)
    return found


def _git(*words: str) -> str:
    return subprocess.run(["git", *words], cwd=ROOT, capture_output=True, text=True).stdout.strip()


def written(folder: Path, number: int, commit: str, made: dict) -> Path:
    """The file of a commit, named so that files sort by age."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{number:05d}-{commit}.json"
    path.write_text(json.dumps(made, indent=1) + "\n")
    return path


def before(folder: Path, path: Path, machine: str) -> dict[str, float]:
    """The figures of the newest file before this one that the same kind of machine made."""
    for older in sorted((p for p in folder.glob("*.json") if p.name < path.name), reverse=True):
        made = json.loads(older.read_text())
        if made["machine"] == machine:
            return made["figures"]
    return {}


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--folder", type=Path, default=FOLDER)
    folder = options.parse_args().folder
    made = {"commit": _git("rev-parse", "HEAD"), "changed": bool(_git("status", "--porcelain", "-uno")),
            "machine": machine(), "figures": figures()}  # fmt: skip
    number = int(_git("rev-list", "--count", "HEAD"))
    path = written(folder, number, _git("rev-parse", "--short", "HEAD"), made)
    old = before(folder, path, made["machine"])
    for name, figure in made["figures"].items():
        ratio = f"  x {figure / old[name]:.2f}" if name in old else ""
        print(f"{name:24} {figure:12.4g}{ratio}")
    print(path)


if __name__ == "__main__":
    main()
