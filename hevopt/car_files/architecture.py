"""What an architecture's file may hold: the components it names, its functions and the coupling."""

from typing import Annotated, Any, Literal, Self, get_args

from pydantic import AfterValidator, ConfigDict, Discriminator, Field, model_validator

from hevopt.car.architecture import Function
from hevopt.car.templates import CouplingKind
from hevopt.car_files.fields import Description, Fraction, KeysOfKind, Name, Named, Ratio, Table
from hevopt.files.toml import FileModel


def _names_a_file(table: dict[str, Any]) -> dict[str, Any]:
    if not isinstance(table.get("file"), str):
        raise ValueError('a table needs file = "name"; its other keys replace those of that file')
    return table


# A component: the name or path of its file, or a table {file, ...} whose other keys replace the file's.
Component = Annotated[
    Annotated[str, Field(min_length=1), Named]
    | Annotated[dict[str, Any], AfterValidator(_names_a_file), Table],
    Discriminator(lambda value: "a table" if isinstance(value, dict) else "a name"),
]


_KEYS_OF_KIND = KeysOfKind(
    {kind: set() for kind in get_args(CouplingKind)}
    | {
        "gearbox_input": {"second_clutch"},
        "gearbox_output": {"machine_ratio", "machine_efficiency"},
    },
    {
        "gearbox_output": {"disconnects_above_speed_max"},
        "even_shaft": {"machine_shift_fuel_g"},
    },
)


class CouplingFile(FileModel):
    """How the machine joins the shafts."""

    model_config = ConfigDict(json_schema_extra=_KEYS_OF_KIND.schema())

    kind: CouplingKind
    second_clutch: bool | None = None
    machine_ratio: Ratio | None = None
    machine_efficiency: Fraction | None = None
    disconnects_above_speed_max: bool = False
    machine_shift_fuel_g: Annotated[float, Field(ge=0, le=10)] = 0.0

    @model_validator(mode="after")
    def _keys_of_kind(self) -> Self:
        _KEYS_OF_KIND.check(self.kind, self.model_fields_set)
        return self


class ArchitectureFile(FileModel):
    """An architecture: its components, functions (Table 1) and coupling."""

    name: Name
    description: Description = ""
    car: Component
    engine: Component
    gearbox: Component
    machine: Component
    battery: Component
    hybrid_mass_kg: Annotated[float, Field(ge=-500, le=5000)] = 0.0
    functions: list[Function]
    gear: Literal["cycle", "free"] = "cycle"
    coupling: CouplingFile
