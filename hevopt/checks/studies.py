"""Study files of compare and sweep checked in full, with every file that they name."""

from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from hevopt.car_files.kinds import COMPONENTS, kind_of
from hevopt.car_files.load import component_contents, sorted_changes
from hevopt.car_files.schema import MODELS
from hevopt.checks.files import (
    ARCHITECTURE,
    CYCLE,
    architecture_faults,
    cycle_finding,
    is_component,
    kind_and_contents,
    table_faults,
    tried,
)
from hevopt.errors import DataError, HevoptError
from hevopt.files.keypaths import with_changes
from hevopt.files.lookup import find, shipped_names
from hevopt.files.shown import printable
from hevopt.files.toml import read_contents
from hevopt.strategies import chosen, strategy_named
from hevopt.strategies.brought import is_reference, located
from hevopt.studies.allowed import NAMES_MAX
from hevopt.studies.cars import cars_of
from hevopt.studies.given import CompareFile, study_of
from hevopt.studies.settings import KEYS
from hevopt.studies.solved import EVERY, check_horizon
from hevopt.studies.study_file import beside_study, changes_in, read_study
from hevopt.sweeps.plan.brought import check_defined
from hevopt.sweeps.plan.study_file import study_and_faults


def compare_faults(path: Path, contents: dict[str, Any], kind: str) -> tuple[list[str], str]:
    """Faults of a study of compare and of the files it names, and what it is about."""
    faults = table_faults(str(path), contents, CompareFile)

    def names(key: str) -> list[str]:
        value = contents.get(key, [])
        given = [n for n in (value if isinstance(value, list) else [value]) if isinstance(n, str)]
        return list(dict.fromkeys(given))

    for key, wanted in (("architectures", ARCHITECTURE), ("cycle", CYCLE)):
        for name in names(key)[:NAMES_MAX]:
            faults += _named_faults(path, key, name, wanted)
    for name in names("strategies"):
        if name != EVERY:
            faults += tried(path, "strategies", partial(_check_strategy, name, path.parent))
    cars = names("architectures")
    good = not faults
    try:
        changes = changes_in(path, contents)
    except DataError as error:
        faults += [f"{path}: {line}" for line in error.listed]
    else:
        in_set = _set_faults(path, changes, cars)
        faults += in_set
        if good:
            if names("strategies") != [EVERY]:
                found = partial(
                    _check_preview, contents.get("horizon_s"), names("strategies"), path
                )
                faults += tried(path, "strategies", found)
            faults += _settings_faults(path, _good(path, changes, cars) if in_set else changes)
    listed = cars or ["the shipped architectures"]
    return faults, ", ".join([*(names("cycle") or ["nedc"]), *listed])


def _check_strategy(name: str, folder: Path) -> None:
    """DataError for a strategy that there is not, or a function that its file does not have."""
    if is_reference(name):
        check_defined(located(name, folder))
    else:
        strategy_named(name)


def _check_preview(horizon_s: float | None, wanted: list[str], path: Path) -> None:
    """DataError for a preview that none of a study's strategies takes."""
    check_horizon(horizon_s, wanted, chosen(wanted, path.parent)[1])


def _named_faults(study: Path, key: str, name: str, wanted: str) -> list[str]:
    """Faults of a file that a study names, read as the kind that is wanted there and never as another."""
    folder, suffix = ("cycles", ".csv") if wanted == CYCLE else ("architectures", ".toml")
    try:
        path = find(folder, beside_study(study, name, suffix), suffix)
    except DataError as error:
        return [f"{study}, {key}: {line}" for line in error.listed]
    try:
        if wanted == CYCLE and path.suffix.lower() != ".toml":
            return cycle_finding(path).faults
        kind, contents = kind_and_contents(path)
        if kind == wanted:
            return architecture_faults(path, contents, kind)[0]
    except HevoptError as error:
        return error.listed
    return [
        f"{study}, {key}: {printable(name)} is no {wanted} but of the kind {kind}; give the file of one"
    ]


def _settings_faults(path: Path, changes: Mapping[str, Any]) -> list[str]:
    """Faults that settings have in the cars, the ones of the battery's charge together, the others one by one."""
    try:
        given = read_study(path)
    except DataError as error:
        return error.listed
    groups: dict[str, list[str]] = {}
    for name in KEYS.keys() & given.keys():
        groups.setdefault(name.partition("_")[0], []).append(name)
    shared = {n: value for n, value in given.items() if n not in KEYS} | {"set": changes}
    faults = []
    for names in ([], *(groups[first] for first in sorted(groups))):
        part = study_of(shared | {name: given[name] for name in names})
        faults += tried(path, "settings", partial(cars_of, part.architectures, part.settings))
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
            if architecture_faults(car, plain, ARCHITECTURE)[0]:
                continue
        except DataError:
            continue
        table, found = _changed(place, plain, own, "")
        faults += found + table_faults(place, table, MODELS[ARCHITECTURE])
        for key in COMPONENTS:
            if (own.keys() & {key} or of_parts[key]) and is_component(value := table.get(key)):
                faults += _part_faults(f"{place} {key}", car, key, value, of_parts[key])
    return list(dict.fromkeys(faults))


def _part_faults(
    place: str, car: Path, key: str, value: str | dict[str, Any], changes: Mapping[str, Any]
) -> list[str]:
    """Faults of a car's component once it is replaced or changed."""
    try:
        plain = component_contents(car, key, value, {}).contents
    except DataError as error:
        return [f"{place}: {line}" for line in error.listed]
    table, faults = _changed(place, plain, changes, f"{key}.")
    return faults + table_faults(place, table, MODELS[kind_of(key)])


def _changed(
    place: str, table: dict[str, Any], changes: Mapping[str, Any], within: str
) -> tuple[dict[str, Any], list[str]]:
    """A table with those changes made that can be, and the faults of the others."""
    faults = []
    for key, value in changes.items():
        try:
            table = with_changes(table, {key: value}, within)
        except DataError as error:
            faults += [f"{place}: {line}" for line in error.listed]
    return table, faults


def sweep_faults(path: Path, contents: dict[str, Any], kind: str) -> tuple[list[str], str]:
    """Faults of a study of sweep, and what it is about."""
    study, faults = study_and_faults(path)
    about = f"{study.architecture}, {len(study.parameters)} parameters" if study else ""
    return [f"{path}: {fault}" for fault in faults], about
