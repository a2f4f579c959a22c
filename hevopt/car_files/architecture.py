"""What an architecture's file may hold: the components it names, its functions and the coupling."""

from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import AfterValidator, Discriminator, Field, model_validator

from hevopt.car.architecture import Function
from hevopt.car.templates import COMPONENTS_OF
from hevopt.car_files.driveline import CouplingFile
from hevopt.car_files.fields import (
    Description,
    Fraction,
    List,
    Name,
    Named,
    NotNegative,
    Number,
    Shape,
    Soc,
    Table,
)
from hevopt.car_files.handling import ClutchFile, DriverFile, ShiftingFile, TyreFile
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


class ConverterFile(FileModel):
    """A converter between battery and bus: one efficiency, or several over the power at the bus."""

    efficiency: Annotated[Annotated[Fraction, Number] | Annotated[list[Fraction], List], Shape]
    power_w: list[NotNegative] | None = None

    @model_validator(mode="after")
    def _points(self) -> Self:
        """As many powers as efficiencies, and more out of the battery for more at the bus."""
        if not isinstance(self.efficiency, list):
            if self.power_w is not None:
                raise ValueError("one efficiency needs no power_w; leave it out, or give a list")
            return self
        power, share = self.power_w, self.efficiency
        if power is None or len(power) != len(share) or len(power) < 2:
            raise ValueError(
                f"efficiency has {len(share)} values; power_w needs as many, and at least 2"
            )
        if (np.diff(power) <= 0).any():
            raise ValueError("power_w must increase")
        # P / share rises where share > P slope, P share where share > -P slope: both linear between two points.
        slope = np.diff(share) / np.diff(power)
        for at in (slice(None, -1), slice(1, None)):
            falls = np.abs(power[at] * slope) >= share[at]
            if falls.any():
                near = power[at][int(np.argmax(falls))]
                raise ValueError(
                    f"efficiency changes so fast near {near:g} W that more power at the bus is less at the battery"
                )
        return self


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
    source: Component | None = None
    gearbox: Component | None = None
    machine: Component | None = None
    machine_2: Component | None = None
    machine_3: Component | None = None
    battery: Component
    hybrid_mass_kg: Annotated[float, Field(ge=-500, le=5000)] = 0.0
    functions: list[Function]
    gear: Literal["cycle", "free"] = "cycle"
    rules: RulesFile | None = None
    converter: ConverterFile | None = None
    tyre: TyreFile | None = None
    clutch: ClutchFile | None = None
    shifting: ShiftingFile | None = None
    driver: DriverFile | None = None
    coupling: CouplingFile

    @model_validator(mode="after")
    def _components(self) -> Self:
        """The components are those of the coupling."""
        keys = ("engine", "source", "gearbox", "machine", "machine_2", "machine_3")
        given = {key for key in keys if getattr(self, key) is not None}
        kind = self.coupling.kind
        if "source" in given:
            if "engine" in given or not (kind == "series" or self.coupling.engine_apart):
                raise ValueError(
                    "a source gives electricity alone: it takes the engine's place in coupling kind 'series', or "
                    "in parts on a shaft that no part joins, with one machine there as its converter; found kind "
                    f"{kind!r}{' and an engine' if 'engine' in given else ''}"
                )
            given = given - {"source"} | {"engine"}
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
