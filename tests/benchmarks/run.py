"""All speed figures in one run, written to reports/benchmarks.md:

    python tests/benchmarks/run.py

Times are medians; ratios are against a baseline in the same process. Whole processes are started afresh, cold ones
with an empty compilation cache.
"""

import os
import platform
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from unittest import mock

import numpy as np

from hevopt import (
    Battery,
    ControlTable,
    Problem,
    build_problem,
    certify,
    compare,
    load_architecture,
    load_cycle,
    simulate,
    solve,
)
from hevopt.bounds import certificate
from hevopt.bounds.lower_dp import lower_bound_kg
from hevopt.bounds.prices import one_price_dual
from hevopt.bounds.step_prices import costate_dual, lp_dual
from hevopt.driving.demand import demand_of
from hevopt.powertrain.powertrain import build_table
from hevopt.problem.choices import choices_of, without_dominated
from hevopt.problem.switching import at_step
from hevopt.strategies import _backward_kernels as kernels
from hevopt.strategies import dp, ecms
from hevopt.strategies._rollout_kernels import Grid

OUT = Path(__file__).parents[2] / "reports" / "benchmarks.md"
HYBRIDS = ("C1", "C2", "D", "E")


def median_s(call: Callable[[], object], runs: int = 7) -> float:
    """Median time of a call, after one that is not counted."""
    call()
    times = []
    for _ in range(runs):
        began = time.perf_counter()
        call()
        times.append(time.perf_counter() - began)
    return sorted(times)[runs // 2]


def backward_call(problem: Problem, nodes: int) -> tuple[Callable[[], object], int]:
    """One backward recursion, and how many evaluations (choices x nodes) it makes."""
    choices = without_dominated(choices_of(problem))
    low, high = problem.window_j
    cell = (high - low) / (nodes - 1)
    grid = Grid(np.full(choices.steps + 1, low), cell)
    terminal = 1e-7 * np.maximum(problem.end_min_j - low - cell * np.arange(nodes), 0.0)

    def call() -> object:
        after = np.tile(terminal, (choices.modes, 1))
        penalty = kernels.Penalty(1e-7 * cell, 0.0, 1.0)
        return kernels.backward(
            choices, after, grid, grid.low_j[:-1], penalty, problem.battery.arrays
        )

    return call, len(choices.cost_kg) * nodes


def numpy_backward(problem: Problem, nodes: int, steps: int) -> int:
    """The last steps of the same recursion in vectorised NumPy, (control, node) at once; evaluations made."""
    table, pack = problem.table, problem.battery
    low, high = problem.window_j
    grid = np.linspace(low, high, nodes)
    slope = np.ptp(pack.open_circuit_v) / np.ptp(pack.soc)
    voltage = np.sqrt(pack.open_circuit_v[0] ** 2 + 2 * slope * grid / pack.capacity_as)
    value = np.tile(1e-7 * np.maximum(problem.end_min_j - grid, 0), (table.modes, 1))
    count = 0
    for k in range(len(table.step_s) - 1, len(table.step_s) - 1 - steps, -1):
        usable = np.flatnonzero(table.feasible[k])
        power = table.battery_power_w[k, usable][:, None]
        root = np.sqrt(voltage**2 - 4 * pack.discharge_ohm[0] * power)
        drain = voltage * 2 * power / (voltage + root)
        drain = np.where(power < 0, pack.coulombic_efficiency * drain, drain)
        place = np.clip(
            (grid - drain * table.step_s[k] - low) / (grid[1] - grid[0]), 0, nodes - 1.001
        )
        whole = place.astype(np.int64)
        share = place - whole
        ahead = value[table.mode[usable]]
        left = np.take_along_axis(ahead, whole, axis=1)
        right = np.take_along_axis(ahead, whole + 1, axis=1)
        total = table.fuel_kg[k, usable][:, None] + left + share * (right - left)
        least = np.full_like(value, 1.0)
        for m in range(len(value)):
            mine = table.mode[usable] == m
            if mine.any():
                least[m] = total[mine].min(axis=0)
        kg, energy_j = at_step(table.switch_fuel_kg, k), at_step(table.switch_energy_j, k)
        switched = [
            [np.interp(grid - energy_j[m, n], grid, least[n]) for n in range(table.modes)]
            for m in range(table.modes)
        ]
        value = np.min(kg[:, :, None] + np.array(switched), axis=1)
        count += len(usable) * nodes
    return count


def foreign_problem() -> Problem:
    """A problem from arrays alone: 1400 steps x 105 controls, curved battery."""
    rng = np.random.default_rng(1)
    demand = np.abs(np.cumsum(rng.normal(0, 1500, 1400))) % 30_000
    share = np.linspace(-1.0, 1.0, 105)
    engine = demand[:, None] - 20_000 * share
    fuel = np.where(engine > 0, 0.1e-3 + engine / 43e6 / 0.38 * (1 + engine / 2e5), 0.0)
    loss = 150 + 0.05 * 20_000 * share**2
    battery = Battery(
        np.linspace(0, 1, 11), 200 + 40 * np.linspace(0, 1, 11) ** 0.5, np.linspace(0.3, 0.2, 11),
        np.linspace(0.25, 0.3, 11), 6.5 * 3600, 0.95, 0.4, 0.8,
    )  # fmt: skip
    feasible = (engine >= 0) & (engine < 60_000)
    table = ControlTable.from_arrays(fuel, 20_000 * share + loss + 0 * engine, feasible)
    return Problem(table, battery, 0.6, 0.6)


def kernel_lines(problem: Problem) -> list[str]:
    """Evaluations per second of the recursion, against vectorised NumPy."""
    pack = problem.battery
    flat = replace(pack, open_circuit_v=np.full(2, 230.0))
    lines = []
    for label, battery in (("SOC-dependent battery", pack), ("constant voltage", flat)):
        call, count = backward_call(replace(problem, battery=battery), 1001)
        lines.append((label, count / median_s(call)))
    began = time.perf_counter()
    plain = numpy_backward(problem, 1001, 100) / (time.perf_counter() - began)
    return [
        *(
            f"| dp kernel, {label}, 1001 nodes | {rate / 1e9:.2f} G evaluations/s |"
            for label, rate in lines
        ),
        f"| the same in vectorised NumPy | {plain / 1e9:.3f} G evaluations/s |",
        f"| ratio, SOC-dependent battery | {lines[0][1] / plain:.0f} |",
    ]


def problem_lines(problems: dict[str, Problem]) -> list[str]:
    """Table, duals and strategies, per architecture."""
    lines, cycle = [], load_cycle("nedc")
    for name, problem in problems.items():
        car = load_architecture(name)
        demand = demand_of(cycle, car.vehicle, car.gearbox)
        rollout = simulate(problem, solve(problem).control)
        worth = one_price_dual(problem)[-1].price_kgpj
        figures = [
            median_s(lambda car=car, demand=demand: build_table(car, demand)),
            median_s(lambda p=problem: one_price_dual.__wrapped__(p)),
            median_s(lambda p=problem, r=rollout: costate_dual(p, r)),
            median_s(lambda p=problem, r=rollout: lp_dual(p, r), 3),
            median_s(lambda p=problem, w=worth: lower_bound_kg(p, w, nodes=16_001), 3),
            median_s(lambda p=problem: dp.solve(p), 3),
            median_s(lambda p=problem: ecms.solve(p), 3),
        ]
        lines.append(
            f"| {name} | " + " | ".join(f"{1e3 * figure:.1f}" for figure in figures) + " |"
        )
    return lines


def process_s(words: list[str], cache: str, runs: int) -> float:
    """Median time of a whole process."""
    environment = os.environ | {"NUMBA_CACHE_DIR": cache}
    times = []
    for _ in range(runs):
        began = time.perf_counter()
        subprocess.run(
            [sys.executable, "-m", "hevopt.cli", *words],
            env=environment,
            check=True,
            capture_output=True,
        )
        times.append(time.perf_counter() - began)
    return sorted(times)[runs // 2]


def continuous_lines(turns: int = 5) -> list[str]:
    """What certificates of all splits cost a comparison: processor time, by turns, least of all."""
    cars = ("A", "B", *HYBRIDS)

    def spent_s() -> float:
        began = time.process_time()
        compare("nedc", cars, observe=lambda *_: None)  # by one process
        return time.process_time() - began

    spent_s()
    with_s, without_s = [], []
    for _ in range(turns):
        with_s.append(spent_s())
        with mock.patch.object(certificate, "split_of", lambda _: None):
            without_s.append(spent_s())
    ratio = min(with_s) / min(without_s)
    return [
        f"| comparison of A to E, certificates of every split over those of the levels | {ratio:.2f} |"
    ]


def process_lines() -> list[str]:
    """hevopt as a user starts it."""
    with tempfile.TemporaryDirectory() as cache:
        cold = process_s(["compare"], cache, 1)
        warm = process_s(["compare"], cache, 5)
        help_s = process_s(["--help"], cache, 5)
    return [
        f"| `hevopt compare`, first time, compilation included | {cold:.1f} s |",
        f"| `hevopt compare`, after that | {warm:.2f} s |",
        f"| `hevopt --help` | {help_s:.2f} s |",
    ]


def convergence_lines() -> list[str]:
    """Fuel of dp against torque levels and nodes, C2 and E on the NEDC."""
    lines, cycle = [], load_cycle("nedc")
    for name in ("C2", "E"):
        car = load_architecture(name)
        by_levels, by_nodes = [], []
        for levels in (21, 41, 81, 161):
            problem = build_problem(car, cycle, levels=levels)
            by_levels.append(simulate(problem, solve(problem).control).total_fuel_kg)
        problem = build_problem(car, cycle)
        for nodes in (201, 401, 801, 1601):
            plan = dp.solve(problem, nodes=nodes, refine=False)
            by_nodes.append(simulate(problem, plan.control).total_fuel_kg)
        for what, fuel in (
            ("levels 21, 41, 81, 161", by_levels),
            ("nodes 201, 401, 801, 1601", by_nodes),
        ):
            lines.append(
                f"| {name} | {what} | " + " | ".join(f"{1e3 * f:.3f}" for f in fuel) + " |"
            )
    return lines


def machine() -> str:
    """Processor, cores and versions."""
    model = platform.processor() or platform.machine()
    for line in (
        Path("/proc/cpuinfo").read_text().splitlines() if Path("/proc/cpuinfo").exists() else ()
    ):
        if line.startswith("model name"):
            model = line.split(":", 1)[1].strip()
            break
    return f"{model}, {os.cpu_count()} cores, Python {platform.python_version()}, NumPy {np.__version__}"


def main() -> None:
    """Measure and write."""
    problems = {n: build_problem(load_architecture(n), load_cycle("nedc")) for n in ("B", *HYBRIDS)}
    foreign = foreign_problem()

    def solve_foreign() -> float:
        rollout = simulate(foreign, dp.solve(foreign, nodes=3001, refine=False).control)
        bound, _ = certify(foreign, rollout, target_gap=1e-2).bound_kg(rollout.end_j)
        return 100 * (rollout.cost_kg / bound - 1)

    foreign_s = median_s(solve_foreign, 3)
    text = [
        "# Benchmarks",
        "",
        "Made by `python tests/benchmarks/run.py`. Medians; these machines are shared, read the ratios first.",
        "",
        f"Machine: {machine()}.",
        "",
        "| what | figure |",
        "|---|---|",
        *kernel_lines(problems["C2"]),
        f"| arrays alone, 1400 steps x 105 controls, 3001 nodes, plan and certificate | {foreign_s:.2f} s, "
        f"gap {solve_foreign():.3f} % |",
        *continuous_lines(),
        *process_lines(),
        "",
        "NEDC, 41 torque levels, ms:",
        "",
        "| car | table | one multiplier | costate prices | LP prices | lower-bound DP, 16001 nodes | dp | ecms |",
        "|---|---|---|---|---|---|---|---|",
        *problem_lines(problems),
        "",
        "Convergence of dp on the NEDC, g of fuel (nodes: first grid only):",
        "",
        "| car | grid | | | | |",
        "|---|---|---|---|---|---|",
        *convergence_lines(),
        "",
    ]
    OUT.write_text("\n".join(text))
    print("\n".join(text))


if __name__ == "__main__":
    main()
