"""`hevopt architectures`, `cycles` and `strategies`: what there is to choose from."""

import sys
from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from hevopt.commands.terminal import Progress, write

architectures_app = typer.Typer(help="The shipped architectures.", rich_markup_mode=None)
cycles_app = typer.Typer(
    help="The shipped cycles, with duration, distance, top speed and whether they list gears.",
    rich_markup_mode=None,
)

# Folder of shipped architectures -> what they are; the study's are those that commands take where none is named.
_GROUPS = {
    "study": "study: the six of the published study, taken where none is named",
    "hybrids": "templates: a topology each, to start from",
    "real": "real: cars that were built, held against the laboratory by hevopt validation",
    "tipin": "tip-in: the car of the study's tip-in",
}


@architectures_app.callback(invoke_without_command=True)
def architectures(context: typer.Context) -> None:
    """The shipped architectures."""
    if context.invoked_subcommand:
        return
    from hevopt.car_files.load import load_architecture
    from hevopt.files.lookup import groups_of, shipped_names
    from hevopt.strategies import fitting

    groups = {"study": shipped_names("architectures", ".toml")}
    groups |= groups_of("architectures", ".toml")
    order = [*_GROUPS, *(group for group in groups if group not in _GROUPS)]
    width = max(len(name) for names in groups.values() for name in names)
    for n, group in enumerate(order):
        write(f"{chr(10) if n else ''}{_GROUPS.get(group, group)}")
        for name in groups[group]:
            car = load_architecture(name)
            write(f"  {name:{width}} {car.description:54} {', '.join(fitting(car.marks))}")


@cycles_app.callback(invoke_without_command=True)
def cycles(context: typer.Context) -> None:
    """The shipped cycles, with duration, distance, top speed and whether they list gears."""
    if context.invoked_subcommand:
        return
    from hevopt.driving.cycle import load_cycle
    from hevopt.files.lookup import shipped_names

    for name in shipped_names("cycles", ".csv"):
        trace = load_cycle(name)
        gears = "gears listed" if trace.gear is not None else "gears from shift speeds"
        write(
            f"{name:18} {trace.duration_s:6.0f} s {trace.distance_m / 1e3:7.2f} km "
            f"{trace.speed_mps.max() * 3.6:6.1f} km/h  {gears}"
        )


def strategies(
    out: Annotated[
        Path | None,
        typer.Option(
            "--out", help="Run them all on C2 and D over all shipped cycles; write a page."
        ),
    ] = None,
) -> None:
    """The strategies, and what each knows while it drives."""
    from hevopt.files.lookup import shipped_names
    from hevopt.files.writing import check_writable, write_whole
    from hevopt.output.strategies_page import strategies_page
    from hevopt.strategies import STRATEGIES, every_strategy, left_out
    from hevopt.studies import comparison as study

    if out is None:
        for name, strategy in every_strategy().items():
            kind = "causal" if strategy.causal else "offline"
            knows = f"knows: {strategy.knows}"
            if name not in STRATEGIES:
                kind, knows = (
                    "brought",
                    f"from {strategy.place.reference}" if strategy.place else "",
                )
            write(f"{name:13} {kind:8} {knows}")
        for fault in left_out():
            print(f"hevopt: left out: {fault}", file=sys.stderr)
        return
    check_writable(out)
    with Progress() as progress:
        comparisons = [
            study.compare(
                cycle, ["C2", "D"], ["all"], allow_shortfall=True, progress=partial(progress.of, cycle)
            )
            for cycle in shipped_names("cycles", ".csv")
        ]  # fmt: skip
    steps = {c.cycle: study.steps_of(c.cycle) for c in comparisons}
    write_whole(out, strategies_page(comparisons, steps).encode())
    write(f"written to {out}")
