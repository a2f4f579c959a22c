"""Command line: the only place that prints and sets the exit status.

0 ok, 2 bad input, 3 infeasible or solver failure.
"""

import os
import sys
from pathlib import Path
from time import monotonic
from typing import TYPE_CHECKING, Annotated

import typer

from hevopt import __version__
from hevopt.errors import DataError, HevoptError, SolverError

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
_INTERRUPTED = 130
# A wrong option or argument. Click's class, which typer imports from click or carries along.
_UsageError = typer.BadParameter.__bases__[0]

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
GearOption = Annotated[
    bool, typer.Option("--free-gear", help="The engine's gear is a control, not the cycle's.")
]
RefineOption = Annotated[
    bool,
    typer.Option("--refine", help="Add torque levels around dp's plan until its cost settles."),
]
HorizonOption = Annotated[
    float | None,
    typer.Option("--horizon", help="Preview of the predictive strategies, s (default 20)."),
]
JsonOption = Annotated[bool, typer.Option("--json", help="Print one JSON object instead.")]
ArchitectureArgument = Annotated[str, typer.Argument(help="Name or TOML file of an architecture.")]


@app.callback(invoke_without_command=True)
def _root(
    version: Annotated[bool, typer.Option("--version", help="Print the version and exit.")] = False,
) -> None:
    if version:
        _write(f"hevopt {__version__}")
        raise typer.Exit


@app.command()
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

    with _Progress() as progress:
        comparison = study.compare(
            cycle,
            _listed(architectures),
            _listed(strategies),
            nox_weight=nox_weight,
            allow_shortfall=allow_shortfall,
            free_gear=free_gear,
            refine=refine,
            horizon_s=horizon,
            progress=progress,
        )
    if json:
        _write(report.comparison_json(comparison))
    else:
        _show(report.comparison_table(comparison))
        _write(report.comparison_notes(comparison) + "\n")
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
        _check_out(out, architecture, cycle)
    with _Progress() as progress:
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
        _write(report.comparison_json(comparison))
        return
    _show(report.comparison_table(comparison))
    _write(report.comparison_notes(comparison))
    calibration = report.calibration_table(plan)
    if calibration is not None:
        _show(calibration)
    if out is not None:
        _write(f"trajectory written to {out}")


@app.command()
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
    _check_out(out, architecture, cycle)
    problem = build_problem(car, trace, nox_weight=nox_weight, allow_shortfall=allow_shortfall)
    report.write_table(out, problem)
    steps, controls = problem.table.fuel_kg.shape
    _write(
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
        _write(f"{name:4} {car.description:45} {', '.join(fitting(car.functions))}")


@app.command()
def strategies(
    out: Annotated[
        Path | None,
        typer.Option(
            "--out", help="Run them all on C2 and D over all shipped cycles; write a page."
        ),
    ] = None,
) -> None:
    """The strategies, and what each knows while it drives."""
    from hevopt import report, study
    from hevopt.files import shipped_names
    from hevopt.strategies import STRATEGIES

    if out is None:
        for name, strategy in STRATEGIES.items():
            kind = "causal" if strategy.causal else "offline"
            _write(f"{name:13} {kind:8} knows: {strategy.knows}")
        return
    report.check_writable(out)
    with _Progress() as progress:
        comparisons = [
            study.compare(
                cycle, ["C2", "D"], ["all"], allow_shortfall=True,
                progress=lambda text, done, total, c=cycle: progress(f"{c}, {text}", done, total),
            )
            for cycle in shipped_names("cycles", ".csv")
        ]  # fmt: skip
    steps = {c.cycle: study.steps_of(c.cycle) for c in comparisons}
    report.write_whole(out, report.strategies_page(comparisons, steps).encode())
    _write(f"written to {out}")


@app.command()
def cycles() -> None:
    """The shipped cycles, with duration, distance, top speed and whether they list gears."""
    from hevopt.cycle import load_cycle
    from hevopt.files import shipped_names

    for name in shipped_names("cycles", ".csv"):
        trace = load_cycle(name)
        gears = "gears listed" if trace.gear is not None else "gears from shift speeds"
        _write(
            f"{name:18} {trace.duration_s:6.0f} s {trace.distance_m / 1e3:7.2f} km "
            f"{trace.speed_mps.max() * 3.6:6.1f} km/h  {gears}"
        )


def main() -> None:
    """Entry point: a user's mistake is one message on stderr and a status, never a traceback."""
    # A terminal that lacks a letter of the report, such as Δ, shows "?" in its place.
    if hasattr(sys.stdout, "reconfigure"):
        sys.stdout.reconfigure(errors="replace")
    status, message = 0, ""
    try:
        # An int where typer was left by typer.Exit, else what the command returned: None.
        status = app(standalone_mode=False) or 0
    except _UsageError as error:
        error.show()
        status = error.exit_code
    except HevoptError as error:
        status, message = error.exit_status, f"error: {error}"
    except OSError as error:
        status, message = DataError.exit_status, f"error: {error}"
    except MemoryError:
        status, message = (
            SolverError.exit_status,
            "error: not enough memory; choose a shorter cycle",
        )
    except (KeyboardInterrupt, typer.Abort):
        status = _INTERRUPTED
    except SystemError as error:
        # Compiled loops turn an interrupt into this.
        if not _comes_from_interrupt(error):
            raise
        status = _INTERRUPTED
    if status == _INTERRUPTED:
        message = "interrupted; nothing was written"
    if message:
        print(f"hevopt: {message}", file=sys.stderr)
    raise SystemExit(status)


def _comes_from_interrupt(error: BaseException | None) -> bool:
    while error is not None and not isinstance(error, KeyboardInterrupt):
        error = error.__cause__ or error.__context__
    return error is not None


def _listed(text: str | None) -> list[str] | None:
    return None if text is None else [name.strip() for name in text.split(",") if name.strip()]


def _check_out(out: Path, architecture: str, cycle: str) -> None:
    """DataError, before anything is solved, where `out` cannot be written or is one of the inputs."""
    from hevopt.files import find
    from hevopt.report import check_writable

    target = check_writable(out)
    for kind, name, suffix in (("architectures", architecture, ".toml"), ("cycles", cycle, ".csv")):
        if target.exists() and target.samefile(find(kind, name, suffix)):
            raise DataError(f"--out {out} is the file that {name} is read from; choose another")


def _show(table: "Table") -> None:
    """Print a table; a terminal narrower than its numbers wraps lines rather than losing digits."""
    from rich.console import Console

    needed = Console(width=_WIDEST).measure(table).maximum
    console = Console(highlight=False, width=max(Console().width, needed))
    with console.capture() as capture:
        console.print(table)
    _write(capture.get().removesuffix("\n"))


def _write(text: str) -> None:
    """The only way to standard output."""
    try:
        print(text, flush=True)
    except OSError as error:
        # What is left in the buffer would fail once more when Python ends.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        if isinstance(error, BrokenPipeError):
            raise typer.Exit from None  # the reader, such as `head`, has seen enough
        raise DataError(f"cannot write to standard output ({error.strerror})") from None


class _Progress:
    """A line on stderr about what is running, once that has taken more than two seconds."""

    def __enter__(self) -> "_Progress":
        self._began = self._said_s = monotonic()
        self._status = None
        return self

    def __call__(self, text: str, done: int, total: int) -> None:
        now = monotonic()
        if now - self._began > _PROGRESS_AFTER_S:
            self._say(f"{done} of {total} done, next {text}", now)

    def _say(self, line: str, now: float) -> None:
        from rich.console import Console
        from rich.text import Text

        console = Console(stderr=True)
        if self._status is not None:
            self._status.update(Text(line))
        elif console.is_terminal:
            self._status = console.status(Text(line))
            self._status.start()
        elif now - self._said_s > _PROGRESS_AFTER_S:
            self._said_s = now
            print(f"hevopt: {line}", file=sys.stderr, flush=True)

    def __exit__(self, *_: object) -> None:
        if self._status is not None:
            self._status.stop()


if __name__ == "__main__":
    main()
