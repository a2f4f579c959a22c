"""What a gearbox's file may hold: ratios, efficiency, shift speeds, and the limits of a gear chosen freely."""

from typing import Annotated, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from hevopt.car.gear_loss import too_steep
from hevopt.car.torque_converter import flaw
from hevopt.car_files.fields import (
    Curve,
    Fraction,
    List,
    Name,
    NotNegative,
    Number,
    Positive,
    Ratio,
    Shape,
    ShiftFuel,
    Soc,
    Speeds,
    check_grid,
)
from hevopt.files.toml import FileModel

# No converter of one stage comes near to the upper end.
TorqueRatio = Annotated[float, Field(ge=0.1, le=10)]


class ShiftSpeedsFile(FileModel):
    up_kmh: list[Positive]
    down_kmh: list[Positive]
    engage_before_launch_s: Annotated[float, Field(ge=0, le=60)] = 1.0


class FreeGearFile(FileModel):
    """What limits a gear that the strategy chooses."""

    shift_fuel_g: ShiftFuel
    engine_speed_min_rpm: Annotated[float, Field(ge=0, le=10_000)]


class GearLossFile(FileModel):
    """Torque that one gear loses, final drive included, over speed and torque at the input."""

    speed_rpm: Speeds
    torque_nm: Curve
    loss_nm: list[list[Annotated[float, Field(allow_inf_nan=True)]]]

    @model_validator(mode="after")
    def _grid(self) -> Self:
        for name, axis in (("speed_rpm", self.speed_rpm), ("torque_nm", self.torque_nm)):
            if (np.diff(axis) <= 0).any():
                raise ValueError(f"{name} must increase")
        check_grid("loss_nm", self.loss_nm, len(self.speed_rpm), len(self.torque_nm))
        steep = too_steep(np.array(self.torque_nm), np.array(self.loss_nm))
        if steep is not None:
            raise ValueError(
                f"loss_nm at {self.speed_rpm[steep.row]:g} rpm rises by {steep.rise:.3g} Nm per Nm between "
                f"{steep.low_nm:g} and {steep.high_nm:g} Nm: more torque at the input would give less at the "
                "output; allowed: below 1"
            )
        return self


class TorqueConverterFile(FileModel):
    """A torque converter in the place of the driver's clutch: curves at one speed of its impeller."""

    speed_ratio: Annotated[list[Soc], Field(min_length=2, max_length=1000)]
    torque_ratio: Annotated[list[TorqueRatio], Field(min_length=2, max_length=1000)]
    impeller_speed_rpm: Annotated[float, Field(ge=100, le=20_000)]
    impeller_torque_nm: Annotated[list[NotNegative], Field(min_length=2, max_length=1000)]
    lock_up_speed_rpm: Annotated[float, Field(ge=0, le=20_000)] | None = None
    lock_up_gear_min: Annotated[int, Field(ge=1, le=20)] = 1
    at_rest: Literal["in_gear", "neutral"] = "in_gear"

    @model_validator(mode="after")
    def _curves(self) -> Self:
        points = len(self.speed_ratio)
        for name in ("torque_ratio", "impeller_torque_nm"):
            if len(getattr(self, name)) != points:
                raise ValueError(
                    f"{name} has {len(getattr(self, name))} values; speed_ratio has {points}"
                )
        curves = (self.speed_ratio, self.torque_ratio, self.impeller_torque_nm)
        if (wrong := flaw(*map(np.array, curves))) is not None:
            raise ValueError(wrong)
        if self.lock_up_speed_rpm is None and "lock_up_gear_min" in self.model_fields_set:
            raise ValueError(
                "lock_up_gear_min needs lock_up_speed_rpm, without which it never locks"
            )
        return self


class GearboxFile(FileModel):
    name: Name
    ratios: Annotated[list[Ratio], Field(min_length=1, max_length=20)]
    final_drive_ratio: Ratio
    efficiency: (
        Annotated[Annotated[Fraction, Number] | Annotated[list[Fraction], List], Shape] | None
    ) = None
    loss_map: list[GearLossFile] | None = None
    shift_gap_s: Annotated[float, Field(ge=0, le=5)] = 0.0
    shift_speeds: ShiftSpeedsFile
    free_gear: FreeGearFile | None = None
    torque_converter: TorqueConverterFile | None = None

    @model_validator(mode="after")
    def _under_load(self) -> Self:
        converter = self.torque_converter
        if converter is not None and self.shift_gap_s > 0:
            raise ValueError(
                f"shift_gap_s {self.shift_gap_s:g}: with a torque_converter gears change under load; make it 0"
            )
        if converter is not None and converter.lock_up_gear_min > len(self.ratios):
            raise ValueError(
                f"torque_converter: lock_up_gear_min {converter.lock_up_gear_min}; allowed: 1 to {len(self.ratios)}"
            )
        return self

    @model_validator(mode="after")
    def _lengths(self) -> Self:
        gears, shifts = len(self.ratios), self.shift_speeds
        if isinstance(self.efficiency, list) and len(self.efficiency) != gears:
            raise ValueError(f"efficiency needs one value or {gears}, one per gear")
        if (self.efficiency is None) == (self.loss_map is None):
            raise ValueError("give either efficiency or loss_map, and not both")
        if self.loss_map is not None and len(self.loss_map) != gears:
            raise ValueError(
                f"loss_map needs {gears} tables, one per gear in their order; found {len(self.loss_map)}"
            )
        if len(shifts.up_kmh) != gears - 1 or len(shifts.down_kmh) != gears - 1:
            raise ValueError(f"shift_speeds need {gears - 1} values each for {gears} gears")
        return self

    @model_validator(mode="after")
    def _falling(self) -> Self:
        if list(self.ratios) != sorted(self.ratios, reverse=True):
            raise ValueError("ratios must fall from first gear to last")
        return self

    @model_validator(mode="after")
    def _no_hunting(self) -> Self:
        shifts = self.shift_speeds
        if any(d >= u for u, d in zip(shifts.up_kmh, shifts.down_kmh, strict=False)):
            raise ValueError("each down_kmh must be below its up_kmh")
        if sorted(shifts.up_kmh) != shifts.up_kmh or sorted(shifts.down_kmh) != shifts.down_kmh:
            raise ValueError("shift speeds must rise from gear to gear")
        return self
