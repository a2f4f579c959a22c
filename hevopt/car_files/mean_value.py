"""What the `mean_value` part of an engine's file may hold: gas path, turbocharger, cylinders and control unit."""

from typing import Annotated, Literal

import numpy as np
from pydantic import Field, model_validator

from hevopt.car_files.fields import Fraction, NotNegative, Speeds
from hevopt.files.toml import FileModel

_Volume = Annotated[float, Field(ge=0.05, le=1000)]
_Loss = Annotated[float, Field(ge=1.0, le=1e12)]
_Share = Annotated[float, Field(ge=0, le=1)]
_Lag = Annotated[float, Field(ge=0.01, le=10)]
_Kelvin = Annotated[float, Field(ge=200, le=2000)]
_Lambda = Annotated[float, Field(ge=0.5, le=20)]
_Diameter = Annotated[float, Field(ge=5, le=500)]
_FlowNumber = Annotated[float, Field(ge=0, le=2)]
_Shares = Annotated[list[_Share], Field(min_length=2, max_length=1000)]
_Lambdas = Annotated[list[_Lambda], Field(min_length=2, max_length=1000)]
# Machs up to which surge and choke must not cross, and how far apart the flow numbers stay.
_MACH_MAX, _APART = 1.8, 0.03


def _check_curve(model: FileModel, points: str, values: str) -> None:
    """ValueError where the points of a curve do not rise, or are not as many as its values."""
    x, y = getattr(model, points), getattr(model, values)
    if len(x) != len(y):
        raise ValueError(f"{points} has {len(x)} values and {values} {len(y)}; give one for each")
    if (np.diff(x) <= 0).any():
        raise ValueError(f"{points} must increase")


class VolumesFile(FileModel):
    """Content of the five volumes."""

    intake_system_l: _Volume
    charge_pipe_l: _Volume
    intake_manifold_l: _Volume
    exhaust_manifold_l: _Volume
    exhaust_system_l: _Volume


class RestrictionsFile(FileModel):
    """Pressure losses H = density dp / W²."""

    filter_pm4: _Loss
    intercooler_pm4: _Loss
    exhaust_pm4: _Loss
    linear_below_pa: Annotated[float, Field(ge=1, le=20_000)]


class CoolerFile(FileModel):
    """A cooler of the charge."""

    effectiveness: _Share
    coolant_k: _Kelvin


class CompressorFile(FileModel):
    """Compact compressor map, in numbers without dimension."""

    wheel_diameter_mm: _Diameter
    head_max: Annotated[float, Field(ge=0.1, le=1.5)]
    head_exponent: Annotated[float, Field(ge=1.2, le=20)]
    surge_flow: _FlowNumber
    surge_flow_per_mach: _FlowNumber
    choke_flow: _FlowNumber
    choke_flow_fall_per_mach: _FlowNumber
    work: Annotated[float, Field(ge=0.1, le=2)]
    work_fall_with_flow: Annotated[float, Field(ge=0, le=10)]
    disc_friction: Annotated[float, Field(ge=0, le=0.2)]

    @model_validator(mode="after")
    def _surge_before_choke(self) -> "CompressorFile":
        for mach in (0.0, _MACH_MAX):
            surge = self.surge_flow + self.surge_flow_per_mach * mach
            choke = self.choke_flow - self.choke_flow_fall_per_mach * mach
            if choke < surge + _APART:
                raise ValueError(
                    f"surge and choke cross: flow numbers {surge:.3g} and {choke:.3g} at a rim speed of {mach:g} "
                    f"Mach; allowed: choke {_APART:g} or more above surge up to Mach {_MACH_MAX:g}; raise "
                    "choke_flow, or lower surge_flow or the changes with Mach"
                )
        if self.head_max >= self.work:
            raise ValueError(
                f"head_max {self.head_max:g} must be below work {self.work:g}: no wheel gives more than it takes"
            )
        return self


class TurbineFile(FileModel):
    """Compact turbine map."""

    wheel_diameter_mm: _Diameter
    area_cm2: Annotated[float, Field(ge=0.05, le=500)]
    flow_exponent: Annotated[float, Field(ge=0.5, le=10)]
    efficiency_max: Annotated[float, Field(ge=0.05, le=0.95)]
    blade_speed_ratio: Annotated[float, Field(ge=0.2, le=1.5)]


class RotorFile(FileModel):
    """The turbocharger's shaft; without an inertia it is scaled from known ones by the wheel's size."""

    inertia_kgm2: Annotated[float, Field(ge=1e-9, le=1)] | None = None
    bearing_nms: Annotated[float, Field(ge=0, le=1e-2)]


class CylindersFile(FileModel):
    """Filling, combustion, friction and wall heat."""

    filling_max: Annotated[float, Field(ge=0.1, le=1.5)]
    filling_fall: NotNegative
    filling_speed_rpm: Annotated[float, Field(ge=100, le=20_000)]
    stoichiometric_air: Annotated[float, Field(ge=1, le=50)]
    efficiency: Annotated[float, Field(ge=0.05, le=0.7)]
    efficiency_best_mps: Annotated[float, Field(ge=0, le=30)]
    efficiency_width_mps: Annotated[float, Field(ge=5, le=1e6)]
    rich_loss: _Share
    rich_width: Annotated[float, Field(ge=0.01, le=10)]
    friction_bar: Annotated[float, Field(ge=0, le=20)]
    friction_bar_s2pm2: Annotated[float, Field(ge=0, le=1)]
    gas_exchange_bar: Annotated[float, Field(ge=0, le=10)]
    wall_share: Annotated[float, Field(ge=0, le=0.8)]
    wall_share_1000rpm: Annotated[float, Field(ge=0, le=0.8)]


class RecirculationFile(FileModel):
    """Exhaust recirculation: valve and cooler."""

    area_mm2: Annotated[float, Field(ge=0, le=1e5)]
    least_pressure_ratio: Annotated[float, Field(ge=0.05, le=0.95)]
    effectiveness: _Share
    coolant_k: _Kelvin


class WallFile(FileModel):
    """Heat of the exhaust manifold."""

    gas_wpk: Annotated[float, Field(ge=0, le=1e4)]
    capacity_jpk: Annotated[float, Field(ge=1, le=1e6)]
    ambient_wpk: Annotated[float, Field(ge=0.01, le=1e4)]


class ControlFile(FileModel):
    """The control unit."""

    pumping_bar: Annotated[float, Field(ge=-5, le=10)]
    pumping_bar_1000rpm: Annotated[float, Field(ge=0, le=10)]
    efficiency_fall: Annotated[float, Field(ge=0.2, le=1.2)]
    efficiency_fall_with_load: Annotated[float, Field(ge=0, le=0.5)]
    smoke_limit_from: Literal["speed_density", "air_meter"]
    smoke_rpm: Speeds
    smoke_lambda: _Lambdas
    meter_lag_s: _Lag
    lambda_rpm: Speeds
    lambda_full_load: _Lambdas
    lambda_load: _Shares
    lambda_part_load: _Lambdas
    charge_k: _Kelvin
    vanes_rpm: Speeds
    vanes: Annotated[list[Fraction], Field(min_length=2, max_length=1000)]
    vanes_growth: Annotated[float, Field(ge=0, le=5)]
    vanes_least: Fraction
    vanes_lag_s: _Lag
    boost_gain_pbar: Annotated[float, Field(ge=0, le=100)]
    boost_integral_pbars: Annotated[float, Field(ge=0, le=100)]
    boost_from_load: _Share
    exhaust_pressure_max_bar: Annotated[float, Field(ge=1, le=20)]
    exhaust_temperature_max_k: _Kelvin
    egr_load: _Shares
    egr_opening: _Shares
    egr_fades_rpm: Annotated[float, Field(ge=0, le=20_000)]
    egr_closed_rpm: Annotated[float, Field(ge=1, le=20_000)]
    egr_lag_s: _Lag

    @model_validator(mode="after")
    def _curves(self) -> "ControlFile":
        for points, values in (
            ("smoke_rpm", "smoke_lambda"),
            ("lambda_rpm", "lambda_full_load"),
            ("lambda_load", "lambda_part_load"),
            ("vanes_rpm", "vanes"),
            ("egr_load", "egr_opening"),
        ):
            _check_curve(self, points, values)
        if self.lambda_load[-1] >= 1:
            raise ValueError("lambda_load must end below 1, where lambda_full_load takes over")
        if self.egr_closed_rpm <= self.egr_fades_rpm:
            raise ValueError(
                f"egr_closed_rpm {self.egr_closed_rpm:g} must lie above egr_fades_rpm {self.egr_fades_rpm:g}"
            )
        return self


class MeanValueFile(FileModel):
    """A turbocharged diesel beyond its map."""

    compression_ratio: Annotated[float, Field(ge=5, le=30)]
    volumes: VolumesFile
    restrictions: RestrictionsFile
    intercooler: CoolerFile
    compressor: CompressorFile
    turbine: TurbineFile
    rotor: RotorFile
    cylinders: CylindersFile
    recirculation: RecirculationFile
    exhaust_wall: WallFile
    control: ControlFile
