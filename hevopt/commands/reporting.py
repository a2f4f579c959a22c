"""`hevopt report`: the page of saved results, of a sweep's store, or of a folder of saved results."""

import shlex
import sys
from pathlib import Path
from typing import Annotated

import typer

from hevopt.commands.terminal import write
from hevopt.errors import DataError
from hevopt.files.shown import encodable


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
    if report is not None and report.suffix.lower() not in (".html", ".htm"):
        raise DataError(f"--report {report}: choose a name that ends in .html")
