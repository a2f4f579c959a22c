"""Why cases of a sweep have no result, or lack a proof: reasons alike but for their numbers as one."""

import re
from collections.abc import Iterator
from dataclasses import dataclass

from hevopt.files.shown import printable

_NUMBER = re.compile(r"\d[\d.]*")


@dataclass(slots=True)
class Reason:
    """Reasons alike: the first one, the design it befell, how many there are."""

    example: str
    design: int
    count: int = 0


class Reasons:
    """Reasons by what they are of, such as an ending or a proof, as cases come; memory holds one of each kind."""

    def __init__(self) -> None:
        self._found: dict[tuple[str, str], Reason] = {}

    def add(self, of: str, reason: str, design: int) -> None:
        """Count a case's reason, a text of one line."""
        line = printable(reason)
        self._found.setdefault((of, _NUMBER.sub("#", line)), Reason(line, design)).count += 1

    def of(self, of: str) -> list[Reason]:
        """Reasons of one thing, the most frequent first."""
        found = [reason for (about, _), reason in self._found.items() if about == of]
        return sorted(found, key=lambda reason: -reason.count)

    def __iter__(self) -> Iterator[str]:
        """What they are of."""
        return iter(dict.fromkeys(of for of, _ in self._found))
