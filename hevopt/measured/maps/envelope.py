"""Where a car may ask for an engine or a machine, and which of it a map knows."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hevopt.car_files.engine import EngineFile
from hevopt.car_files.machine import MachineFile
from hevopt.display.facts import Shown
from hevopt.measured.maps.grid import MapGrid
from hevopt.measured.maps.request import ImportedMap
from hevopt.units import RPM_PER_RADPS

Array = NDArray[np.float64]

FINE = 200
_ROUNDING = 1e-9


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Envelope(Shown):
    """Where the car may ask for: between two torques at each speed; all (speed,)."""

    speed_radps: Array
    low_nm: Array
    high_nm: Array


def envelope_of(file: EngineFile | MachineFile, speed_radps: Array | None = None) -> Envelope:
    """Torques between which the car may use the component: motoring and full load, or a machine's limits.

    speed_radps: where, else evenly over all speeds of the component; NaN at other speeds than its own
    """
    engine = isinstance(file, EngineFile)
    low_rpm, high_rpm = (
        (file.idle_rpm, file.full_load.speed_rpm[-1]) if engine else (0.0, file.speed_max_rpm)
    )
    rpm = np.linspace(low_rpm, high_rpm, FINE)
    if speed_radps is not None:
        rpm = speed_radps * RPM_PER_RADPS
        slack = _ROUNDING * high_rpm
        rpm = np.where((rpm < low_rpm - slack) | (rpm > high_rpm + slack), np.nan, rpm)
    speed = rpm / RPM_PER_RADPS
    if engine:
        full, grid = file.full_load, file.fuel_map
        low = np.interp(rpm, grid.speed_rpm, grid.motoring_torque_nm)  # drawn on beyond the map
        return Envelope(speed, low, np.interp(rpm, full.speed_rpm, full.torque_nm))
    with np.errstate(divide="ignore"):
        high = np.minimum(file.torque_max_nm, file.power_max_w / speed)
    if (full := file.full_load) is not None:
        high = np.minimum(high, np.interp(rpm, full.speed_rpm, full.torque_nm, right=0.0))
    return Envelope(speed, -high, high)


def between(grid: MapGrid, envelope: Envelope) -> tuple[Array, NDArray[np.bool_]]:
    """(speed, share) torques evenly from the lowest to the highest at each speed, and which are known."""
    shares = np.linspace(0.0, 1.0, FINE)
    torque = envelope.low_nm[:, None] * (1 - shares) + envelope.high_nm[:, None] * shares
    return torque, ~np.isnan(grid.at(torque, envelope.speed_radps[:, None]))


def accepted(imported: ImportedMap, speed_radps: Array, torque_nm: Array) -> NDArray[np.bool_]:
    """Where a car may use the component: within its limits, and all that the file holds a map of is known."""
    envelope = envelope_of(imported.file, speed_radps)
    inside = (torque_nm >= envelope.low_nm) & (torque_nm <= envelope.high_nm)
    for grid in (imported.grid, *(imported.nox or ())[:1]):
        inside &= ~np.isnan(grid.at(torque_nm, speed_radps))
    return inside


def in_reach(
    file: EngineFile | MachineFile, speed_radps: Array, torque_nm: Array
) -> NDArray[np.bool_]:
    """Where the component can be at all, whatever was measured: between idle and its highest speed, and within
    its limits of torque."""
    envelope = envelope_of(file, speed_radps)
    slack = _ROUNDING * np.nanmax(np.abs(torque_nm), initial=0.0)
    above = torque_nm >= envelope.low_nm - slack
    return above & (torque_nm <= envelope.high_nm + slack)


def corners(grid: MapGrid, file: EngineFile | MachineFile) -> tuple[Array, Array]:
    """Speeds and torques, (place,), at which a map may be at its best: its cells in reach, and those of the limits.

    The limits at the grid's speeds and at the corners of the full-load curve.
    """
    speed, torque = mesh(grid)
    reached = in_reach(file, speed, torque)
    at = grid.speed_radps
    if file.full_load is not None:
        at = np.union1d(at, np.array(file.full_load.speed_rpm) / RPM_PER_RADPS)
    limits = envelope_of(file, at)
    speeds = np.concatenate([speed[reached], at, at])
    torques = np.concatenate([torque[reached], limits.high_nm, limits.low_nm])
    known = np.isfinite(torques)
    return speeds[known], torques[known]


def mesh(grid: MapGrid) -> tuple[Array, Array]:
    """(speed, torque) speed and torque of every cell."""
    return np.meshgrid(grid.speed_radps, grid.torque_nm, indexing="ij")


def place(speed_radps: float, torque_nm: float) -> str:
    """A place of a map in words."""
    return f"{speed_radps * RPM_PER_RADPS:.4g} rpm, {torque_nm:.4g} Nm"
