"""Files of every kind checked in full: architectures and the components behind them, cycles, study files.

What a TOML file is, is told by its keys: the kind that knows most of them.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hevopt.architecture import COMPONENTS, component_contents, load_architecture
from hevopt.cycle import faults_in, load_cycle
from hevopt.datafile import FileModel, faults_of, read_contents
from hevopt.errors import DataError, HevoptError
from hevopt.file_schema import MODELS
from hevopt.files import find, is_path, printable, read_text, shipped_names, shown
from hevopt.strategies import strategy_named
from hevopt.study_file import CompareFile, beside_study, cars_of, read_study
from hevopt.sweeps import study_file as sweep_file
from hevopt.units import KMH_PER_MPS

COMPARE, SWEEP, CYCLE = "study file of compare", "study file of sweep", "cycle"
_KINDS: dict[str, type[FileModel]] = {
    **MODELS,
    COMPARE: CompareFile,
    SWEEP: sweep_file.StudyFile,
}
_FOLDERS = {".toml": "architectures", ".csv": "cycles"}
_LINES_LISTED = 20
_MEGABYTES_MAX = 50
_KEYS_LISTED = 200
# A shipped car in which a component is tried out.
_TRIED_IN = "C2"


@dataclass(frozen=True, slots=True)
class Finding:
    """What a file is, in words, and its faults, each with file, key path or line, value and what is allowed.

    count: how many there are; beyond some tens of lines of a cycle, `faults` ends with how many are left out
    """

    path: Path
    kind: str
    about: str
    faults: list[str]
    count: int


def validate(name: str) -> Finding:
    """What is wrong with a file, given by its path or as the name of a shipped one."""
    try:
        path = _file(name)
        if _is_cycle(path):
            return _cycle(path)
        contents = read_contents(path)
        kind = _kind_of(path, contents)
    except DataError as error:
        return _finding(Path(name), "file", "", _lines(error))
    try:
        faults, about = _CHECKS.get(kind, _component)(path, contents, kind)
    except HevoptError as error:
        faults, about = _lines(error), ""
    return _finding(path, kind, about, list(dict.fromkeys(faults)))


def _finding(path: Path, kind: str, about: str, faults: list[str]) -> Finding:
    return Finding(path, kind, about, faults, len(faults))


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
    for suffix, kind in _FOLDERS.items():
        if name in shipped_names(kind, suffix):
            return find(kind, name, suffix)
    return path


def _kind_of(path: Path, contents: dict[str, Any]) -> str:
    """The kind of file that knows most of the keys; of several, the one with most of what it needs."""

    def fit(kind: str) -> tuple[int, float]:
        fields = _KINDS[kind].model_fields
        needed = [name for name, field in fields.items() if field.is_required()]
        return sum(key in fields for key in contents), -sum(key not in contents for key in needed)

    best = max(_KINDS, key=fit)
    equal = [kind for kind in _KINDS if fit(kind) == fit(best)]
    if fit(best)[0] == 0 or len(equal) > 1 or set(contents) == {"name"}:
        raise DataError(
            f"{path}: its keys are those of no known file; expected: {', '.join(_KINDS)} in TOML, or a cycle "
            "in CSV"
        )
    return best


def _architecture(path: Path, contents: dict[str, Any], kind: str) -> tuple[list[str], str]:
    faults = _table_faults(str(path), contents, MODELS[kind])
    for key in COMPONENTS:
        value = contents.get(key)
        if isinstance(value, str) or (
            isinstance(value, dict) and isinstance(value.get("file"), str)
        ):
            try:
                part = component_contents(path, key, value, {})
            except DataError as error:
                faults += _lines(error)
                continue
            faults += _table_faults(part.place, part.contents, MODELS[key])
    if faults:
        return faults, ""
    car = load_architecture(path.absolute() if path.suffix != ".toml" else path)
    return [], f"{car.name}: {car.description}" if car.description else car.name


def _component(path: Path, contents: dict[str, Any], kind: str) -> tuple[list[str], str]:
    faults = _table_faults(str(path), contents, MODELS[kind])
    if not faults:
        load_architecture(_TRIED_IN, {kind: str(path.absolute())})
    return faults, str(contents.get("name", ""))


def _compare(path: Path, contents: dict[str, Any], kind: str) -> tuple[list[str], str]:
    faults = _table_faults(str(path), contents, CompareFile)

    def names(key: str) -> list[str]:
        value = contents.get(key, [])
        return [n for n in (value if isinstance(value, list) else [value]) if isinstance(n, str)]

    for key, suffix in (("architectures", ".toml"), ("cycle", ".csv")):
        for name in names(key):
            place = beside_study(path, name, suffix)
            found = _tried(path, key, lambda p=place, s=suffix: find(_FOLDERS[s], p, s))
            faults += found or validate(place).faults
    for name in names("strategies"):
        if name != "all":
            faults += _tried(path, "strategies", lambda name=name: strategy_named(name))
    if not faults:
        faults = _tried(path, "settings", lambda: cars_of(read_study(path)))
    cars = names("architectures") or ["the shipped architectures"]
    return faults, ", ".join([*(names("cycle") or ["nedc"]), *cars])


def _sweep(path: Path, contents: dict[str, Any], kind: str) -> tuple[list[str], str]:
    study = sweep_file.read_study(path)
    return [], f"{study.architecture}, {len(study.parameters)} parameters"


_CHECKS: dict[str, Callable[[Path, dict[str, Any], str], tuple[list[str], str]]] = {
    "architecture": _architecture,
    COMPARE: _compare,
    SWEEP: _sweep,
}


def _is_cycle(path: Path) -> bool:
    if path.suffix.lower() in (".csv", ".toml"):
        return path.suffix.lower() == ".csv"
    lines = (line.strip() for line in read_text(path, _MEGABYTES_MAX).splitlines())
    header = next((line for line in lines if line and not line.startswith("#")), "")
    return "time_s" in header.split(",")


def _cycle(path: Path) -> Finding:
    found = faults_in(path)
    if found:
        left = len(found) - _LINES_LISTED
        listed = found[:_LINES_LISTED] + ([f"and {left} more"] if left > 0 else [])
        faults = [f"{path}{',' if f.startswith('line ') else ':'} {f}" for f in listed]
        return Finding(path, CYCLE, "", faults, len(found))
    cycle = load_cycle(path.absolute())
    about = (
        f"{cycle.name}: {cycle.duration_s:g} s, {cycle.distance_m / 1e3:.2f} km, up to "
        f"{cycle.speed_mps.max() * KMH_PER_MPS:.1f} km/h"
    )
    return _finding(path, CYCLE, about, [])


def _table_faults(place: str, contents: dict[str, Any], model: type[FileModel]) -> list[str]:
    return [f"{place}: {fault}" for fault in faults_of(contents, model, _KEYS_LISTED)[1]]


def _tried(path: Path, key: str, read: Callable[[], object]) -> list[str]:
    try:
        read()
    except DataError as error:
        return [f"{path}, {key}: {line}" for line in _lines(error)]
    return []


def _lines(error: HevoptError) -> list[str]:
    """The faults that an error lists, each with the file in front."""
    head, *faults = str(error).split("\n  ")
    place = head.rpartition(": ")[0]
    return [f"{place}: {fault}" for fault in faults] or [head]
