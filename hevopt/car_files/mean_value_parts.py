"""From a checked engine file to the mean-value engine and its control unit in SI units."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from hevopt.car_files.engine import EngineFile
from hevopt.car_files.mean_value import ControlFile, MeanValueFile
from hevopt.errors import DataError
from hevopt.files.toml import checked
from hevopt.mean_value.parameters import (
    NO_ASSIST,
    Array,
    Compressor,
    Control,
    Cooler,
    Cylinders,
    Diesel,
    Engine,
    Recirculation,
    Restrictions,
    Rotor,
    Turbine,
    Volumes,
    Wall,
    packed_curves,
)
from hevopt.mean_value.rotor import scaled_inertia_kgm2
from hevopt.mean_value.scaling import scaled
from hevopt.units import TO_SI

_RPM = TO_SI["_rpm"][1]
_MM, _L, _BAR = 1e-3, 1e-3, 1e5


def mean_value_of(place: str, contents: Mapping[str, Any]) -> Diesel:
    """The mean-value engine and control unit of an engine file's contents, scaled where the file says so.

    DataError with `place` in front where the contents are faulty or have no such part.
    """
    file = checked(place, dict(contents), EngineFile)
    if file.mean_value is None:
        raise DataError(
            f"{place}: engine {file.name!r} has no [mean_value] part, which turbo-lag needs; use one that has it, "
            "such as engine_diesel_1600, or add the part (its keys: hevopt architectures schema engine)"
        )
    control = file.mean_value.control
    diesel = Diesel(_engine(file, file.mean_value), _control(control), _curves(file, control))
    return diesel if file.scale is None else scaled(diesel, file.scale.factor)


def _engine(file: EngineFile, data: MeanValueFile) -> Engine:
    losses, wheel, cylinders = data.restrictions, data.compressor, data.cylinders
    diameter = wheel.wheel_diameter_mm * _MM
    inertia = data.rotor.inertia_kgm2 or scaled_inertia_kgm2(diameter)[0]
    egr = data.recirculation
    return Engine(
        Volumes(*(litres * _L for litres in data.volumes.model_dump().values())),
        Restrictions(*losses.model_dump().values()),
        Cooler(data.intercooler.effectiveness, data.intercooler.coolant_k),
        Compressor(**{**wheel.model_dump(exclude={"wheel_diameter_mm"}), "wheel_diameter_m": diameter}),
        Turbine(
            data.turbine.wheel_diameter_mm * _MM / 2,
            data.turbine.area_cm2 * 1e-4,
            data.turbine.flow_exponent,
            data.turbine.efficiency_max,
            data.turbine.blade_speed_ratio,
        ),
        Rotor(inertia, data.rotor.bearing_nms),
        Cylinders(
            displacement_m3=file.displacement_cm3 * TO_SI["_cm3"][1],
            stroke_m=file.stroke_mm * _MM,
            compression_ratio=data.compression_ratio,
            filling_max=cylinders.filling_max,
            filling_fall=cylinders.filling_fall,
            filling_speed_radps=cylinders.filling_speed_rpm * _RPM,
            heating_value_jpkg=file.fuel.heating_value_mjpkg * TO_SI["_mjpkg"][1],
            stoichiometric_air=cylinders.stoichiometric_air,
            efficiency=cylinders.efficiency,
            efficiency_best_mps=cylinders.efficiency_best_mps,
            efficiency_width_mps=cylinders.efficiency_width_mps,
            rich_loss=cylinders.rich_loss,
            rich_width=cylinders.rich_width,
            friction_pa=cylinders.friction_bar * _BAR,
            friction_pa_s2pm2=cylinders.friction_bar_s2pm2 * _BAR,
            gas_exchange_pa=cylinders.gas_exchange_bar * _BAR,
            wall_share=cylinders.wall_share,
            wall_share_1000rpm=cylinders.wall_share_1000rpm,
        ),
        Recirculation(egr.area_mm2 * 1e-6, egr.least_pressure_ratio, Cooler(egr.effectiveness, egr.coolant_k)),
        Wall(**data.exhaust_wall.model_dump()),
    )  # fmt: skip


def _control(data: ControlFile) -> Control:
    return Control(
        pumping_pa=data.pumping_bar * _BAR,
        pumping_pa_1000rpm=data.pumping_bar_1000rpm * _BAR,
        efficiency_fall=data.efficiency_fall,
        efficiency_fall_with_load=data.efficiency_fall_with_load,
        air_meter=float(data.smoke_limit_from == "air_meter"),
        meter_lag_s=data.meter_lag_s,
        charge_k=data.charge_k,
        vanes_growth=data.vanes_growth,
        vanes_least=data.vanes_least,
        vanes_lag_s=data.vanes_lag_s,
        boost_gain_ppa=data.boost_gain_pbar / _BAR,
        boost_integral_ppas=data.boost_integral_pbars / _BAR,
        boost_from_load=data.boost_from_load,
        exhaust_pressure_max_pa=data.exhaust_pressure_max_bar * _BAR,
        exhaust_temperature_max_k=data.exhaust_temperature_max_k,
        egr_fades_radps=data.egr_fades_rpm * _RPM,
        egr_closed_radps=data.egr_closed_rpm * _RPM,
        egr_lag_s=data.egr_lag_s,
    )


def _curves(file: EngineFile, data: ControlFile) -> Array:
    full = file.full_load
    return packed_curves(
        {
            "full_load": (_radps(full.speed_rpm), full.torque_nm),
            "smoke": (_radps(data.smoke_rpm), data.smoke_lambda),
            "full_lambda": (_radps(data.lambda_rpm), data.lambda_full_load),
            "vanes": (_radps(data.vanes_rpm), data.vanes),
            "part_lambda": (data.lambda_load, data.lambda_part_load),
            "egr": (data.egr_load, data.egr_opening),
            "assist": NO_ASSIST,
        }
    )


def _radps(rpm: list[float]) -> Array:
    return np.array(rpm) * _RPM
