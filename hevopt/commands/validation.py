"""`hevopt validation`: the real cars held against the laboratory."""

from pathlib import Path
from typing import Annotated

import typer

from hevopt.commands.reporting import check_ending, command_line
from hevopt.commands.terminal import Progress, listed, write


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
    from hevopt.files.writing import check_outs, write_whole
    from hevopt.reproduction.validation.laboratory import measured_files

    check_ending("--out", out, *((".md",) if fastsim else (".md", ".html")))
    check_outs({"--out": out}, measured_files())
    wanted = listed(cars), listed(cycles)
    with Progress() as progress:
        text = _across(*wanted, progress) if fastsim else _beside(*wanted, progress, out)
    write_whole(out, text.encode())
    write(f"written to {out}")


def _beside(cars: list[str] | None, cycles: list[str] | None, progress: Progress, out: Path) -> str:
    from hevopt.reproduction.validation.cases import hold
    from hevopt.reproduction.validation.page import COMMAND, page

    held = hold(cars, cycles, progress)
    text = page(held, _command(COMMAND, cars, cycles))
    if out.suffix.lower() != ".html":
        return text
    from hevopt.pages.validation import validation_page

    return validation_page(held, text)


def _across(cars: list[str] | None, cycles: list[str] | None, progress: Progress) -> str:
    from hevopt.reproduction.cross_tool.held import hold_across
    from hevopt.reproduction.cross_tool.page import COMMAND, cross_page

    return cross_page(hold_across(cars, cycles, progress), _command(COMMAND, cars, cycles))


def _command(whole: str, cars: list[str] | None, cycles: list[str] | None) -> str:
    """What makes the page: of all cars and cycles, or as it was given."""
    return whole if cars is None and cycles is None else command_line()
