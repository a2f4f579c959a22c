"""Coverage of the rooms that the proofs rest on, without compilation so that loops count: python tests/covered.py

Only small problems are solved, as loops are slow without compilation: what is covered is covered by what can
be followed by hand or by enumeration. Exit status 1 where a room is below its floor, or a test fails.
"""

import json
import os
import subprocess
import sys
import tempfile
from collections import defaultdict
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
# Per cent of the lines of each room; what is reached may only rise.
FLOORS = {"problem": 85.0, "bounds": 88.0, "strategies": 94.0}
TESTS = [
    "tests/test_uncompiled.py",
    "tests/problem/test_problem.py",
    "tests/problem/test_frames.py",
    "tests/strategies/test_reach.py",
    "tests/strategies/test_brought.py",
    "tests/strategies/test_value_blocks.py",
]
RUNS = [
    ["-m", "pytest", "-n", "0", "-m", "not long", *TESTS],
    ["tests/proofs/run.py", "--count", "200", "--nodes", "61"],
]


def shares(report: dict) -> dict[str, float]:
    """Per cent of the lines of each room that were run, from coverage's report."""
    lines = defaultdict(lambda: [0, 0])
    for path, file in report["files"].items():
        room = Path(path).parts[1]
        lines[room][0] += file["summary"]["covered_lines"]
        lines[room][1] += file["summary"]["num_statements"]
    return {room: 100 * run / max(1, there) for room, (run, there) in lines.items()}


def main() -> int:
    source = ",".join(f"hevopt/{room}" for room in FLOORS)
    with tempfile.TemporaryDirectory() as folder:
        own = os.environ | {"NUMBA_DISABLE_JIT": "1", "COVERAGE_FILE": f"{folder}/data"}

        def coverage(*words: str) -> int:
            return subprocess.run(
                [sys.executable, "-m", "coverage", *words], cwd=ROOT, env=own
            ).returncode

        failed = [run for run in RUNS if coverage("run", "-p", f"--source={source}", *run)]
        coverage("combine", "-q", folder)
        coverage("json", "-q", "-o", f"{folder}/report.json")
        report = json.loads(Path(folder, "report.json").read_text())
    for path, file in sorted(report["files"].items()):
        print(f"{file['summary']['percent_covered']:6.1f} %  {path}")
    found = shares(report)
    for room, floor in FLOORS.items():
        print(f"{room}: {found[room]:.1f} % of its lines, at least {floor:g} %")
    below = [room for room, floor in FLOORS.items() if found[room] < floor]
    return 1 if failed or below else 0


if __name__ == "__main__":
    sys.exit(main())
