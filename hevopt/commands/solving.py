"""`hevopt compare`, `run` and `table`: one cycle, solved."""

import sys
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from hevopt.commands.options import (
    ArchitectureArgument,
    CycleOption,
    HorizonOption,
    JsonOption,
    RefineOption,
    takes_settings,
)
from hevopt.commands.terminal import Progress, check_out, listed, show, write
from hevopt.errors import DataError

if TYPE_CHECKING:
    from hevopt.cycle import Cycle
    from hevopt.study_file import Cars, Settings

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
    from hevopt import outputs, report, study
    from hevopt.commands.reporting import check_files, command_line, write_files
    from hevopt.commands.studies import with_studies
    from hevopt.cycle import load_cycle
    from hevopt.study_file import Settings, cars_of, read_study, settings_of

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
    cars = cars_of(settings)
    trace = load_cycle(settings.get("cycle", "nedc"))
    about = _about(cars, trace, settings)
    _check_tables({"--out": out, "--out-steps": steps}, {"--report": page, "--save": save}, about)
    keep = page is not None or save is not None
    if (fronts or effects) and not keep:
        raise DataError(
            "--fronts and --sensitivity add to the page; name it with --report or --save"
        )
    observers, driven = [], []
    if keep:
        from hevopt.pages.collect import Collector, check_steps

        check_steps(trace)
        check_files(page, save, [str(car.source) for car in cars.cars], str(trace.source))
        collector = Collector()
        observers.append(collector.observe)
    if steps is not None:
        observers.append(
            lambda case, row, plan, trajectory: driven.append(
                (row, outputs.step_columns(trace, case.problem, trajectory))
            )
        )
    with Progress() as progress:
        comparison = study.compare(
            trace,
            cars.cars,
            settings.get("strategies", None),
            nox_weight=settings.get("nox_weight", 0.0),
            allow_shortfall=settings.get("allow_shortfall", False),
            free_gear=settings.get("free_gear", False),
            refine=settings.get("refine", False),
            horizon_s=settings.get("horizon_s", None),
            progress=progress,
            observe=lambda *solved: [observer(*solved) for observer in observers],
        )
    lines = []
    if keep:
        results = collector.results(
            comparison,
            command_line(),
            changes=_changed(cars),
            others=[settings.file] if settings.file is not None else [],
            published=not any(cars.changes.values()),
        )
        results = with_studies(results, cars, trace, settings, fronts=fronts, effects=effects)
        lines = write_files(results, page, save)
    if out is not None:
        outputs.write_rows(out, comparison, about)
        lines.append(f"rows written to {out}")
    if steps is not None:
        outputs.write_steps(steps, comparison, outputs.joined(driven), about)
        lines.append(f"steps written to {steps}")
    if json:
        write(outputs.result_json(comparison, about))
    else:
        show(report.comparison_table(comparison))
        write("\n".join([report.comparison_notes(comparison), *_changed(cars)]) + "\n")
        # Published figures are those of the shipped cars.
        published = None if any(cars.changes.values()) else report.published_table(comparison)
        if published is not None:
            show(published)
        for line in lines:
            write(line)
    for case, error in comparison.failures.items():
        print(f"hevopt: {case}: {error}", file=sys.stderr)
    if comparison.failures:
        raise typer.Exit(max(error.exit_status for error in comparison.failures.values()))


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
    from hevopt import outputs, report, study
    from hevopt.cycle import load_cycle
    from hevopt.strategies import strategy_named
    from hevopt.study_file import cars_of, settings_of

    strategy_named(strategy)
    named = {"refine": refine, "horizon_s": horizon}
    options = given | {name: value for name, value in named.items() if value is not None}
    settings = settings_of(_OPTIONS, options)
    cars, trace = cars_of(settings, [architecture]), load_cycle(cycle)
    car = cars.cars[0]
    about = _about(cars, trace, settings)
    if out is not None:
        check_out(out, architecture, cycle)
        outputs.check_table_file(out)
    nox_weight = settings.get("nox_weight", 0.0)
    with Progress() as progress:
        progress(f"{car.name}: table and certificate", 0, 1)
        case = study.prepare(
            car,
            trace,
            nox_weight=nox_weight,
            allow_shortfall=settings.get("allow_shortfall", False),
            refine=settings.get("refine", False),
        )
        progress(f"{car.name}: {strategy}", 0, 1)
        row, plan, trajectory = study.run_case(case, strategy, horizon)
    comparison = study.Comparison(trace.name, [row], {}, nox_weight, "nothing, a single run")
    if out is not None:
        columns = outputs.step_columns(trace, case.problem, trajectory)
        outputs.write_steps(out, comparison, columns, about)
    if json:
        write(outputs.result_json(comparison, about))
        return
    show(report.comparison_table(comparison))
    write("\n".join([report.comparison_notes(comparison), *_changed(cars)]))
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
    from hevopt import report
    from hevopt.cycle import load_cycle
    from hevopt.powertrain import build_problem
    from hevopt.study_file import cars_of, settings_of

    settings = settings_of(_OPTIONS, given)
    car, trace = cars_of(settings, [architecture]).cars[0], load_cycle(cycle)
    check_out(out, architecture, cycle)
    problem = build_problem(
        car,
        trace,
        nox_weight=settings.get("nox_weight", 0.0),
        allow_shortfall=settings.get("allow_shortfall", False),
    )
    report.write_table(out, problem)
    steps, controls = problem.table.fuel_kg.shape
    write(
        f"{steps} steps x {controls} controls written to {out}; its README entry names the arrays"
    )


def _about(cars: "Cars", trace: "Cycle", settings: "Settings") -> dict[str, Any]:
    """What a result comes from: digests of the files read, versions, and the settings that are not in a file."""
    from hevopt.provenance import files_digests, versions

    own = [settings.file] if settings.file is not None else []
    shared = {"nox_weight": 0.0, "allow_shortfall": False, "free_gear": False, "refine": False}
    return {
        "inputs": dict(files_digests(cars.cars, [trace], own)),
        "versions": versions(),
        "settings": {
            **{name: settings.get(name, default) for name, default in shared.items()},
            "horizon_s": settings.get("horizon_s", None),
            "changes": cars.changes,
            "left_out": cars.left_out,
        },
    }


def _check_tables(
    outs: Mapping[str, Path | None], others: Mapping[str, Path | None], about: Mapping[str, Any]
) -> None:
    """DataError, before anything is solved, where a table cannot be written, or over an input or another file."""
    from hevopt.outputs import check_table_file
    from hevopt.writing import check_writable

    taken = {Path(name).resolve(): "an input" for name in about["inputs"]}
    taken |= {p.resolve(): f"the file of {o} as well" for o, p in others.items() if p is not None}
    for option, out in outs.items():
        if out is not None:
            target = check_writable(out)
            if target in taken:
                raise DataError(f"{option} {out} is {taken[target]}; choose another")
            check_table_file(out)
            taken[target] = f"the file of {option} as well"


def _changed(cars: "Cars") -> list[str]:
    """Lines that say what was changed in the cars, and what was left out."""
    said: dict[str, list[str]] = {}
    for car, changes in cars.changes.items():
        for key, value in changes.items():
            said.setdefault(f"{key} = {value}", []).append(car)
    every = len(cars.changes)
    lines = [
        f"set: {change}" + ("" if len(names) == every else f" in {', '.join(names)}")
        for change, names in said.items()
    ]
    return lines + cars.left_out
