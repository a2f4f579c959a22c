"""What the wheels ask for, step by step: (Cycle, Vehicle, Gearbox) to torque, speed, gear and clutch.

Step k covers [t_k, t_k+1] with the mean of the two speeds and their difference over the time.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from hevopt.car.transmission import Gearbox, gears_from_shift_speeds
from hevopt.car.vehicle import Vehicle, tractive_force_n
from hevopt.display.facts import Shown
from hevopt.driving.cycle import Cycle
from hevopt.errors import DataError

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Demand(Shown):
    """Wheel torque and speed per step; every array is (time,). Torque > 0 drives the car.

    auxiliary_w: electric load as the cycle lists it, None where it is the car's
    """

    time_s: Array
    step_s: Array
    speed_mps: Array
    wheel_torque_nm: Array
    wheel_speed_radps: Array
    wheel_accel_radps2: Array
    gear: NDArray[np.int64]
    clutch_open: NDArray[np.bool_]
    auxiliary_w: Array | None = None

    @property
    def wheel_power_w(self) -> Array:
        """(time,) power at the wheels, inertia of car and wheels included."""
        return self.wheel_torque_nm * self.wheel_speed_radps

    @property
    def distance_m(self) -> float:
        """Distance driven."""
        return float(np.sum(self.speed_mps * self.step_s))

    @property
    def wheel_work_jpm(self) -> float:
        """Positive work at the wheels per distance."""
        return float(np.sum(np.maximum(self.wheel_power_w, 0) * self.step_s)) / self.distance_m

    def with_torque(self, wheel_torque_nm: Array) -> "Demand":
        """The same steps with another torque."""
        return replace(self, wheel_torque_nm=wheel_torque_nm)

    def with_gear(self, gear: NDArray[np.int64]) -> "Demand":
        """The same steps in other gears."""
        return replace(self, gear=gear)


def demand_of(cycle: Cycle, vehicle: Vehicle, gearbox: Gearbox | None) -> Demand:
    """The cycle's demand on this car, with the cycle's gears or, without any, the shift speeds'.

    A car without a gearbox has gear 0 and no clutch.
    """
    step_s = np.diff(cycle.time_s)
    speed = (cycle.speed_mps[1:] + cycle.speed_mps[:-1]) / 2
    accel = np.diff(cycle.speed_mps) / step_s
    force = tractive_force_n(vehicle, speed, accel, cycle.grade[:-1])
    if gearbox is None:
        gear = np.zeros(len(step_s), dtype=np.int64)
        clutch_open = np.zeros(len(step_s), dtype=np.bool_)
    elif cycle.gear is None or cycle.clutch_open is None:
        gear, clutch_open = gears_from_shift_speeds(gearbox, cycle.time_s, cycle.speed_mps)
    else:
        gear, clutch_open = cycle.gear[:-1], cycle.clutch_open[:-1]
    if gearbox is not None and gear.max() >= len(gearbox.ratios):
        k = int(np.argmax(gear >= len(gearbox.ratios)))
        raise DataError(
            f"cycle {cycle.name}, t = {cycle.time_s[k]:g} s: gear {gear[k]}; gearbox "
            f"{gearbox.name!r} has gears 0 to {len(gearbox.ratios) - 1}; change the cycle's gear "
            "column or remove it"
        )
    radius = vehicle.tyre_radius_m
    return Demand(
        cycle.time_s[:-1], step_s, speed, force * radius, speed / radius, accel / radius,
        gear, clutch_open, None if cycle.auxiliary_w is None else cycle.auxiliary_w[:-1],
    )  # fmt: skip
