"""Files of every kind checked in full: architectures and the components behind them, cycles, study files.

What a TOML file is, is told by its keys: the kind that knows most of them.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from difflib import get_close_matches
from pathlib import Path
from typing import Any

from hevopt.architecture import (
    COMPONENTS,
    component_contents,
    load_architecture,
    sorted_changes,
)
from hevopt.cycle import faults_in, load_cycle
from hevopt.datafile import FileModel, faults_of, read_contents
from hevopt.errors import DataError, HevoptError
from hevopt.file_schema import MODELS
from hevopt.files import find, is_path, printable, read_text, shipped_names, shown
from hevopt.keypaths import with_changes
from hevopt.strategies import strategy_named
from hevopt.study import check_horizon
from hevopt.study_file import KEYS, CompareFile, beside_study, cars_of, changes_in, read_study
from hevopt.sweeps import study_file as sweep_file
from hevopt.units import KMH_PER_MPS

COMPARE, SWEEP, CYCLE = "study file of compare", "study file of sweep", "cycle"
_KINDS: dict[str, type[FileModel]] = {
    **MODELS,
    COMPARE: CompareFile,
    SWEEP: sweep_file.StudyFile,
}
_FOLDERS = {".toml": "architectures", ".csv": "cycles"}
_SHIPPED = (
    *((folder, suffix) for suffix, folder in _FOLDERS.items()),
    ("architectures/components", ".toml"),
)
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
    names = {n: (kind, suffix) for kind, suffix in _SHIPPED for n in shipped_names(kind, suffix)}
    if name in names:
        kind, suffix = names[name]
        return find(kind, name, suffix)
    close = get_close_matches(name, names, n=3)
    hint = f"close matches: {', '.join(close)}; " if close else ""
    raise DataError(
        f"{printable(name)}: no such file, and no shipped architecture, component or cycle has that name; {hint}"
        "give the path of a file or such a name"
    )


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
        if _is_component(value := contents.get(key)):
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


def _is_component(value: Any) -> bool:
    named = isinstance(value, dict) and isinstance(value.get("file"), str)
    return isinstance(value, str) or named


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
    cars = names("architectures")
    good = not faults
    try:
        changes = changes_in(path, contents)
    except DataError as error:
        faults += [f"{path}: {line}" for line in _lines(error)]
    else:
        in_set = _set_faults(path, changes, cars)
        faults += in_set
        if good:
            if names("strategies") != ["all"]:
                faults += _tried(
                    path,
                    "strategies",
                    lambda: check_horizon(contents.get("horizon_s"), names("strategies")),
                )
            faults += _settings_faults(path, _good(path, changes, cars) if in_set else changes)
    listed = cars or ["the shipped architectures"]
    return faults, ", ".join([*(names("cycle") or ["nedc"]), *listed])


def _settings_faults(path: Path, changes: Mapping[str, Any]) -> list[str]:
    """Faults that settings have in the cars, the ones of the battery's charge together, the others one by one."""
    try:
        settings = read_study(path)
    except DataError as error:
        return _lines(error)
    groups: dict[str, list[str]] = {}
    for name in KEYS.keys() & settings.given.keys():
        groups.setdefault(name.partition("_")[0], []).append(name)
    shared = {name: value for name, value in settings.given.items() if name not in KEYS}
    faults = []
    for names in ([], *(groups[first] for first in sorted(groups))):
        given = shared | {name: settings.given[name] for name in names}
        part = replace(settings, given=given, changes=changes)
        faults += _tried(path, "settings", lambda part=part: cars_of(part))
    return list(dict.fromkeys(faults))


def _good(path: Path, changes: Mapping[str, Any], cars: Sequence[str]) -> dict[str, Any]:
    """The changes that have no fault by themselves."""
    return {k: v for k, v in changes.items() if not _set_faults(path, {k: v}, cars)}


def _set_faults(path: Path, changes: Mapping[str, Any], cars: Sequence[str]) -> list[str]:
    """What [set] makes of the cars, every fault of every component; cars with faults of their own are left out."""
    place, faults = f"{path}, set", []
    own, of_parts = sorted_changes(changes)
    if not changes:
        return []
    for name in cars or shipped_names("architectures", ".toml"):
        try:
            car = find("architectures", beside_study(path, name, ".toml"), ".toml")
            plain = read_contents(car)
            if _architecture(car, plain, "architecture")[0]:
                continue
        except DataError:
            continue
        table, found = _changed(place, plain, own, "")
        faults += found + _table_faults(place, table, MODELS["architecture"])
        for key in COMPONENTS:
            if (own.keys() & {key} or of_parts[key]) and _is_component(value := table.get(key)):
                faults += _part_faults(f"{place} {key}", car, key, value, of_parts[key])
    return list(dict.fromkeys(faults))


def _part_faults(
    place: str, car: Path, key: str, value: str | dict[str, Any], changes: Mapping[str, Any]
) -> list[str]:
    """Faults of a car's component once it is replaced or changed."""
    try:
        plain = component_contents(car, key, value, {}).contents
    except DataError as error:
        return [f"{place}: {line}" for line in _lines(error)]
    table, faults = _changed(place, plain, changes, f"{key}.")
    return faults + _table_faults(place, table, MODELS[key])


def _changed(
    place: str, table: dict[str, Any], changes: Mapping[str, Any], within: str
) -> tuple[dict[str, Any], list[str]]:
    """A table with those changes made that can be, and the faults of the others."""
    faults = []
    for key, value in changes.items():
        try:
            table = with_changes(table, {key: value}, within)
        except DataError as error:
            faults += [f"{place}: {line}" for line in _lines(error)]
    return table, faults


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
