"""Where a car may ask for an engine or a machine, and which of it a map knows."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hevopt.engine_file import EngineFile
from hevopt.imports.map_grid import Grid
from hevopt.machine_file import MachineFile
from hevopt.units import RPM_PER_RADPS

Array = NDArray[np.float64]

FINE = 200


@dataclass(frozen=True, slots=True, eq=False)
class Envelope:
    """Where the car may ask for: between two torques at each speed; all (speed,)."""

    speed_radps: Array
    low_nm: Array
    high_nm: Array


def envelope_of(file: EngineFile | MachineFile, count: int = FINE) -> Envelope:
    """Torques between which the car may use the component: motoring and full load, or a machine's limits."""
    if isinstance(file, EngineFile):
        full, grid = file.full_load, file.fuel_map
        rpm = np.linspace(file.idle_rpm, full.speed_rpm[-1], count)
        low = np.interp(rpm, grid.speed_rpm, grid.motoring_torque_nm)
        return Envelope(rpm / RPM_PER_RADPS, low, np.interp(rpm, full.speed_rpm, full.torque_nm))
    speed = np.linspace(0.0, file.speed_max_rpm, count) / RPM_PER_RADPS
    with np.errstate(divide="ignore"):
        high = np.minimum(file.torque_max_nm, file.power_max_w / speed)
    return Envelope(speed, -high, high)


def between(grid: Grid, envelope: Envelope) -> tuple[Array, NDArray[np.bool_]]:
    """(speed, share) torques evenly from the lowest to the highest at each speed, and which are known."""
    shares = np.linspace(0.0, 1.0, FINE)
    torque = envelope.low_nm[:, None] * (1 - shares) + envelope.high_nm[:, None] * shares
    return torque, ~np.isnan(grid.at(torque, envelope.speed_radps[:, None]))


def mesh(grid: Grid) -> tuple[Array, Array]:
    """(speed, torque) speed and torque of every cell."""
    return np.meshgrid(grid.speed_radps, grid.torque_nm, indexing="ij")


def place(speed_radps: float, torque_nm: float) -> str:
    """A place of a map in words."""
    return f"{speed_radps * RPM_PER_RADPS:.4g} rpm, {torque_nm:.4g} Nm"
