"""`hevopt compare`, `run` and `table`: one cycle, solved."""

import sys
from pathlib import Path
from typing import Annotated

import typer

from hevopt.commands.options import (
    ArchitectureArgument,
    CycleOption,
    GearOption,
    HorizonOption,
    JsonOption,
    NoxOption,
    RefineOption,
    ShortfallOption,
)
from hevopt.commands.terminal import Progress, check_out, listed, show, write


def compare(
    cycle: CycleOption = "nedc",
    architectures: Annotated[
        str | None, typer.Option("--architectures", help="Names or files, separated by commas.")
    ] = None,
    strategies: Annotated[
        str | None,
        typer.Option("--strategies", help="Names, separated by commas, or all."),
    ] = None,
    nox_weight: NoxOption = 0.0,
    allow_shortfall: ShortfallOption = False,
    free_gear: GearOption = False,
    refine: RefineOption = False,
    horizon: HorizonOption = None,
    json: JsonOption = False,
) -> None:
    """Strategies on architectures over one cycle, each with its certified bound."""
    from hevopt import report, study

    with Progress() as progress:
        comparison = study.compare(
            cycle,
            listed(architectures),
            listed(strategies),
            nox_weight=nox_weight,
            allow_shortfall=allow_shortfall,
            free_gear=free_gear,
            refine=refine,
            horizon_s=horizon,
            progress=progress,
        )
    if json:
        write(report.comparison_json(comparison))
    else:
        show(report.comparison_table(comparison))
        write(report.comparison_notes(comparison) + "\n")
        published = report.published_table(comparison)
        if published is not None:
            show(published)
    for case, error in comparison.failures.items():
        print(f"hevopt: {case}: {error}", file=sys.stderr)
    if comparison.failures:
        raise typer.Exit(max(error.exit_status for error in comparison.failures.values()))


def run(
    architecture: ArchitectureArgument,
    strategy: Annotated[str, typer.Option("--strategy", help="Name of a strategy.")] = "dp",
    cycle: CycleOption = "nedc",
    out: Annotated[
        Path | None,
        typer.Option("--out", help="Write every power and loss per step to this CSV file."),
    ] = None,
    nox_weight: NoxOption = 0.0,
    allow_shortfall: ShortfallOption = False,
    free_gear: GearOption = False,
    refine: RefineOption = False,
    horizon: HorizonOption = None,
    json: JsonOption = False,
) -> None:
    """One strategy on one architecture, with its calibration curve and its trajectory."""
    from hevopt import report, study
    from hevopt.architecture import load_architecture
    from hevopt.cycle import load_cycle
    from hevopt.strategies import strategy_named

    strategy_named(strategy)
    car, trace = load_architecture(architecture), load_cycle(cycle)
    car = car.with_free_gear() if free_gear else car
    if out is not None:
        check_out(out, architecture, cycle)
    with Progress() as progress:
        progress(f"{car.name}: table and certificate", 0, 1)
        case = study.prepare(
            car,
            trace,
            nox_weight=nox_weight,
            allow_shortfall=allow_shortfall,
            refine=refine,
        )
        progress(f"{car.name}: {strategy}", 0, 1)
        row, plan, trajectory = study.run_case(case, strategy, horizon)
    comparison = study.Comparison(trace.name, [row], {}, nox_weight, "nothing, a single run")
    if out is not None:
        report.write_trajectory(out, case.problem, trajectory)
    if json:
        write(report.comparison_json(comparison))
        return
    show(report.comparison_table(comparison))
    write(report.comparison_notes(comparison))
    calibration = report.calibration_table(plan)
    if calibration is not None:
        show(calibration)
    if out is not None:
        write(f"trajectory written to {out}")


def table(
    architecture: ArchitectureArgument,
    out: Annotated[Path, typer.Option("--out", help="The .npz file to write.")],
    cycle: CycleOption = "nedc",
    nox_weight: NoxOption = 0.0,
    allow_shortfall: ShortfallOption = False,
    free_gear: GearOption = False,
) -> None:
    """Write the control table of an architecture on a cycle, for other solvers."""
    from hevopt import report
    from hevopt.architecture import load_architecture
    from hevopt.cycle import load_cycle
    from hevopt.powertrain import build_problem

    car, trace = load_architecture(architecture), load_cycle(cycle)
    car = car.with_free_gear() if free_gear else car
    check_out(out, architecture, cycle)
    problem = build_problem(car, trace, nox_weight=nox_weight, allow_shortfall=allow_shortfall)
    report.write_table(out, problem)
    steps, controls = problem.table.fuel_kg.shape
    write(
        f"{steps} steps x {controls} controls written to {out}; its README entry names the arrays"
    )
