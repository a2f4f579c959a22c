"""Maps of a car's engine and machine on a grid, for drawing."""

import numpy as np
from numpy.typing import NDArray

from hevopt.car.architecture import Architecture
from hevopt.pages.comparison.saved_car import MapFigures

Array = NDArray[np.float64]
_SPEEDS, _TORQUES = 49, 61
# Below this share of the highest torque, figures per work say nothing.
_LEAST_SHARE = 0.02


def engine_map(car: Architecture) -> MapFigures:
    """Efficiency and NOx per work of the engine; beyond full load as far as its model goes."""
    engine = car.engine
    speed = np.linspace(engine.full_load_speed_radps[0], engine.speed_max_radps, _SPEEDS)
    top = float(np.max(engine.full_load_torque_nm))
    torque = np.linspace(_LEAST_SHARE * top, 1.02 * top, _TORQUES)
    grid_speed, grid_torque = speed[:, None], torque[None, :]
    work = grid_speed * grid_torque
    with np.errstate(invalid="ignore", divide="ignore"):
        fuel = engine.fuel_kgps(grid_torque, grid_speed)
        nox = engine.nox_kgps(grid_torque, grid_speed) / work
        efficiency = work / (fuel * engine.heating_value_jpkg)
    return MapFigures(
        name=engine.name,
        speed_radps=_rounded(speed, 3),
        torque_nm=_rounded(torque, 3),
        efficiency=_nested(efficiency, 5),
        nox_kgpj=_nested(nox, 14) if np.nanmax(nox, initial=0.0) > 0 else None,
        limit_nm=_rounded(engine.full_load_nm(speed), 3),
        least_nm=_nested(engine.drag_nm(speed)[None, :], 3)[0],
    )


def machine_map(car: Architecture, used_radps: float, used_nm: float) -> MapFigures:
    """Efficiency of machine and inverter in the direction of the power, up to its limits.

    used_radps, used_nm: highest speed and torque that can be used, for a machine that names no limits
    """
    machine = car.machines[0]
    top_speed = machine.speed_max_radps if np.isfinite(machine.speed_max_radps) else used_radps
    speed = np.linspace(0.0, max(float(top_speed), 1.0), _SPEEDS)
    limit = machine.limit_nm(speed)
    top = machine.torque_max_nm if np.isfinite(machine.torque_max_nm) else 1.1 * used_nm
    top = max(float(top), 1e-3)
    # A limit beyond the grid is none that could be drawn.
    limit = np.minimum(limit, 2 * top)
    torque = np.linspace(-top, top, 2 * (_TORQUES // 2) + 1)
    grid_speed, grid_torque = speed[:, None], torque[None, :]
    mechanical = grid_speed * grid_torque
    electric = mechanical + machine.loss_w(grid_torque, grid_speed)
    with np.errstate(invalid="ignore", divide="ignore"):
        efficiency = np.where(mechanical > 0, mechanical / electric, electric / mechanical)
    # A generator that needs power from both sides has no efficiency.
    efficiency = np.where(efficiency > 0, efficiency, np.nan)
    return MapFigures(
        name=machine.name,
        speed_radps=_rounded(speed, 3),
        torque_nm=_rounded(torque, 4),
        efficiency=_nested(efficiency, 5),
        nox_kgpj=None,
        limit_nm=_rounded(limit, 4),
        least_nm=_rounded(-limit, 4),
    )


def _rounded(values: Array, digits: int) -> list[float]:
    return np.round(values, digits).tolist()


def _nested(values: Array, digits: int) -> list[list[float | None]]:
    return [
        [round(x, digits) if np.isfinite(x) else None for x in line] for line in values.tolist()
    ]
