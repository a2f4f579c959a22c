"""Strategies that users bring to a command: by --policy, or in place of a strategy's name."""

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hevopt.errors import DataError

if TYPE_CHECKING:
    from hevopt.strategies import Strategy
    from hevopt.studies.settings import Settings

PolicyOption = Annotated[
    list[str] | None,
    typer.Option(
        "--policy",
        metavar="FILE.py:FUNCTION",
        help="A strategy of your own, or MODULE:FUNCTION; can be repeated.",
    ),
]


def brought_to(
    settings: "Settings", references: list[str] | None, folder: Path | None = None
) -> "tuple[Settings, dict[str, Strategy]]":
    """Settings whose strategies count those of --policy, and by name all that are no shipped ones.

    folder: from where strategies of the settings that are files are taken
    """
    from hevopt.strategies import chosen, policies

    names, others = chosen(settings.strategies, folder)
    own = policies(references or [])
    if twice := own.keys() & (others.keys() | set(names or ())):
        raise DataError(f"strategy {sorted(twice)[0]} is given twice; give it once")
    if names is not None and names != ["all"]:
        settings = replace(settings, strategies=(*names, *own))
    return settings, {**others, **own}


def one_of(strategy: str | None, references: list[str] | None) -> "tuple[str, dict[str, Strategy]]":
    """The one strategy of a command, dp where none is named, and by its name what was brought."""
    from hevopt.strategies import chosen, policies

    if references:
        if strategy is not None or len(references) > 1:
            raise DataError(
                "--policy and --strategy name one strategy here; give one of them, once"
            )
        own = policies(references)
        return next(iter(own)), own
    return strategy or "dp", chosen([strategy or "dp"])[1]
