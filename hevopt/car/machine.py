"""Electric machine with its inverter, equation (18): electric power = mechanical power + loss(T, w).

Power > 0 is motoring. The laws of the loss are in machine_laws.py.

Another size by one factor k (another active length, windings and inverter to match), speeds unchanged: torque and
power limits and inertia are k times, and so is the loss at equal speed, loss_k(k T, w) = k loss(T, w), so that the
efficiency is the same at the same share of the limits. Torque and power have one factor.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from hevopt.car.machine_laws import LossLaw
from hevopt.display.facts import Shown

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class TorqueCurve(Shown):
    """The largest torque of either sign over speed; the first holds down to rest, there is none beyond the last.

    speed_radps, torque_nm: (point,)
    """

    speed_radps: Array
    torque_nm: Array

    def scaled(self, factor: float) -> "TorqueCurve":
        """The same speeds with torques multiplied."""
        return replace(self, torque_nm=factor * self.torque_nm)


@dataclass(frozen=True, slots=True, repr=False)
class Machine(Shown):
    """A machine: its limits and the law of its loss.

    full_load: what holds beside the limits of torque and power; None for these alone.
    spin_efficiency: of what passes between the battery's store and a shaft whose speed the machine changes at a
    start, a stop or a change of gear
    """

    name: str
    power_max_w: float
    torque_max_nm: float
    speed_max_radps: float
    inertia_kgm2: float
    loss: LossLaw
    full_load: TorqueCurve | None = None
    spin_efficiency: float = 0.85

    def limit_nm(self, speed_radps: Array) -> Array:
        """Largest torque of either sign at a speed, by torque, by power and by the full-load curve."""
        by_power = self.power_max_w / np.maximum(speed_radps, 1e-9)
        limit = np.minimum(self.torque_max_nm, by_power)
        if self.full_load is None:
            return limit
        curve = self.full_load
        along = np.interp(speed_radps, curve.speed_radps, curve.torque_nm, right=0.0)
        return np.minimum(limit, along)

    def loss_w(self, torque_nm: Array, speed_radps: Array) -> Array:
        """Loss of machine and inverter, never negative; NaN outside a measured map.

        A machine that turns backwards is the mirrored one: loss(T, -w) = loss(-T, w).
        """
        backwards = speed_radps < 0
        if np.any(backwards):
            return self.loss.loss_w(np.where(backwards, -torque_nm, torque_nm), np.abs(speed_radps))
        return self.loss.loss_w(torque_nm, speed_radps)

    def generating_nm(self, electric_power_w: float | Array, speed_radps: Array) -> Array:
        """Torque, against the speed, that generates an electric power >= 0; NaN where that is too much.

        Of several such torques, the one closest to zero.
        """
        torque = self.loss.generating_nm(electric_power_w, np.abs(speed_radps))
        return np.where(speed_radps < 0, -torque, torque)

    def scaled(self, factor: float) -> "Machine":
        """The machine with `factor` times the torque and power, at equal speeds and efficiencies."""
        return replace(
            self,
            power_max_w=factor * self.power_max_w,
            torque_max_nm=factor * self.torque_max_nm,
            inertia_kgm2=factor * self.inertia_kgm2,
            loss=self.loss.scaled(factor),
            full_load=None if self.full_load is None else self.full_load.scaled(factor),
        )
