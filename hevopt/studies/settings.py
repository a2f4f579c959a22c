"""The settings of a comparison, once: keys of its study file, options and keywords all come from these fields.

Charge settings are for cars whose battery drives (any function beyond start_stop); those of A and B carry the
electric load only, and keep their own. The cost of a shift is for cars whose gear is free. What values are
allowed stands in `allowed`, which takes long to load and is needed only where settings are checked.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, NamedTuple, TypedDict

if TYPE_CHECKING:
    from hevopt.car_files.fields import AuxiliaryPower, Mass, ShiftFuel, Soc, StartFuel
    from hevopt.studies.allowed import Horizon, Names, NoxWeight, SocEnd

NEUTRAL = "neutral"
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

    strategies: "Names | None" = None
    nox_weight: "NoxWeight" = 0.0
    allow_shortfall: bool = False
    free_gear: bool = False
    refine: bool = False
    horizon_s: "Horizon | None" = None
    soc_start: "Soc | None" = None
    soc_min: "Soc | None" = None
    soc_max: "Soc | None" = None
    soc_end: "SocEnd | None" = None
    auxiliaries_w: "AuxiliaryPower | None" = None
    mass_kg: "Mass | None" = None
    start_cost_g: "StartFuel | None" = None
    shift_cost_g: "ShiftFuel | None" = None
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


class Study(NamedTuple):
    """A comparison: cycle and architectures by name or path, None for the shipped ones, and how they are solved."""

    cycle: str
    architectures: tuple[str, ...] | None
    settings: Settings
