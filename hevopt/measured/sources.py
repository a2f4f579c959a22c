"""Where what an import writes comes from."""

import hashlib
from collections.abc import Iterable
from pathlib import Path

from hevopt import __version__
from hevopt.files.lookup import is_path


def digests(sources: Iterable[Path]) -> list[str]:
    """Name, SHA-256 and program of every input, for the head of what is written."""
    return [
        f"From {path.name}, SHA-256 {hashlib.sha256(path.read_bytes()).hexdigest()}, hevopt {__version__}."
        for path in sources
    ]


def own_file(like: str | None) -> list[str]:
    """The file of the component that gives the remaining keys; none where it is a shipped one."""
    return [like] if like is not None and is_path(like, ".toml") else []
