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
    fastsim: Annotated[
        bool,
        typer.Option(
            "--fastsim", help="The cars in FASTSim instead, step by step; needs hevopt[cross-tool]."
        ),
    ] = False,
) -> None:
    """The real cars beside what laboratories measured, with what lies between in parts; or in another tool."""
    from hevopt.commands.reporting import command_line
    from hevopt.files.shown import printable
    from hevopt.files.writing import check_outs, write_whole
    from hevopt.reproduction.validation.cases import hold
    from hevopt.reproduction.validation.laboratory import measured_files
    from hevopt.reproduction.validation.page import COMMAND, page

    endings = (".md",) if fastsim else (".md", ".html")
    if out.suffix.lower() not in endings:
        said = " or ".join(endings)
        raise DataError(f"--out {printable(str(out))}: choose a name that ends in {said}")
    check_outs({"--out": out}, measured_files())
    if fastsim:
        _across(out, listed(cars), listed(cycles))
        return
    with Progress() as progress:
        held = hold(listed(cars), listed(cycles), progress)
    command = COMMAND if cars is None and cycles is None else command_line()
    text = page(held, command)
    if out.suffix.lower() == ".html":
        from hevopt.pages.validation import validation_page

        text = validation_page(held, text)
    write_whole(out, text.encode())
    write(f"written to {out}")


def _across(out: Path, cars: list[str] | None, cycles: list[str] | None) -> None:
    from hevopt.commands.reporting import command_line
    from hevopt.files.writing import write_whole
    from hevopt.reproduction.cross_tool.held import hold_across
    from hevopt.reproduction.cross_tool.page import COMMAND, cross_page

    with Progress() as progress:
        held = hold_across(cars, cycles, progress)
    command = COMMAND if cars is None and cycles is None else command_line()
    write_whole(out, cross_page(held, command).encode())
    write(f"written to {out}")
