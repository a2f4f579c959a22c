"""Electric machine with its inverter, equation (18): electric power = mechanical power + loss(T, w).

Power > 0 is motoring. At rest without torque the inverter is off and the loss is 0.
A measured loss map is interpolated (grid.py) and never extrapolated: outside it the result is NaN.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hevopt.car.grid import interpolated

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class LossGrid:
    """A measured loss map, machine and inverter; cells that were not measured are NaN.

    speed_radps: (speed,), torque_nm: (torque,) of both signs, loss_w: (speed, torque)
    """

    speed_radps: Array
    torque_nm: Array
    loss_w: Array


@dataclass(frozen=True, slots=True, eq=False)
class TorqueCurve:
    """The largest torque of either sign over speed; the first holds down to rest, there is none beyond the last.

    speed_radps, torque_nm: (point,)
    """

    speed_radps: Array
    torque_nm: Array


@dataclass(frozen=True, slots=True)
class Machine:
    """A machine by its loss c0 + c1 w + c2 w² + c3 T² or a measured map, or by one efficiency for either direction.

    loss: (4,) c0 (W), c1 (W s), c2 (W s²), c3 (W/(Nm)²), or a map; None where `efficiency` is given.
    full_load: what holds beside the limits of torque and power; None for these alone.
    """

    name: str
    power_max_w: float
    torque_max_nm: float
    speed_max_radps: float
    inertia_kgm2: float
    loss: tuple[float, float, float, float] | LossGrid | None
    efficiency: float | None
    full_load: TorqueCurve | None = None


def torque_limit_nm(machine: Machine, speed_radps: Array) -> Array:
    """Largest torque of either sign at a speed, by torque, by power and by the full-load curve."""
    by_power = machine.power_max_w / np.maximum(speed_radps, 1e-9)
    limit = np.minimum(machine.torque_max_nm, by_power)
    if machine.full_load is None:
        return limit
    curve = machine.full_load
    return np.minimum(limit, np.interp(speed_radps, curve.speed_radps, curve.torque_nm, right=0.0))


def loss_w(machine: Machine, torque_nm: Array, speed_radps: Array) -> Array:
    """Loss of machine and inverter, never negative; NaN outside a measured map."""
    if machine.loss is None:
        power = torque_nm * speed_radps
        efficiency = machine.efficiency
        return np.where(power > 0, power * (1 / efficiency - 1), -power * (1 - efficiency))
    turning = (speed_radps > 0) | (torque_nm != 0)
    if isinstance(machine.loss, LossGrid):
        return np.where(turning, _on_grid(machine.loss, torque_nm, speed_radps), 0.0)
    c0, c1, c2, c3 = machine.loss
    loss = c0 + c1 * speed_radps + c2 * speed_radps**2 + c3 * torque_nm**2
    return np.where(turning, loss, 0.0)


def generating_torque_nm(machine: Machine, electric_power_w: float, speed_radps: Array) -> Array:
    """Torque (negative) that generates an electric power >= 0 at a speed; NaN where that is too much.

    Of several such torques, the one closest to zero.
    """
    speed = np.maximum(speed_radps, 1e-9)
    if machine.loss is None:
        return -electric_power_w / machine.efficiency / speed
    if isinstance(machine.loss, LossGrid):
        return _generating_on_grid(machine.loss, electric_power_w, speed_radps)
    c0, c1, c2, c3 = machine.loss
    constant = electric_power_w + c0 + c1 * speed + c2 * speed**2
    if c3 == 0:
        return -constant / speed
    root = speed**2 - 4 * c3 * constant
    return np.where(root >= 0, (-speed + np.sqrt(np.maximum(root, 0.0))) / (2 * c3), np.nan)


def _generating_on_grid(grid: LossGrid, electric_power_w: float, speed_radps: Array) -> Array:
    """Exact inverse: at a given speed the loss is linear in torque between rows and diagonals of the grid."""
    speed = np.asarray(speed_radps, dtype=float)[..., None]
    i = np.clip(np.searchsorted(grid.speed_radps, speed, "right") - 1, 0, len(grid.speed_radps) - 2)
    x = (speed - grid.speed_radps[i]) / (grid.speed_radps[i + 1] - grid.speed_radps[i])
    low, step = grid.torque_nm[:-1], np.diff(grid.torque_nm)
    ends = np.broadcast_to(grid.torque_nm, (*speed.shape[:-1], len(grid.torque_nm)))
    breaks = np.concatenate([ends, low + x * step, low + (1 - x) * step, 0 * speed], axis=-1)
    # From zero downwards, the first piece on which the electric power passes the one wanted.
    torque = -np.sort(-np.minimum(breaks, 0.0), axis=-1)
    surplus = torque * speed + _on_grid(grid, torque, speed) + electric_power_w
    before, after = surplus[..., :-1], surplus[..., 1:]
    passes = (before >= 0) & (after <= 0) & (before > after)
    first = np.argmax(passes, axis=-1)[..., None]
    part = np.take_along_axis(before, first, -1) / np.take_along_axis(
        np.where(passes, before - after, np.nan), first, -1
    )
    start, end = (np.take_along_axis(t, first, -1) for t in (torque[..., :-1], torque[..., 1:]))
    return (start + part * (end - start))[..., 0]


def _on_grid(grid: LossGrid, torque_nm: Array, speed_radps: Array) -> Array:
    return interpolated(grid.speed_radps, grid.torque_nm, grid.loss_w, torque_nm, speed_radps)
