"""`hevopt compare`, `run` and `table`: one cycle, solved."""

import sys
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import typer

from hevopt.commands.options import (
    ArchitectureArgument,
    CycleOption,
    HorizonOption,
    JsonOption,
    RefineOption,
    takes_settings,
)
from hevopt.commands.terminal import Progress, listed, show, write

_OPTIONS = "the command line"


@takes_settings
def compare(
    given: dict[str, Any],
    study_path: Annotated[
        Path | None,
        typer.Argument(
            metavar="STUDY", help="TOML file with the settings below; options go first."
        ),
    ] = None,
    cycle: CycleOption = None,
    architectures: Annotated[
        str | None, typer.Option("--architectures", help="Names or files, separated by commas.")
    ] = None,
    strategies: Annotated[
        str | None,
        typer.Option("--strategies", help="Names, separated by commas, or all."),
    ] = None,
    refine: RefineOption = None,
    horizon: HorizonOption = None,
    json: JsonOption = False,
    out: Annotated[
        Path | None, typer.Option("--out", help="Write the rows to this .csv, .parquet or .json.")
    ] = None,
    steps: Annotated[
        Path | None,
        typer.Option(
            "--out-steps", help="Write every step of every row to this .csv, .parquet or .json."
        ),
    ] = None,
    page: Annotated[
        Path | None,
        typer.Option("--report", help="Write an HTML page that opens offline to this file."),
    ] = None,
    save: Annotated[
        Path | None,
        typer.Option("--save", help="Save all results to this file (JSON, gzip), for report."),
    ] = None,
    fronts: Annotated[
        bool, typer.Option("--fronts", help="Add every car's front of fuel and NOx to the page.")
    ] = False,
    effects: Annotated[
        bool, typer.Option("--sensitivity", help="Add every car's sensitivities to the page.")
    ] = False,
) -> None:
    """Strategies on architectures over one cycle, each with its certified bound."""
    from hevopt.commands.comparing import Files, Job, show_comparison
    from hevopt.commands.forecast import say_how_long
    from hevopt.driving.cycle import load_cycle
    from hevopt.studies import comparison as study
    from hevopt.studies.settings import Settings, cars_of, read_study, settings_of

    named = {
        "cycle": cycle,
        "architectures": listed(architectures),
        "strategies": listed(strategies),
        "refine": refine,
        "horizon_s": horizon,
    }
    options = given | {name: value for name, value in named.items() if value is not None}
    settings = Settings() if study_path is None else read_study(study_path)
    settings = settings.joined(settings_of(_OPTIONS, options))
    job = Job(cars_of(settings), load_cycle(settings.get("cycle", "nedc")), settings)
    files = Files(out, steps, page, save, fronts, effects)
    files.check(job)
    compared = partial(
        study.compare,
        architectures=job.cars.cars,
        strategies=settings.get("strategies", None),
        nox_weight=settings.get("nox_weight", 0.0),
        allow_shortfall=settings.get("allow_shortfall", False),
        free_gear=settings.get("free_gear", False),
        refine=settings.get("refine", False),
        horizon_s=settings.get("horizon_s", None),
    )
    say_how_long(job.trace, compared)
    with Progress() as progress:
        comparison = compared(job.trace, progress=progress, observe=files.observe)
    # Before the files, which may take long: what is solved is seen whatever becomes of them.
    show_comparison(job, comparison, json=json)
    lines, of_files = files.write(job, comparison)
    for line in () if json else lines:
        write(line)
    failures = comparison.failures | of_files
    for case, error in failures.items():
        print(f"hevopt: {case}: {error}", file=sys.stderr)
    if failures:
        raise typer.Exit(max(error.exit_status for error in failures.values()))


@takes_settings
def run(
    given: dict[str, Any],
    architecture: ArchitectureArgument,
    strategy: Annotated[str, typer.Option("--strategy", help="Name of a strategy.")] = "dp",
    cycle: CycleOption = "nedc",
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            help="Write inputs, powers and losses per step to this .csv, .parquet or .json.",
        ),
    ] = None,
    refine: RefineOption = None,
    horizon: HorizonOption = None,
    json: JsonOption = False,
) -> None:
    """One strategy on one architecture, with its calibration curve and its trajectory."""
    from hevopt.commands.comparing import Job
    from hevopt.commands.forecast import say_how_long
    from hevopt.driving.cycle import load_cycle
    from hevopt.files.writing import check_outs
    from hevopt.output import file_tables as outputs
    from hevopt.output import terminal_tables as report
    from hevopt.strategies import strategy_named
    from hevopt.studies import comparison as study
    from hevopt.studies.case import prepare
    from hevopt.studies.settings import cars_of, settings_of

    strategy_named(strategy)
    study.check_horizon(horizon, [strategy])
    named = {"refine": refine, "horizon_s": horizon}
    options = given | {name: value for name, value in named.items() if value is not None}
    settings = settings_of(_OPTIONS, options)
    job = Job(cars_of(settings, [architecture]), load_cycle(cycle), settings)
    car, trace = job.cars.cars[0], job.trace
    if out is not None:
        check_outs({"--out": out}, job.inputs)
        outputs.check_table_file(out)
    nox_weight = settings.get("nox_weight", 0.0)
    prepared = partial(
        prepare,
        car,
        nox_weight=nox_weight,
        allow_shortfall=settings.get("allow_shortfall", False),
        refine=settings.get("refine", False),
    )
    say_how_long(trace, lambda piece: study.run_case(prepared(piece), strategy, horizon))
    with Progress() as progress:
        progress(f"{car.name}: table and certificate", 0, 1)
        case = prepared(trace)
        progress(f"{car.name}: {strategy}", 0, 1)
        row, plan, trajectory = study.run_case(case, strategy, horizon)
    comparison = study.Comparison(
        trace.name,
        [row],
        {},
        nox_weight,
        end_asked=study.end_asked([car]),
        lost_proofs=study.lost_proofs(case),
    )
    if out is not None:
        columns = outputs.step_columns(case, trajectory)
        outputs.write_steps(out, comparison, columns, job.about)
    if json:
        write(outputs.result_json(comparison, job.about))
        return
    show(report.comparison_table(comparison))
    write("\n".join([report.comparison_notes(comparison), *job.changed()]))
    calibration = report.calibration_table(plan)
    if calibration is not None:
        show(calibration)
    if out is not None:
        write(f"trajectory written to {out}")


@takes_settings
def table(
    given: dict[str, Any],
    architecture: ArchitectureArgument,
    out: Annotated[Path, typer.Option("--out", help="The .npz file to write.")],
    cycle: CycleOption = "nedc",
) -> None:
    """Write the control table of an architecture on a cycle, for other solvers."""
    from hevopt.commands.comparing import Job
    from hevopt.driving.cycle import load_cycle
    from hevopt.files.writing import check_outs
    from hevopt.output.control_table import write_table
    from hevopt.powertrain.powertrain import build_problem
    from hevopt.studies.case import require_nox
    from hevopt.studies.settings import cars_of, settings_of

    settings = settings_of(_OPTIONS, given)
    job = Job(cars_of(settings, [architecture]), load_cycle(cycle), settings)
    car, trace = job.cars.cars[0], job.trace
    check_outs({"--out": out}, job.inputs)
    nox_weight = settings.get("nox_weight", 0.0)
    if nox_weight > 0:
        require_nox(car, f"nox_weight {nox_weight:g}")
    problem = build_problem(
        car,
        trace,
        nox_weight=nox_weight,
        allow_shortfall=settings.get("allow_shortfall", False),
    )
    write_table(out, problem)
    steps, controls = problem.table.fuel_kg.shape
    write(
        f"{steps} steps x {controls} controls written to {out}; its README entry names the arrays"
    )
