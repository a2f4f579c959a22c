"""`hevopt fmu`: a car for other simulators."""

from pathlib import Path
from typing import Annotated, Any

import typer

from hevopt.commands.grouped import FILES
from hevopt.commands.options import SETTINGS, ArchitectureArgument, takes_settings
from hevopt.commands.terminal import write

_OF_THE_CAR = (
    "soc_start", "soc_min", "soc_max", "auxiliaries_w", "mass_kg", "start_cost_g", "changes",
)  # fmt: skip


@takes_settings(*(name for name in SETTINGS if name not in _OF_THE_CAR))
def fmu(
    given: dict[str, Any],
    architecture: ArchitectureArgument,
    out: Annotated[
        Path, typer.Option("--out", help="The unit, a file .fmu.", rich_help_panel=FILES)
    ],
    step: Annotated[
        float, typer.Option("--step", help="The unit's own step, 0.001 to 0.1 s.")
    ] = 0.01,
) -> None:
    """A driven car as a unit of FMI 2.0 for co-simulation: force, gear and torque in, speed and fuel out."""
    from hevopt.files.writing import check_outs
    from hevopt.fmu import export_fmu
    from hevopt.studies.cars import cars_of
    from hevopt.studies.given import given_of, study_of

    cars = cars_of([architecture], study_of(given_of("the command line", given)).settings)
    car = cars.cars[0]
    check_outs({"--out": out}, car.files)
    export_fmu(car, out, step_s=step)
    write("\n".join([f"{car.name}: unit written to {out}, own step {step:g} s", *cars.said()]))
