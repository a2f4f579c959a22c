"""`hevopt size`: the sizes for which a car burns, emits or costs least while it performs."""

from pathlib import Path
from typing import Annotated

import typer

from hevopt.commands.options import JsonOption
from hevopt.commands.reporting import command_line
from hevopt.commands.sweep_view import SweepProgress
from hevopt.commands.terminal import show, write
from hevopt.errors import DataError
from hevopt.files.writing import note_written

_STOPPED = 4


def size(
    study: Annotated[Path, typer.Argument(help="TOML file of the sizing.")],
    store: Annotated[
        Path | None,
        typer.Option("--store", help="File of the results (default: beside the study, .sqlite)."),
    ] = None,
    jobs: Annotated[
        int | None, typer.Option("--jobs", min=1, help="Number of workers (default: all cores).")
    ] = None,
    json: JsonOption = False,
) -> None:
    """Search a study's sizes for the best car that meets its requirements; stopped, it goes on where it was."""
    from hevopt.sweeps.sweep import check_system

    check_system()
    from hevopt.output import sizing_tables as tables
    from hevopt.sizing.size import sized
    from hevopt.sweeps.run import Execution, Onlookers, Stopped
    from hevopt.sweeps.signals import wish_to_end

    place = study.with_suffix(".sqlite") if store is None else store
    with SweepProgress() as progress, wish_to_end() as wish:
        watch = Onlookers(progress, progress.say, wish, wish.held)
        try:
            found = sized(study, place, Execution(workers=jobs), command_line(), watch)
        except (KeyboardInterrupt, Stopped):
            progress.finish()
            write(
                f"stopped; all results there are lie in {place}; the same command goes on from there"
            )
            raise typer.Exit(_STOPPED) from None
    note_written(place)
    if json:
        from json import dumps

        write(dumps(tables.as_dict(found), indent=1, allow_nan=False))
        return
    if found.best is None:
        raise DataError(f"{study}: no design meets what is asked")
    for table in tables.tables(found):
        show(table)
    write(tables.notes(found))
