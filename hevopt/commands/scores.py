"""`hevopt scores`: benchmarks of which something is known, and what is found here."""

from pathlib import Path
from typing import Annotated

import typer

from hevopt.commands.reporting import check_ending
from hevopt.commands.terminal import Progress, write


def scores(
    out: Annotated[Path, typer.Option("--out", help="The page to write, Markdown (.md).")],
) -> None:
    """Benchmarks whose optimum is known by hand, or published, beside dp and bound."""
    from hevopt.files.writing import check_outs, write_whole
    from hevopt.reproduction.scores.page import page, scored

    check_ending("--out", out, ".md")
    check_outs({"--out": out}, [])
    with Progress() as progress:
        told = scored(progress)
    write_whole(out, page(told).encode())
    write(f"written to {out}")
