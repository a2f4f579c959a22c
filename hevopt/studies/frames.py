"""Rows as a table of pandas."""

from collections.abc import Iterable, Mapping
from types import NoneType
from typing import TYPE_CHECKING, Any, get_args, get_type_hints

from hevopt.files.frames import TYPES
from hevopt.studies.forward_rows import ForwardFigures
from hevopt.studies.rows import Row

if TYPE_CHECKING:
    import pandas as pd

_NONE: Mapping[tuple[str, str], ForwardFigures] = {}


def kinds_of_rows() -> dict[str, type]:
    """Field of a row -> int, float or str: what a table has of it; text for what is more than a number."""
    return _kinds(Row)


def told_forward(
    forward: Mapping[tuple[str, str], ForwardFigures], car: str, strategy: str
) -> dict[str, Any]:
    """A row's forward figures by name; those that say so where the row was not solved."""
    figures = forward.get((car, strategy), ForwardFigures("not driven: the row has no plan"))
    return figures.as_dict()


def _kinds(of: type) -> dict[str, type]:
    hints = {name: get_args(hint) or (hint,) for name, hint in get_type_hints(of).items()}
    kinds = {
        name: next(kind for kind in found if kind is not NoneType) for name, found in hints.items()
    }
    return {name: kind if kind in TYPES else str for name, kind in kinds.items()}


def rows_frame(
    cycle: str, rows: Iterable[Row], forward: Mapping[tuple[str, str], ForwardFigures] = _NONE
) -> "pd.DataFrame":
    """One line per row, the cycle in front, then the fields of `Row`; what does not exist is missing.

    forward: architecture and strategy -> figures that follow, where there are any
    """
    import pandas as pd

    kinds = {"cycle": str, **kinds_of_rows()}
    lines = [{"cycle": cycle, **row.as_dict()} for row in rows]
    if forward:
        kinds |= {f"forward_{name}": kind for name, kind in _kinds(ForwardFigures).items()}
        for line in lines:
            line |= told_forward(forward, line["architecture"], line["strategy"])
    return pd.DataFrame(
        {
            name: pd.Series([line[name] for line in lines], dtype=TYPES[kind])
            for name, kind in kinds.items()
        }
    )
