"""A source of electricity without a shaft, such as a fuel cell: fuel over the power that it gives.

It takes the engine's place on a shaft of one speed, so that torque stands for power; the machine on that shaft is
the converter by which it feeds the bus. It gives from nothing up to its most, and takes nothing.
"""

from dataclasses import dataclass, replace

import numpy as np

from hevopt.car.engine import Engine
from hevopt.display.facts import Shown
from hevopt.problem.arrays import Array, Flags

# Of the shaft that stands for it; whichever it is, no result depends on it.
SPEED_RADPS = 100.0


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class SourceLaw(Shown):
    """Fuel over power, linear between points; NaN beyond them.

    power_w: (point,) from 0 up; fuel_kgps: (point,)
    """

    power_w: Array
    fuel_of_kgps: Array
    nox_known: bool = False
    lowest_nm: float = 0.0

    def fuel_kgps(self, torque_nm: Array, speed_radps: Array) -> Array:
        """Fuel flow at the power that torque and speed stand for."""
        power_w = torque_nm * np.asarray(speed_radps)
        beyond = 1e-9 * self.power_w[-1]
        inside = (power_w >= -beyond) & (power_w <= self.power_w[-1] + beyond)
        return np.where(inside, np.interp(power_w, self.power_w, self.fuel_of_kgps), np.nan)

    def nox_kgps(self, torque_nm: Array, speed_radps: Array) -> Array:
        """None."""
        return np.zeros(np.broadcast_shapes(np.shape(torque_nm), np.shape(speed_radps)))

    def drag_nm(self, speed_radps: Array) -> Array:
        """None: it takes no power."""
        return np.zeros(np.shape(speed_radps))

    def covered_nm(self, full_load_nm: Array, speed_radps: Array) -> Array:
        """All that it gives."""
        return np.asarray(full_load_nm)

    def near_edge(self, torque_nm: Array, speed_radps: Array, share: float) -> Flags:
        """Nowhere: it is known up to its most."""
        return np.zeros(np.broadcast_shapes(np.shape(torque_nm), np.shape(speed_radps)), dtype=bool)

    def scaled(self, factor: float) -> "SourceLaw":
        """That of `factor` times the cells."""
        power_w, fuel_kgps = factor * self.power_w, factor * self.fuel_of_kgps
        return replace(self, power_w=power_w, fuel_of_kgps=fuel_kgps)


def source_as_engine(
    name: str,
    law: SourceLaw,
    *,
    heating_value_jpkg: float,
    fuel_density_kgpm3: float,
    co2_kgpkg: float,
    start_fuel_kg: float,
    least_on_s: float,
    least_off_s: float,
) -> Engine:
    """A source in the engine's place; see `Engine` for what the figures of its fuel and dwell are."""
    return Engine(
        name=name,
        idle_radps=SPEED_RADPS,
        inertia_kgm2=0.0,
        start_fuel_kg=start_fuel_kg,
        heating_value_jpkg=heating_value_jpkg,
        fuel_density_kgpm3=fuel_density_kgpm3,
        co2_kgpkg=co2_kgpkg,
        full_load_speed_radps=np.array([SPEED_RADPS, SPEED_RADPS]),
        full_load_torque_nm=np.full(2, law.power_w[-1] / SPEED_RADPS),
        law=law,
        least_on_s=least_on_s,
        least_off_s=least_off_s,
    )
