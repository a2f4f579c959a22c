"""What certificates of every split leave open on the shipped cars, and whether tables of 2001 levels agree:

    python tests/benchmarks/continuous.py --out reports/benchmarks_continuous.md [--cars C2 ...] [--cycles nedc ...]

Dynamic programming over refined levels is held against the bound of every split. Then every control of a table of
2001 levels, where the engine rests too, is valued at the prices of that bound, with the charge of the plan and with
those at the window's ends: none of its step and mode may cost less than the least that the bound counts there, so
that no bound of that table at the same prices lies below.
"""

import argparse
import sys
from dataclasses import fields, replace
from pathlib import Path
from unittest import mock

import numpy as np

if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).parents[1]))

from between import Dense, dense_below

from hevopt import load_architecture, load_cycle
from hevopt.bounds.claim import Scope
from hevopt.driving.demand import Demand, demand_of
from hevopt.driving.driver import change_down
from hevopt.files.lookup import shipped_names
from hevopt.powertrain import levels
from hevopt.powertrain.powertrain import build_table
from hevopt.studies.case import Case, prepare
from hevopt.studies.settings import Settings

CARS = ("A", "B", "C1", "C2", "D", "E")
LEVELS, BLOCK = 2001, 200
GOAL_PERCENT = 0.02
# A step that a car cannot follow is driven as far as it goes.
SETTINGS = Settings(refine=True, allow_shortfall=True)


def part_of(demand: Demand, begin: int, end: int) -> Demand:
    """Some steps of a drive."""
    parts = {part.name: getattr(demand, part.name) for part in fields(demand)}
    return Demand(**{n: None if v is None else v[begin:end] for n, v in parts.items()})


def dense(case: Case, price: np.ndarray, at_once: int = BLOCK) -> Dense:
    """Every control of a table of 2001 levels against what the bound counts, at one price for each step."""
    problem, car = case.problem, case.car
    demand = demand_of(case.cycle, car.vehicle, car.gearbox)
    if case.cycle.gear is None and car.gear == "cycle":
        demand = change_down(demand, car.vehicle, car.engine, car.gearbox)
    demand = demand.with_torque(demand.wheel_torque_nm - problem.table.missing_torque_nm)
    low, high = (np.full(len(price), end) for end in problem.battery.granted_window_j)
    energies = (case.dp_trajectory.energy_j[:-1], low, high)
    worst, count = -np.inf, 0
    with mock.patch.object(levels, "_BRAKING_LEVELS", LEVELS):
        for begin in range(0, len(price), at_once):
            end = min(begin + at_once, len(price))
            # What hangs on the step before or after is that of the whole drive but at the ends.
            first, last = max(begin - 1, 0), min(end + 1, len(price))
            fine = build_table(car, part_of(demand, first, last), levels=LEVELS)
            reject = fine.reject.copy()
            reject[: begin - first] = 1
            reject[len(reject) - (last - end) :] = 1
            fine = replace(fine, reject=reject)
            below, looked = dense_below(problem, fine, [price], energies, first)
            worst, count = max(worst, below), count + looked
    return Dense(worst, count)


def row(car: str, cycle: str) -> tuple[str, bool]:
    """A row of the page, and whether it is within the goal."""
    case = prepare(load_architecture(car), load_cycle(cycle), SETTINGS)
    plan, certificate = case.dp_trajectory, case.certificate
    extra_j = plan.end_j - certificate.end_min_j
    lines = [line for group in certificate.proofs.values() for line in group]
    best = max(lines, key=lambda line: line.value_kg + line.price_kgpj * extra_j)
    bound_kg = best.value_kg + best.price_kgpj * extra_j
    gap = 100 * (plan.cost_kg / bound_kg - 1)
    seen = dense(case, best.scale * best.shape)
    good = certificate.scope is Scope.CONTINUOUS and gap <= GOAL_PERCENT and seen.below <= 0
    controls = case.problem.table.fuel_kg.shape[1]
    figures = f"{controls} | {gap:.4f} | {seen.count:.2e} | {seen.below:.0e}"
    return f"| {car} | {cycle} | {certificate.scope} | {figures} |", good


def main() -> int:
    """The page; status 1 where a row is beyond the goal."""
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--cars", nargs="+", default=CARS)
    options.add_argument("--cycles", nargs="+", default=shipped_names("cycles", ".csv"))
    options.add_argument("--out", type=Path)
    asked = options.parse_args()
    rows, beyond = [], []
    for cycle in asked.cycles:
        for car in asked.cars:
            text, good = row(car, cycle)
            rows.append(text)
            beyond += [] if good else [f"{car} on {cycle}"]
            print(text, flush=True)
    end = (
        f"Beyond {GOAL_PERCENT:g} %, tabulated, or above a control: {', '.join(beyond) or 'none'}."
    )
    print(end)
    if asked.out is not None:
        asked.out.write_text(
            "# Certificates of every split, on the shipped cars\n\nMade by `python tests/benchmarks/continuous.py "
            "--out reports/benchmarks_continuous.md`. *Gap*: dynamic programming over refined levels above the "
            f"bound of every split, %.\n*Looked at*: controls of a table of {LEVELS} levels, where the engine "
            "rests too, valued at the prices of that bound at three charges; *above*: by how\nmuch the least that "
            "the bound counts in a step and mode lies above the least of them, as a share of the greatest value; "
            "0 or less is as it must be.\n\n| car | cycle | scope | controls | gap, % | looked at | above |\n"
            "|---|---|---|---:|---:|---:|---:|\n" + "\n".join(rows) + f"\n\n{end}\n"
        )
    return 1 if beyond else 0


if __name__ == "__main__":
    sys.exit(main())
