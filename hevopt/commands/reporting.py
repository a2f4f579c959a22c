"""`hevopt report`: the page of saved results, of a sweep's store, or of a folder of saved results."""

import shlex
import sys
from pathlib import Path
from typing import Annotated

import typer

from hevopt.commands.terminal import write
from hevopt.errors import DataError
from hevopt.files.shown import encodable, printable


def report(
    file: Annotated[
        Path,
        typer.Argument(
            help="What hevopt compare --save wrote, the store of a sweep, or a folder of saved comparisons."
        ),
    ],
    out: Annotated[Path, typer.Option("--out", help="The HTML page to write.")],
) -> None:
    """Write the page of saved results: one HTML file that opens offline."""
    from hevopt.pages.report import report as write_page

    write(f"written to {write_page(file, out)}")


def command_line() -> str:
    """The command as it was given, quoted for a shell."""
    return encodable(shlex.join(["hevopt", *sys.argv[1:]]))


def check_page(report: Path | None) -> None:
    """DataError for a page whose name does not say that it is one."""
    if report is not None and report.suffix.lower() != ".htm":
        check_ending("--report", report, ".html")


def check_ending(option: str, path: Path, *endings: str) -> None:
    """DataError for a file whose name does not say what it is."""
    if path.suffix.lower() not in endings:
        *others, last = endings
        said = f"{', '.join(others)} or {last}" if others else last
        raise DataError(f"{option} {printable(str(path))}: choose a name that ends in {said}")
