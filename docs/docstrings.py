"""Docstrings as pages need them: what stands there as `name: meaning`, line under line, becomes a list."""

import re
from typing import Any

from griffe import Extension, Object

_FIELD = re.compile(r"([a-z_]\w*(?:, [a-z_]\w*)*): ")
_ENDS = re.compile(r"(Raises|Equations?|None|DataError)\b|$")


def listed(text: str) -> str:
    """Lines of fields as items of a list, with the lines that go on below them; other lines as they are."""
    lines: list[str] = []
    within = False
    for line in text.splitlines():
        field = _FIELD.match(line)
        if field:
            lines += [] if within else [""]
            names = ", ".join(f"`{name}`" for name in field[1].split(", "))
            line, within = f"- {names}: {line[field.end() :]}", True
        elif within and _ENDS.match(line):
            lines.append("")
            within = False
        lines.append(f"  {line}" if within and not field else line)
    return "\n".join(lines)


class Fields(Extension):
    """Changes the docstring of everything that the reference shows."""

    def on_object(self, *, obj: Object, **_: Any) -> None:
        """Called by griffe with each module, class, function and attribute."""
        if obj.docstring is not None:
            obj.docstring.value = listed(obj.docstring.value)
