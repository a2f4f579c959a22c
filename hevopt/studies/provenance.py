"""Where a result comes from: digests of inputs and of the code that computes, versions of what it runs on."""

import hashlib
import json
import platform
import re
from collections.abc import Iterable, Iterator, Mapping
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

from hevopt import __version__
from hevopt.car.architecture import Architecture
from hevopt.driving.cycle import Cycle
from hevopt.files.lookup import places_shown, without_folders

# Whole numbers up to here are floats without loss.
_EXACT_MAX = 2**53
_PACKAGE = Path(__file__).resolve().parents[1]
# Every result comes out of these; what they import, and nothing else, can change one.
_ROOTS = ("studies.comparison", "sweeps.workers.work")
_IMPORT = re.compile(r"^[ \t]*from hevopt(?:\.([\w.]+))? import (\([^)]*\)|.*)", re.MULTILINE)
_NAME, _COMMENT = re.compile(r"\w+"), re.compile(r"#.*")
_LIBRARIES = ("numpy", "scipy", "numba", "cvxpy", "clarabel", "osqp")


def digest(value: Any) -> str:
    """SHA-256 of nested tables and values, whatever the order of keys; numbers count to the last bit."""
    text = json.dumps(_floats(value), sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()


def _floats(value: Any) -> Any:
    """The value with whole numbers as floats: 8000 and 8000.0 are one."""
    if isinstance(value, Mapping):
        return {key: _floats(inner) for key, inner in value.items()}
    if isinstance(value, list | tuple):
        return [_floats(inner) for inner in value]
    return float(value) if type(value) is int and abs(value) <= _EXACT_MAX else value


def cycle_contents(cycle: Cycle) -> dict[str, Any]:
    """Everything of a cycle that a result depends on, as lists."""
    fields = ("time_s", "speed_mps", "grade", "gear", "clutch_open", "auxiliary_w")
    arrays = {name: getattr(cycle, name) for name in fields}
    return {name: None if a is None else a.tolist() for name, a in arrays.items()}


@cache
def physics_digest() -> str:
    """SHA-256 of the source of every module that can change a result."""
    found = hashlib.sha256()
    for path in sorted(_reached()):
        found.update(path.relative_to(_PACKAGE).as_posix().encode() + b"\0")
        found.update(path.read_bytes())
    return found.hexdigest()


def _reached() -> set[Path]:
    """The source files of the package that are imported, at whatever distance, for a result."""
    waiting, named = list(_ROOTS), set[str]()
    reached: set[Path] = set()
    while waiting:
        module = waiting.pop()
        if module in named:
            continue
        named.add(module)
        for path in _files_of(module):
            if path not in reached:
                reached.add(path)
                waiting += _imported(path.read_text("utf-8"))
    return reached


def _imported(text: str) -> Iterator[str]:
    """What the text of a module imports of the package, and from there, below the package: modules and names in
    them. Its text tells, in a fraction of the time that a syntax tree takes; a test holds it to that."""
    for module, names in _IMPORT.findall(text):
        yield module
        for name in _NAME.findall(_COMMENT.sub("", names)):
            yield f"{module}.{name}".removeprefix(".")


def _files_of(module: str) -> list[Path]:
    """The file of a module below the package; all files of one that is a folder."""
    place = _PACKAGE.joinpath(*module.split("."))
    if module and place.is_dir():
        return sorted(place.glob("*.py"))
    file = place.with_suffix(".py")
    return [file] if module and file.is_file() else []


@cache
def versions() -> dict[str, str]:
    """Name -> version of hevopt, Python and the libraries that compute."""
    names = {name: version(name) for name in _LIBRARIES}
    return {"hevopt": __version__, "python": platform.python_version()} | names


def code_digest() -> str:
    """SHA-256 of everything but its inputs that can change a result: hevopt's code, Python, the libraries."""
    return digest({"code": physics_digest(), "versions": versions()})


def files_digests(
    cars: Iterable[Architecture], cycles: Iterable[Cycle], others: Iterable[Path] = ()
) -> Mapping[str, str]:
    """File as read -> SHA-256 of its bytes, of all files behind some cars and cycles, and others."""
    paths = [path for car in cars for path in car.files]
    paths += [cycle.source for cycle in cycles if cycle.source is not None]
    paths += others
    return {
        str(path): hashlib.sha256(path.read_bytes()).hexdigest() for path in dict.fromkeys(paths)
    }


def digests_shown(digests: Mapping[str, str]) -> dict[str, str]:
    """File as a report names it -> SHA-256."""
    names = places_shown(map(Path, digests))
    return {names[Path(file)]: digest for file, digest in digests.items()}


def changes_shown(changes: Mapping[str, Mapping[str, Any]]) -> dict[str, dict[str, Any]]:
    """Car -> what was changed in it, files without folders that are the user's."""
    return {
        car: {k: without_folders(v) if isinstance(v, str) else v for k, v in of.items()}
        for car, of in changes.items()
    }
