"""Time and memory of long drives, the NEDC driven again and again, written to reports/benchmarks_long.md:

    python tests/benchmarks/long.py [TIMES ...]

Processor time and memory of whole processes, `hevopt compare` on A and C2 with ecms, certificates included.
Compiled loops are in the cache before the first.
"""

import csv
import os
import subprocess
import sys
import tempfile
from pathlib import Path

from run import machine

ROOT = Path(__file__).parents[2]
OUT = ROOT / "reports" / "benchmarks_long.md"
TIMES = (1, 10, 30, 169)
WORDS = ("compare", "--architectures", "A,C2", "--strategies", "ecms", "--json")


def repeated(path: Path, times: int) -> int:
    """Write the NEDC that many times in a row to a file; its number of steps."""
    lines = (ROOT / "cycles" / "nedc.csv").read_text().splitlines()
    header, *rows = csv.reader(line for line in lines if not line.startswith("#"))
    steps = len(rows) - 1
    with path.open("w") as file:
        print(",".join(header), file=file)
        for n in range(times):
            # The last row of a drive is the first one of the next.
            for k, row in enumerate(rows if n == times - 1 else rows[:-1]):
                print(n * steps + k, *row[1:], sep=",", file=file)
    return times * steps


def measured(cycle: Path) -> tuple[float, float]:
    """Seconds of processor time, and megabytes at most."""
    with tempfile.TemporaryFile("w+") as said:
        process = subprocess.Popen(
            [sys.executable, "-m", "hevopt.cli", *WORDS, "--cycle", str(cycle)],
            stdout=subprocess.DEVNULL, stderr=said,
        )  # fmt: skip
        _, status, usage = os.wait4(process.pid, 0)
        said.seek(0)
        text = said.read()
    if status:
        sys.exit(text)
    # Kilobytes, but bytes on macOS.
    per_mb = 1e6 if sys.platform == "darwin" else 1e3
    return usage.ru_utime + usage.ru_stime, usage.ru_maxrss / per_mb


def main() -> None:
    """Measure and write."""
    lines = []
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "drive.csv"
        repeated(path, 1)
        measured(path)
        for times in [int(word) for word in sys.argv[1:]] or TIMES:
            steps = repeated(path, times)
            seconds, megabytes = measured(path)
            per_step = 1e3 * seconds / steps
            lines.append(f"| {steps} | {seconds:.1f} | {per_step:.2f} | {megabytes:.0f} |")
            print(lines[-1], flush=True)
    text = [
        "# Benchmarks of long drives",
        "",
        "Made by `python tests/benchmarks/long.py`: `hevopt compare --architectures A,C2 --strategies ecms` on the "
        "NEDC driven again and again, certificates included. Processor time, not that on the wall.",
        "",
        f"Machine: {machine()}.",
        "",
        "| steps | s | ms per step | MB at most |",
        "|---|---|---|---|",
        *lines,
        "",
    ]
    OUT.write_text("\n".join(text))


if __name__ == "__main__":
    main()
