"""Engine as a 0D map: fuel and NOx over torque and speed, by one of the laws in engine_laws.py.

Another size by one factor k, speeds unchanged (Willans scaling; L. Guzzella, A. Sciarretta, Vehicle Propulsion
Systems, Springer, section 3.1: brake and fuel mean pressure over mean piston speed are those of a family of
engines, whatever their size). The stroke stays, and the number of cylinders changes by k: at equal speed the piston
speed is the same, at equal mean pressure the efficiency. So displacement, full load, drag and power are k times as
large at every speed, and
    fuel_k(k T, w) = k fuel(T, w)    NOx_k(k T, w) = k NOx(T, w)    inertia, fuel of a start: k times
The factor may be called that of displacement, torque or power: with speeds unchanged the three are one.
"""

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from hevopt.car.engine_laws import EngineLaw, NoFuelLaw
from hevopt.display.facts import Shown

Array = NDArray[np.float64]
# Least that the best efficiency counts: what is divided by it stays finite.
_EFFICIENCY_MIN = 0.01
# What a car without an engine counts a joule of electricity as: fuel of so many J/kg. Any figure makes the same
# plan least; that of diesel keeps costs at the size of others.
ELECTRICITY_JPKG = 42.9e6


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Engine(Shown):
    """An engine and its fuel.

    full_load_*: (point,) curve of the highest torque over speed
    least_*_s: for how long it stays on, once started, and off, once stopped
    """

    name: str
    idle_radps: float
    inertia_kgm2: float
    start_fuel_kg: float
    heating_value_jpkg: float
    fuel_density_kgpm3: float
    co2_kgpkg: float
    full_load_speed_radps: Array
    full_load_torque_nm: Array
    law: EngineLaw
    least_on_s: float = 0.0
    least_off_s: float = 0.0

    @property
    def speed_max_radps(self) -> float:
        """Highest speed of the full-load curve."""
        return float(self.full_load_speed_radps[-1])

    @property
    def nox_known(self) -> bool:
        """Whether there are data on NOx."""
        return self.law.nox_known

    def full_load_nm(self, speed_radps: Array) -> Array:
        """Highest torque at a speed within the full-load curve."""
        return np.interp(speed_radps, self.full_load_speed_radps, self.full_load_torque_nm)

    def covered_nm(self, speed_radps: Array) -> Array:
        """Highest torque that the engine gives and its data cover: full load, or less where a map ends below it.

        NaN where a map knows nothing at a speed.
        """
        return self.law.covered_nm(self.full_load_nm(speed_radps), speed_radps)

    def drag_nm(self, speed_radps: Array) -> Array:
        """Torque of the turning engine without fuel, negative; NaN at speeds beyond a measured map's."""
        return self.law.drag_nm(speed_radps)

    def fuel_kgps(self, torque_nm: Array, speed_radps: Array) -> Array:
        """Fuel flow; 0 at or below the drag torque (fuel cut), NaN outside a measured map."""
        return self.law.fuel_kgps(torque_nm, speed_radps)

    def nox_kgps(self, torque_nm: Array, speed_radps: Array) -> Array:
        """NOx flow; 0 while the fuel is cut is the caller's to apply. NaN outside a measured map.

        0 everywhere where it is not known, so that sums stay finite; `nox_known` tells.
        """
        return self.law.nox_kgps(torque_nm, speed_radps)

    def best_nm(self, speed_radps: Array) -> Array:
        """Torque of highest efficiency at each speed, from a grid of 1 % of full load.

        Of the closest speeds that a measured map knows where it knows nothing: no control is possible there.
        """
        speeds, torques = _best_line(self)
        best_nm: Array = np.interp(speed_radps, speeds, torques)
        return best_nm

    def best_radps(self, power_w: Array) -> Array:
        """Speed at which a power takes least fuel, from a grid; the fastest where no speed gives it."""
        powers, speeds = _best_speeds(self)
        best_radps: Array = np.interp(power_w, powers, speeds)
        return best_radps

    def scaled(self, factor: float) -> "Engine":
        """The engine with `factor` times the displacement, at equal mean pressures and piston speeds."""
        return replace(
            self,
            inertia_kgm2=factor * self.inertia_kgm2,
            start_fuel_kg=factor * self.start_fuel_kg,
            full_load_torque_nm=factor * self.full_load_torque_nm,
            law=self.law.scaled(factor),
        )

    @property
    def best_efficiency(self) -> float:
        """The highest efficiency of all speeds and torques."""
        speed, torque = _best_line(self)
        fuel_w = self.heating_value_jpkg * self.fuel_kgps(torque, speed)
        efficiency = torque * speed / np.where(fuel_w > 0, fuel_w, np.inf)
        return max(float(np.nanmax(efficiency)), _EFFICIENCY_MIN)


def no_engine() -> Engine:
    """What stands for the engine of a car that has none: it burns nothing and no shaft turns with it."""
    return Engine(
        name="none",
        idle_radps=0.0,
        inertia_kgm2=0.0,
        start_fuel_kg=0.0,
        heating_value_jpkg=ELECTRICITY_JPKG,
        fuel_density_kgpm3=835.0,
        co2_kgpkg=0.0,
        full_load_speed_radps=np.array([0.0, 1.0]),
        full_load_torque_nm=np.zeros(2),
        law=NoFuelLaw(),
    )


@lru_cache(maxsize=64)
def _best_line(engine: Engine) -> tuple[Array, Array]:
    """(speed,) speeds and the torque of highest efficiency at each."""
    speeds = np.linspace(engine.full_load_speed_radps[0], engine.speed_max_radps, 101)[:, None]
    torques = engine.full_load_nm(speeds) * np.linspace(0.01, 1.0, 100)
    fuel = engine.fuel_kgps(torques, speeds)
    with np.errstate(invalid="ignore", divide="ignore"):
        efficiency = torques * speeds / np.where(fuel > 0, fuel, np.nan)
    efficiency = np.where(np.isfinite(efficiency), efficiency, -1.0)
    best, known = np.argmax(efficiency, axis=1), (efficiency >= 0).any(axis=1)
    known |= ~known.any()
    return speeds[known, 0], torques[np.arange(len(speeds)), best][known]


@lru_cache(maxsize=64)
def _best_speeds(engine: Engine) -> tuple[Array, Array]:
    """(power,) powers, rising, and the speed at which each takes least fuel."""
    speeds = np.linspace(engine.idle_radps, engine.speed_max_radps, 101)
    most = np.nan_to_num(engine.covered_nm(speeds), nan=0.0)
    powers = np.linspace(0.02, 1.0, 50) * float(np.max(most * speeds))
    torques = powers[:, None] / speeds
    fuel = np.where(torques <= most, engine.fuel_kgps(torques, speeds[None, :]), np.nan)
    known = ~np.isnan(fuel).all(axis=1)
    best = np.argmin(np.where(np.isnan(fuel[known]), np.inf, fuel[known]), axis=1)
    return powers[known], speeds[best]
