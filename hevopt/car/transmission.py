"""Gearbox and final drive, equations (13) and (14): efficiency by the direction of power flow, or losses."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hevopt.car.gear_loss import GearLoss
from hevopt.car.torque_converter import HydraulicConverter
from hevopt.display.facts import Shown

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Gearbox(Shown):
    """Forward gears with the final drive; gear 0 is neutral.

    ratios, efficiency: (gear + 1,) input to wheels, index 0 for neutral; efficiency 1 where loss says what is lost
    up_mps, down_mps: (gear - 1,) speeds of the change up from, and down to, gears 1, 2, ...
    shift_fuel_kg, engine_speed_min_radps: cost of a change and lowest engine speed above first gear, where the
    gear is a control; None where it cannot be one
    shift_gap_s: time without torque at a listed change of gear; 0 for a dual clutch gearbox
    loss: torque lost over gear, speed and torque; None where one efficiency of each gear says it
    torque_converter: in the place of the driver's clutch; None where it is a clutch
    """

    name: str
    ratios: Array
    efficiency: Array
    up_mps: Array
    down_mps: Array
    engage_before_launch_s: float
    shift_fuel_kg: float | None = None
    engine_speed_min_radps: float = 0.0
    shift_gap_s: float = 0.0
    loss: GearLoss | None = None
    torque_converter: HydraulicConverter | None = None

    def needed_nm(self, gear: NDArray[np.int64], input_radps: Array, output_nm: Array) -> Array:
        """(time,) torque at the input for one at the wheels, each in a gear and at a speed of the input."""
        ratio = self.ratios[gear]
        if self.loss is not None:
            return self.loss.input_nm(gear, input_radps, output_nm / ratio)
        return input_torque_nm(output_nm, ratio, self.efficiency[gear])


def output_torque_nm(input_nm: Array, ratio: Array, efficiency: Array) -> Array:
    """Torque at the wheels for a torque at the input."""
    return np.where(input_nm > 0, input_nm * efficiency, input_nm / efficiency) * ratio


def input_torque_nm(output_nm: Array, ratio: Array, efficiency: Array) -> Array:
    """Torque at the input for a torque at the wheels: the inverse of `output_torque_nm`."""
    return np.where(output_nm > 0, output_nm / efficiency, output_nm * efficiency) / ratio


def gears_from_shift_speeds(
    gearbox: Gearbox, time_s: Array, speed_mps: Array
) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Gear and open clutch per step for a trace without gears, from the speed at the step's end or start,
    whichever is higher.

    At standstill neutral; first gear with open clutch `engage_before_launch_s` before moving off.
    """
    steps = len(time_s) - 1
    gear = np.zeros(steps, dtype=np.int64)
    moving = (speed_mps[1:] + speed_mps[:-1]) > 0
    current = 1
    for k in range(steps):
        if not moving[k]:
            current = 1
            continue
        speed = max(speed_mps[k], speed_mps[k + 1])
        while current <= len(gearbox.up_mps) and speed > gearbox.up_mps[current - 1]:
            current += 1
        while current > 1 and speed < gearbox.down_mps[current - 2]:
            current -= 1
        gear[k] = current
    clutch_open = np.zeros(steps, dtype=bool)
    for rest in np.flatnonzero(moving[1:] & ~moving[:-1]):
        launch_s = time_s[rest + 1]
        waiting = ~moving[: rest + 1] & (
            time_s[: rest + 1] >= launch_s - gearbox.engage_before_launch_s
        )
        gear[: rest + 1][waiting] = 1
        clutch_open[: rest + 1][waiting] = True
    return gear, clutch_open
