"""`hevopt report`: the page of saved results; and the files that `hevopt compare` leaves behind."""

import shlex
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hevopt.commands.terminal import write
from hevopt.files.lookup import starts_with
from hevopt.files.shown import encodable

if TYPE_CHECKING:
    from hevopt.pages.comparison.results import Results

_TOO_MUCH = "`hevopt report` reads no more, nothing is saved; ask for fewer cars or strategies, or a shorter cycle"
_SQLITE = b"SQLite format 3\0"


def report(
    file: Annotated[
        Path, typer.Argument(help="What hevopt compare --save wrote, or the store of a sweep.")
    ],
    out: Annotated[Path, typer.Option("--out", help="The HTML page to write.")],
) -> None:
    """Write the page of saved results: one HTML file that opens offline."""
    from hevopt.files.writing import check_outs, write_whole

    page, inputs = _page(file)
    check_outs({"--out": out}, [file, *inputs])
    write_whole(out, page.encode())
    write(f"written to {out}")


def _page(file: Path) -> tuple[str, list[str]]:
    """The page of a saved comparison, or of a sweep where the file is an SQLite database; the files behind it."""
    if starts_with(file, _SQLITE):
        from hevopt.pages.sweep.data import load_sweep
        from hevopt.pages.sweep.page import sweep_page

        sweep = load_sweep(file)
        return sweep_page(sweep), list(sweep.inputs)
    from hevopt.pages.comparison.page import comparison_page
    from hevopt.pages.comparison.saved import load_results

    results = load_results(file)
    return comparison_page(results), list(results.inputs)


def write_files(results: "Results", page: Path | None, saved: Path | None) -> list[str]:
    """Write the page and the saved results, each where asked for; a line for each."""
    from hevopt.files.writing import write_whole
    from hevopt.pages.comparison.page import comparison_page
    from hevopt.pages.comparison.results import packed
    from hevopt.pages.comparison.room import check_room

    contents = []
    if saved is not None:
        text = results.text()
        check_room(f"--save {saved}", text, _TOO_MUCH)
    if page is not None:
        contents.append(("report", page, comparison_page(results).encode()))
    if saved is not None:
        contents.append(("results", saved, packed(text)))
    for _, path, whole in contents:
        write_whole(path, whole)
    return [f"{what} written to {path}" for what, path, _ in contents]


def command_line() -> str:
    """The command as it was given, quoted for a shell."""
    return encodable(shlex.join(["hevopt", *sys.argv[1:]]))
