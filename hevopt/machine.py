"""Electric machine with its inverter, equation (18): electric power = mechanical power + loss(T, w).

Power > 0 is motoring. At rest without torque the inverter is off and the loss is 0.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Machine:
    """A machine by its loss c0 + c1 w + c2 w² + c3 T², or by one efficiency for either direction.

    loss: (4,) c0 (W), c1 (W s), c2 (W s²), c3 (W/(Nm)²); None where `efficiency` is given.
    """

    name: str
    power_max_w: float
    torque_max_nm: float
    speed_max_radps: float
    inertia_kgm2: float
    loss: tuple[float, float, float, float] | None
    efficiency: float | None


def torque_limit_nm(machine: Machine, speed_radps: Array) -> Array:
    """Largest torque of either sign at a speed, by torque and by power."""
    by_power = machine.power_max_w / np.maximum(speed_radps, 1e-9)
    return np.minimum(machine.torque_max_nm, by_power)


def loss_w(machine: Machine, torque_nm: Array, speed_radps: Array) -> Array:
    """Loss of machine and inverter, never negative."""
    if machine.loss is None:
        power = torque_nm * speed_radps
        efficiency = machine.efficiency
        return np.where(power > 0, power * (1 / efficiency - 1), -power * (1 - efficiency))
    c0, c1, c2, c3 = machine.loss
    turning = (speed_radps > 0) | (torque_nm != 0)
    loss = c0 + c1 * speed_radps + c2 * speed_radps**2 + c3 * torque_nm**2
    return np.where(turning, loss, 0.0)


def generating_torque_nm(machine: Machine, electric_power_w: float, speed_radps: Array) -> Array:
    """Torque (negative) that generates an electric power >= 0 at a speed; NaN where that is too much."""
    speed = np.maximum(speed_radps, 1e-9)
    if machine.loss is None:
        return -electric_power_w / machine.efficiency / speed
    c0, c1, c2, c3 = machine.loss
    constant = electric_power_w + c0 + c1 * speed + c2 * speed**2
    if c3 == 0:
        return -constant / speed
    root = speed**2 - 4 * c3 * constant
    return np.where(root >= 0, (-speed + np.sqrt(np.maximum(root, 0.0))) / (2 * c3), np.nan)
