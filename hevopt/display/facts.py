"""What an object says of itself: one line in a console, a small table in a notebook; of arrays only the shape."""

from collections.abc import Iterable, Mapping, Sequence, Set
from dataclasses import fields, is_dataclass
from enum import Enum
from html import escape
from pathlib import Path
from typing import Any

import numpy as np

_LINE_MAX = 150
_TEXT_MAX = 40
_ENTRIES_MAX = 6


class Shown:
    """Base of the dataclasses that users meet, declared with repr=False: they differ in `_facts` alone."""

    __slots__ = ()

    def _facts(self) -> Mapping[str, Any]:
        """What is told, by name and in order: all fields, where a class does not choose."""
        return {part.name: getattr(self, part.name) for part in fields(self)}  # type: ignore[arg-type]

    def __repr__(self) -> str:
        said: list[str] = []
        for name, value in self._facts().items():
            text = isinstance(value, str | Path) and not isinstance(value, Enum)
            said.append(f"{name}={repr(_cut(value)) if text else told(value)}")
            if sum(map(len, said)) > _LINE_MAX:
                said[-1] = "..."
                break
        return f"{type(self).__name__}({', '.join(said)})"

    def _repr_html_(self) -> str:
        return html_table(type(self).__name__, ["", ""], list(self._facts().items()))


def html_table(title: str, heads: Sequence[str], lines: Iterable[Sequence[Any]]) -> str:
    """A table in HTML of what is told of values, every text escaped."""

    def row(cells: Sequence[Any], kind: str) -> str:
        return "".join(f"<{kind}>{escape(told(cell))}</{kind}>" for cell in cells)

    rows = [row(heads, "th"), *(row(cells, "td") for cells in lines)]
    body = "\n".join(f"<tr>{cells}</tr>" for cells in rows)
    return f"<table>\n<caption>{escape(told(title))}</caption>\n{body}\n</table>"


def told(value: Any) -> str:
    """A value in a few words of one line."""
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, Enum | np.ndarray):
        return f"array{value.shape}" if isinstance(value, np.ndarray) else str(value)
    if isinstance(value, float):
        return f"{value:.6g}"
    if value is None or isinstance(value, int):
        return str(value)
    if isinstance(value, str | Path):
        return repr(_cut(value))[1:-1]
    if isinstance(value, Mapping | Sequence | Set) and not isinstance(value, Shown):
        return _entries(value)
    return f"{type(value).__name__}(...)" if is_dataclass(value) else type(value).__name__


def _cut(value: str | Path) -> str:
    text = value.name if isinstance(value, Path) else value
    return text if len(text) <= _TEXT_MAX else f"{text[: _TEXT_MAX - 3]}..."


def _entries(values: Mapping[Any, Any] | Sequence[Any] | Set[Any]) -> str:
    """Of a mapping its keys, of others their entries; only how many where they are many or more than a word."""
    plain = str | int | float | Enum | np.generic
    if len(values) > _ENTRIES_MAX or not all(isinstance(entry, plain) for entry in values):
        return f"{len(values)} entries"
    entries = sorted(values, key=str) if isinstance(values, Set) else values
    return f"({', '.join(map(told, entries))})"
