"""Rows as a table of pandas."""

from collections.abc import Iterable
from types import NoneType
from typing import TYPE_CHECKING, get_args, get_type_hints

from hevopt.files.frames import TYPES
from hevopt.studies.rows import Row

if TYPE_CHECKING:
    import pandas as pd


def kinds_of_rows() -> dict[str, type]:
    """Field of a row -> int, float or str: what a table has of it; text for what is more than a number."""
    hints = {name: get_args(hint) or (hint,) for name, hint in get_type_hints(Row).items()}
    kinds = {
        name: next(kind for kind in found if kind is not NoneType) for name, found in hints.items()
    }
    return {name: kind if kind in TYPES else str for name, kind in kinds.items()}


def rows_frame(cycle: str, rows: Iterable[Row]) -> "pd.DataFrame":
    """One line per row, the cycle in front, then the fields of `Row`; what does not exist is missing."""
    import pandas as pd

    kinds = {"cycle": str, **kinds_of_rows()}
    lines = [{"cycle": cycle, **row.as_dict()} for row in rows]
    return pd.DataFrame(
        {
            name: pd.Series([line[name] for line in lines], dtype=TYPES[kind])
            for name, kind in kinds.items()
        }
    )
