"""The car on the road: resistance forces, equations (5) to (12) of the study."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hevopt.car.braking import Braking
from hevopt.display.facts import Shown
from hevopt.units import STANDARD_GRAVITY_MPS2

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, repr=False)
class Vehicle(Shown):
    """A car without its powertrain.

    rolling_n, air_n: (4,) forces on a level road as polynomials of speed, r0 + r1 v + r2 v² + r3 v³ (N, m/s); of
    these the rolling resistance scales with the cosine of the slope
    braking: what the machine may take of it; None: all that machine and battery can
    auxiliary_off_power_w: electric load while the engine is at rest; None: the same as while it turns
    """

    name: str
    mass_kg: float
    tyre_radius_m: float
    wheel_inertia_kgm2: float
    auxiliary_power_w: float
    rolling_n: tuple[float, float, float, float]
    air_n: tuple[float, float, float, float]
    braking: Braking | None = None
    auxiliary_off_power_w: float | None = None

    def load_w(self, *, engine_on: bool) -> float:
        """Electric load, engine turning or at rest."""
        off_w = self.auxiliary_off_power_w
        return self.auxiliary_power_w if engine_on or off_w is None else off_w

    @property
    def equivalent_mass_kg(self) -> float:
        """Mass with the wheels' inertia, equation (11); engine and machine are charged on their shafts."""
        return self.mass_kg + self.wheel_inertia_kgm2 / self.tyre_radius_m**2


def tractive_force_n(vehicle: Vehicle, speed_mps: Array, accel_mps2: Array, grade: Array) -> Array:
    """Force at the tyres that keeps speed and acceleration; 0 at standstill, where the brakes hold.

    All arguments and the result: (time,). Equations (5) to (12); rolling and air resistance need motion.
    """
    slope_rad = np.arctan(grade)
    powers = np.stack([np.ones_like(speed_mps), speed_mps, speed_mps**2, speed_mps**3])
    rolling = np.asarray(vehicle.rolling_n) @ powers * np.cos(slope_rad)
    air = np.asarray(vehicle.air_n) @ powers
    climbing = vehicle.mass_kg * STANDARD_GRAVITY_MPS2 * np.sin(slope_rad)
    force = rolling + air + climbing + vehicle.equivalent_mass_kg * accel_mps2
    return np.where(speed_mps > 0, force, 0.0)
