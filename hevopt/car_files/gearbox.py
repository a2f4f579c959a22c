"""What a gearbox's file may hold: ratios, efficiency, shift speeds, and the limits of a gear chosen freely."""

from typing import Annotated, Self

from pydantic import Field, model_validator

from hevopt.car_files.fields import Fraction, List, Name, Number, Positive, Ratio, Shape, ShiftFuel
from hevopt.files.toml import FileModel


class ShiftSpeedsFile(FileModel):
    up_kmh: list[Positive]
    down_kmh: list[Positive]
    engage_before_launch_s: Annotated[float, Field(ge=0, le=60)] = 1.0


class FreeGearFile(FileModel):
    """What limits a gear that the strategy chooses."""

    shift_fuel_g: ShiftFuel
    engine_speed_min_rpm: Annotated[float, Field(ge=0, le=10_000)]


class GearboxFile(FileModel):
    name: Name
    ratios: Annotated[list[Ratio], Field(min_length=1, max_length=20)]
    final_drive_ratio: Ratio
    efficiency: Annotated[Annotated[Fraction, Number] | Annotated[list[Fraction], List], Shape]
    shift_gap_s: Annotated[float, Field(ge=0, le=5)] = 0.0
    shift_speeds: ShiftSpeedsFile
    free_gear: FreeGearFile | None = None

    @model_validator(mode="after")
    def _lengths(self) -> Self:
        gears, shifts = len(self.ratios), self.shift_speeds
        if isinstance(self.efficiency, list) and len(self.efficiency) != gears:
            raise ValueError(f"efficiency needs one value or {gears}, one per gear")
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
