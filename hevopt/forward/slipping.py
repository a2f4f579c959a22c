"""What a driven car's books tell where its tyres slip: the wheels turn by themselves, the brakes act on the car."""

import numpy as np

from hevopt.car.architecture import Architecture
from hevopt.forward import _drive_kernels as col
from hevopt.forward._books_kernels import Begin
from hevopt.forward._slip_kernels import DRIVEN_SHARE
from hevopt.problem.arrays import Array


def slipping(
    car: Architecture, record: Array, begin: Begin, kinetic_w: Array, step_s: float
) -> dict[str, Array]:
    """(step,) powers that differ from those of tyres that roll, W, and the slip after every step.

    begin: the car before the first step; kinetic_w: (step,) as of wheels that roll
    tyre_slip_w: what slides, never negative; tyre_spring_w: what bends the tyres and comes back
    """
    spin = np.append(begin.spin_radps, record[:, col.SPIN])
    speed = np.append(begin.speed_mps, record[:, col.SPEED])
    wheel = speed / car.vehicle.tyre_radius_m + spin
    rolls = _mean(wheel - spin)
    driven_kgm2 = DRIVEN_SHARE * car.vehicle.wheel_inertia_kgm2
    beyond = driven_kgm2 * np.diff(spin * (2 * wheel - spin)) / (2 * step_s)
    brake, held = record[:, col.BRAKE] * rolls, record[:, col.HELD] * rolls
    slides = record[:, col.SPEED] * record[:, col.TYRE] * record[:, col.SLIP]
    return {
        "brake_power_w": brake,
        "held_w": held,
        "wheel_power_w": record[:, col.WHEEL] * _mean(wheel) - brake + held,
        "tyre_lag_w": np.zeros(len(record)),
        "kinetic_w": kinetic_w + beyond,
        "tyre_slip": record[:, col.SLIP],
        "tyre_slip_w": slides,
        "tyre_spring_w": record[:, col.TYRE] * car.vehicle.tyre_radius_m * _mean(spin) - slides,
    }


def _mean(values: Array) -> Array:
    mean: Array = (values[1:] + values[:-1]) / 2
    return mean
