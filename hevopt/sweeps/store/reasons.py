"""Why cases of a sweep have no result: their errors, those alike but for their numbers as one."""

import re
from dataclasses import dataclass

from hevopt.files.shown import printable

_NUMBER = re.compile(r"\d[\d.]*")


@dataclass(slots=True)
class Reason:
    """Errors alike: the first one's first line, the design it befell, how many there are."""

    example: str
    design: int
    count: int = 0


class Reasons:
    """Reasons by outcome, as cases come; memory holds one of each kind."""

    def __init__(self) -> None:
        self._found: dict[tuple[str, str], Reason] = {}

    def add(self, outcome: str, error: str, design: int) -> None:
        """Count the error of a case that ended with an outcome."""
        line = first_line(error)
        kind = outcome, _NUMBER.sub("#", line)
        self._found.setdefault(kind, Reason(line, design)).count += 1

    def of(self, outcome: str) -> list[Reason]:
        """Reasons of an outcome, the most frequent first."""
        found = [reason for (ended, _), reason in self._found.items() if ended == outcome]
        return sorted(found, key=lambda reason: -reason.count)


def first_line(error: str) -> str:
    """What a message says at once; details follow on lines of their own."""
    return printable((error.splitlines() or ["no reason given"])[0].rstrip(":"))
