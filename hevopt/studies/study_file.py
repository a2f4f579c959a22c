"""Study files of `hevopt compare study.toml`: one TOML file from which a run is repeated.

    cycle = "wltc_class3b"                  a name, or a path from the file
    architectures = ["A", "./mine.toml"]    strategies = ["ecms", "dp"]
    nox_weight = 0.0        allow_shortfall = false     free_gear = false     refine = false     horizon_s = 20
    soc_start = 0.6         soc_min = 0.4               soc_max = 0.8         soc_end = "neutral"
    auxiliaries_w = 400     mass_kg = 1350              start_cost_g = 0.2    shift_cost_g = 0.05
    [set]                                   any key of an architecture or its components, by its path
    machine.power_max_w = 2e4

Every key may be left out. The command line has the same as options, which go first.
"""

import re
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from hevopt.car_files.kinds import COMPONENTS
from hevopt.errors import DataError
from hevopt.files.lookup import is_path
from hevopt.files.shown import printable, shown
from hevopt.files.toml import read_contents
from hevopt.studies.given import flat_changes, given_of

_NAME_OR_PATH = re.compile(r"[A-Za-z_./~][\w./~ -]*")
# Keys of files that are none of compare's, and where to give them instead.
_OTHER_FILES = {
    "coupling": "an architecture; give the file with --architectures",
    "parameters": "a study file of sweep; give the file to hevopt sweep",
}


def read_study(path: Path) -> dict[str, Any]:
    """What a study file gives, see `given.given_of`, its paths taken from where it lies; DataError with every
    fault.
    """
    contents = read_contents(path)
    for key, what in _OTHER_FILES.items():
        if key in contents:
            raise DataError(f"{path}: {key} is a key of {what}")
    given = given_of(str(path), contents)
    if "cycle" in given:
        given["cycle"] = beside_study(path, given["cycle"], ".csv")
    if "architectures" in given:
        given["architectures"] = [beside_study(path, a, ".toml") for a in given["architectures"]]
    return given | {"set": _beside(path, given["set"])}


def changes_in(path: Path, contents: Mapping[str, Any]) -> dict[str, Any]:
    """Key path -> value of a study file's [set], its paths taken from where it lies."""
    table = contents.get("set")
    return _beside(path, flat_changes(table)) if isinstance(table, Mapping) else {}


def _beside(path: Path, changes: Mapping[str, Any]) -> dict[str, Any]:
    """Changes with the files of components taken from where the study lies."""
    changes = dict(changes)
    for key in COMPONENTS:
        if isinstance(value := changes.get(key), str):
            changes[key] = beside_study(path, value, ".toml")
    return changes


def assignments(texts: Sequence[str]) -> dict[str, Any]:
    """Key path -> value of texts such as `machine.power_max_w=2e4`.

    The value is written as in TOML, but a name or a path needs no quotes, which a shell takes away.
    """
    changes: dict[str, Any] = {}
    for text in texts:
        key, equals, value = text.partition("=")
        key = key.strip()
        if not equals or not key:
            raise DataError(f"--set {shown(text)}; needed: KEY=VALUE, as machine.power_max_w=2e4")
        if key in changes:
            raise DataError(f"--set {printable(key)} is given twice; leave one out")
        changes[key] = _toml_value(key, value.strip())
    return changes


def _toml_value(key: str, text: str) -> Any:
    try:
        found = tomllib.loads(f"value = {text}")
    except (ValueError, RecursionError):
        found = {"value": text} if _NAME_OR_PATH.fullmatch(text) else {}
    if list(found) != ["value"]:
        raise DataError(
            f"--set {printable(key)}={shown(text)[1:-1]}: not a value; allowed: a number, true, false, a list "
            f"[1, 2], a table {{ a = 1 }}, a name or path, or text in quotes, as --set '{printable(key)}=\"text\"'"
        )
    return found["value"]


def beside_study(path: Path, name: str, suffix: str) -> str:
    """A name as it stands; a path in a study file, from where that lies and still a path."""
    if not is_path(name, suffix):
        return name
    located = str(path.parent / name)
    return located if is_path(located, suffix) else f"./{located}"
