"""`hevopt drive`: a car driven forward, by somebody at the pedals."""

from pathlib import Path
from typing import Annotated, Any

import typer

from hevopt.commands.options import ArchitectureArgument, CycleOption, JsonOption, takes_settings
from hevopt.commands.terminal import Progress, show, write

_MISSED = 3


@takes_settings("strategies", "allow_shortfall")
def drive(
    given: dict[str, Any],
    architecture: ArchitectureArgument,
    strategy: Annotated[
        str, typer.Option("--strategy", help="Name of a strategy, whose plan is driven.")
    ] = "dp",
    cycle: CycleOption = "nedc",
    step: Annotated[float, typer.Option("--step", help="Step, 0.001 to 0.1 s.")] = 0.01,
    strict: Annotated[
        bool, typer.Option("--strict", help="Exit status 3 where the trace is missed.")
    ] = False,
    out: Annotated[
        Path | None,
        typer.Option("--out", help="Write every step to this .csv, .parquet or .json."),
    ] = None,
    json: JsonOption = False,
) -> None:
    """A strategy's plan driven forward, with driver, clutch and tyres, beside the backward run."""
    from hevopt.commands.comparing import Job
    from hevopt.driving.cycle import load_cycle
    from hevopt.files.writing import check_outs
    from hevopt.output import driven_tables as tables
    from hevopt.output.file_tables import check_table_file, write_frame
    from hevopt.studies.cars import cars_of
    from hevopt.studies.driven import drive as driven_by
    from hevopt.studies.settings import given_of, study_of

    settings = study_of(given_of("the command line", given)).settings
    job = Job(cars_of([architecture], settings), load_cycle(cycle), settings)
    car = job.cars.cars[0]
    if out is not None:
        check_outs({"--out": out}, job.inputs)
        check_table_file(out)
    with Progress() as progress:
        progress(f"{car.name}: {strategy}", 0, 1)
        driven = driven_by(car, job.trace, strategy, settings=settings, step_s=step)
    if out is not None:
        write_frame(out, tables.steps_frame(driven.run), job.about)
    if json:
        from json import dumps

        write(dumps(tables.as_dict(driven) | job.about, indent=1, allow_nan=False))
    else:
        show(tables.twin_table(driven))
        show(tables.audit_table(driven))
        write("\n".join([tables.notes(driven), *job.cars.said()]))
        if out is not None:
            write(f"steps written to {out}")
    if strict and driven.run.missed:
        raise typer.Exit(_MISSED)
