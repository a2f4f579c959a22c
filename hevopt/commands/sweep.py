"""`hevopt sweep`: run a study into a store, see how far one is, export it."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hevopt.commands.reporting import command_line
from hevopt.commands.sweep_end import end, export_store, show_status
from hevopt.commands.sweep_view import SweepProgress, duration
from hevopt.commands.terminal import write
from hevopt.errors import DataError
from hevopt.files.shown import printable
from hevopt.files.writing import note_written

if TYPE_CHECKING:
    from hevopt.sweeps.run import Execution, Schedule
    from hevopt.sweeps.signals import Wish

_FIRST_CASES = 5


def sweep(
    context: typer.Context,
    study: Annotated[
        Path | None, typer.Argument(help="TOML file of the study.", show_default=False)
    ] = None,
    store: Annotated[
        Path | None,
        typer.Option("--store", help="File of the results (default: beside the study, .sqlite)."),
    ] = None,
    backend: Annotated[
        str, typer.Option("--backend", help="What runs the workers: loky, dask or ray.")
    ] = "loky",
    jobs: Annotated[
        int | None, typer.Option("--jobs", min=1, help="Number of workers (default: all cores).")
    ] = None,
    scheduler: Annotated[
        str | None,
        typer.Option("--scheduler", help="Address of a running Dask or Ray cluster."),
    ] = None,
    timeout: Annotated[
        float | None,
        typer.Option(
            "--timeout", min=0.001, max=1e6, help="Seconds after which a case is a failed one."
        ),
    ] = None,
    memory_mb: Annotated[
        float | None,
        typer.Option(
            "--memory-mb", min=1, max=1e8, help="Address space of a worker's process, MB."
        ),
    ] = None,
    prune: Annotated[
        bool,
        typer.Option("--prune", help="Solve no design whose certified bound proves it worse."),
    ] = False,
    resume: Annotated[
        bool,
        typer.Option(
            "--resume/--no-resume",
            help="Run what the store lacks; or refuse a store that exists.",
        ),
    ] = True,
    retry_failed: Annotated[
        bool, typer.Option("--retry-failed", help="Run failed cases of the store once more.")
    ] = False,
    dry_run: Annotated[
        bool,
        typer.Option("--dry-run", help="Say what would run and how long; run only a sample."),
    ] = False,
    status: Annotated[
        Path | None,
        typer.Option("--status", help="Say how far the sweep of this store is, and nothing else."),
    ] = None,
    export: Annotated[
        Path | None,
        typer.Option("--export", help="Write the cases to this .csv or .parquet file."),
    ] = None,
) -> None:
    """Solve every design of a study on all cores or a cluster; stopped at any time, it goes on where it was."""
    _check_given(context)
    if status is not None:
        show_status(status)
        return
    if study is None:
        if store is None or export is None:
            raise DataError(
                "name a study, as in `hevopt sweep study.toml`; or `--status FILE`; or `--store FILE "
                "--export TABLE.csv`"
            )
        export_store(store, export)
        return
    from hevopt.sweeps.sweep import check_system

    check_system()
    from hevopt.sweeps.into_store import check_sweep, into_store
    from hevopt.sweeps.run import Execution, Onlookers, Stopped
    from hevopt.sweeps.signals import wish_to_end

    execution = Execution(backend, jobs, scheduler, timeout, memory_mb)
    store = study.with_suffix(".sqlite") if store is None else store
    check_sweep(execution, study, store, {"--export": export})
    _check(store, export, resume)
    with SweepProgress() as progress, wish_to_end() as wish:
        try:
            if dry_run:
                _rehearse(study, store, execution, prune, retry_failed, progress, wish)
                return
            done = into_store(
                study,
                store,
                execution,
                command_line(),
                prune=prune,
                retry_failed=retry_failed,
                watch=Onlookers(progress, progress.say, wish, wish.held),
                planning=progress.plan,
                outs={"--export": export},
            )
        except (KeyboardInterrupt, Stopped):
            done = None
        progress.finish()
        if store.exists():
            note_written(store)
        end(store, done, export)


def _check_given(context: typer.Context) -> None:
    """DataError for what is given beside something that makes it meaningless."""
    sources = {name: context.get_parameter_source(name) for name in context.params}
    given = {name for name, source in sources.items() if source and source.name == "COMMANDLINE"}
    if "status" in given:
        alone, beside = "--status FILE stands alone", {"status"}
    elif "study" not in given:
        alone, beside = "--store FILE --export TABLE.csv without a study", {"store", "export"}
    elif "dry_run" in given:
        alone, beside = "--dry-run stores and writes nothing", given - {"export"}
    else:
        return
    options = {name: "--" + name.replace("_", "-") for name in context.params} | {
        "study": "the study"
    }
    if extra := [option for name, option in options.items() if name in given - beside]:
        raise DataError(f"{alone}; leave out {', '.join(extra)}")


def _check(store: Path, export: Path | None, resume: bool) -> None:
    """DataError, before anything is planned, for a table that cannot be written, or a store that was to be new."""
    from hevopt.sweeps.store.export import check_export

    if export is not None:
        check_export(export)
    if store.exists() and store.stat().st_size and not resume:
        raise DataError(
            f"{store} exists, and --no-resume asks for a new store; remove it yourself, or name another "
            "with --store"
        )


def _rehearse(
    study: Path,
    store: Path,
    execution: "Execution",
    prune: bool,
    retry_failed: bool,
    progress: SweepProgress,
    wish: "Wish",
) -> None:
    from hevopt.sweeps.estimate import timed_sample
    from hevopt.sweeps.into_store import NOTHING_TO_PRUNE
    from hevopt.sweeps.plan.designs import merged_values
    from hevopt.sweeps.plan.study_file import read_study
    from hevopt.sweeps.run import Onlookers, plan_of, settled
    from hevopt.sweeps.store.reading import open_to_read
    from hevopt.sweeps.workers.pools import cores

    contents = read_study(study)
    plan = plan_of(contents, prune=prune, progress=progress.plan)
    keys = {case.key for case in plan.planned}
    done: set[str] = set()
    if store.exists() and store.stat().st_size:
        with open_to_read(store) as reader:
            done = keys & settled(reader.endings(), retry_failed=retry_failed)
    _say_plan(plan, len(keys), len(done))
    for key, (asked, distinct) in merged_values(contents).items():
        write(
            f"{printable(key)}: {asked} values asked for, {distinct} once rounded to whole numbers"
        )
    if prune and not plan.prunable:
        write(NOTHING_TO_PRUNE)
    with wish.held():
        sample = timed_sample(
            plan, keys - done, execution, Onlookers(notice=progress.say, stop=wish)
        )
    if sample is None:
        write("nothing is left to run")
        return
    workers = execution.workers or cores()
    startup_s, total_s = sample.startup_s, sample.total_s
    write(
        f"timed sample: {sample.cases} cases, one after the other, took {duration(sample.seconds)}; estimate: "
        f"{duration(startup_s + total_s)} on one worker, {duration(startup_s + total_s / workers)} on {workers}, "
        f"{duration(startup_s)} of it to start and compile{', less what is pruned' if prune else ''}"
    )


def _say_plan(plan: "Schedule", cases: int, done: int) -> None:
    designs = plan.designs
    dropped = f", {designs.excluded} more excluded by constraints" if designs.excluded else ""
    twice = f", {designs.duplicates} more sampled twice" if designs.duplicates else ""
    write(
        f"{len(designs)} designs{dropped}{twice}; {cases} cases, {done} of them in the store already"
    )
    write("first cases:")
    for case in plan.planned[:_FIRST_CASES]:
        values = ", ".join(f"{k} = {v}" for k, v in designs[case.design].values.items())
        write(f"  design {case.design} ({values}), {case.cycle}, {case.strategy}")
