"""A good file to spoil, and the commands that read it."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

ROOT = Path(__file__).parents[2]
ARCHITECTURES, CYCLES = ROOT / "architectures", ROOT / "cycles"
COMPONENTS = ARCHITECTURES / "components"
SHORT_CYCLE = Path(__file__).parent / "short.csv"


@dataclass(frozen=True)
class Seed:
    """A file, sets of words after `hevopt` that read it, and good files beside it: name -> contents."""

    name: str
    contents: bytes
    commands: tuple[Sequence[str], ...]
    beside: dict[str, bytes] = field(default_factory=dict)


def each_spoilt(files: dict[str, bytes], *commands: Sequence[str]) -> list[Seed]:
    """For commands that read several files: one seed for each of these, the others good."""
    return [
        Seed(name, contents, commands, {n: c for n, c in files.items() if n != name})
        for name, contents in files.items()
    ]
