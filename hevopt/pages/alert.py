"""What the checks of a page, of a comparison as of a sweep, say."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Alert:
    """One thing to check: its name, whether there is something to say, and what, line by line.

    grave: what puts figures in doubt, rather than what only deserves a look
    """

    name: str
    found: bool
    lines: list[str]
    grave: bool = True
