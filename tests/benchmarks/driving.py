"""Times of forward runs: python tests/benchmarks/driving.py; processor time, compiled before."""

import sys
from pathlib import Path
from time import process_time

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from forward.drives import plan_of

from hevopt.forward import _drive_kernels as col
from hevopt.forward.lines import line_of
from hevopt.forward.run import follow, loop_car, task_of, whole_handling

REPEATS = 5


def main() -> None:
    """The loop alone, and with books and drive quality, of an NEDC at 100 Hz; 1000 cars are 1000 loops."""
    for name in ("A", "C2", "E"):
        car, cycle, plan, _ = plan_of(name)
        line = line_of(car)
        record = np.zeros((round(cycle.duration_s / 0.01), col.COLUMNS))
        task = task_of(car, cycle, plan, cycle.time_s)
        driven = loop_car(car, line, whole_handling(car, None), task.load_w)
        loops, runs = [], []
        for _ in range(REPEATS + 1):
            began = process_time()
            loop = col.begun(driven, task, float(plan.energy_j[0]))
            col.advance(driven, task, col.work_of(driven.ways), loop, 0, record, 0.01)
            loops.append(process_time() - began)
            began = process_time()
            follow(car, cycle, plan, line=line)
            runs.append(process_time() - began)
        loop_ms, run_ms = 1e3 * min(loops[1:]), 1e3 * min(runs[1:])
        print(
            f"{name}: loop {loop_ms:.0f} ms ({1e6 * loop_ms / len(record):.0f} ns per step), "
            f"with books and quality {run_ms:.0f} ms; 1000 cars x NEDC on two cores: {loop_ms / 2:.0f} s"
        )


if __name__ == "__main__":
    main()
