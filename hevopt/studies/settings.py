"""Study files of `hevopt compare study.toml`: one TOML file from which a run is repeated.

    cycle = "wltc_class3b"                  a name, or a path from the file
    architectures = ["A", "./mine.toml"]    strategies = ["ecms", "dp"]
    nox_weight = 0.0        allow_shortfall = false     free_gear = false     refine = false     horizon_s = 20
    soc_start = 0.6         soc_min = 0.4               soc_max = 0.8         soc_end = "neutral"
    auxiliaries_w = 400     mass_kg = 1350              start_cost_g = 0.2    shift_cost_g = 0.05
    [set]                                   any key of an architecture or its components, by its path
    machine.power_max_w = 2e4

Every key may be left out. The command line has the same as options, which go first. Charge settings are for cars
whose battery drives (any function beyond start_stop); those of A and B carry the electric load only, and keep their
own. The cost of a shift is for cars whose gear is free.
"""

import re
import tomllib
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

from pydantic import AfterValidator, BeforeValidator, Field

from hevopt.car.architecture import Architecture
from hevopt.car_files.fields import AuxiliaryPower, Mass, ShiftFuel, Soc, StartFuel
from hevopt.car_files.load import COMPONENTS, load_architecture
from hevopt.errors import DataError
from hevopt.files.lookup import is_path, shipped_names
from hevopt.files.shown import printable, shown
from hevopt.files.toml import FileModel, checked, read_contents

NEUTRAL = "neutral"
NAMES_MAX = 1000
# Setting -> the key that it stands for.
KEYS = {
    "mass_kg": "car.mass_kg",
    "auxiliaries_w": "car.auxiliary_power_w",
    "start_cost_g": "engine.start_fuel_g",
    "shift_cost_g": "gearbox.free_gear.shift_fuel_g",
    "soc_start": "battery.soc.start",
    "soc_min": "battery.soc.min",
    "soc_max": "battery.soc.max",
    "soc_end": "battery.soc.end",
}
# Keys of files that are none of compare's, and where to give them instead.
_NAME_OR_PATH = re.compile(r"[A-Za-z_./~][\w./~ -]*")
_OTHER_FILES = {
    "coupling": "an architecture; give the file with --architectures",
    "parameters": "a study file of sweep; give the file to hevopt sweep",
}


def _soc_end(value: Any) -> Any:
    number = isinstance(value, int | float) and not isinstance(value, bool)
    if value != NEUTRAL and not (number and 0 <= value <= 1):
        raise ValueError(f'allowed: "{NEUTRAL}" (that of the start), or 0 to 1')
    return value


def _each_once(names: list[str]) -> list[str]:
    if not names:
        raise ValueError("name at least one, or leave it out for the usual ones")
    twice = [name for name, count in Counter(names).items() if count > 1]
    if twice:
        raise ValueError(f"{shown(twice[0])} is given twice; give it once")
    return names


_Names = Annotated[list[str], Field(max_length=NAMES_MAX), AfterValidator(_each_once)]


class CompareFile(FileModel):
    """What a comparison is made of; None for what is left to the default."""

    cycle: str | None = None
    architectures: _Names | None = None
    strategies: _Names | None = None
    nox_weight: Annotated[float, Field(ge=0, le=1e6)] | None = None
    allow_shortfall: bool | None = None
    free_gear: bool | None = None
    refine: bool | None = None
    horizon_s: Annotated[float, Field(ge=1e-3, le=1e6)] | None = None
    soc_start: Soc | None = None
    soc_min: Soc | None = None
    soc_max: Soc | None = None
    soc_end: Annotated[float | str | None, BeforeValidator(_soc_end)] = None
    auxiliaries_w: AuxiliaryPower | None = None
    mass_kg: Mass | None = None
    start_cost_g: StartFuel | None = None
    shift_cost_g: ShiftFuel | None = None
    set: Annotated[dict[str, Any], Field(default_factory=dict)]


@dataclass(frozen=True, slots=True)
class Settings:
    """What a comparison is made of, the file and the command line together.

    given: setting -> value, but for `set`; changes: key path -> value; file: the study file
    """

    given: Mapping[str, Any] = field(default_factory=dict)
    changes: Mapping[str, Any] = field(default_factory=dict)
    file: Path | None = None

    def get(self, name: str, default: Any) -> Any:
        """A setting, or a default where it is not given."""
        return self.given.get(name, default)

    def joined(self, over: "Settings") -> "Settings":
        """These settings with others on top."""
        kept = {k: v for k, v in self.given.items() if KEYS.get(k) not in over.changes}
        replaced = {KEYS[name] for name in over.given if name in KEYS}
        changes = {k: v for k, v in self.changes.items() if k not in replaced}
        return Settings({**kept, **over.given}, {**changes, **over.changes}, self.file or over.file)


@dataclass(frozen=True, slots=True)
class Cars:
    """The cars of a comparison; car -> what was changed in it; what was left out where it has no meaning."""

    cars: list[Architecture]
    changes: dict[str, dict[str, Any]]
    left_out: list[str]


def read_study(path: Path) -> Settings:
    """The settings of a study file, its paths taken from where it lies; DataError with every fault."""
    contents = read_contents(path)
    for key, what in _OTHER_FILES.items():
        if key in contents:
            raise DataError(f"{path}: {key} is a key of {what}")
    settings = settings_of(str(path), contents)
    given = dict(settings.given)
    if "cycle" in given:
        given["cycle"] = beside_study(path, given["cycle"], ".csv")
    if "architectures" in given:
        given["architectures"] = [beside_study(path, a, ".toml") for a in given["architectures"]]
    return Settings(given, _beside(path, settings.changes), path)


def changes_in(path: Path, contents: Mapping[str, Any]) -> dict[str, Any]:
    """Key path -> value of a study file's [set], its paths taken from where it lies."""
    table = contents.get("set")
    return _beside(path, _flat(table)) if isinstance(table, Mapping) else {}


def _beside(path: Path, changes: Mapping[str, Any]) -> dict[str, Any]:
    """Changes with the files of components taken from where the study lies."""
    changes = dict(changes)
    for key in COMPONENTS:
        if isinstance(value := changes.get(key), str):
            changes[key] = beside_study(path, value, ".toml")
    return changes


def settings_of(place: str, contents: Mapping[str, Any]) -> Settings:
    """Settings from keys and values, checked; `place` is how a message names where they stand."""
    checked(place, dict(contents), CompareFile)
    changes = _flat(contents.get("set", {}))
    given = {name: value for name, value in contents.items() if name != "set"}
    for name, key in KEYS.items():
        if name in given and key in changes:
            raise DataError(f"{place}: {name} and set {key} are one; leave one of them out")
    return Settings(given, changes)


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


def cars_of(settings: Settings, wanted: Sequence[str] | None = None) -> Cars:
    """The architectures, by default those of the settings or else the shipped ones, with the settings made in them.

    Raises DataError where a setting has a meaning for none of them.
    """
    names = settings.get("architectures", None) if wanted is None else wanted
    names = shipped_names("architectures", ".toml") if names is None else names
    cars, changes, without = [], {}, {}
    for name in names:
        car = load_architecture(name, settings.changes)
        car = car.with_free_gear() if settings.get("free_gear", False) else car
        named, left = _named_changes(settings, car)
        if named:
            car = load_architecture(name, {**settings.changes, **named})
            car = car.with_free_gear() if settings.get("free_gear", False) else car
        cars.append(car)
        changes[car.name] = {**settings.changes, **named}
        for setting in left:
            without.setdefault(setting, []).append(car.name)
    for setting, unfit in without.items():
        if len(unfit) == len(cars):
            raise DataError(f"{setting} = {settings.given[setting]}: {_why(setting, unfit)}")
    return Cars(cars, changes, [f"{setting}: {_why(setting, u)}" for setting, u in without.items()])


def _named_changes(settings: Settings, car: Architecture) -> tuple[dict[str, Any], list[str]]:
    """Key path -> value of the settings that have a meaning for a car, and the names of those without."""
    drives = bool(car.functions - {"start_stop"})
    named, left = {}, []
    for name in KEYS:
        if name not in settings.given:
            continue
        fits = {"soc": drives, "shift": car.gear == "free"}.get(name.partition("_")[0], True)
        if not drives and name == "soc_end" and settings.given[name] == NEUTRAL:
            continue  # what such a battery is anyway
        if fits:
            named[KEYS[name]] = settings.given[name]
        else:
            left.append(name)
    if named.get(KEYS["soc_end"]) == NEUTRAL:
        named[KEYS["soc_end"]] = named.get(KEYS["soc_start"], car.soc_start)
    return named, left


def _why(setting: str, cars: Sequence[str]) -> str:
    listed = printable(", ".join(cars))
    if setting == "shift_cost_g":
        return f'not for {listed}, whose gear is the cycle\'s; free it with --free-gear or gear = "free"'
    return (
        f"not for {listed}, whose battery carries the electric load only; set {KEYS[setting]} changes it "
        "all the same"
    )


def _flat(table: Mapping[str, Any], at: str = "") -> dict[str, Any]:
    """Key path -> value of nested tables; of a component given as a table, its file and what replaces its keys."""
    flat: dict[str, Any] = {}
    for key, value in table.items():
        path = f"{at}.{key}" if at else key
        leaves = {path: value}
        if isinstance(value, dict) and value:
            inner = dict(value)
            file = {path: inner.pop("file")} if path in COMPONENTS and "file" in inner else {}
            leaves = file | _flat(inner, path)
        for found, leaf in leaves.items():
            if found in flat:
                raise DataError(f"set {printable(found)} is given twice; leave one out")
            flat[found] = leaf
    return flat


def beside_study(path: Path, name: str, suffix: str) -> str:
    """A name as it stands; a path in a study file, from where that lies and still a path."""
    if not is_path(name, suffix):
        return name
    located = str(path.parent / name)
    return located if is_path(located, suffix) else f"./{located}"
