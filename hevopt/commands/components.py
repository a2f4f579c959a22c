"""Options that the commands share which write component files, and what they make of them."""

import tomllib
from typing import Annotated, Any

import typer

from hevopt.errors import DataError
from hevopt.files.shown import shown

ColumnOption = Annotated[
    list[str] | None,
    typer.Option("--column", help="ROLE=NAME: which column holds what; may be repeated."),
]
UnitOption = Annotated[
    list[str] | None,
    typer.Option("--unit", help="ROLE=UNIT: the unit of a column; may be repeated."),
]
SheetOption = Annotated[str | None, typer.Option("--sheet", help="Sheet of an Excel workbook.")]
LikeOption = Annotated[
    str | None,
    typer.Option("--like", help="Name or file of a component that gives the remaining keys."),
]
SetOption = Annotated[
    list[str] | None,
    typer.Option("--set", help="KEY=VALUE of the component's file; may be repeated."),
]


def values_of(texts: list[str] | None) -> dict[str, Any]:
    """KEY=VALUE as a mapping; a value that is no TOML value is text."""
    values = {}
    for text in texts or []:
        key, mark, value = text.partition("=")
        if not mark or not key.strip():
            raise DataError(f"--set {shown(text)}: KEY=VALUE is needed, such as idle_rpm=800")
        try:
            read = tomllib.loads(f"x = {value}")
            values[key.strip()] = read["x"] if len(read) == 1 else value.strip()
        except (ValueError, RecursionError):
            values[key.strip()] = value.strip()
    return values
