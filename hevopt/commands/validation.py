"""`hevopt validation`: the real cars held against the laboratory."""

from pathlib import Path
from typing import Annotated

import typer

from hevopt.commands.terminal import Progress, listed, write
from hevopt.errors import DataError


def validation(
    out: Annotated[
        Path,
        typer.Option("--out", help="The page to write, Markdown (.md) or one HTML file (.html)."),
    ],
    cars: Annotated[
        str | None,
        typer.Option("--cars", help="Real cars, separated by commas (default all with a test)."),
    ] = None,
    cycles: Annotated[
        str | None,
        typer.Option("--cycles", help="Cycles, separated by commas (default all with a test)."),
    ] = None,
) -> None:
    """The real cars beside what laboratories measured, with what lies between in parts."""
    from hevopt.commands.reporting import command_line
    from hevopt.files.shown import printable
    from hevopt.files.writing import check_outs, write_whole
    from hevopt.reproduction.validation.cases import hold
    from hevopt.reproduction.validation.laboratory import measured_files
    from hevopt.reproduction.validation.page import COMMAND, page

    if out.suffix.lower() not in (".md", ".html"):
        raise DataError(f"--out {printable(str(out))}: choose a name that ends in .md or .html")
    check_outs({"--out": out}, measured_files())
    with Progress() as progress:
        held = hold(listed(cars), listed(cycles), progress)
    command = COMMAND if cars is None and cycles is None else command_line()
    text = page(held, command)
    if out.suffix.lower() == ".html":
        from hevopt.pages.validation import validation_page

        text = validation_page(held, text)
    write_whole(out, text.encode())
    write(f"written to {out}")
