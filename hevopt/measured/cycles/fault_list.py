"""Faults of a drive's rows as they are found, and the message that lists them by line."""

from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

from hevopt.errors import DataError
from hevopt.files.shown import shown
from hevopt.measured.cycles.columns import Drive
from hevopt.measured.tables.cells import LISTED


@dataclass(slots=True)
class Faults:
    """Faults or repairs as they are found: (line, kind, text, what the text is filled with)."""

    found: list[tuple[int, str, str, tuple]] = field(default_factory=list)

    def add(self, line: int, kind: str, text: str, *values: object) -> None:
        """One fault; its text is filled in only where it is shown, for there may be a million."""
        self.found.append((int(line), kind, text, values))

    def texts(self, count: int | None = None) -> list[str]:
        """`line 12: ...` of the first faults, or of all, in the order of lines."""
        ordered = sorted(self.found, key=lambda fault: fault[0])
        return [f"line {line}: {text.format(*values)}" for line, _, text, values in ordered[:count]]


def refused(path: Path, faults: Faults, advice: str) -> DataError:
    """The error that lists the faults by line, counts them by kind and says what to do."""
    kinds = Counter(fault[1] for fault in faults.found)
    counts = ", ".join(f"{count} {kind}" for kind, count in kinds.items())
    total = len(faults.found)
    more = [f"and {total - LISTED} more"] if total > LISTED else []
    body = "\n  ".join(faults.texts(LISTED) + more)
    return DataError(f"{path}: {total} fault{'s' * (total > 1)} ({counts})\n  {body}\n{advice}")


def empty_cell(drive: Drive, role: str, row: int) -> str:
    """What a fault says of a cell that holds no number."""
    cell = drive.text.get((role, int(row)))
    return "is empty" if cell is None else f"is {shown(cell)}, no usable number"
