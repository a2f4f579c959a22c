"""`hevopt drive` and `hevopt performance`: cars driven forward, along a trace and at full pedal."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from hevopt.commands.options import ArchitectureArgument, CycleOption, JsonOption, takes_settings
from hevopt.commands.reporting import check_ending, check_page, command_line
from hevopt.commands.terminal import Progress, show, write
from hevopt.errors import DataError, InfeasibleError

if TYPE_CHECKING:
    from hevopt.car.architecture import Architecture

EngineModelOption = Annotated[
    Literal["map", "mean_value"],
    typer.Option(
        "--engine-model",
        help="The steady map, or the mean-value engine with its turbocharger's lag.",
    ),
]


@takes_settings("strategies", "allow_shortfall")
def drive(
    given: dict[str, Any],
    architecture: ArchitectureArgument,
    strategy: Annotated[
        str, typer.Option("--strategy", help="Name of a strategy, which decides or is replayed.")
    ] = "dp",
    cycle: CycleOption = "nedc",
    step: Annotated[float, typer.Option("--step", help="Step, 0.001 to 0.1 s.")] = 0.01,
    decide_every: Annotated[
        float, typer.Option("--decide-every", help="From one decision to the next, 0.02 to 10 s.")
    ] = 0.5,
    dwell: Annotated[
        float,
        typer.Option("--dwell", help="The engine stays on, and off, for so many seconds, 0 to 60."),
    ] = 1.0,
    replay: Annotated[
        bool, typer.Option("--replay", help="Drive the plan even where the strategy can decide.")
    ] = False,
    engine_model: EngineModelOption = "map",
    strict: Annotated[
        bool, typer.Option("--strict", help="Exit status 3 where the trace is missed.")
    ] = False,
    out: Annotated[
        Path | None,
        typer.Option("--out", help="Write every step to this .csv, .parquet or .json."),
    ] = None,
    report: Annotated[
        Path | None, typer.Option("--report", help="Write a page to this HTML file.")
    ] = None,
    json: JsonOption = False,
) -> None:
    """A strategy driven forward, with driver, clutch and tyres, beside the backward run.

    conventional, nox_cut, power_follower, thermostat, a_ecms, sdp and mpc decide on the way; of all others the plan
    is replayed.
    """
    from hevopt.commands.comparing import ComparisonJob
    from hevopt.driving.cycle import load_cycle
    from hevopt.files.writing import check_outs, write_whole
    from hevopt.forward.asked import Asking
    from hevopt.output import driven_tables as tables
    from hevopt.output.file_tables import check_table_file, write_frame
    from hevopt.studies.cars import cars_of
    from hevopt.studies.driven import drive as driven_by
    from hevopt.studies.given import given_of, study_of

    settings = study_of(given_of("the command line", given)).settings
    job = ComparisonJob(cars_of([architecture], settings), load_cycle(cycle), settings)
    car = job.cars.cars[0]
    check_outs({"--out": out, "--report": report}, job.inputs)
    if out is not None:
        check_table_file(out)
    check_page(report)
    with Progress() as progress:
        progress(f"{car.name}: {strategy}", 0, 1)
        driven = driven_by(
            car, job.trace, strategy, settings=settings, step_s=step,
            asking=Asking(decide_every, dwell), replay=replay, engine_model=engine_model,
        )  # fmt: skip
    if out is not None:
        write_frame(out, tables.steps_frame(driven.run), job.about)
    if report is not None:
        from hevopt.pages.forward.page import driven_page

        write_whole(report, driven_page(driven, command_line()).encode())
    if json:
        from json import dumps

        write(dumps(tables.as_dict(driven) | job.about, indent=1, allow_nan=False))
    else:
        show(tables.twin_table(driven))
        show(tables.audit_table(driven))
        write("\n".join([tables.notes(driven), *job.cars.said()]))
        if out is not None:
            write(f"steps written to {out}")
        if report is not None:
            write(f"page written to {report}")
    if strict and driven.run.missed:
        raise typer.Exit(InfeasibleError.exit_status)


def performance(
    cars: Annotated[str, typer.Argument(help="Names or files of architectures, by commas.")],
    boost: Annotated[
        bool, typer.Option("--boost", help="Add a line with e-boost for cars that have it.")
    ] = False,
    added_mass: Annotated[float, typer.Option("--added-mass", help="Driver and load, kg.")] = 0.0,
    gap: Annotated[
        float | None, typer.Option("--gap", help="Time without torque in a change of gear, s.")
    ] = None,
    boost_lag: Annotated[
        float,
        typer.Option("--boost-lag", help="Time constant by which full load comes, s; of the map."),
    ] = 0.0,
    engine_model: EngineModelOption = "map",
    plot: Annotated[
        Path | None, typer.Option("--plot", help="Tractive-force diagram: .png, .svg or .pdf.")
    ] = None,
    report: Annotated[
        Path | None, typer.Option("--report", help="Write a page to this HTML file.")
    ] = None,
    json: JsonOption = False,
) -> None:
    """How fast cars are: from rest, in gear, top speed and slopes, with and without e-boost."""
    from hevopt.car_files.load import load_architecture
    from hevopt.commands.terminal import listed
    from hevopt.files.writing import check_outs, write_whole
    from hevopt.forward.performance import performance as figures_of
    from hevopt.forward.run import shifting_of
    from hevopt.output import performance_tables as tables

    loaded = [load_architecture(name) for name in listed(cars) or []]
    if not loaded:
        raise DataError("no cars; name architectures, such as A,C2")
    if plot is not None:
        _check_plot(plot)
    check_page(report)
    check_outs({"--plot": plot, "--report": report}, [file for car in loaded for file in car.files])
    found = []
    with Progress() as progress:
        for n, car in enumerate(loaded):
            progress(car.name, n, len(loaded))
            shifting = None if gap is None else shifting_of(car)._replace(gap_s=gap)
            handling = car.handling._replace(shifting=shifting or car.handling.shifting)
            for how in manners(car, engine_model, boost and "e_boost" in car.functions):
                lag = boost_lag if how["engine_model"] == "map" else 0.0
                found.append(
                    figures_of(car, **how, added_kg=added_mass, boost_lag_s=lag, handling=handling)
                )
    if plot is not None:
        from hevopt.output.force_diagram import force_diagram

        write_whole(plot, force_diagram(found, plot.suffix.lower()[1:]))
    if report is not None:
        from hevopt.pages.forward.page import performance_page

        write_whole(report, performance_page(found, command_line()).encode())
    if json:
        from json import dumps

        write(dumps({"cars": [tables.as_dict(of) for of in found]}, indent=1, allow_nan=False))
        return
    for table in (tables.speed_table, tables.gear_table):
        show(table(found))
    if any(of.boosts for of in found):
        show(tables.help_table(found))
    show(tables.limit_table(found))
    write(tables.NOTE)
    if engine_model == "mean_value":
        write(tables.MEAN_VALUE_NOTE)
    for car in loaded:
        if boost and "e_boost" not in car.functions:
            write(f"{car.name}: e_boost is none of its functions, so there is no line with it")
    if plot is not None:
        write(f"diagram written to {plot}")
    if report is not None:
        write(f"page written to {report}")


def manners(car: "Architecture", engine_model: str, boost: bool) -> list[dict[str, Any]]:
    """How a car is driven, line by line: steady map and mean-value engine, alone and with its machine.

    A machine fills the hole of an engine that it turns with; none does of one that has a speed of its own.
    """
    found: list[dict[str, Any]] = [{"engine_model": "map"}]
    if boost:
        found.append({"engine_model": "map", "boosts": True})
    if engine_model == "mean_value":
        found.append({"engine_model": "mean_value"})
        if boost:
            if not car.driveline.free_engine_speed:
                found.append({"engine_model": "mean_value", "fills": True})
            found.append({"engine_model": "mean_value", "boosts": True})
    return found


def _check_plot(plot: Path) -> None:
    from hevopt.files.writing import check_writable

    check_writable(plot)
    check_ending("--plot", plot, ".png", ".svg", ".pdf")
