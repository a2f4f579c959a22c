"""What the file of a source of electricity may hold: a fuel cell, or what else gives power for fuel, shaftless."""

from typing import Annotated, Self

import numpy as np
from pydantic import Field, model_validator

from hevopt.car.engine import Engine
from hevopt.car.source import SourceLaw, source_as_engine
from hevopt.car_files.engine import Dwell, FuelFile
from hevopt.car_files.fields import Name, NotNegative, StartFuel, check_efficiency
from hevopt.files.toml import FileModel
from hevopt.units import TO_SI

_Points = Annotated[list[NotNegative], Field(min_length=2, max_length=10_000)]


class SourceFile(FileModel):
    """A source of electricity: fuel over the power that it gives, before the converter that feeds the bus."""

    name: Name
    power_kw: _Points
    fuel_gps: _Points
    start_fuel_g: StartFuel = 0.0
    least_on_s: Dwell = 0.0
    least_off_s: Dwell = 0.0
    fuel: FuelFile

    @model_validator(mode="after")
    def _points(self) -> Self:
        """Powers from 0 up, fuel that rises with them, and power that such fuel can give."""
        power, fuel = np.array(self.power_kw), np.array(self.fuel_gps)
        if len(power) != len(fuel):
            raise ValueError(f"power_kw has {len(power)} values and fuel_gps {len(fuel)}")
        if power[0] != 0 or (np.diff(power) <= 0).any() or (np.diff(fuel) <= 0).any():
            raise ValueError("power_kw must begin at 0 and increase, and fuel_gps with it")
        fuel_kw, hint = (
            fuel * self.fuel.heating_value_mjpkg,
            "fuel_gps is in g/s, heating_value_mjpkg in MJ/kg",
        )
        if (over := power > fuel_kw).any():
            raise ValueError(f"{power[np.argmax(over)]:g} kW is more than its fuel holds; {hint}")
        check_efficiency(power[1:] / fuel_kw[1:], hint)
        return self


def source_of(data: SourceFile) -> Engine:
    """The source of its file, in the engine's place."""
    gram, watt = TO_SI["_g"][1], TO_SI["_kw"][1]
    law = SourceLaw(np.array(data.power_kw) * watt, np.array(data.fuel_gps) * gram)
    return source_as_engine(
        data.name,
        law,
        heating_value_jpkg=data.fuel.heating_value_mjpkg * TO_SI["_mjpkg"][1],
        fuel_density_kgpm3=data.fuel.density_kgpl * TO_SI["_kgpl"][1],
        co2_kgpkg=data.fuel.co2_kgpkg,
        start_fuel_kg=data.start_fuel_g * gram,
        least_on_s=data.least_on_s,
        least_off_s=data.least_off_s,
    )
