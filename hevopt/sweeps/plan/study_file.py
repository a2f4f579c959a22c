"""The file of a sweep: a car, cycles, strategies and parameters, checked in full before anything runs.

`[parameters]` gives each key path of the architecture (`machine.power_max_w`), or `nox_weight`, a list of values
or a range `{ from, to, count, log }`. A component and keys of it can both be parameters where these are quoted:
`engine = [...]` and `"engine.idle_rpm" = [...]`. `[derived]` gives further keys as expressions of the parameters,
`battery.parallel = "round(machine.scale.power)"`, in the grammar of constraints. A strategy of one's own is named
by FILE.py:FUNCTION or MODULE:FUNCTION, which every worker runs. Paths in the file are relative to it; names mean
shipped files.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field

from hevopt.car.architecture import Architecture
from hevopt.car_files.kinds import COMPONENTS
from hevopt.car_files.load import load_architecture
from hevopt.driving.cycle import load_cycle
from hevopt.errors import DataError
from hevopt.files.lookup import find, is_path
from hevopt.files.shown import printable, shown
from hevopt.files.toml import FileModel, faults_of, good_keys, read_contents
from hevopt.sweeps.plan.brought import brought_of
from hevopt.sweeps.plan.constraints import Constraint, Expression, expression, parse
from hevopt.sweeps.plan.jobs import BOUND, NOX_WEIGHT, Brought
from hevopt.sweeps.plan.parameters import (
    DESIGNS_MAX,
    Range,
    Values,
    flattened,
    kind_of,
    parameter_faults,
    values_of,
)

_PARAMETERS_MAX = 32
_FAULTS_LISTED, _MODEL_FAULTS = 20, 200
# The keys of the whole file that may follow a table by mistake, and so fall into it.
_OF_THE_FILE = ("architecture", "cycles", "strategies", "allow_shortfall", "constraints")
_TABLES = ("sample", "parameters", "derived")
_Names = Annotated[list[str], Field(min_length=1, max_length=1000)]


class SampleFile(FileModel):
    """A sample of the designs in place of every combination."""

    method: Literal["sobol", "latin_hypercube"]
    count: Annotated[int, Field(ge=1, le=DESIGNS_MAX)]
    seed: Annotated[int, Field(ge=0, le=2**32 - 1)] = 0


class StudyFile(FileModel):
    architecture: str
    cycles: _Names
    strategies: _Names
    allow_shortfall: bool = False
    parameters: Annotated[dict[str, Any], Field(max_length=_PARAMETERS_MAX)]
    sample: SampleFile | None = None
    constraints: Annotated[list[str], Field(default_factory=list, max_length=1000)]
    derived: Annotated[dict[str, Any], Field(default_factory=dict, max_length=_PARAMETERS_MAX)]


@dataclass(frozen=True, slots=True, eq=False)
class SweepStudy:
    """What to sweep.

    source: the study file; architecture, cycles: names of shipped files, or absolute paths
    parameters: key path of the architecture, or `nox_weight`, -> its values, in order and as written
    sample: None for every combination
    brought: name -> what a worker needs of a strategy from outside; files: in which these stand
    derived: key path of the architecture -> what follows from the parameters
    """

    source: Path
    architecture: str
    cycles: tuple[str, ...]
    strategies: tuple[str, ...]
    allow_shortfall: bool
    parameters: Mapping[str, Values]
    sample: SampleFile | None
    constraints: tuple[Constraint, ...]
    brought: Mapping[str, Brought]
    files: tuple[Path, ...]
    derived: Mapping[str, Expression] = field(default_factory=dict)


def read_study(path: str | Path) -> SweepStudy:
    """The study of a file; DataError with its faults, each with its place."""
    study, faults = study_and_faults(Path(path))
    _raise(Path(path), faults)
    assert study is not None  # without a fault there is one
    return study


def study_and_faults(path: Path) -> tuple[SweepStudy | None, list[str]]:
    """The study of a file, None where it has faults, and every fault, those beside wrong keys as well."""
    return contents_and_faults(path, read_contents(path))


def contents_and_faults(
    path: Path, contents: dict[str, Any], *, open_ranges: bool = False
) -> tuple[SweepStudy | None, list[str]]:
    """The same of contents that are read already; open_ranges: whether a range needs no count."""
    faults = _without_misplaced(contents)
    faults += _with_flat_parameters(contents)
    count, in_model = faults_of(contents, StudyFile, _MODEL_FAULTS)
    faults += in_model + ([f"and {count - len(in_model)} more"] if count > len(in_model) else [])
    good, folder = good_keys(contents, StudyFile), path.parent
    parameters = _parameters(
        good.get("parameters", {}), open_ranges or "sample" in contents, faults
    )
    architecture, car = _car(folder, good.get("architecture"), faults)
    cycles = _cycles(folder, good.get("cycles", ()), faults)
    strategies = good.get("strategies", ())
    brought, files, found = brought_of(dict.fromkeys(strategies), folder, car, [BOUND])
    faults += found + _twice("strategies", strategies)
    if car is not None:

        def load(changes: Mapping[str, Any]) -> Architecture:
            return load_architecture(architecture, located_changes(folder, changes))

        faults += parameter_faults(load, parameters)
    constraints: tuple[Constraint, ...] = ()
    derived: dict[str, Expression] = {}
    if parameters and len(parameters) == len(contents["parameters"]):
        constraints = _constraints(good.get("constraints", ()), parameters, faults)
        derived = derived_of(good.get("derived", {}), parameters, faults)
    if faults:
        return None, list(dict.fromkeys(faults))
    data = StudyFile.model_validate(contents)
    return SweepStudy(
        path, architecture, cycles, tuple(data.strategies), data.allow_shortfall,
        parameters, data.sample, constraints, brought, tuple(files), derived,
    ), []  # fmt: skip


def located_changes(folder: Path, changes: Mapping[str, Any]) -> dict[str, Any]:
    """Key path -> value with the paths of components taken from the folder of the study."""
    return {
        key: str((folder / value).absolute())
        if key in COMPONENTS and isinstance(value, str) and is_path(value, ".toml")
        else value
        for key, value in changes.items()
    }


def _raise(path: Path, faults: Sequence[str]) -> None:
    if len(faults) == 1:
        raise DataError(f"{path}, {faults[0]}")
    if faults:
        raise DataError.of(str(path), faults[:_FAULTS_LISTED], len(faults))


def _without_misplaced(contents: dict[str, Any]) -> list[str]:
    """Take keys of the whole file out of the tables that they fell into; a fault for each."""
    faults = []
    for table in _TABLES:
        inner = contents.get(table)
        if not isinstance(inner, dict):
            continue
        for key in [key for key in _OF_THE_FILE if key in inner]:
            faults.append(
                f"{table}.{key}: {key} is a key of the whole file; write it above the first [table]"
            )
            contents.setdefault(key, inner.pop(key))
    return faults


def _with_flat_parameters(contents: dict[str, Any]) -> list[str]:
    """Make the parameters key paths and their values; the faults in that."""
    tables = contents.setdefault("parameters", {})
    if not isinstance(tables, dict):
        return []
    given = list(flattened(tables))
    contents["parameters"] = dict(given)
    if given:
        return _twice("parameters", [key for key, _ in given])
    return [
        "parameters: nothing to vary; add the table [parameters] with a line such as "
        "machine.power_max_w = [15e3, 18e3]"
    ]


def _twice(place: str, names: Sequence[str]) -> list[str]:
    twice = [name for name, count in Counter(names).items() if count > 1]
    return [f"{place}: {shown(name)} is given twice; give it once" for name in twice]


def _car(folder: Path, name: str | None, faults: list[str]) -> tuple[str, Architecture | None]:
    """The architecture's name or absolute path, and the car before any change, None where it has faults."""
    if name is None:
        return "", None
    try:
        located = _located("architectures", name, ".toml", folder)
        return located, load_architecture(located)
    except DataError as error:
        faults.append(f"architecture: {error}")
        return name, None


def _cycles(folder: Path, names: Sequence[str], faults: list[str]) -> tuple[str, ...]:
    """The cycles' names or absolute paths."""
    located: list[str] = []
    by_name: dict[str, dict[str, str]] = {}
    for name in names:
        try:
            located.append(_located("cycles", name, ".csv", folder))
            by_name.setdefault(load_cycle(located[-1]).name, {})[located[-1]] = name
        except DataError as error:
            faults.append(f"cycles: {error}")
    faults += _twice("cycles", names)
    for name, files in by_name.items():
        if len(files) > 1:
            listed = ", ".join(printable(given) for given in files.values())
            faults.append(
                f"cycles: {len(files)} files have the name {shown(name)}: {listed}; results are told apart by "
                "it: rename a file, or leave one out"
            )
    return tuple(located)


def _located(kind: str, name: str, suffix: str, folder: Path) -> str:
    if not is_path(name, suffix):
        return name
    return str(find(kind, name, suffix, beside=folder).absolute())


def _parameters(given: Mapping[str, Any], sampled: bool, faults: list[str]) -> dict[str, Values]:
    parameters = {}
    for key, value in given.items():
        try:
            values = parameters[key] = values_of(key, value)
        except DataError as error:
            faults += error.listed
            continue
        if not sampled and isinstance(values, Range) and values.count is None:
            faults.append(
                f"parameters.{printable(key)}: count is missing; say how many values to take, or add the "
                "table [sample]"
            )
    return parameters


def _constraints(
    texts: Sequence[str], parameters: Mapping[str, Values], faults: list[str]
) -> tuple[Constraint, ...]:
    kinds = {key: kind_of(values) for key, values in parameters.items()}
    read = []
    for text in texts:
        try:
            read.append(parse(text, kinds))
        except DataError as error:
            faults.append(f"constraints: {error}")
    return tuple(read)


def derived_of(
    given: Mapping[str, Any], parameters: Mapping[str, Values], faults: list[str]
) -> dict[str, Expression]:
    """Key path -> expression of the table [derived]; what is wrong with it is added to `faults`."""
    kinds = {key: kind_of(values) for key, values in parameters.items()}
    found = {}
    for key, text in flattened(given):
        place = f"derived.{printable(key)}"
        if not isinstance(text, str):
            faults.append(
                f'{place} = {shown(text)}: an expression in quotes is needed, such as "2 * {next(iter(kinds))}"'
            )
        elif key in parameters or key == NOX_WEIGHT:
            faults.append(
                f"{place}: {'a parameter as well; leave one out' if key in parameters else 'no key of a car'}"
            )
        else:
            try:
                found[key] = expression(text, kinds)
            except DataError as error:
                faults.append(f"{place}: {error}")
    return found
