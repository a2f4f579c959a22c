"""From checked component files to components in SI units."""

from math import inf

import numpy as np

from hevopt.car.braking import Braking
from hevopt.car.converter import Converter
from hevopt.car.engine import Engine
from hevopt.car.engine_laws import CompactLaw, EngineMap, FuelCoefficients, NoxCoefficients
from hevopt.car.gear_loss import GearLoss, LossInGear
from hevopt.car.machine import Machine, TorqueCurve
from hevopt.car.machine_laws import LossByCoefficients, LossByEfficiency, LossLaw, LossMap
from hevopt.car.torque_converter import HydraulicConverter
from hevopt.car.transmission import Gearbox
from hevopt.car.vehicle import Vehicle
from hevopt.car_files.architecture import ConverterFile
from hevopt.car_files.battery import BatteryFile, LinearVoltageFile
from hevopt.car_files.car import BrakingFile, CarFile
from hevopt.car_files.engine import EngineFile, EngineGridFile
from hevopt.car_files.fields import FullLoadFile
from hevopt.car_files.gearbox import GearboxFile, GearLossFile, TorqueConverterFile
from hevopt.car_files.machine import LossMapFile, MachineFile
from hevopt.errors import DataError
from hevopt.problem.battery import Battery
from hevopt.units import STANDARD_GRAVITY_MPS2, TO_SI

_MASS_MIN_KG = 50.0


def vehicle_of(car: CarFile, hybrid_mass_kg: float) -> Vehicle:
    """The vehicle of a car's file and the mass that an architecture adds; DataError where the sum is too small."""
    load, mass_kg = car.road_load, car.mass_kg + hybrid_mass_kg
    if mass_kg < _MASS_MIN_KG:
        raise DataError(
            f"mass_kg {car.mass_kg:g} and the architecture's hybrid_mass_kg {hybrid_mass_kg:g} add up "
            f"to {mass_kg:g} kg; allowed: {_MASS_MIN_KG:g} kg or more; raise one of them"
        )
    if load.coastdown_c0_n is not None:
        rolling = (0.0, 0.0, 0.0, 0.0)
        air = (load.coastdown_c0_n, load.coastdown_c1_nspm, load.coastdown_c2_ns2pm2, 0.0)
        if load.coastdown_mass_kg is not None:  # C0 as rolling resistance, in proportion to weight
            rolling = (load.coastdown_c0_n * mass_kg / load.coastdown_mass_kg, 0.0, 0.0, 0.0)
            air = (0.0, *air[1:])
    else:
        weight_n = mass_kg * STANDARD_GRAVITY_MPS2
        rolling = (
            weight_n * (load.rolling_c0 or 0.0),
            weight_n * load.rolling_c1_spm,
            weight_n * load.rolling_c2_s2pm2,
            weight_n * load.rolling_c3_s3pm3,
        )
        air = (0.0, 0.0, load.air_density_kgpm3 / 2 * (load.drag_area_m2 or 0.0), 0.0)
    return Vehicle(
        car.name,
        mass_kg,
        car.tyre_radius_m,
        car.wheel_inertia_kgm2,
        car.auxiliary_power_w,
        rolling,
        air,
        None if car.braking is None else _braking(car.braking),
        car.auxiliary_off_power_w,
    )


def _braking(data: BrakingFile) -> Braking:
    return Braking(
        np.array(data.speed_kmh) * TO_SI["_kmh"][1],
        np.array(data.machine_share),
        data.axle,
        data.load_share,
        data.height_share,
    )


def engine_of(data: EngineFile) -> Engine:
    """The engine of its file, scaled where the file says so."""
    rpm, gram = TO_SI["_rpm"][1], TO_SI["_g"][1]
    engine = Engine(
        name=data.name,
        idle_radps=data.idle_rpm * rpm,
        inertia_kgm2=data.inertia_kgm2,
        start_fuel_kg=data.start_fuel_g * gram,
        heating_value_jpkg=data.fuel.heating_value_mjpkg * TO_SI["_mjpkg"][1],
        fuel_density_kgpm3=data.fuel.density_kgpl * TO_SI["_kgpl"][1],
        co2_kgpkg=data.fuel.co2_kgpkg,
        full_load_speed_radps=np.array(data.full_load.speed_rpm) * rpm,
        full_load_torque_nm=np.array(data.full_load.torque_nm),
        law=_engine_map(data.fuel_map) if data.fuel_map is not None else _compact_law(data),
        least_on_s=data.least_on_s,
        least_off_s=data.least_off_s,
    )
    return engine if data.scale is None else engine.scaled(data.scale.factor)


def _engine_map(data: EngineGridFile) -> EngineMap:
    gram = TO_SI["_g"][1]
    return EngineMap(
        np.array(data.speed_rpm) * TO_SI["_rpm"][1],
        np.array(data.torque_nm),
        np.array(data.fuel_gps) * gram,
        None if data.nox_gps is None else np.array(data.nox_gps) * gram,
        np.array(data.motoring_torque_nm),
    )


def _compact_law(data: EngineFile) -> CompactLaw:
    fuel, nox = data.fuel_coefficients, data.nox_coefficients
    assert fuel is not None  # an engine file without a map has them, as its check makes sure
    return CompactLaw(
        displacement_m3=data.displacement_cm3 * TO_SI["_cm3"][1],
        stroke_m=data.stroke_mm * TO_SI["_mm"][1],
        heating_value_jpkg=data.fuel.heating_value_mjpkg * TO_SI["_mjpkg"][1],
        speed_max_radps=data.full_load.speed_rpm[-1] * TO_SI["_rpm"][1],
        fuel=FuelCoefficients(**fuel.model_dump()),
        nox=None if nox is None else NoxCoefficients(**nox.model_dump()),
    )


def gearbox_of(data: GearboxFile) -> Gearbox:
    """The gearbox of its file; gear 0, neutral, stands first."""
    gears, kmh, free = len(data.ratios), TO_SI["_kmh"][1], data.free_gear
    efficiency = data.efficiency if isinstance(data.efficiency, list) else [data.efficiency] * gears
    loss = None
    if data.loss_map is not None:
        efficiency, loss = [1.0] * gears, GearLoss([_gear_loss(gear) for gear in data.loss_map])
    return Gearbox(
        data.name,
        np.array([1.0, *data.ratios]) * data.final_drive_ratio,
        np.array([1.0, *efficiency]),
        np.array(data.shift_speeds.up_kmh) * kmh,
        np.array(data.shift_speeds.down_kmh) * kmh,
        data.shift_speeds.engage_before_launch_s,
        None if free is None else free.shift_fuel_g * TO_SI["_g"][1],
        0.0 if free is None else free.engine_speed_min_rpm * TO_SI["_rpm"][1],
        data.shift_gap_s,
        loss,
        None if data.torque_converter is None else _torque_converter(data.torque_converter),
    )


def _torque_converter(data: TorqueConverterFile) -> HydraulicConverter:
    radps = TO_SI["_rpm"][1]
    lock_up_rpm = data.lock_up_speed_rpm
    return HydraulicConverter(
        np.array(data.speed_ratio),
        np.array(data.torque_ratio),
        np.array(data.impeller_torque_nm) / (data.impeller_speed_rpm * radps) ** 2,
        inf if lock_up_rpm is None else lock_up_rpm * radps,
        data.lock_up_gear_min,
        data.at_rest == "in_gear",
    )


def _gear_loss(data: GearLossFile) -> LossInGear:
    speed = np.array(data.speed_rpm) * TO_SI["_rpm"][1]
    return LossInGear(speed, np.array(data.torque_nm), np.array(data.loss_nm))


def machine_of(data: MachineFile) -> Machine:
    """The machine of its file, scaled where the file says so."""
    machine = Machine(
        data.name,
        data.power_max_w,
        data.torque_max_nm or inf,
        (data.speed_max_rpm or inf) * TO_SI["_rpm"][1],
        data.inertia_kgm2,
        _loss_law(data),
        None if data.full_load is None else _torque_curve(data.full_load),
        data.spin_efficiency,
    )
    return machine if data.scale is None else machine.scaled(data.scale.factor)


def _loss_law(data: MachineFile) -> LossLaw:
    if data.loss_map is not None:
        return _loss_map(data.loss_map)
    if data.efficiency is not None:
        return LossByEfficiency(data.efficiency)
    given = (data.loss_c0_w, data.loss_c1_ws, data.loss_c2_ws2, data.loss_c3_wpnm2)
    return LossByCoefficients(*(coefficient or 0.0 for coefficient in given))


def _torque_curve(data: FullLoadFile) -> TorqueCurve:
    return TorqueCurve(np.array(data.speed_rpm) * TO_SI["_rpm"][1], np.array(data.torque_nm))


def _loss_map(data: LossMapFile) -> LossMap:
    torque, loss = np.array(data.torque_nm), np.array(data.loss_w)
    if data.symmetric:
        above = torque > 0
        torque = np.concatenate([-torque[above][::-1], torque])
        loss = np.hstack([loss[:, above][:, ::-1], loss])
    return LossMap(np.array(data.speed_rpm) * TO_SI["_rpm"][1], torque, loss)


def converter_of(data: ConverterFile) -> Converter:
    if isinstance(data.efficiency, list):
        return Converter(np.array(data.power_w), np.array(data.efficiency))
    return Converter(np.array([0.0, 1.0]), np.array([data.efficiency] * 2))


def battery_of(data: BatteryFile) -> Battery:
    """The battery of its file, as one pack of all its cells.

    Strings in parallel, and cells of another capacity, carry the current together: k times the charge and the
    limits at equal voltage, 1/k of the resistance.
    """
    cells = data.cells_in_series
    size = data.parallel * (1.0 if data.scale is None else data.scale.capacity)
    points = np.array(data.curve_soc or [0.0, 1.0])
    voltage = data.open_circuit_v
    if isinstance(voltage, LinearVoltageFile):
        voltage = list(voltage.intercept + voltage.slope * points)
    discharge, charge = (
        np.broadcast_to(r, points.shape) * cells / size for r in data.resistances()
    )
    power_max_w = (data.power_max_w or inf) * cells * size
    current_max_a = (data.current_max_a or inf) * size
    voltage_max_v = (data.voltage_max_v or inf) * cells
    return Battery(
        points, np.array(voltage) * cells, discharge, charge,
        data.capacity_ah * TO_SI["_ah"][1] * size, data.coulombic_efficiency,
        data.soc.min, data.soc.max,
        power_max_w, power_max_w, current_max_a, current_max_a,
        data.voltage_min_v * cells, voltage_max_v,
    )  # fmt: skip
