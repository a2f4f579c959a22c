"""`hevopt compare`, `run` and `table`: one cycle, solved."""

import sys
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import typer

from hevopt.commands.brought import PolicyOption
from hevopt.commands.grouped import FILES, PAGE
from hevopt.commands.options import (
    ArchitectureArgument,
    ColdStartOption,
    CycleGivenOption,
    CycleOption,
    JsonOption,
    WideOption,
    takes_settings,
)
from hevopt.commands.terminal import Progress, listed, show, write

_OPTIONS = "the command line"


@takes_settings()
def compare(
    given: dict[str, Any],
    study_path: Annotated[
        Path | None,
        typer.Argument(
            metavar="STUDY", help="TOML file with the settings below; options go first."
        ),
    ] = None,
    cycle: CycleGivenOption = None,
    architectures: Annotated[
        str | None, typer.Option("--architectures", help="Names or files, separated by commas.")
    ] = None,
    policy: PolicyOption = None,
    json: JsonOption = False,
    wide: WideOption = False,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out", help="Write the rows to this .csv, .parquet or .json.", rich_help_panel=FILES
        ),
    ] = None,
    steps: Annotated[
        Path | None,
        typer.Option(
            "--out-steps",
            help="Write every step of every row to this .csv, .parquet or .json.",
            rich_help_panel=FILES,
        ),
    ] = None,
    page: Annotated[
        Path | None,
        typer.Option(
            "--report",
            help="Write an HTML page that opens offline to this file.",
            rich_help_panel=FILES,
        ),
    ] = None,
    save: Annotated[
        Path | None,
        typer.Option(
            "--save",
            help="Save all results to this file (JSON, gzip), for report.",
            rich_help_panel=FILES,
        ),
    ] = None,
    proofs: Annotated[
        Path | None,
        typer.Option(
            "--proof",
            help="Write every bound as a proof that others can check, there.",
            rich_help_panel=FILES,
        ),
    ] = None,
    nox_limit: Annotated[
        float | None,
        typer.Option(
            "--nox-limit", help="Draw a limit of NOx on the page, mg/km.", rich_help_panel=PAGE
        ),
    ] = None,
    fronts: Annotated[
        bool,
        typer.Option(
            "--fronts",
            help="Add every car's front of fuel and NOx to the page.",
            rich_help_panel=PAGE,
        ),
    ] = False,
    effects: Annotated[
        bool, typer.Option("--sensitivity", help="Add every car's sensitivities to the page.")
    ] = False,
    cold_start: ColdStartOption = None,
    forward: Annotated[
        bool, typer.Option("--forward", help="Drive every row forward too, as `drive` does.")
    ] = False,
) -> None:
    """Strategies on architectures over one cycle, each with its certified bound."""
    from hevopt.commands.reading import read_ahead

    named = {"cycle": cycle, "architectures": listed(architectures)}
    options = given | {name: value for name, value in named.items() if value is not None}
    read = read_ahead(options, _OPTIONS, study_path)

    from hevopt.commands.brought import brought_to
    from hevopt.commands.comparing import (
        ComparisonJob,
        Files,
        cold_starts,
        ready_to_show,
        show_comparison,
    )
    from hevopt.commands.forecast import say_how_long
    from hevopt.studies import comparison as study
    from hevopt.studies.by_car import Watch

    of_study = study_path is not None and "strategies" not in options
    folder = study_path.parent if study_path is not None and of_study else None
    settings, cars, trace, is_study = read()
    settings, others = brought_to(settings, policy, folder)
    cold = cold_starts(cold_start)
    job = ComparisonJob(cars, trace, settings, study_path, others, cold, is_study)
    files = Files(out, steps, page, save, proofs, fronts, effects, nox_limit)
    files.check(job)
    compared = partial(
        study.compare_cars, cars.cars, settings=settings, others=others, forward=forward
    )
    say_how_long(job.trace, compared)
    with Progress() as progress:
        watch = Watch(progress, files.observer(cold), partial(ready_to_show, job))
        comparison = compared(job.trace, watch=watch, may_fork=True)
    # Before the files, which may take long: what is solved is seen whatever becomes of them.
    show_comparison(job, comparison, json=json, wide=wide)
    lines, of_files = files.write(job, comparison)
    for line in () if json else lines:
        write(line)
    failures = comparison.failures | of_files
    for case, error in failures.items():
        print(f"hevopt: {case}: {error}", file=sys.stderr)
    if failures:
        raise typer.Exit(max(error.exit_status for error in failures.values()))


@takes_settings("strategies")
def run(
    given: dict[str, Any],
    architecture: ArchitectureArgument,
    strategy: Annotated[
        str | None, typer.Option("--strategy", help="Name of a strategy (default: dp).")
    ] = None,
    policy: PolicyOption = None,
    cycle: CycleOption = "nedc",
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            help="Write inputs, powers and losses per step to this .csv, .parquet or .json.",
        ),
    ] = None,
    json: JsonOption = False,
    wide: WideOption = False,
    cold_start: ColdStartOption = None,
) -> None:
    """One strategy on one architecture, with its calibration curve and its trajectory."""
    from hevopt.commands.brought import one_of
    from hevopt.commands.comparing import ComparisonJob, cold_starts, show_rows
    from hevopt.commands.forecast import say_how_long
    from hevopt.driving.cycle import load_cycle
    from hevopt.files.writing import check_outs
    from hevopt.output import file_tables as outputs
    from hevopt.output.beside_tables import calibration_table, thresholds_line
    from hevopt.studies import comparison as study
    from hevopt.studies.by_car import lost_proofs
    from hevopt.studies.cars import cars_of
    from hevopt.studies.case import prepare
    from hevopt.studies.given import given_of, study_of
    from hevopt.studies.solved import causal_among, check_horizon, run_case, why_not_causal

    settings = study_of(given_of(_OPTIONS, given)).settings
    name, others = one_of(strategy, policy)
    check_horizon(settings.horizon_s, [name], others)
    job = ComparisonJob(
        cars_of([architecture], settings), load_cycle(cycle), settings, None, others,
        cold_starts(cold_start),
    )  # fmt: skip
    car, trace = job.cars.cars[0], job.trace
    if out is not None:
        check_outs({"--out": out}, job.inputs)
        outputs.check_table_file(out)
    prepared = partial(prepare, car, settings=settings)
    solved = partial(run_case, strategy=name, horizon_s=settings.horizon_s, others=others)
    say_how_long(trace, lambda piece: solved(prepared(piece)))
    with Progress() as progress:
        progress(f"{car.name}: table and certificate", 0, 1)
        case = prepared(trace)
        progress(f"{car.name}: {name}", 0, 1)
        row, plan, trajectory = solved(case)
        if job.cold is not None:
            job.cold.observe(case, row, plan, trajectory)
        shown = why_not_causal(case, name, plan, others)
    peeking = {} if shown is None else {(car.name, name): shown}
    comparison = study.Comparison(
        trace.name,
        [row],
        {},
        settings.nox_weight,
        end_asked=study.end_asked([car]),
        lost_proofs=lost_proofs(case),
        causal=causal_among([row], peeking, others),
        peeking=peeking,
    )
    if out is not None:
        steps = outputs.step_frame(case, trajectory)
        outputs.write_steps(out, comparison, steps, job.about)
    if json:
        write(outputs.result_json(comparison, job.about))
        return
    show_rows(job, comparison, wide=wide)
    calibration = calibration_table(plan)
    if calibration is not None:
        show(calibration)
    if "thresholds" in plan.notes:
        write(thresholds_line(plan.notes["thresholds"]))
    if out is not None:
        write(f"trajectory written to {out}")


@takes_settings("strategies", "refine", "horizon_s")
def table(
    given: dict[str, Any],
    architecture: ArchitectureArgument,
    out: Annotated[Path, typer.Option("--out", help="The .npz file to write.")],
    cycle: CycleOption = "nedc",
) -> None:
    """Write the control table of an architecture on a cycle, for other solvers."""
    from hevopt.commands.comparing import ComparisonJob
    from hevopt.driving.cycle import load_cycle
    from hevopt.files.writing import check_outs
    from hevopt.output.control_table import write_table
    from hevopt.powertrain.powertrain import build_problem
    from hevopt.studies.cars import cars_of
    from hevopt.studies.given import given_of, study_of
    from hevopt.studies.nox import require_nox

    settings = study_of(given_of(_OPTIONS, given)).settings
    job = ComparisonJob(cars_of([architecture], settings), load_cycle(cycle), settings)
    car, trace = job.cars.cars[0], job.trace
    check_outs({"--out": out}, job.inputs)
    if settings.nox_weight > 0:
        require_nox(car, f"nox_weight {settings.nox_weight:g}")
    problem = build_problem(
        car,
        trace,
        nox_weight=settings.nox_weight,
        allow_shortfall=settings.allow_shortfall,
    )
    write_table(out, problem)
    steps, controls = problem.table.fuel_kg.shape
    write(
        f"{steps} steps x {controls} controls written to {out}; its README entry names the arrays"
    )
