"""`hevopt validate`: a file of any kind checked in full."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from hevopt.checks.files import (
    ARCHITECTURE,
    COMPARE,
    CYCLE,
    SWEEP,
    Finding,
    architecture_faults,
    component_faults,
    cycle_finding,
    finding,
    kind_and_contents,
)
from hevopt.checks.studies import compare_faults, sweep_faults
from hevopt.errors import DataError, HevoptError, close_to
from hevopt.files.lookup import find, grouped_names, is_path, meant_by, shipped_names
from hevopt.files.shown import printable, shown

_SHIPPED = (("architectures", ".toml"), ("cycles", ".csv"), ("architectures/components", ".toml"))
_CHECKS: dict[str, Callable[[Path, dict[str, Any], str], tuple[list[str], str]]] = {
    ARCHITECTURE: architecture_faults,
    COMPARE: compare_faults,
    SWEEP: sweep_faults,
}


def validate(name: str) -> Finding:
    """What is wrong with a file, given by its path or as the name of a shipped one."""
    try:
        path = _file(name)
        kind, contents = kind_and_contents(path)
        if kind == CYCLE:
            return cycle_finding(path)
    except DataError as error:
        return finding(Path(name), "file", "", error.listed)
    try:
        faults, about = _CHECKS.get(kind, component_faults)(path, contents, kind)
    except HevoptError as error:
        faults, about = error.listed, ""
    return finding(path, kind, about, list(dict.fromkeys(faults)))


def _file(name: str) -> Path:
    path = Path(name)
    try:
        if path.exists() and not path.is_file():
            raise DataError(f"{printable(name)}: not a regular file; give a .toml or .csv file")
        if path.exists() or is_path(name, ".toml"):
            return path
    except OSError as error:
        raise DataError(
            f"{shown(name)} cannot be looked up ({error.strerror}); check the path"
        ) from None
    names = {n: (kind, suffix) for kind, suffix in _SHIPPED for n in shipped_names(kind, suffix)}
    names |= {n: _SHIPPED[0] for n in grouped_names(*_SHIPPED[0])}
    if name in names:
        kind, suffix = names[name]
        return find(kind, name, suffix)
    hint = close_to(name, names, meant_by("cycles", name))
    raise DataError(
        f"{printable(name)}: no such file, and no shipped architecture, component or cycle has that name; {hint}"
        "give the path of a file or such a name"
    )
