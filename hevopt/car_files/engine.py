"""What an engine's file may hold: sizes, fuel, full load, and fuel and NOx by coefficients or a measured map."""

from math import pi
from typing import Annotated, Self

import numpy as np
from pydantic import Field, model_validator

from hevopt.car_files.fields import (
    Coefficient,
    Curve,
    FullLoadFile,
    Name,
    NotNegative,
    ScaleFactor,
    ScaleFile,
    Specific,
    Speeds,
    StartFuel,
    check_efficiency,
    check_grid,
)
from hevopt.car_files.mean_value import MeanValueFile
from hevopt.files.toml import FileModel
from hevopt.problem.arrays import rising

Dwell = Annotated[float, Field(ge=0, le=3600)]
NotPositive = Annotated[float, Field(ge=-1e6, le=0)]
# exp() of more than this overflows.
_EXPONENT_MAX = 700.0


class FuelFile(FileModel):
    heating_value_mjpkg: Annotated[float, Field(ge=5, le=150)]
    density_kgpl: Annotated[float, Field(ge=0.01, le=2)]
    co2_kgpkg: Annotated[float, Field(ge=0, le=5)]


class FuelCoefficientsFile(FileModel):
    a: Annotated[float, Field(ge=0.01, le=10)]
    b: Coefficient
    c: Coefficient
    a2: NotPositive
    l: Annotated[float, Field(ge=-1e6, le=-1e-3)]  # noqa: E741
    l2: NotPositive


class NoxCoefficientsFile(FileModel):
    m0: NotNegative
    lo: NotNegative
    hi: NotNegative
    p0: Coefficient
    p1: Coefficient
    dp: Annotated[float, Field(ge=0.01, le=1e6)]


class EngineGridFile(FileModel):
    """A measured map: rows are speeds, columns torques; nan marks a cell that was not measured."""

    speed_rpm: Speeds
    torque_nm: Curve
    fuel_gps: list[list[Annotated[float, Field(allow_inf_nan=True)]]]
    nox_gps: list[list[Annotated[float, Field(allow_inf_nan=True)]]] | None = None
    motoring_torque_nm: Curve

    @model_validator(mode="after")
    def _shapes(self) -> Self:
        shape = (len(self.speed_rpm), len(self.torque_nm))
        for name in ("fuel_gps", "nox_gps"):
            grid = getattr(self, name)
            if grid is not None:
                check_grid(name, grid, *shape)
        if len(self.motoring_torque_nm) != shape[0] or max(self.motoring_torque_nm) >= 0:
            raise ValueError(f"motoring_torque_nm must be {shape[0]} values below 0")
        if (np.diff(self.speed_rpm) <= 0).any() or (np.diff(self.torque_nm) <= 0).any():
            raise ValueError("speed_rpm and torque_nm must increase")
        return self


class EngineScaleFile(ScaleFile):
    displacement: ScaleFactor | None = None


class EngineFile(FileModel):
    name: Name
    displacement_cm3: Annotated[float, Field(ge=10, le=100_000)]
    bore_mm: Annotated[float, Field(ge=10, le=1000)]
    stroke_mm: Annotated[float, Field(ge=10, le=1000)]
    idle_rpm: Annotated[float, Field(ge=50, le=5000)]
    inertia_kgm2: Annotated[float, Field(ge=0, le=100)]
    start_fuel_g: StartFuel
    least_on_s: Dwell = 0.0
    least_off_s: Dwell = 0.0
    fuel: FuelFile
    full_load: FullLoadFile
    fuel_coefficients: FuelCoefficientsFile | None = None
    fuel_map: EngineGridFile | None = None
    nox_coefficients: NoxCoefficientsFile | None = None
    mean_value: MeanValueFile | None = None
    mass_kgpl: Specific | None = None
    price_pl: Specific | None = None
    scale: EngineScaleFile | None = None

    @model_validator(mode="after")
    def _one_map(self) -> Self:
        if (self.fuel_coefficients is None) == (self.fuel_map is None):
            raise ValueError("give either fuel_coefficients or fuel_map")
        if self.fuel_map is not None and self.nox_coefficients is not None:
            raise ValueError("with fuel_map, NOx is nox_gps in the map, not nox_coefficients")
        low, high = self.full_load.speed_rpm[0], self.full_load.speed_rpm[-1]
        if not low <= self.idle_rpm < high:
            raise ValueError(
                f"idle_rpm {self.idle_rpm:g} must lie within full_load.speed_rpm, {low:g} to {high:g}"
            )
        return self

    @model_validator(mode="after")
    def _efficiency(self) -> Self:
        """Most of a map, up to full load, gives no more power than its fuel holds, and some of it a share."""
        grid = self.fuel_map
        if grid is not None:
            speed, torque = np.array(grid.speed_rpm)[:, None], np.array(grid.torque_nm)
            fuel_kw = np.array(grid.fuel_gps) * self.fuel.heating_value_mjpkg
            full = np.interp(speed, self.full_load.speed_rpm, self.full_load.torque_nm)
            used = (torque > 0) & (torque <= full) & (speed >= self.idle_rpm) & (fuel_kw > 0)
            power_kw = speed * pi / 30 * torque / 1e3
            hint = "fuel_map.fuel_gps is in g/s, torque_nm in Nm, heating_value_mjpkg in MJ/kg"
            check_efficiency(power_kw[used] / fuel_kw[used], hint)
        return self

    @model_validator(mode="after")
    def _fuel_at_every_speed(self) -> Self:
        """The p_mf equation (engine.py) has a root, and rising fuel, up to full load and top speed."""
        if self.fuel_coefficients is None:
            return self
        k, curve = self.fuel_coefficients, self.full_load
        rpm = rising(np.linspace(0.0, curve.speed_rpm[-1], 201), curve.speed_rpm)
        piston_mps = 2 * self.stroke_mm / 1e3 * rpm / 60
        slope = k.a + k.b * piston_mps + k.c * piston_mps**2
        torque = np.interp(rpm, curve.speed_rpm, curve.torque_nm)
        full_bar = 4 * pi * torque / (self.displacement_cm3 * 1e-6) / 1e5
        root = slope**2 + 4 * k.a2 * (full_bar - k.l - k.l2 * piston_mps**2)
        if (slope <= 0).any():
            raise ValueError(
                f"fuel_coefficients: a + b cm + c cm² is {slope.min():.3g} at "
                f"{rpm[np.argmin(slope)]:g} rpm; it must be > 0 from 0 to full_load's top speed"
            )
        if (root < 0).any():
            raise ValueError(
                f"fuel_coefficients: full load at {rpm[np.argmin(root)]:g} rpm has no fuel; lower "
                "full_load.torque_nm or bring a2 closer to 0"
            )
        return self

    @model_validator(mode="after")
    def _nox_steepness(self) -> Self:
        k = self.nox_coefficients
        if k is not None:
            tops = [k.p0 + k.p1 * (rpm / 1000 - 2) for rpm in (0.0, self.full_load.speed_rpm[-1])]
            if max(tops) > _EXPONENT_MAX * k.dp:
                raise ValueError(
                    f"nox_coefficients: (p0 + p1 (n/1000 - 2)) / dp reaches {max(tops) / k.dp:.3g} "
                    f"by full_load's top speed; allowed: up to {_EXPONENT_MAX:g}; raise dp"
                )
        return self
