"""The laws by which a machine and its inverter lose power: one class each, with the same methods.

Torque > 0 motors; the speed is not negative (a machine that turns backwards is the mirrored one, machine.py).
At rest without torque the inverter is off and the loss is 0.
A measured map is interpolated (grid.py) and never extrapolated: outside it the result is NaN.
"""

from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from hevopt.car.grid import interpolated
from hevopt.display.facts import Shown

Array = NDArray[np.float64]


class LossLaw(Protocol):
    """What a machine asks of the law that it loses by."""

    def loss_w(self, torque_nm: Array, speed_radps: Array) -> Array:
        """Loss, never negative; NaN outside a measured map."""

    def generating_nm(self, electric_power_w: float | Array, speed_radps: Array) -> Array:
        """Torque (negative) that generates an electric power >= 0; NaN where that is too much.

        Of several such torques, the one closest to zero.
        """

    def scaled(self, factor: float) -> "LossLaw":
        """The law of a machine with `factor` times the torque and power, see machine.py."""


@dataclass(frozen=True, slots=True)
class LossByEfficiency:
    """One efficiency for either direction of power."""

    efficiency: float

    def loss_w(self, torque_nm: Array, speed_radps: Array) -> Array:
        """The share of the power that the efficiency leaves over."""
        power = torque_nm * speed_radps
        return np.where(
            power > 0, power * (1 / self.efficiency - 1), -power * (1 - self.efficiency)
        )

    def generating_nm(self, electric_power_w: float | Array, speed_radps: Array) -> Array:
        """The torque of the electric power over the efficiency."""
        return -electric_power_w / self.efficiency / np.maximum(speed_radps, 1e-9)

    def scaled(self, factor: float) -> "LossByEfficiency":
        """The same: an efficiency has no size."""
        return self


@dataclass(frozen=True, slots=True)
class LossByCoefficients:
    """Loss c0 + c1 w + c2 w² + c3 T², in W with w in rad/s and T in Nm."""

    c0: float
    c1: float
    c2: float
    c3: float

    def loss_w(self, torque_nm: Array, speed_radps: Array) -> Array:
        """The polynomial; 0 at rest without torque."""
        turning = (speed_radps > 0) | (torque_nm != 0)
        loss = self.c0 + self.c1 * speed_radps + self.c2 * speed_radps**2 + self.c3 * torque_nm**2
        return np.where(turning, loss, 0.0)

    def generating_nm(self, electric_power_w: float | Array, speed_radps: Array) -> Array:
        """The root of the quadratic that is closer to zero."""
        speed = np.maximum(speed_radps, 1e-9)
        constant = electric_power_w + self.c0 + self.c1 * speed + self.c2 * speed**2
        if self.c3 == 0:
            return -constant / speed
        root = speed**2 - 4 * self.c3 * constant
        torque = (-speed + np.sqrt(np.maximum(root, 0.0))) / (2 * self.c3)
        return np.where(root >= 0, torque, np.nan)

    def scaled(self, factor: float) -> "LossByCoefficients":
        """c3 falls by the factor by which the others grow."""
        return LossByCoefficients(
            factor * self.c0, factor * self.c1, factor * self.c2, self.c3 / factor
        )


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class LossMap(Shown):
    """A measured loss map, machine and inverter; cells that were not measured are NaN.

    speed_radps: (speed,), torque_nm: (torque,) of both signs, loss: (speed, torque), W
    """

    speed_radps: Array
    torque_nm: Array
    loss: Array

    def loss_w(self, torque_nm: Array, speed_radps: Array) -> Array:
        """The map's value; 0 at rest without torque."""
        turning = (speed_radps > 0) | (torque_nm != 0)
        return np.where(turning, self._at(torque_nm, speed_radps), 0.0)

    def generating_nm(self, electric_power_w: float | Array, speed_radps: Array) -> Array:
        """Exact inverse: at a given speed the loss is linear in torque between rows and diagonals of the map."""
        speed, grid_speed = np.asarray(speed_radps, dtype=float)[..., None], self.speed_radps
        i = np.clip(np.searchsorted(grid_speed, speed, "right") - 1, 0, len(grid_speed) - 2)
        x = (speed - grid_speed[i]) / (grid_speed[i + 1] - grid_speed[i])
        low, step = self.torque_nm[:-1], np.diff(self.torque_nm)
        ends = np.broadcast_to(self.torque_nm, (*speed.shape[:-1], len(self.torque_nm)))
        breaks = np.concatenate([ends, low + x * step, low + (1 - x) * step, 0 * speed], axis=-1)
        # From zero downwards, the first piece on which the electric power passes the one wanted.
        torque = -np.sort(-np.minimum(breaks, 0.0), axis=-1)
        surplus = torque * speed + self._at(torque, speed) + np.asarray(electric_power_w)[..., None]
        before, after = surplus[..., :-1], surplus[..., 1:]
        passes = (before >= 0) & (after <= 0) & (before > after)
        first = np.argmax(passes, axis=-1)[..., None]
        part = np.take_along_axis(before, first, -1) / np.take_along_axis(
            np.where(passes, before - after, np.nan), first, -1
        )
        start, end = (np.take_along_axis(t, first, -1) for t in (torque[..., :-1], torque[..., 1:]))
        root: Array = (start + part * (end - start))[..., 0]
        return root

    def scaled(self, factor: float) -> "LossMap":
        """The same map with torques and losses multiplied."""
        return replace(self, torque_nm=factor * self.torque_nm, loss=factor * self.loss)

    def _at(self, torque_nm: Array, speed_radps: Array) -> Array:
        return interpolated(self.speed_radps, self.torque_nm, self.loss, torque_nm, speed_radps)
