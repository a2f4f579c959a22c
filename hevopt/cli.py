"""Command line: the only place that prints and sets the exit status.

0 ok, 2 bad input, 3 infeasible or solver failure.
"""

import sys
from pathlib import Path
from time import monotonic
from typing import TYPE_CHECKING, Annotated

import typer

from hevopt import __version__
from hevopt.errors import HevoptError

if TYPE_CHECKING:
    from rich.table import Table

app = typer.Typer(
    name="hevopt",
    help="How little a hybrid could burn on a driving cycle, how close a strategy comes, and the proof.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)

_PROGRESS_AFTER_S = 2.0
_WIDEST = 400

CycleOption = Annotated[str, typer.Option("--cycle", help="Name or CSV file of a cycle.")]
NoxOption = Annotated[
    float,
    typer.Option("--nox-weight", help="kg of fuel that a kg of NOx counts (ecms, dp, bound)."),
]
ShortfallOption = Annotated[
    bool,
    typer.Option(
        "--allow-shortfall", help="Drive on where the car cannot follow, and mark the rows."
    ),
]
JsonOption = Annotated[bool, typer.Option("--json", help="Print one JSON object instead.")]
ArchitectureArgument = Annotated[str, typer.Argument(help="Name or TOML file of an architecture.")]


@app.callback(invoke_without_command=True)
def _root(
    version: Annotated[bool, typer.Option("--version", help="Print the version and exit.")] = False,
) -> None:
    if version:
        print(f"hevopt {__version__}")
        raise typer.Exit


@app.command()
def compare(
    cycle: CycleOption = "nedc",
    architectures: Annotated[
        str, typer.Option("--architectures", help="Names or files, separated by commas.")
    ] = "",
    strategies: Annotated[
        str, typer.Option("--strategies", help="Names, separated by commas; default: all that fit.")
    ] = "",
    nox_weight: NoxOption = 0.0,
    allow_shortfall: ShortfallOption = False,
    json: JsonOption = False,
) -> None:
    """Strategies on architectures over one cycle, each with its certified bound."""
    from hevopt import report, study

    with _Progress() as progress:
        comparison = study.compare(
            cycle,
            _listed(architectures),
            _listed(strategies),
            nox_weight=nox_weight,
            allow_shortfall=allow_shortfall,
            progress=progress,
        )
    if json:
        print(report.comparison_json(comparison))
    else:
        _show(report.comparison_table(comparison))
        print(report.comparison_notes(comparison) + "\n")
        published = report.published_table(comparison)
        if published is not None:
            _show(published)
    for case, error in comparison.failures.items():
        print(f"hevopt: {case}: {error}", file=sys.stderr)
    if comparison.failures:
        raise typer.Exit(max(error.exit_status for error in comparison.failures.values()))


@app.command()
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
    json: JsonOption = False,
) -> None:
    """One strategy on one architecture, with its calibration curve and its trajectory."""
    from hevopt import report, study
    from hevopt.architecture import load_architecture
    from hevopt.cycle import load_cycle
    from hevopt.powertrain import build_problem
    from hevopt.strategies import strategy_named

    strategy_named(strategy)
    car, trace = load_architecture(architecture), load_cycle(cycle)
    with _Progress() as progress:
        progress(f"{car.name}: table and certificate", 0, 1)
        problem = build_problem(car, trace, nox_weight=nox_weight, allow_shortfall=allow_shortfall)
        certificate = study.reference_certificate(problem)
        progress(f"{car.name}: {strategy}", 0, 1)
        row, plan, trajectory = study.run_case(car, trace, problem, certificate, strategy)
    comparison = study.Comparison(trace.name, [row], {}, nox_weight, "nothing, a single run")
    if out is not None:
        report.write_trajectory(out, problem, trajectory)
    if json:
        print(report.comparison_json(comparison))
        return
    _show(report.comparison_table(comparison))
    print(report.comparison_notes(comparison))
    calibration = report.calibration_table(plan)
    if calibration is not None:
        _show(calibration)
    if out is not None:
        print(f"trajectory written to {out}")


@app.command()
def table(
    architecture: ArchitectureArgument,
    out: Annotated[Path, typer.Option("--out", help="The .npz file to write.")],
    cycle: CycleOption = "nedc",
    nox_weight: NoxOption = 0.0,
    allow_shortfall: ShortfallOption = False,
) -> None:
    """Write the control table of an architecture on a cycle, for other solvers."""
    from hevopt import report
    from hevopt.architecture import load_architecture
    from hevopt.cycle import load_cycle
    from hevopt.powertrain import build_problem

    problem = build_problem(
        load_architecture(architecture),
        load_cycle(cycle),
        nox_weight=nox_weight,
        allow_shortfall=allow_shortfall,
    )
    report.write_table(out, problem)
    steps, controls = problem.table.fuel_kg.shape
    print(
        f"{steps} steps x {controls} controls written to {out}; its README entry names the arrays"
    )


@app.command()
def architectures() -> None:
    """The shipped architectures."""
    from hevopt.architecture import load_architecture
    from hevopt.files import shipped_names
    from hevopt.strategies import fitting

    for name in shipped_names("architectures", ".toml"):
        car = load_architecture(name)
        print(f"{name:4} {car.description:45} {', '.join(fitting(car.functions))}")


@app.command()
def cycles() -> None:
    """The shipped cycles, with duration, distance, top speed and whether they list gears."""
    from hevopt.cycle import load_cycle
    from hevopt.files import shipped_names

    for name in shipped_names("cycles", ".csv"):
        trace = load_cycle(name)
        gears = "gears listed" if trace.gear is not None else "gears from shift speeds"
        print(
            f"{name:18} {trace.duration_s:6.0f} s {trace.distance_m / 1e3:7.2f} km "
            f"{trace.speed_mps.max() * 3.6:6.1f} km/h  {gears}"
        )


def main() -> None:
    """Entry point: a user's mistake is one message on stderr and a status, never a traceback."""
    try:
        app()
    except HevoptError as error:
        print(f"hevopt: error: {error}", file=sys.stderr)
        raise SystemExit(error.exit_status) from None
    except KeyboardInterrupt:
        print("hevopt: interrupted; nothing was written", file=sys.stderr)
        raise SystemExit(130) from None


def _listed(text: str) -> list[str] | None:
    names = [name.strip() for name in text.split(",") if name.strip()]
    return names or None


def _show(table: "Table") -> None:
    """Print a table; a terminal narrower than its numbers wraps lines rather than losing digits."""
    from rich.console import Console

    console = Console(highlight=False)
    needed = Console(width=_WIDEST).measure(table).maximum
    Console(highlight=False, width=max(console.width, needed)).print(table)


class _Progress:
    """A line on stderr about what is running, once that has taken more than two seconds."""

    def __enter__(self) -> "_Progress":
        self._began = self._said_s = monotonic()
        self._status = None
        return self

    def __call__(self, text: str, done: int, total: int) -> None:
        now = monotonic()
        line = f"{done} of {total} done, next {text}"
        if self._status is not None:
            self._status.update(line)
        elif now - self._began > _PROGRESS_AFTER_S:
            self._start(line, now)

    def _start(self, line: str, now: float) -> None:
        from rich.console import Console

        console = Console(stderr=True)
        if console.is_terminal:
            self._status = console.status(line)
            self._status.start()
        elif now - self._said_s > _PROGRESS_AFTER_S:
            self._said_s = now
            print(f"hevopt: {line}", file=sys.stderr, flush=True)

    def __exit__(self, *_: object) -> None:
        if self._status is not None:
            self._status.stop()


if __name__ == "__main__":
    main()
