"""Proofs over ranges of sizes, and the shipped example of a sizing, to reports/benchmarks_sizing.md:

    python tests/benchmarks/sizing.py            # the example too: minutes
    python tests/benchmarks/sizing.py --proofs

Proofs are told in seconds of one processor, so that a busy machine changes little; the example by the clock.
"""

import shutil
import sys
import tempfile
import time
from pathlib import Path

from hevopt import load_cycle, size
from hevopt.sizing.proof.prove import prove
from hevopt.sizing.proof.space import DRIVE
from hevopt.studies.provenance import versions

ROOT = Path(__file__).parents[2]
OUT = ROOT / "reports" / "benchmarks_sizing.md"
SIZES = {
    "engine.scale.displacement": (0.8, 1.2),
    "machine.scale.power": (0.6, 1.6),
    "battery.cells_in_series": (40.0, 120.0),
}
RANGES = {
    "engine 0.8 to 1.2, machine 0.6 to 1.6, 40 to 120 cells": SIZES,
    "final drive 2.8 to 4.0": {DRIVE: (2.8, 4.0)},
    "the example's: engine 0.7 to 1.2, machine 0.5 to 2.0, 40 to 120 cells, final drive 2.8 to 4.0": {
        "engine.scale.displacement": (0.7, 1.2),
        "machine.scale.power": (0.5, 2.0),
        "battery.cells_in_series": (40.0, 120.0),
        DRIVE: (2.8, 4.0),
    },
}


def proofs() -> list[str]:
    """A line of the table for each set of ranges."""
    cycle = load_cycle("nedc")
    prove("C2", {"machine.scale.power": (0.9, 1.1)}, cycle, boxes_max=1)  # loops and imports
    lines = []
    for name, ranges in RANGES.items():
        began = time.process_time()
        found = prove("C2", ranges, cycle)
        seconds = time.process_time() - began
        lines.append(
            f"| {name} | {found.bound_l_per_100km:.4f} | {found.best_l_per_100km:.4f} | {100 * found.gap:.2f} | "
            f"{'yes' if found.closed else 'no'} | {found.boxes} | {seconds:.0f} |"
        )
        print(lines[-1], flush=True)
    return lines


def example() -> list[str]:
    """What the shipped example takes, from an empty store."""
    with tempfile.TemporaryDirectory() as folder:
        study = Path(shutil.copy(ROOT / "examples" / "size_c2.toml", folder))
        began = time.perf_counter()
        found = size(study, workers=2)
        seconds = time.perf_counter() - began
    assert found.best is not None and found.proven is not None  # or size would have raised
    proof, burnt = found.proofs[0], found.best.fuel_l_per_100km[0]
    return [
        "",
        f"The shipped example, `hevopt size examples/size_c2.toml` with two workers: {seconds:.0f} s, of which "
        f"{proof.seconds:.0f} s for the proof; best {burnt:.4f} l/100 km, no car of the ranges below "
        f"{proof.bound_l_per_100km:.4f}, the gap without requirements {100 * proof.gap:.2f} %.",
    ]


def main() -> None:
    """Measure and write."""
    stamp = ", ".join(f"{name} {version}" for name, version in versions().items())
    lines = [
        "# Sizing: proofs over ranges",
        "",
        f"C2 on the NEDC, target gap 0.3 %. {stamp}. Made by `python tests/benchmarks/sizing.py`.",
        "",
        "| ranges | no car below, l/100 km | best found | gap, % | closed | boxes | s of one processor |",
        "|---|---|---|---|---|---|---|",
        *proofs(),
        *([] if "--proofs" in sys.argv else example()),
    ]
    OUT.write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
