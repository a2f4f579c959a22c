"""The settings of a comparison, once: keys of its study file, options and keywords all come from these fields.

Charge settings are for cars whose battery drives (any function beyond start_stop); those of A and B carry the
electric load only, and keep their own. The cost of a shift is for cars whose gear is free.
"""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from numbers import Real
from typing import Annotated, Any, Literal, NamedTuple, TypedDict, get_type_hints

import numpy as np
from pydantic import AfterValidator, BeforeValidator, Field, Strict, create_model

from hevopt.car_files.fields import AuxiliaryPower, Mass, ShiftFuel, Soc, StartFuel
from hevopt.car_files.kinds import COMPONENTS
from hevopt.errors import DataError, unknown_name
from hevopt.files.shown import printable, shown
from hevopt.files.toml import FileModel, checked

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


def _soc_end(value: Any) -> Any:
    number = isinstance(value, int | float) and not isinstance(value, bool)
    if value != NEUTRAL and not (number and 0 <= value <= 1):
        raise ValueError(f'allowed: "{NEUTRAL}" (that of the start), or 0 to 1')
    return value


def _each_once(names: tuple[str, ...]) -> tuple[str, ...]:
    if not names:
        raise ValueError("name at least one, or leave it out for the usual ones")
    twice = [name for name, count in Counter(names).items() if count > 1]
    if twice:
        raise ValueError(f"{shown(twice[0])} is given twice; give it once")
    return names


Names = Annotated[
    tuple[str, ...], Strict(False), Field(max_length=NAMES_MAX), AfterValidator(_each_once)
]
SocEnd = Annotated[float | Literal["neutral"], BeforeValidator(_soc_end)]


@dataclass(frozen=True, slots=True, kw_only=True)
class Settings:
    """How a comparison changes its cars and solves them. None: as the car's files, or the strategy, have it.

    strategies: by name, ("all",) for every one that fits a car; None: the usual ones that fit
    nox_weight: kg of fuel that a kg of NOx counts
    allow_shortfall: drive on where a car cannot follow; free_gear: the engine's gear is a choice
    refine: add torque levels around dynamic programming's plan until its cost settles
    horizon_s: preview of the predictive strategies
    soc_start, soc_min, soc_max, soc_end: state of charge at the start, its window, the least at the end ("neutral":
    that of the start)
    auxiliaries_w: electric load; mass_kg: the car without the parts of the hybrid
    start_cost_g, shift_cost_g: fuel of an engine start, and what a change of a free gear counts
    changes: key path -> value in every architecture that is read, the [set] of a study file
    """

    strategies: Names | None = None
    nox_weight: Annotated[float, Field(ge=0, le=1e6)] = 0.0
    allow_shortfall: bool = False
    free_gear: bool = False
    refine: bool = False
    horizon_s: Annotated[float, Field(ge=1e-3, le=1e6)] | None = None
    soc_start: Soc | None = None
    soc_min: Soc | None = None
    soc_max: Soc | None = None
    soc_end: SocEnd | None = None
    auxiliaries_w: AuxiliaryPower | None = None
    mass_kg: Mass | None = None
    start_cost_g: StartFuel | None = None
    shift_cost_g: ShiftFuel | None = None
    changes: Mapping[str, Any] = field(default_factory=dict)


class Keywords(TypedDict, total=False):
    """The settings that functions take as keywords beside the strategies; a test holds them to `Settings`."""

    nox_weight: float
    allow_shortfall: bool
    free_gear: bool
    refine: bool
    horizon_s: float | None
    soc_start: float | None
    soc_min: float | None
    soc_max: float | None
    soc_end: float | str | None
    auxiliaries_w: float | None
    mass_kg: float | None
    start_cost_g: float | None
    shift_cost_g: float | None
    changes: Mapping[str, Any] | None


def _file_fields() -> dict[str, Any]:
    """Key of a study file -> its type and default: those of the settings, changes as the table [set]."""
    hints = get_type_hints(Settings, include_extras=True)
    own = {f.name: (hints[f.name], f.default) for f in fields(Settings) if f.name != "changes"}
    return own | {"set": (dict[str, Any], Field(default_factory=dict))}


CompareFile = create_model(
    "CompareFile",
    __base__=FileModel,
    __doc__="A study file of compare: cycle, architectures, and a key for every setting.",
    cycle=(str, "nedc"),
    architectures=(Names | None, None),
    **_file_fields(),
)


def given_of(place: str, contents: Mapping[str, Any]) -> dict[str, Any]:
    """Keys and values of a study as they are given, checked, its `set` as key path -> value.

    `place` is how a message names where they stand. DataError with every fault.
    """
    checked(place, dict(contents), CompareFile)
    changes = flat_changes(contents.get("set", {}))
    for name, key in KEYS.items():
        if name in contents and key in changes:
            raise DataError(f"{place}: {name} and set {key} are one; leave one of them out")
    return {**contents, "set": changes}


def joined(below: Mapping[str, Any], over: Mapping[str, Any]) -> dict[str, Any]:
    """What two places give, both as `given_of` has it, the second on top."""
    kept = {name: value for name, value in below.items() if KEYS.get(name) not in over["set"]}
    replaced = {KEYS[name] for name in over if name in KEYS}
    changes = {key: value for key, value in below["set"].items() if key not in replaced}
    return {**kept, **over, "set": {**changes, **over["set"]}}


class Study(NamedTuple):
    """A comparison: cycle and architectures by name or path, None for the shipped ones, and how they are solved."""

    cycle: str
    architectures: tuple[str, ...] | None
    settings: Settings


def study_of(given: Mapping[str, Any]) -> Study:
    """The comparison of what is given, as `given_of` has it, and the default of what is not."""
    file: Any = CompareFile.model_validate(dict(given))
    own = {f.name: getattr(file, f.name) for f in fields(Settings) if f.name != "changes"}
    return Study(file.cycle, file.architectures, Settings(**own, changes=file.set))


def settings_from(place: str, keywords: Mapping[str, Any], **own: Any) -> Settings:
    """Settings of a function's keywords, and of what that function knows itself; None is what is not given.

    place: names the function. DataError for a keyword that is no setting, with those that are, and a wrong value.
    """
    known = list(Keywords.__annotations__)
    for name in keywords:
        if name not in known:
            raise DataError(f"{place}: {unknown_name('setting', printable(name), known)}")
    given = {
        name: _plain(value) for name, value in {**keywords, **own}.items() if value is not None
    }
    changes = given.pop("changes", {})
    if not isinstance(changes, Mapping):
        raise DataError(
            f"{place}: changes = {shown(changes)}; needed: a mapping of key path to value"
        )
    return study_of(given_of(place, {**given, "set": dict(changes)})).settings


def _plain(value: Any) -> Any:
    """A number of NumPy as Python's own; everything else as it is."""
    return value.item() if isinstance(value, Real | np.bool_) and hasattr(value, "item") else value


def flat_changes(table: Mapping[str, Any], at: str = "") -> dict[str, Any]:
    """Key path -> value of nested tables; of a component given as a table, its file and what replaces its keys."""
    flat: dict[str, Any] = {}
    for key, value in table.items():
        path = f"{at}.{key}" if at else key
        leaves = {path: value}
        if isinstance(value, dict) and value:
            inner = dict(value)
            file = {path: inner.pop("file")} if path in COMPONENTS and "file" in inner else {}
            leaves = file | flat_changes(inner, path)
        for found, leaf in leaves.items():
            if found in flat:
                raise DataError(f"set {printable(found)} is given twice; leave one out")
            flat[found] = leaf
    return flat
