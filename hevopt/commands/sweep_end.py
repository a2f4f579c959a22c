"""What a sweep came to: as it ends, by `--status`, or as a table in a file."""

import tomllib
from pathlib import Path
from shlex import quote
from time import monotonic
from typing import TYPE_CHECKING

import typer

from hevopt.commands.sweep_view import best_table, counted, discarded, duration, reasons
from hevopt.commands.terminal import show, write
from hevopt.errors import InfeasibleError
from hevopt.files.shown import printable

if TYPE_CHECKING:
    from hevopt.sweeps.run import Advance
    from hevopt.sweeps.store.reading import Reader

PARTLY = 4


def end(store: Path, done: "Advance | None", export: Path | None) -> None:
    """Say what came of it; the exit status says it too."""
    from hevopt.sweeps.store.export import export as write_export
    from hevopt.sweeps.store.reading import open_to_read

    if done is None and not store.exists():
        write("stopped before anything was run; the same command starts it")
        raise typer.Exit(PARTLY)
    with open_to_read(store) as reader:
        counts = reader.counts()
        if done is not None:
            _say_results(reader, done)
        write(counted(counts))
        if export is not None and done is not None:
            write(f"{write_export(reader, export)} cases written to {export}")
    if done is None:
        write(f"stopped; all results there are lie in {store}; the same command goes on from there")
        raise typer.Exit(PARTLY)
    write(
        f"results in {store}\n  as a table: hevopt sweep --store {quote(str(store))} --export FILE.csv\n"
        f"  as a page:  hevopt report {quote(str(store))} --out PAGE.html"
    )
    if counts["failed"]:
        write("--retry-failed runs failed cases once more")
    if counts["missing"]:
        write(f"{counts['missing']} cases have no result; the same command runs them")
        raise typer.Exit(PARTLY)
    if not counts["ok"]:
        raise typer.Exit(InfeasibleError.exit_status)
    if counts["failed"]:
        raise typer.Exit(PARTLY)


def _say_results(reader: "Reader", done: "Advance") -> None:
    took_s = monotonic() - done.began_s
    pace = f", {done.done / took_s:.3g}/s" if done.done else ""
    write(f"{done.done} cases run in {duration(took_s)}{pace}; {done.failed} of them failed")
    _say_standing(reader)


def _say_standing(reader: "Reader") -> None:
    for line in reasons(reader):
        write(line)
    table, more = best_table(reader)
    if table is not None:
        show(table)
    if more:
        write(f"and {more} more NOx weights; --export lists them")
    for line in discarded(reader):
        write(line)
    write(_foot(reader.meta().get("study", "")))


def _foot(study: str) -> str:
    """What the figures above hold for: warm engine, gears, and the mean over which cycles."""
    try:
        named = tomllib.loads(study).get("cycles", [])
    except tomllib.TOMLDecodeError:
        named = []
    cycles = [printable(Path(name).name) for name in named if isinstance(name, str)]
    mean = f"; figures: mean over {', '.join(cycles)}" if len(cycles) > 1 else ""
    on = f"; cycle: {cycles[0]}" if len(cycles) == 1 else ""
    return (
        "warm engine from start to end; gears as a cycle lists them, else by the car's own shift speeds"
        f"{mean}{on}"
    )


def show_status(path: Path) -> None:
    """Print how far the sweep of a store is, and its best designs so far."""
    from hevopt.sweeps.store.reading import open_to_read

    with open_to_read(path) as reader:
        meta, counts = reader.meta(), reader.counts()
        file, begun = (printable(meta.get(name, "unknown")) for name in ("study_file", "begun"))
        write(f"study {file}, begun {begun}")
        write(counted(counts))
        _say_standing(reader)


def export_store(store: Path, out: Path) -> None:
    """Write the cases of a store as a table."""
    from hevopt.files.writing import check_outs
    from hevopt.sweeps.store.export import check_export, export
    from hevopt.sweeps.store.reading import inputs_in, open_to_read

    check_outs({"--export": out}, [store])
    check_export(out)
    with open_to_read(store) as reader:
        check_outs({"--export": out}, inputs_in(reader.meta()))
        write(f"{export(reader, out)} cases written to {out}")
