"""Nested tables, as a TOML file holds them, with some of their values replaced."""

from collections.abc import Mapping
from copy import deepcopy
from typing import Any

from hevopt.errors import DataError
from hevopt.files.shown import shown


def with_changes(
    contents: Mapping[str, Any], changes: Mapping[str, Any], within: str = ""
) -> dict[str, Any]:
    """A copy of nested tables with the values at some key paths (`soc.start`, `ratios.0`) replaced or added.

    within: what a message puts before every key path, such as `gearbox.` where the tables are those of a gearbox
    """
    changed = deepcopy(dict(contents))
    for key, value in changes.items():
        *way, last = key.split(".")
        if not all((*way, last)):
            raise DataError(
                f"change of {shown(within + key)}: a part of the key path is empty; give the path of a "
                "key as the file has it, such as machine.power_max_w"
            )
        table: Any = changed
        for n, step in enumerate(way):
            if isinstance(table, dict):
                table = table.setdefault(step, {})
            elif isinstance(table, list) and step.isdecimal() and int(step) < len(table):
                table = table[int(step)]
            if not isinstance(table, dict | list):
                raise DataError(
                    f"change of {shown(within + key)}: {shown(within + '.'.join(way[: n + 1]))} is "
                    f"{shown(table)}, not a table; give the path of a key as the file has it"
                )
        if isinstance(table, list) and not (last.isdecimal() and int(last) < len(table)):
            raise DataError(
                f"change of {shown(within + key)}: {shown(within + '.'.join(way))} is a list of "
                f"{len(table)} values; its entries are 0 to {len(table) - 1}"
            )
        table[int(last) if isinstance(table, list) else last] = deepcopy(value)
    return changed


def merged(table: Mapping[str, Any], over: Mapping[str, Any]) -> dict[str, Any]:
    """The table with the keys of another in place of its own; tables within both are merged likewise."""
    both = dict(table)
    for key, value in over.items():
        inner = both.get(key)
        if isinstance(value, Mapping) and isinstance(inner, Mapping):
            value = merged(inner, value)
        both[key] = value
    return both
