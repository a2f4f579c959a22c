"""Times of forward runs, written to reports/benchmarks_driving.md:

    python tests/benchmarks/driving.py [CARS]

Processor time on the NEDC at 100 Hz, compiled before: the loop alone, and with books and drive quality; replayed,
and with a strategy that decides twice a second. Then CARS (1000) cars of different mass, every one planned and
driven, by two processes: time on the wall.
"""

import sys
from concurrent.futures import ProcessPoolExecutor
from functools import cache
from pathlib import Path
from time import perf_counter, process_time

import numpy as np
from run import machine

sys.path.insert(0, str(Path(__file__).parents[1]))

from forward.drives import plan_of

from hevopt import build_problem, load_architecture, load_cycle, simulate
from hevopt.forward.asked import Asking, Decider, follow_asked
from hevopt.forward.lines import line_of
from hevopt.forward.loops import Driving
from hevopt.forward.plans import replay_of
from hevopt.forward.run import follow
from hevopt.powertrain.points import points_of
from hevopt.problem.holding import with_holding
from hevopt.strategies import STRATEGIES, a_ecms

OUT = Path(__file__).parents[2] / "reports" / "benchmarks_driving.md"
REPEATS = 7
CARS, PROCESSES = 1000, 2
LIGHTEST_KG, HEAVIEST_KG = 1100.0, 1700.0


class Watched:
    """Processor time of the loop within runs."""

    def __init__(self):
        self.spent_s = 0.0
        advance = Driving.advance

        def timed(*arguments):
            began = process_time()
            loop = advance(*arguments)
            self.spent_s += process_time() - began
            return loop

        Driving.advance = timed

    def least_ms(self, run):
        """(loop, whole run), the least of several."""
        found = []
        for _ in range(REPEATS):
            began, self.spent_s = process_time(), 0.0
            run()
            found.append((1e3 * self.spent_s, 1e3 * (process_time() - began)))
        return [min(times) for times in zip(*found[1:], strict=True)]


def deciding(car, cycle, trajectory, line):
    """A run that a_ecms decides twice a second; its table of operating points is made before."""
    problem = trajectory.problem
    points = points_of(car, problem)
    held = with_holding(points.problem)

    def run():
        stepper = a_ecms.start_on(problem, held, 0.5)
        decider = Decider("a_ecms", stepper, points.problem, points, Asking())
        return follow_asked(car, cycle, decider, trajectory, line=line)

    return run


def run_lines():
    """A row per car and how it is driven."""
    watched = Watched()
    for name in ("A", "C2", "E", "prius_1998"):
        car, cycle, plan, trajectory = plan_of(name)
        line = line_of(car)
        runs = {"replayed": lambda car=car, c=cycle, p=plan, n=line: follow(car, c, p, line=n)}
        if name != "A":
            runs["a_ecms, every 0.5 s"] = deciding(car, cycle, trajectory, line)
        for how, run in runs.items():
            loop_ms, run_ms = watched.least_ms(run)
            ns = 1e6 * loop_ms / (100 * cycle.duration_s)
            yield f"| {name} | {how} | {loop_ms:.0f} | {ns:.0f} | {run_ms:.0f} |"


@cache
def _base():
    return load_architecture("A"), load_cycle("nedc")


def of_mass(mass_kg):
    """Fuel in kg of a car of another mass, planned and driven, and the processor time of that."""
    began, (car, cycle) = process_time(), _base()
    car = car.of_mass(mass_kg)
    problem = build_problem(car, cycle, allow_shortfall=True)
    trajectory = simulate(problem, STRATEGIES["baseline"].solve(problem).control)
    run = follow(car, cycle, replay_of(trajectory, line_of(car)))
    assert not run.missed
    return run.fuel_kg, process_time() - began


def many_line(count):
    """Cars of masses from the lightest to the heaviest, by two processes."""
    masses = np.linspace(LIGHTEST_KG, HEAVIEST_KG, count).tolist()
    began = perf_counter()
    with ProcessPoolExecutor(PROCESSES) as pool:
        fuel, spent_s = zip(*pool.map(of_mass, masses, chunksize=10), strict=True)
    assert np.all(np.diff(fuel) > 0)
    each_s = float(np.mean(spent_s))
    return (
        f"{count} cars of A x NEDC, planned and driven, books and quality included, by {PROCESSES} processes: "
        f"{perf_counter() - began:.0f} s on the wall, {1e3 * each_s:.0f} ms of processor time each, which is "
        f"{CARS * each_s / PROCESSES:.0f} s for {CARS} cars on {PROCESSES} free cores."
    )


def main():
    """Measure and write."""
    count = int(sys.argv[1]) if sys.argv[1:] else CARS
    text = [
        "# Benchmarks of driving",
        "",
        f"Made by `python {' '.join(['tests/benchmarks/driving.py', *sys.argv[1:]])}`: the NEDC at 100 Hz, "
        "processor time, the least of "
        f"{REPEATS - 1}; the machine is shared, so that other work shows.",
        "",
        f"Machine: {machine()}.",
        "",
        "| car | driven | loop, ms | ns per step | whole run, ms |",
        "|---|---|---|---|---|",
        *run_lines(),
        "",
        many_line(count),
        "",
    ]
    OUT.write_text("\n".join(text))
    print("\n".join(text))


if __name__ == "__main__":
    main()
