"""What an architecture's file may say of the driveline: a kind, which stands for parts, or the parts themselves."""

from typing import Annotated, Literal, Self, get_args

from pydantic import ConfigDict, Field, model_validator

from hevopt.car.templates import CouplingKind
from hevopt.car_files.fields import Fraction, KeysOfKind, Name, Ratio, ShiftFuel
from hevopt.files.toml import FileModel

PartKind = Literal[
    "gear", "gearbox", "clutch", "one_way_clutch", "planetary", "shaft_brake", "torque_converter"
]
Ratios = Annotated[list[Ratio], Field(min_length=1, max_length=20)]

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
        "gear": {"efficiency"},
        "gearbox": {"ratios", "efficiency", "shift_fuel_g"},
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
    efficiency: Fraction = 1.0
    operation: Literal["driver", "strategy"] | None = None
    shift_fuel_g: ShiftFuel = 0.0

    @model_validator(mode="after")
    def _keys_of_kind(self) -> Self:
        _KEYS_OF_PART.check(self.kind, self.model_fields_set - {"kind", "name"})
        return self


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
        "parts": {"engine_shaft", "machine_shaft", "machine_2_shaft", "machine_3_shaft"},
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
    parts: Annotated[list[PartFile], Field(min_length=1, max_length=40)] | None = None

    @model_validator(mode="after")
    def _keys_of_kind(self) -> Self:
        _KEYS_OF_KIND.check(self.kind, self.model_fields_set - {"kind"})
        names = [part.name for part in self.parts or ()]
        if twice := sorted({name for name in names if names.count(name) > 1}):
            raise ValueError(f"parts: two are called {', '.join(twice)}; give each its own name")
        return self

    @property
    def shafts(self) -> dict[str, str]:
        """Component -> the shaft that it sits on, where the parts are listed."""
        keys = ("engine", "machine", "machine_2", "machine_3")
        named = {key: getattr(self, f"{key}_shaft") for key in keys}
        return {key: shaft for key, shaft in named.items() if shaft is not None}
