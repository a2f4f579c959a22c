"""What all commands share: printing, progress, checks of what a user names."""

import os
import sys
from functools import cached_property
from textwrap import wrap
from time import monotonic
from typing import TYPE_CHECKING

from hevopt.errors import DataError

if TYPE_CHECKING:
    from rich.console import Console
    from rich.status import Status
    from rich.table import Table

_PROGRESS_AFTER_S = 2.0


def listed(text: str | None) -> list[str] | None:
    return None if text is None else [name.strip() for name in text.split(",") if name.strip()]


def width() -> int | None:
    """Columns of the terminal, or those that COLUMNS asks for; None where the output goes elsewhere."""
    from rich.console import Console

    return Console().width if sys.stdout.isatty() or os.environ.get("COLUMNS") else None


def show(table: "Table") -> None:
    """Print a table; a terminal narrower than its numbers wraps lines rather than losing digits."""
    write(text_of(table))


def text_of(table: "Table") -> str:
    """What `show` prints: the table as wide as it is."""
    from rich.console import Console

    from hevopt.output.tables import WIDEST

    console = Console(highlight=False, width=max(Console().width, WIDEST))
    with console.capture() as capture:
        console.print(table)
    text = capture.get().removesuffix("\n")
    return text if sys.stdout.isatty() else "\n".join(map(str.rstrip, text.split("\n")))


def show_notes(text: str) -> None:
    """Print lines, each wrapped between words where a terminal is narrower."""
    columns = width()
    lines = text.split("\n")
    if columns is not None:
        lines = [part for line in lines for part in wrap(line, max(columns, 40)) or [""]]
    write("\n".join(lines))


def write(text: str) -> None:
    """The only way to standard output."""
    try:
        print(text, flush=True)
    except OSError as error:
        raise DataError(f"cannot write to standard output ({error.strerror})") from None


class Progress:
    """A line on stderr about what is running, once that has taken more than two seconds."""

    def __enter__(self) -> "Progress":
        self._began = self._said_s = monotonic()
        self._status: Status | None = None
        return self

    @cached_property
    def _console(self) -> "Console":
        from rich.console import Console

        return Console(stderr=True)

    def __call__(self, text: str, done: int, total: int) -> None:
        now = monotonic()
        if now - self._began > _PROGRESS_AFTER_S:
            self._say(f"{done} of {total} done, next {text}", now)

    def of(self, what: str, text: str, done: int, total: int) -> None:
        """The same for one of several runs."""
        self(f"{what}, {text}", done, total)

    def _say(self, line: str, now: float) -> None:
        from rich.text import Text

        console = self._console
        if self._status is not None:
            self._status.update(Text(line))
        elif console.is_terminal:
            self._status = console.status(Text(line))
            self._status.start()
        elif now - self._said_s > _PROGRESS_AFTER_S:
            self._said_s = now
            print(f"hevopt: {line}", file=sys.stderr, flush=True)

    def __exit__(self, *_: object) -> None:
        if self._status is not None:
            self._status.stop()
