"""Every shipped car on every shipped cycle, driven: python tests/benchmarks/driven.py [--out PAGE] [CAR ...].

The plan of dynamic programming is replayed, of a car without a choice the one that it has. Beside the backward run
stand fuel, drive quality and marks, and of all components what does not add up, as a share of what passed the
wheels.
"""

import argparse
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from hevopt import DrivenPlan, InfeasibleError, drive, load_architecture, load_cycle
from hevopt.files.lookup import groups_of, shipped_names
from hevopt.studies.solved import strategies_for

LIMIT = 1e-9
CYCLES = shipped_names("cycles", ".csv")


def every_car() -> list[str]:
    """All shipped cars, those of the folders behind those of the study."""
    groups = groups_of("architectures", ".toml")
    return [
        *shipped_names("architectures", ".toml"),
        *(car for names in groups.values() for car in names),
    ]


def driven_plan(car: str, cycle: str) -> DrivenPlan:
    """The plan of dp, or of the car's own way of driving, replayed."""
    built = load_architecture(car)
    fitting = strategies_for(built, None)
    strategy = "dp" if "dp" in fitting else fitting[-1]
    return drive(built, load_cycle(cycle), strategy, replay=True)


class Worst(NamedTuple):
    """The largest share of a component that does not add up, and where."""

    share: float
    where: str


def table(cars: list[str], worst: dict[str, Worst]) -> Iterator[str]:
    """Rows of the page; worst: filled, component by component."""
    for car in cars:
        for cycle in CYCLES:
            try:
                found = driven_plan(car, cycle)
            except InfeasibleError as error:
                yield f"| {car} | {cycle} | | | | | | | not driven: {error.headline} |"
                continue
            run, residual = found.run, found.run.residual
            for name, share in residual.items():
                worst[name] = max(
                    worst.get(name, Worst(0.0, "")), Worst(share, f"{car} on {cycle}")
                )
            largest = max(residual, key=lambda name: residual[name])
            fuel, change = found.corrected_l_per_100km, found.change_percent
            yield (
                f"| {car} | {cycle} | {'' if fuel is None else f'{fuel:.3f}'} | "
                f"{found.electricity_kwh_per_100km:.2f} | {'' if change is None else f'{change:+.2f}'} | "
                f"{3.6 * run.quality.speed_error_mps:.3f} | {len(run.quality.violations)} | "
                f"{largest} {residual[largest]:.0e} | {', '.join(found.marks)} |"
            )


def main() -> None:
    """The page, and which components do not add up."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("cars", nargs="*")
    parser.add_argument("--out", type=Path)
    asked = parser.parse_args()
    worst: dict[str, Worst] = {}
    rows = []
    for row in table(asked.cars or every_car(), worst):
        rows.append(row)
        print(row, flush=True)
    parts = "\n".join(
        f"| {name} | {found.share:.0e} | {found.where} |" for name, found in worst.items()
    )
    beyond = [name for name, found in worst.items() if not found.share < LIMIT]
    text = (
        "# Every shipped car on every shipped cycle, driven\n\nMade by `python tests/benchmarks/driven.py --out "
        "reports/driven.md`: the plan of dynamic programming replayed at 100 Hz, of a car without a choice the one "
        "that it has. Fuel is charge-corrected; *against backward* is fuel, without an engine energy from the "
        "battery. "
        "Residual: the component whose energy adds up least, as a share of what passed the wheels.\n\n"
        "| component | largest residual | where |\n|---|---:|---|\n" + parts + "\n\n"
        f"Beyond {LIMIT:g}: {', '.join(beyond) or 'none'}.\n\n"
        "| car | cycle | l/100 km | kWh/100 km from the battery | against backward, % | RMSSE, km/h | violations | "
        "residual | marks |\n|---|---|---:|---:|---:|---:|---:|---|---|\n" + "\n".join(rows) + "\n"
    )
    print(parts)
    if asked.out is not None:
        asked.out.write_text(text)


if __name__ == "__main__":
    main()
