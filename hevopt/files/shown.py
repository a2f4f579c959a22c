"""Values and texts of others as a message may quote them."""

from datetime import date, time

_SHOWN_CHARACTERS = 40


def shown(value: object) -> str:
    """A value of a file as a message quotes it: on one line, printable, and short."""
    try:
        text = _as_in_toml(value)
    except (ValueError, RecursionError):  # thousands of digits, or of brackets
        return f"a very long {type(value).__name__}"
    return text if len(text) <= _SHOWN_CHARACTERS else text[: _SHOWN_CHARACTERS - 3] + "..."


def _as_in_toml(value: object) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, date | time):
        return value.isoformat()
    if isinstance(value, list):
        return f"[{', '.join(map(_as_in_toml, value))}]"
    if isinstance(value, dict) and value:
        inner = (f"{printable(str(key))} = {_as_in_toml(found)}" for key, found in value.items())
        return f"{{ {', '.join(inner)} }}"
    return repr(value)


def encodable(text: str) -> str:
    """The text as it can be written: bytes of a file name that are no UTF-8 as Python spells them, `\\udce9`."""
    return text.encode("utf-8", "backslashreplace").decode()


def printable(text: str) -> str:
    """The text with what a terminal could take for a command, such as a line end, as '?'."""
    return "".join(c if c.isprintable() else "?" for c in text)


def first_line(error: object) -> str:
    """What a message, such as another library's, says first."""
    return printable((str(error).splitlines() or [type(error).__name__])[0].rstrip(":"))
