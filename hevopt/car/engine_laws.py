"""The laws by which an engine burns: one class each, with the same methods.

Compact coefficients: brake mean pressure p_me = 4 pi T / Vd (four-stroke), and the fuel mean pressure p_mf solves
    p_me = (a + b cm + c cm²) p_mf + a2 p_mf² + l + l2 cm²
(CO2MPAS, European Commission), so the drag torque is where p_mf = 0 and fuel is cut on overrun.
A measured map is interpolated (grid.py) and never extrapolated: outside it the result is NaN.
Torques and speeds are arrays of shapes that broadcast; speed is not negative.
"""

from dataclasses import dataclass, replace
from math import pi
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from hevopt.car.grid import along, highest_known, interpolated
from hevopt.display.facts import Shown

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]
PA_PER_BAR = 1e5


class EngineLaw(Protocol):
    """What an engine asks of the law that it burns by."""

    @property
    def nox_known(self) -> bool:
        """Whether there are data on NOx."""

    @property
    def lowest_nm(self) -> float:
        """Lowest torque, 0 or above, of which the fuel is known at every speed that is."""

    def fuel_kgps(self, torque_nm: Array, speed_radps: Array) -> Array:
        """Fuel flow; 0 at or below the drag torque (fuel cut), NaN outside a measured map."""

    def nox_kgps(self, torque_nm: Array, speed_radps: Array) -> Array:
        """NOx flow, 0 where it is not known; 0 while the fuel is cut is the caller's to apply."""

    def drag_nm(self, speed_radps: Array) -> Array:
        """Torque of the turning engine without fuel, negative; NaN at speeds beyond a measured map's."""

    def covered_nm(self, full_load_nm: Array, speed_radps: Array) -> Array:
        """Full load, or less where a map ends below it; NaN where it knows nothing at a speed."""

    def near_edge(self, torque_nm: Array, speed_radps: Array, share: float) -> Flags:
        """Whether a point lies within a share of the axes from where the data end."""

    def scaled(self, factor: float) -> "EngineLaw":
        """The law of an engine with `factor` times the displacement, see engine.py."""


@dataclass(frozen=True, slots=True)
class FuelCoefficients:
    """Coefficients of the p_mf equation, pressures in bar and piston speed in m/s."""

    a: float
    b: float
    c: float
    a2: float
    l: float  # noqa: E741
    l2: float


@dataclass(frozen=True, slots=True)
class NoxCoefficients:
    """Brake-specific NOx as a logistic function of load, g/kWh, bar, rev/min."""

    m0: float
    lo: float
    hi: float
    p0: float
    p1: float
    dp: float


@dataclass(frozen=True, slots=True)
class NoFuelLaw:
    """That of a car without an engine: nothing is burnt, whatever is asked."""

    nox_known: bool = False
    lowest_nm: float = 0.0

    def fuel_kgps(self, torque_nm: Array, speed_radps: Array) -> Array:
        """None."""
        return np.zeros(np.broadcast_shapes(np.shape(torque_nm), np.shape(speed_radps)))

    def nox_kgps(self, torque_nm: Array, speed_radps: Array) -> Array:
        """None."""
        return self.fuel_kgps(torque_nm, speed_radps)

    def drag_nm(self, speed_radps: Array) -> Array:
        """None."""
        return np.zeros(np.shape(speed_radps))

    def covered_nm(self, full_load_nm: Array, speed_radps: Array) -> Array:
        """None."""
        return np.zeros(np.shape(full_load_nm))

    def near_edge(self, torque_nm: Array, speed_radps: Array, share: float) -> Flags:
        """Nowhere."""
        return self.fuel_kgps(torque_nm, speed_radps) > 0

    def scaled(self, factor: float) -> "NoFuelLaw":
        """The same."""
        return self


@dataclass(frozen=True, slots=True, repr=False)
class CompactLaw(Shown):
    """Fuel and NOx by coefficients over mean pressure and mean piston speed.

    speed_max_radps: beyond it an engine is not used, and the polynomials mean nothing
    """

    displacement_m3: float
    stroke_m: float
    heating_value_jpkg: float
    speed_max_radps: float
    fuel: FuelCoefficients
    nox: NoxCoefficients | None

    @property
    def nox_known(self) -> bool:
        """Whether there are coefficients of NOx."""
        return self.nox is not None

    @property
    def lowest_nm(self) -> float:
        """None below 0: coefficients have no end."""
        return 0.0

    def fuel_kgps(self, torque_nm: Array, speed_radps: Array) -> Array:
        """Fuel flow; 0 at or below the drag torque."""
        k, cm = self.fuel, self.piston_speed_mps(speed_radps)
        p_me = self.mean_pressure_bar(torque_nm)
        slope = k.a + k.b * cm + k.c * cm**2
        load = np.maximum(p_me - k.l - k.l2 * cm**2, 0.0)
        # Drag torque recomputed from p_me differs from 0 by rounding; a fuel cut must be exactly 0.
        load = np.where(load < 1e-9, 0.0, load)
        p_mf = 2 * load / (slope + np.sqrt(np.maximum(slope**2 + 4 * k.a2 * load, 0.0)))
        power_w = p_mf * PA_PER_BAR * self.displacement_m3 * speed_radps / (4 * pi)
        return power_w / self.heating_value_jpkg

    def nox_kgps(self, torque_nm: Array, speed_radps: Array) -> Array:
        """NOx flow; 0 everywhere without coefficients."""
        if self.nox is None:
            return np.zeros(np.broadcast(torque_nm, speed_radps).shape)
        k = self.nox
        speed_rpm = speed_radps * 60 / (2 * pi)
        p_me = np.maximum(self.mean_pressure_bar(torque_nm), 0.0)
        steepness = (p_me - k.p0 - k.p1 * (speed_rpm / 1000 - 2)) / k.dp
        specific_gpkwh = k.lo + (k.hi - k.lo) / (1 + np.exp(-steepness))
        # 1 bar on 1 litre is 100 J per working cycle, and g/kWh x 100 J = mg / 36.
        mg_per_litre_cycle = k.m0 + specific_gpkwh * p_me * (speed_rpm / 2000) ** 0.19 / 36
        cycles_per_s = speed_radps / (4 * pi)
        return mg_per_litre_cycle * 1e-6 * (self.displacement_m3 * 1e3) * cycles_per_s

    def drag_nm(self, speed_radps: Array) -> Array:
        """Torque at which the fuel mean pressure is 0."""
        k, cm = self.fuel, self.piston_speed_mps(speed_radps)
        return (k.l + k.l2 * cm**2) * PA_PER_BAR * self.displacement_m3 / (4 * pi)

    def covered_nm(self, full_load_nm: Array, speed_radps: Array) -> Array:
        """Full load: coefficients have no end."""
        return full_load_nm

    def near_edge(self, torque_nm: Array, speed_radps: Array, share: float) -> Flags:
        """Nowhere: coefficients have no end."""
        return np.zeros(np.broadcast(torque_nm, speed_radps).shape, dtype=bool)

    def scaled(self, factor: float) -> "CompactLaw":
        """The same mean pressures in another displacement."""
        return replace(self, displacement_m3=factor * self.displacement_m3)

    def piston_speed_mps(self, speed_radps: Array) -> Array:
        """Mean piston speed, at speeds beyond the highest that of the highest."""
        return self.stroke_m * np.minimum(speed_radps, self.speed_max_radps) / pi

    def mean_pressure_bar(self, torque_nm: Array) -> Array:
        """Brake mean pressure of a torque."""
        return 4 * pi * torque_nm / self.displacement_m3 / PA_PER_BAR


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class EngineMap(Shown):
    """A measured map; cells that were not measured are NaN.

    speed_radps: (speed,), torque_nm: (torque,), fuel and nox: (speed, torque), kg/s; nox None: unknown
    motoring_nm: (speed,) torque of the unfired engine, negative
    """

    speed_radps: Array
    torque_nm: Array
    fuel: Array
    nox: Array | None
    motoring_nm: Array

    @property
    def nox_known(self) -> bool:
        """Whether NOx was measured."""
        return self.nox is not None

    @property
    def lowest_nm(self) -> float:
        """The lowest torque of the map, where that is above 0."""
        return max(0.0, float(self.torque_nm[0]))

    def fuel_kgps(self, torque_nm: Array, speed_radps: Array) -> Array:
        """Fuel flow; 0 at or below the drag torque, NaN outside what was measured."""
        cut = torque_nm <= self.drag_nm(speed_radps) + 1e-9
        return np.where(cut, 0.0, self._at(self.fuel, torque_nm, speed_radps))

    def nox_kgps(self, torque_nm: Array, speed_radps: Array) -> Array:
        """NOx flow, NaN outside what was measured; 0 everywhere where none was."""
        if self.nox is None:
            return np.zeros(np.broadcast(torque_nm, speed_radps).shape)
        return self._at(self.nox, torque_nm, speed_radps)

    def drag_nm(self, speed_radps: Array) -> Array:
        """Torque of the unfired engine; NaN beyond the map's speeds."""
        return along(self.speed_radps, self.motoring_nm, speed_radps)

    def covered_nm(self, full_load_nm: Array, speed_radps: Array) -> Array:
        """Full load, or less where the map ends below it; NaN where it knows nothing at a speed."""
        known = self.fuel if self.nox is None else self.fuel + self.nox
        top = highest_known(self.speed_radps, self.torque_nm, known, speed_radps)
        return np.minimum(full_load_nm, top)

    def near_edge(self, torque_nm: Array, speed_radps: Array, share: float) -> Flags:
        """Whether a point lies within a share of the axes from the map's ends."""
        near = np.zeros(np.broadcast(torque_nm, speed_radps).shape, dtype=bool)
        for value, axis in ((torque_nm, self.torque_nm), (speed_radps, self.speed_radps)):
            margin = share * (axis[-1] - axis[0])
            near |= (value <= axis[0] + margin) | (value >= axis[-1] - margin)
        return near

    def scaled(self, factor: float) -> "EngineMap":
        """The same map with torques and flows multiplied."""
        return replace(
            self,
            torque_nm=factor * self.torque_nm,
            fuel=factor * self.fuel,
            nox=None if self.nox is None else factor * self.nox,
            motoring_nm=factor * self.motoring_nm,
        )

    def _at(self, values: Array, torque_nm: Array, speed_radps: Array) -> Array:
        return interpolated(self.speed_radps, self.torque_nm, values, torque_nm, speed_radps)
