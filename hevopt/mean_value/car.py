"""A car in a gear for the mean-value engine, and its state at constant speed."""

from math import atanh

import numpy as np
from numpy.typing import NDArray

from hevopt.car.architecture import Architecture
from hevopt.errors import DataError, SolverError
from hevopt.mean_value import states as s
from hevopt.mean_value.parameters import (
    FULL_LOAD,
    Ambient,
    Car,
    Diesel,
    Drive,
    Gas,
    Model,
    curve_of,
)
from hevopt.mean_value.paths import Paths
from hevopt.mean_value.settle import held, steady_state
from hevopt.units import KMH_PER_MPS, RPM_PER_RADPS

Array = NDArray[np.float64]

# Estimates: what a clutch carries over the highest torque; slip at which it carries 76 % of that, as good as
# closed; relaxation of the tyre (the source study's equation 2; relaxation length 0.5 m at 10 m/s).
CLUTCH_RESERVE, CLUTCH_SLIP_RADPS, TYRE_LAG_S = 1.5, 1.0, 0.05

# No car: an engine on a dynamometer.
BENCH = Car(1.0, 1.0, (0.0, 0.0, 0.0, 0.0), 1.0, 1.0, 1.0, 1.0, 1.0, 0.0, 1.0)


def car_in_gear(architecture: Architecture, diesel: Diesel, found: Paths) -> Car:
    """The car with a gear engaged, its machines turning along without torque. found: of the gear"""
    vehicle, engine = architecture.vehicle, architecture.engine
    torque = curve_of(diesel.curves, FULL_LOAD)[1]
    return Car(
        engine_inertia_kgm2=engine.inertia_kgm2 + found.crank_kgm2,
        mass_kg=vehicle.equivalent_mass_kg + found.wheel_kgm2 / vehicle.tyre_radius_m**2,
        resistance_n=(
            vehicle.rolling_n[0] + vehicle.air_n[0],
            vehicle.rolling_n[1] + vehicle.air_n[1],
            vehicle.rolling_n[2] + vehicle.air_n[2],
            vehicle.rolling_n[3] + vehicle.air_n[3],
        ),
        ratio_radpm=found.engine.ratio / vehicle.tyre_radius_m,
        efficiency=found.engine.efficiency,
        clutch_nm=CLUTCH_RESERVE * float(torque.max()),
        clutch_slip_radps=CLUTCH_SLIP_RADPS,
        tyre_lag_s=TYRE_LAG_S,
        assist_ratio_radpm=0.0,
        assist_efficiency=1.0,
    )


def model_of(diesel: Diesel, car: Car, drive: Drive = Drive()) -> Model:  # noqa: B008
    """The equations of an engine in a car, at standard pressure and 25 °C."""
    return Model(*diesel, car, drive, Ambient(), Gas())


def cruise(model: Model, speed_mps: float) -> Array:
    """(state,) of the car at a constant speed; DataError where the engine cannot hold it in this gear."""
    car, rpm = model.car, model.car.ratio_radpm * speed_mps * RPM_PER_RADPS
    speeds, torques = curve_of(model.curves, FULL_LOAD)
    low, high = speeds[0] * RPM_PER_RADPS, speeds[-1] * RPM_PER_RADPS
    kmh = speed_mps * KMH_PER_MPS
    if not low <= rpm <= high:
        what = "too high" if rpm < low else "too low"
        raise DataError(
            f"{kmh:g} km/h: the gear is {what} for the speed, the engine would turn at {rpm:.0f} rpm; allowed: "
            f"{low:.0f} to {high:.0f} rpm, which is {kmh * low / rpm:.0f} to {kmh * high / rpm:.0f} km/h in this "
            "gear; choose another gear or speed"
        )
    powers = np.array([1.0, speed_mps, speed_mps**2, speed_mps**3])
    force = float(np.dot(car.resistance_n, powers))
    torque = force / (car.ratio_radpm * car.efficiency)
    full = float(np.interp(car.ratio_radpm * speed_mps, speeds, torques))
    if torque >= full:
        raise DataError(
            f"{kmh:g} km/h needs {torque:.0f} Nm at {rpm:.0f} rpm, and full load there is {full:.0f} Nm; choose a "
            "lower gear or speed"
        )
    slip = car.clutch_slip_radps * atanh(torque / car.clutch_nm)
    engine_radps = car.ratio_radpm * speed_mps + slip
    try:
        state = steady_state(held(model, torque), engine_radps, speed_mps, torque / full)
        unsettled = None
    except SolverError as error:
        unsettled = error
    if unsettled is not None or not 0.0 <= state[s.PEDAL] < 1.0:
        needed = f"{kmh:g} km/h needs {torque:.0f} Nm at {rpm:.0f} rpm"
        _refuse_load(model, engine_radps, torque, needed)
        raise unsettled or SolverError(f"{needed}, at which the engine does not settle")
    state[s.TYRE] = force
    return state


def _refuse_load(model: Model, engine_radps: float, torque: float, needed: str) -> None:
    """DataError where a torque lies beyond what the pedal settles to at either end."""
    most = settled_torque_nm(model, engine_radps)
    if most <= torque:
        raise DataError(
            f"{needed}, and the engine settles to {most:.0f} Nm there with full pedal: its smoke limit leaves no "
            "more fuel to the air it gets; lower the limit, or choose a lower gear"
        )
    least = settled_torque_nm(model, engine_radps, pedal=0.0)
    if least >= torque:
        raise DataError(
            f"{needed}, and with the pedal released the engine settles to {least:.0f} Nm there; choose a higher "
            "gear"
        )


def settled_torque_nm(model: Model, engine_radps: float, pedal: float = 1.0) -> float:
    """Torque that a pedal settles to at a held engine speed."""
    from hevopt.mean_value._run_kernels import observe

    state = steady_state(held(model), engine_radps, pedal=pedal)
    signals = observe(np.zeros(1), state[None], held(model))[0]
    return float(signals[s.SIGNALS.index("torque_nm")])
