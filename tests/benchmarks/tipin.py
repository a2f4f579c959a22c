"""Speed of the mean-value engine and of a study of tip-ins, written to reports/benchmarks_tipin.md:

    python tests/benchmarks/tipin.py

Speeds of one core are by its processor time, so that they hold on a busy machine too.
"""

import os
import platform
import resource
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from hevopt.mean_value.run import SAMPLE_S, simulate
from hevopt.studies.provenance import versions
from hevopt.tipin.case import BASE
from hevopt.tipin.drive import tip_in
from hevopt.tipin.study import manoeuvre_of

OUT = Path(__file__).parents[2] / "reports" / "benchmarks_tipin.md"
SECONDS, CASES = 8.0, 200
CARS = (("1.3 l, 40 km/h in IV", "compact_1300", 40, 4), ("1.6 l, 60 km/h in VI", "A", 60, 6))
WAYS = (
    ("RK4, 0.25 ms", {}),
    ("RK4, 0.5 ms", {"step_s": 0.5e-3}),
    ("LSODA, 1e-8", {"integrator": "lsoda"}),
)


def processor_s(call: Callable[[], object], runs: int = 5) -> float:
    """Median processor time of a call, after one that is not counted."""
    call()
    times = []
    for _ in range(runs):
        began = time.process_time()
        call()
        times.append(time.process_time() - began)
    return sorted(times)[runs // 2]


def speed_lines() -> list[str]:
    """Seconds simulated per second of one core, and how far accelerations lie apart."""
    lines = []
    for label, car, kmh, gear in CARS:
        found = tip_in(manoeuvre_of(car, kmh / 3.6, gear), BASE).run
        model, start = found.model, found.states[0]
        for way, settings in WAYS:
            taken = processor_s(lambda m=model, y=start, s=settings: simulate(m, y, SECONDS, **s))
            other = simulate(model, start, SECONDS, **settings)
            off = np.abs(other["accel_mps2"] - found["accel_mps2"]).max()
            lines.append(f"| {label} | {way} | {SECONDS / taken:.0f} | {off:.0e} |")
    return lines


def study_s() -> tuple[float, float]:
    """Wall and processor time of CASES tip-ins, `hevopt tipin` as a process, compiled parts in the cache."""
    values = ",".join(f"{x:.4f}" for x in np.linspace(0.5, 2.0, CASES - 1))
    command = [sys.executable, "-m", "hevopt.cli", "tipin", "--turbo-inertia", values, "--json"]
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    began = time.perf_counter()
    subprocess.run(command, check=True, capture_output=True)
    wall = time.perf_counter() - began
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return wall, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def main() -> None:
    """Everything measured and written."""
    lines = speed_lines()
    wall, processor = study_s()
    known = ", ".join(f"{name} {version}" for name, version in versions().items())
    cores = os.cpu_count() or 1
    OUT.write_text(
        f"""# Speed of tip-ins

Made by `python tests/benchmarks/tipin.py`.
{platform.machine()}, {cores} cores, load {os.getloadavg()[0]:.1f} meanwhile; {known}.

## One tip-in of {SECONDS:g} s, sampled every {1e3 * SAMPLE_S:g} ms, guarded every second

| tip-in | integrator | times real time, one core | acceleration off RK4 at 0.25 ms, m/s² |
|---|---|---|---|
{chr(10).join(lines)}

## A study of {CASES} tip-ins, each with its constant speed before and its steady map beside it

`hevopt tipin` from start to end: {wall:.1f} s, {processor:.1f} s of processor time, which is
{processor / cores:.1f} s on {cores} idle cores.
""",
        "utf-8",
    )
    print(OUT.read_text("utf-8"))


if __name__ == "__main__":
    main()
