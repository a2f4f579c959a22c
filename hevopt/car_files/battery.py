"""What a battery's file may hold: cells in series, their voltage and resistance, the window of their charge."""

from typing import Annotated, Any, Self

import numpy as np
from pydantic import Field, model_validator

from hevopt.car_files.fields import (
    Fraction,
    List,
    Name,
    NotNegative,
    Number,
    Positive,
    ScaleFactor,
    Shape,
    Soc,
    Specific,
    Table,
)
from hevopt.files.toml import FileModel

Ohm = Annotated[Annotated[NotNegative, Number] | Annotated[list[NotNegative], List], Shape]


class LinearVoltageFile(FileModel):
    intercept: Positive
    slope: NotNegative


class BatteryScaleFile(FileModel):
    """Another size of the same cells by one factor of their capacity; see components.py."""

    capacity: ScaleFactor


class SocFile(FileModel):
    """Window and start of the state of charge; `end` is the least at the end, by default the start."""

    start: Soc
    min: Soc
    max: Soc
    end: Soc | None = None

    @model_validator(mode="after")
    def _window(self) -> Self:
        if not self.min < self.max:
            raise ValueError(f"empty window: min {self.min:g} must be below max {self.max:g}")
        if not self.min <= self.start <= self.max:
            raise ValueError(f"start {self.start:g} must lie in [{self.min:g}, {self.max:g}]")
        if self.end is not None and not self.min <= self.end <= self.max:
            raise ValueError(f"end {self.end:g} must lie in [{self.min:g}, {self.max:g}]")
        least = self.start if self.end is None else self.end
        if least == self.max:
            raise ValueError(
                f"the least charge at the end, {least:g}, is max itself, which no plan meets exactly; give end a "
                "value below max, such as 0.01 less, or raise max"
            )
        return self


class BatteryFile(FileModel):
    """A battery of equal cells in series and strings of them in parallel, figures per cell, over SOC where they are
    lists."""

    name: Name
    cells_in_series: Annotated[int, Field(ge=1, le=10_000)]
    parallel: Annotated[int, Field(ge=1, le=1000)] = 1
    capacity_ah: Positive
    open_circuit_v: Annotated[
        Annotated[LinearVoltageFile, Table] | Annotated[list[Positive], List], Shape
    ]
    resistance_ohm: Ohm | None = None
    discharge_ohm: Ohm | None = None
    charge_ohm: Ohm | None = None
    curve_soc: list[Soc] | None = None
    coulombic_efficiency: Fraction = 1.0
    power_max_w: Positive | None = None
    current_max_a: Positive | None = None
    voltage_min_v: NotNegative = 0.0
    voltage_max_v: Positive | None = None
    mass_kgpkwh: Specific | None = None
    price_pkwh: Specific | None = None
    scale: BatteryScaleFile | None = None
    soc: SocFile

    @model_validator(mode="after")
    def _curves(self) -> Self:
        given = self.model_fields_set & {"resistance_ohm", "discharge_ohm", "charge_ohm"}
        if given not in ({"resistance_ohm"}, {"discharge_ohm", "charge_ohm"}):
            raise ValueError(
                "give either resistance_ohm, or discharge_ohm and charge_ohm; found: "
                f"{', '.join(sorted(given)) or 'none'}"
            )
        lists = [v for v in (self.open_circuit_v, *self.resistances()) if isinstance(v, list)]
        if lists and self.curve_soc is None:
            raise ValueError("values over SOC need curve_soc")
        points = self.curve_soc
        if points is None:
            return self
        if any(len(v) != len(points) for v in lists):
            raise ValueError(f"values over SOC need {len(points)} entries, as curve_soc")
        if len(points) < 2 or (np.diff(points) <= 0).any():
            raise ValueError("curve_soc must increase and have at least 2 entries")
        return self

    def resistances(self) -> tuple[Any, Any]:
        """Discharge and charge resistance as given."""
        if self.resistance_ohm is not None:
            return self.resistance_ohm, self.resistance_ohm
        return self.discharge_ohm, self.charge_ohm
