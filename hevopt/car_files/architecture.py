"""What an architecture's file may hold: the components it names, its functions and the coupling."""

from typing import Annotated, Any, Literal, Self

from pydantic import AfterValidator, Discriminator, Field, model_validator

from hevopt.car.architecture import Function
from hevopt.car.templates import COMPONENTS_OF
from hevopt.car_files.driveline import CouplingFile
from hevopt.car_files.fields import Description, Name, Named, NotNegative, Soc, Table
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


class RulesFile(FileModel):
    """Thresholds of the rules; what is left out is calibrated on the cycle."""

    electric_soc: Soc | None = None
    electric_power_w: NotNegative | None = None
    electric_speed_kmh: Annotated[float, Field(ge=0, le=1000)] | None = None
    engine_on_power_w: Annotated[float, Field(ge=-1e6, le=1e6)] | None = None
    engine_off_power_w: Annotated[float, Field(ge=-1e6, le=1e6)] | None = None
    charge_power_w: NotNegative | None = None
    reference_soc: Soc | None = None
    thermostat_on_soc: Soc | None = None
    thermostat_off_soc: Soc | None = None

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        """What starts the engine lies beyond what stops it."""
        on_w, off_w = self.engine_on_power_w, self.engine_off_power_w
        if on_w is not None and off_w is not None and off_w > on_w:
            raise ValueError(
                f"engine_off_power_w {off_w:g} lies above engine_on_power_w {on_w:g}; the engine stops below the "
                "power that starts it"
            )
        on, off = self.thermostat_on_soc, self.thermostat_off_soc
        if on is not None and off is not None and on >= off:
            raise ValueError(
                f"thermostat_on_soc {on:g} is not below thermostat_off_soc {off:g}; the engine charges from "
                "the one to the other"
            )
        return self


class ArchitectureFile(FileModel):
    """An architecture: its components, functions (Table 1) and coupling."""

    name: Name
    description: Description = ""
    car: Component
    engine: Component | None = None
    gearbox: Component | None = None
    machine: Component | None = None
    machine_2: Component | None = None
    machine_3: Component | None = None
    battery: Component
    hybrid_mass_kg: Annotated[float, Field(ge=-500, le=5000)] = 0.0
    functions: list[Function]
    gear: Literal["cycle", "free"] = "cycle"
    rules: RulesFile | None = None
    coupling: CouplingFile

    @model_validator(mode="after")
    def _components(self) -> Self:
        """The components are those of the coupling."""
        keys = ("engine", "gearbox", "machine", "machine_2", "machine_3")
        given = {key for key in keys if getattr(self, key) is not None}
        kind = self.coupling.kind
        if kind == "parts":
            geared = [part for part in self.coupling.parts or () if part.kind == "gearbox"]
            needed = {*self.coupling.shafts}
            needed |= {"gearbox"} if any(part.ratios is None for part in geared) else set()
        else:
            needed = set(COMPONENTS_OF[kind])
        if missing := sorted(needed - given):
            raise ValueError(f"coupling kind {kind!r} needs {', '.join(missing)}")
        if "engine" not in given and "gearbox" in given:
            raise ValueError(
                "a gearbox with listed gears needs an engine; without one leave it out"
            )
        if extra := sorted(given - needed):
            how = "; say on which shaft, such as machine_2_shaft" if kind == "parts" else ""
            raise ValueError(f"coupling kind {kind!r} does not use {', '.join(extra)}{how}")
        return self
