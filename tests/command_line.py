"""The command line, run in the process of the tests as a user would run it."""

from math import inf
from typing import NamedTuple

import pytest

from hevopt.cli import main


class Seen(NamedTuple):
    """What a user sees of a run."""

    status: int
    out: str
    err: str


def call(monkeypatch, capsys, *words) -> Seen:
    """Exit status, standard output and standard error of `hevopt` with these words."""
    monkeypatch.setattr("sys.argv", ["hevopt", *map(str, words)])
    # What a slow machine says meanwhile is not what the tests look at.
    monkeypatch.setattr("hevopt.commands.terminal._PROGRESS_AFTER_S", inf)
    with pytest.raises(SystemExit) as stop:
        main()
    return Seen(stop.value.code or 0, *capsys.readouterr())
