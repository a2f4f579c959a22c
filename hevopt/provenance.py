"""Where a result comes from: digests of inputs and of the code that computes, versions of what it runs on."""

import hashlib
import json
import platform
from collections.abc import Iterable, Mapping
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

from hevopt import __version__
from hevopt.architecture import Architecture
from hevopt.cycle import Cycle

_PACKAGE = Path(__file__).resolve().parent
# What prints, draws or stores results, and cannot change one.
_NOT_PHYSICS = ("commands", "pages", "cli.py", "report.py", "writing.py", "published.py")
_LIBRARIES = ("numpy", "scipy", "numba", "cvxpy", "clarabel", "osqp")


def digest(value: Any) -> str:
    """SHA-256 of nested tables and values, whatever the order of keys; floats count to the last bit."""
    text = json.dumps(value, sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()


def cycle_contents(cycle: Cycle) -> dict[str, Any]:
    """Everything of a cycle that a result depends on, as lists."""
    fields = ("time_s", "speed_mps", "grade", "gear", "clutch_open")
    arrays = {name: getattr(cycle, name) for name in fields}
    return {name: None if a is None else a.tolist() for name, a in arrays.items()}


@cache
def physics_digest() -> str:
    """SHA-256 of the source of every module that can change a result."""
    found = hashlib.sha256()
    for path in sorted(_PACKAGE.glob("**/*.py")):
        if path.relative_to(_PACKAGE).parts[0] not in _NOT_PHYSICS:
            found.update(path.relative_to(_PACKAGE).as_posix().encode() + b"\0")
            found.update(path.read_bytes())
    return found.hexdigest()


@cache
def versions() -> dict[str, str]:
    """Name -> version of hevopt, Python and the libraries that compute."""
    names = {name: version(name) for name in _LIBRARIES}
    return {"hevopt": __version__, "python": platform.python_version()} | names


def files_digests(cars: Iterable[Architecture], cycles: Iterable[Cycle]) -> Mapping[str, str]:
    """File as read -> SHA-256 of its bytes, of all files behind some cars and cycles."""
    paths = [path for car in cars for path in car.files]
    paths += [cycle.source for cycle in cycles if cycle.source is not None]
    return {
        str(path): hashlib.sha256(path.read_bytes()).hexdigest() for path in dict.fromkeys(paths)
    }
