"""What an architecture's file may say of the driveline: a kind, which stands for parts, or the parts themselves."""

from typing import Annotated, Literal, Self, get_args

from pydantic import ConfigDict, Field, model_validator

from hevopt.car.templates import CouplingKind
from hevopt.car_files.fields import (
    Fraction,
    KeysOfKind,
    List,
    Name,
    Number,
    Ratio,
    Shape,
    ShiftFuel,
)
from hevopt.files.toml import FileModel

PartKind = Literal[
    "gear", "gearbox", "clutch", "one_way_clutch", "planetary", "shaft_brake", "torque_converter"
]
Ratios = Annotated[list[Ratio], Field(min_length=1, max_length=20)]
GearNumbers = Annotated[
    list[Annotated[int, Field(ge=1, le=20)]], Field(min_length=1, max_length=20)
]

_KEYS_OF_PART = KeysOfKind(
    {
        "gear": {"first", "second", "ratio"},
        "gearbox": {"first", "second"},
        "clutch": {"first", "second", "operation"},
        "one_way_clutch": {"first"},
        "planetary": {"sun", "ring", "carrier", "ratio"},
        "shaft_brake": {"first"},
        "torque_converter": {"first", "second"},
    },
    {
        "gear": {"efficiency", "speed_max_rpm"},
        "gearbox": {"ratios", "efficiency", "shift_fuel_g", "gears", "preselected"},
        "one_way_clutch": {"second"},
        "planetary": {"efficiency"},
    },
)


class PartFile(FileModel):
    """A part that joins shafts."""

    model_config = ConfigDict(json_schema_extra=_KEYS_OF_PART.schema())

    kind: PartKind
    name: Name
    first: Name | None = None
    second: Name | None = None
    sun: Name | None = None
    ring: Name | None = None
    carrier: Name | None = None
    ratio: Ratio | None = None
    ratios: Ratios | None = None
    efficiency: Annotated[Annotated[Fraction, Number] | Annotated[list[Fraction], List], Shape] = (
        1.0
    )
    speed_max_rpm: Annotated[float, Field(ge=1, le=1e6)] | None = None
    gears: GearNumbers | None = None
    preselected: bool = False
    operation: Literal["driver", "strategy"] | None = None
    shift_fuel_g: ShiftFuel = 0.0

    @model_validator(mode="after")
    def _keys_of_kind(self) -> Self:
        given = self.model_fields_set
        _KEYS_OF_PART.check(self.kind, given - {"kind", "name"})
        listed = sorted(given & {"gears", "preselected"})
        if self.ratios is not None and listed:
            raise ValueError(f"with ratios of its own it does not use {', '.join(listed)}")
        if self.kind == "gearbox" and self.ratios is None and "efficiency" in given:
            raise ValueError("without ratios the efficiency is that of the architecture's gearbox")
        if "shift_fuel_g" in given and self.ratios is None and not self.preselected:
            raise ValueError("shift_fuel_g is of gears that the strategy chooses; these are listed")
        if self.preselected and self.gears is None:
            raise ValueError("preselected needs gears, those among the architecture's gearbox")
        if isinstance(self.efficiency, list) and self.ratios is None:
            raise ValueError("one efficiency is needed, as there is one ratio")
        if isinstance(self.efficiency, list) and len(self.efficiency) != len(self.ratios or ()):
            raise ValueError(
                f"efficiency has {len(self.efficiency)} values; ratios has {len(self.ratios or ())}"
            )
        return self

    @property
    def efficiencies(self) -> tuple[float, ...]:
        """One for all its gears, or one per gear."""
        return (self.efficiency,) if isinstance(self.efficiency, float) else tuple(self.efficiency)


class StateFile(FileModel):
    """What is closed together, everything else that the strategy closes being open."""

    closed: Annotated[list[Name], Field(max_length=40)]
    engine: Literal["on", "off"] | None = None


_KEYS_OF_KIND = KeysOfKind(
    {kind: set() for kind in get_args(CouplingKind)}
    | {
        "gearbox_input": {"second_clutch"},
        "gearbox_output": {"machine_ratio", "machine_efficiency"},
        "power_split": {"planetary_ratio", "final_drive_ratio"},
        "series": {"final_drive_ratio"},
        "electric": {"final_drive_ratio"},
        "series_parallel": {"final_drive_ratio", "lock_up_ratio"},
        "belt_and_axle": {"axle_ratio"},
        "parts": {"parts"},
    },
    {
        "gearbox_output": {"disconnects_above_speed_max"},
        "even_shaft": {"machine_shift_fuel_g"},
        "power_split": {"planetary_efficiency", "final_drive_efficiency"},
        "series": {"final_drive_efficiency"},
        "electric": {"final_drive_efficiency"},
        "series_parallel": {"final_drive_efficiency", "lock_up_efficiency"},
        "belt_and_axle": {"axle_efficiency"},
        "parts": {
            "engine_shaft",
            "machine_shaft",
            "machine_2_shaft",
            "machine_3_shaft",
            "states",
            "follows_load",
        },
    },
)


class CouplingFile(FileModel):
    """How engine and machines join the wheels."""

    model_config = ConfigDict(json_schema_extra=_KEYS_OF_KIND.schema())

    kind: CouplingKind
    second_clutch: bool | None = None
    machine_ratio: Ratio | None = None
    machine_efficiency: Fraction | None = None
    disconnects_above_speed_max: bool = False
    machine_shift_fuel_g: Annotated[float, Field(ge=0, le=10)] = 0.0
    planetary_ratio: Ratio | None = None
    planetary_efficiency: Fraction = 1.0
    final_drive_ratio: Ratio | None = None
    final_drive_efficiency: Fraction = 1.0
    lock_up_ratio: Ratio | None = None
    lock_up_efficiency: Fraction = 1.0
    axle_ratio: Ratio | None = None
    axle_efficiency: Fraction = 1.0
    engine_shaft: Name | None = None
    machine_shaft: Name | None = None
    machine_2_shaft: Name | None = None
    machine_3_shaft: Name | None = None
    follows_load: bool = False
    parts: Annotated[list[PartFile], Field(min_length=1, max_length=40)] | None = None
    states: Annotated[list[StateFile], Field(min_length=1, max_length=100)] | None = None

    @model_validator(mode="after")
    def _keys_of_kind(self) -> Self:
        _KEYS_OF_KIND.check(self.kind, self.model_fields_set - {"kind"})
        names = [part.name for part in self.parts or ()]
        if twice := sorted({name for name in names if names.count(name) > 1}):
            raise ValueError(f"parts: two are called {', '.join(twice)}; give each its own name")
        return self

    @property
    def engine_apart(self) -> bool:
        """Whether the parts leave the engine alone on its shaft with one machine."""
        ends = {
            end for p in self.parts or () for end in (p.first, p.second, p.sun, p.ring, p.carrier)
        }
        beside = [name for name, shaft in self.shafts.items() if shaft == self.engine_shaft]
        return self.engine_shaft is not None and self.engine_shaft not in ends and len(beside) == 2

    @property
    def shafts(self) -> dict[str, str]:
        """Component -> the shaft that it sits on, where the parts are listed."""
        keys = ("engine", "machine", "machine_2", "machine_3")
        named = {key: getattr(self, f"{key}_shaft") for key in keys}
        return {key: shaft for key, shaft in named.items() if shaft is not None}
