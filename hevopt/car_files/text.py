"""A component's contents as the text of a TOML file, with where every key comes from."""

from collections.abc import Iterable, Mapping
from math import isnan
from typing import Any

from hevopt.files.shown import printable

_WIDTH = 112


def component_text(
    head: Iterable[str], contents: Mapping[str, Any], origins: Mapping[str, str]
) -> str:
    """TOML of tables. head: comment lines; origins: key path -> comment behind the key."""
    out = [f"# {printable(line)}" for line in head]
    return "\n".join([*out, *_table(contents, "", origins)]) + "\n"


def _table(contents: Mapping[str, Any], prefix: str, origins: Mapping[str, str]) -> list[str]:
    """Keys of a table, then the tables in it, and its lists of tables."""
    tables = {key: value for key, value in contents.items() if isinstance(value, Mapping)}
    several = {key: value for key, value in contents.items() if _is_tables(value)}
    plain = {k: v for k, v in contents.items() if k not in tables | several and v is not None}
    out = _keys(plain, prefix, origins)
    for name, table in tables.items():
        note = origins.get(prefix + name)
        out += ["", f"[{prefix}{name}]" + (f"  # {printable(note)}" if note else "")]
        out += _table(table, f"{prefix}{name}.", origins)
    for name, each in several.items():
        for table in each:
            out += ["", f"[[{prefix}{name}]]", *_table(table, f"{prefix}{name}.", origins)]
    return out


def _is_tables(value: Any) -> bool:
    return isinstance(value, list) and bool(value) and isinstance(value[0], Mapping)


def _keys(table: Mapping[str, Any], prefix: str, origins: Mapping[str, str]) -> list[str]:
    lines = []
    for key, value in table.items():
        note = origins.get(prefix + key)
        comment = f"  # {printable(note)}" if note else ""
        if isinstance(value, list):
            lines += _list(key, value)
        else:
            lines.append(f"{key} = {_scalar(value)}{comment}")
    return lines


def _list(key: str, values: list[Any]) -> list[str]:
    if values and isinstance(values[0], list):
        rows = [f"    [{', '.join(map(_number, row))}]," for row in values]
        return [f"{key} = [", *rows, "]"]
    line = f"{key} = [{', '.join(map(_number, values))}]"
    if len(line) <= _WIDTH:
        return [line]
    return [f"{key} = [", *_wrapped([_number(value) for value in values]), "]"]


def _wrapped(words: list[str]) -> list[str]:
    lines, line = [], "   "
    for word in words:
        if len(line) + len(word) + 2 > _WIDTH:
            lines.append(line)
            line = "   "
        line += f" {word},"
    return [*lines, line]


def _scalar(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        escaped = value.replace("\\", "\\\\").replace('"', '\\"')
        return f'"{escaped}"'
    return _number(value)


def _number(value: float) -> str:
    """Seven digits: finer than any bench, and the same from every unit."""
    if isinstance(value, int):
        return str(value)
    if isnan(value):
        return "nan"
    text = f"{value:.7g}"
    return text if any(c in text for c in ".en") else f"{text}.0"
