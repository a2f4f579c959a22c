"""`hevopt scores`: benchmarks of which something is known, and what is found here."""

from pathlib import Path
from typing import Annotated

import typer

from hevopt.commands.terminal import Progress, write
from hevopt.errors import DataError


def scores(
    out: Annotated[Path, typer.Option("--out", help="The page to write, Markdown (.md).")],
) -> None:
    """Benchmarks whose optimum is known by hand, or published, beside dp and bound."""
    from hevopt.files.shown import printable
    from hevopt.files.writing import check_outs, write_whole
    from hevopt.reproduction.scores.page import page, scored

    if out.suffix.lower() != ".md":
        raise DataError(f"--out {printable(str(out))}: choose a name that ends in .md")
    check_outs({"--out": out}, [])
    with Progress() as progress:
        told = scored(progress)
    write_whole(out, page(told).encode())
    write(f"written to {out}")
