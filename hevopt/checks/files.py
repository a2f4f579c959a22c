"""Files of every kind but studies checked in full: architectures and the components behind them, cycles.

What a TOML file is, is told by its keys: the kind that knows most of them.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeGuard

from hevopt.car_files.kinds import COMPONENTS, kind_of
from hevopt.car_files.load import component_contents, load_architecture
from hevopt.car_files.schema import MODELS
from hevopt.driving.cycle import IMPORT, faults_in, load_cycle
from hevopt.errors import DataError, Fault
from hevopt.files.lookup import read_text
from hevopt.files.toml import FileModel, faults_of, read_contents
from hevopt.measured.tables.table import columns_found, read_measured
from hevopt.studies.given import CompareFile
from hevopt.sweeps.plan.study_file import StudyFile
from hevopt.units import KMH_PER_MPS

ARCHITECTURE, CYCLE = "architecture", "cycle"
COMPARE, SWEEP = "study file of compare", "study file of sweep"
_KINDS: dict[str, type[FileModel]] = {**MODELS, COMPARE: CompareFile, SWEEP: StudyFile}
_LINES_LISTED = 20
_MEGABYTES_MAX = 50
_KEYS_LISTED = 200
# A shipped car in which a component is tried out; a gearbox in one that takes a torque converter as well.
_TRIED_IN, _GEARBOX_IN = "C2", "C1"


@dataclass(frozen=True, slots=True)
class Finding:
    """What a file is, in words, and its faults, each with file, key path or line, value and what is allowed.

    count: how many there are; beyond some tens of lines of a cycle, `faults` ends with how many are left out
    advice: what to do about all of them, or ''
    """

    path: Path
    kind: str
    about: str
    faults: list[str]
    count: int
    advice: str = ""


def finding(path: Path, kind: str, about: str, faults: list[str]) -> Finding:
    """A finding whose faults are all listed."""
    return Finding(path, kind, about, faults, len(faults))


def kind_and_contents(path: Path) -> tuple[str, dict[str, Any]]:
    """The kind of a file, and its keys and values unless it is a cycle."""
    try:
        if _is_cycle(path):
            return CYCLE, {}
        contents = read_contents(path)
    except DataError as error:
        raise _of_measured(path) or error from None
    return _kind_of(path, contents), contents


def _of_measured(path: Path) -> DataError | None:
    """What to say of a measured table, such as a logged drive, given where a file of hevopt is expected."""
    if path.suffix.lower() == ".toml":
        return None
    try:
        measured = read_measured(path)
    except DataError:
        return None
    if len(measured.columns) < 2 or len(measured.lines) < 2:
        return None
    return DataError(
        f"{path}: a table ({columns_found(measured)}), neither TOML nor a cycle file; {IMPORT}; measured maps by "
        "`hevopt maps import`, coast-downs by `hevopt coastdown`"
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


def _is_cycle(path: Path) -> bool:
    if path.suffix.lower() in (".csv", ".toml"):
        return path.suffix.lower() == ".csv"
    lines = (line.strip() for line in read_text(path, _MEGABYTES_MAX).splitlines())
    header = next((line for line in lines if line and not line.startswith("#")), "")
    return "time_s" in header.split(",")


def architecture_faults(path: Path, contents: dict[str, Any], kind: str) -> tuple[list[str], str]:
    """Faults of an architecture and of its components, and what it is about."""
    faults = table_faults(str(path), contents, MODELS[kind])
    for key in COMPONENTS:
        if is_component(value := contents.get(key)):
            try:
                part = component_contents(path, key, value, {})
            except DataError as error:
                faults += error.listed
                continue
            faults += table_faults(part.place, part.contents, MODELS[kind_of(key)])
    if faults:
        return faults, ""
    car = load_architecture(path.absolute() if path.suffix != ".toml" else path)
    return [], f"{car.name}: {car.description}" if car.description else car.name


def is_component(value: Any) -> TypeGuard[str | dict[str, Any]]:
    """Whether a value names the file of a component."""
    named = isinstance(value, dict) and isinstance(value.get("file"), str)
    return isinstance(value, str) or named


def component_faults(path: Path, contents: dict[str, Any], kind: str) -> tuple[list[str], str]:
    """Faults of a component by itself and, without any, in a shipped car; what it is about.

    No shipped car has a source, of which its own file says everything.
    """
    faults = table_faults(str(path), contents, MODELS[kind])
    if not faults and kind != "source":
        car = _GEARBOX_IN if kind == "gearbox" else _TRIED_IN
        load_architecture(car, {kind: str(path.absolute())})
    return faults, str(contents.get("name", ""))


def cycle_finding(path: Path) -> Finding:
    """What is wrong with a cycle, in its first lines, or how long it is."""
    found = faults_in(path)
    if found:
        left = len(found) - _LINES_LISTED
        faults = [
            *map(str, found[:_LINES_LISTED]),
            *([f"{path}: and {left} more"] if left > 0 else []),
        ]
        advice = IMPORT if any(isinstance(fault, Fault) for fault in found) else ""
        return Finding(path, CYCLE, "", faults, len(found), advice)
    cycle = load_cycle(path.absolute())
    about = (
        f"{cycle.name}: {cycle.duration_s:g} s, {cycle.distance_m / 1e3:.2f} km, up to "
        f"{cycle.speed_mps.max() * KMH_PER_MPS:.1f} km/h"
    )
    return finding(path, CYCLE, about, [])


def table_faults(place: str, contents: dict[str, Any], model: type[FileModel]) -> list[str]:
    """Faults of a table, each with `place` in front."""
    count, faults = faults_of(contents, model, _KEYS_LISTED)
    return DataError.of(place, faults, count).listed if faults else []


def tried(path: Path, key: str, read: Callable[[], object]) -> list[str]:
    """Faults of a key of a file, told by an error of `read`."""
    try:
        read()
    except DataError as error:
        return [f"{path}, {key}: {line}" for line in error.listed]
    return []
