"""The file of a sweep: a car, cycles, strategies and parameters, checked in full before anything runs.

`[parameters]` gives each key path of the architecture (`machine.power_max_w`), or `nox_weight`, a list of values
or a range `{ from, to, count, log }`. A component and keys of it can both be parameters where these are quoted:
`engine = [...]` and `"engine.idle_rpm" = [...]`. Paths in the file are relative to it; names mean shipped files.
"""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field

from hevopt.architecture import Architecture, load_architecture
from hevopt.cycle import load_cycle
from hevopt.datafile import FileModel, checked, read_contents
from hevopt.errors import DataError, unknown_name
from hevopt.files import find, is_path, printable, shown
from hevopt.strategies import STRATEGIES, fitting
from hevopt.sweeps.constraints import Constraint, parse
from hevopt.sweeps.jobs import BOUND
from hevopt.sweeps.parameters import (
    DESIGNS_MAX,
    Range,
    Values,
    flattened,
    kind_of,
    parameter_faults,
    values_of,
)

_PARAMETERS_MAX = 32
_FAULTS_LISTED = 20
# The keys of the whole file that may follow a table by mistake, and so fall into it.
_OF_THE_FILE = ("architecture", "cycles", "strategies", "allow_shortfall", "constraints")
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


@dataclass(frozen=True, slots=True, eq=False)
class SweepStudy:
    """What to sweep.

    source: the study file; architecture, cycles: names of shipped files, or absolute paths
    parameters: key path of the architecture, or `nox_weight`, -> its values, in the order of the file
    sample: None for every combination
    """

    source: Path
    architecture: str
    cycles: tuple[str, ...]
    strategies: tuple[str, ...]
    allow_shortfall: bool
    parameters: Mapping[str, Values]
    sample: SampleFile | None
    constraints: tuple[Constraint, ...]


def read_study(path: str | Path) -> SweepStudy:
    """The study of a file; DataError with every fault and its place."""
    path = Path(path)
    contents = read_contents(path)
    faults = list(_misplaced(contents))
    if contents.get("parameters", {}) == {}:
        faults.append(
            "parameters: nothing to vary; add the table [parameters] with a line such as "
            "machine.power_max_w = [15e3, 18e3]"
        )
    if isinstance(contents.get("parameters"), dict):
        given = list(flattened(contents["parameters"]))
        contents["parameters"] = dict(given)
        faults += _twice("parameters", [key for key, _ in given])
    _raise(path, faults)
    data = checked(str(path), contents, StudyFile)
    parameters = _parameters(data, faults)
    architecture, car = _car(path.parent, data.architecture, faults)
    cycles = _cycles(path.parent, data.cycles, faults)
    if car is not None:
        faults += _strategy_faults(data.strategies, car)
        faults += parameter_faults(architecture, parameters)
    complete = len(parameters) == len(data.parameters)
    constraints = _constraints(data.constraints, parameters, faults) if complete else ()
    _raise(path, faults)
    return SweepStudy(
        path, architecture, cycles, tuple(data.strategies), data.allow_shortfall,
        parameters, data.sample, constraints,
    )  # fmt: skip


def _raise(path: Path, faults: Sequence[str]) -> None:
    if len(faults) == 1:
        raise DataError(f"{path}, {faults[0]}")
    if faults:
        more = len(faults) - _FAULTS_LISTED
        listed = [*faults[:_FAULTS_LISTED], *([f"and {more} more"] if more > 0 else [])]
        raise DataError(f"{path}: {len(faults)} faults\n  " + "\n  ".join(listed))


def _misplaced(contents: Mapping[str, Any]) -> Iterator[str]:
    for table in ("sample", "parameters"):
        inner = contents.get(table)
        for key in _OF_THE_FILE:
            if isinstance(inner, dict) and key in inner:
                yield f"{table}.{key}: {key} is a key of the whole file; write it above the first [table]"


def _twice(place: str, names: Sequence[str]) -> list[str]:
    twice = [name for name, count in Counter(names).items() if count > 1]
    return [f"{place}: {shown(name)} is given twice; give it once" for name in twice]


def _car(folder: Path, name: str, faults: list[str]) -> tuple[str, Architecture | None]:
    """The architecture's name or absolute path, and the car before any change."""
    try:
        located = _located("architectures", name, ".toml", folder)
        return located, load_architecture(located)
    except DataError as error:
        faults.append(f"architecture: {error}")
        return name, None


def _cycles(folder: Path, names: Sequence[str], faults: list[str]) -> tuple[str, ...]:
    """The cycles' names or absolute paths."""
    located, read = [], []
    for name in names:
        try:
            located.append(_located("cycles", name, ".csv", folder))
            read.append(load_cycle(located[-1]).name)
        except DataError as error:
            faults.append(f"cycles: {error}")
    faults += _twice("cycles", read)
    return tuple(located)


def _located(kind: str, name: str, suffix: str, folder: Path) -> str:
    if not is_path(name, suffix):
        return name
    return str(find(kind, name, suffix, beside=folder).absolute())


def _strategy_faults(names: Sequence[str], car: Architecture) -> Iterator[str]:
    known = [*fitting(car.functions, every=True), BOUND]
    for name in names:
        if name in STRATEGIES and name not in known:
            yield f"strategies: {name} does not fit {car.name}; allowed: {', '.join(known)}"
        elif name not in known:
            error = unknown_name("strategy", printable(name), known)
            yield f"strategies: {error}"
    yield from _twice("strategies", names)


def _parameters(data: StudyFile, faults: list[str]) -> dict[str, Values]:
    parameters = {}
    for key, given in data.parameters.items():
        try:
            values = parameters[key] = values_of(key, given)
        except DataError as error:
            faults.append(str(error).replace("\n  ", "; "))
            continue
        if data.sample is None and isinstance(values, Range) and values.count is None:
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
