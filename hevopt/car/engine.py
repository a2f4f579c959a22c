"""Engine as a 0D map: fuel and NOx over torque and speed, from compact coefficients or a measured grid.

Brake mean pressure p_me = 4 pi T / Vd (four-stroke). With coefficients, the fuel mean pressure p_mf solves
    p_me = (a + b cm + c cm²) p_mf + a2 p_mf² + l + l2 cm²
(CO2MPAS, European Commission), so the drag torque is where p_mf = 0 and fuel is cut on overrun.
A grid is interpolated (grid.py) and never extrapolated: outside it the result is NaN.
"""

from dataclasses import dataclass
from math import pi

import numpy as np
from numpy.typing import NDArray

from hevopt.car.grid import along, highest_known, interpolated

Array = NDArray[np.float64]
_PA_PER_BAR = 1e5


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


@dataclass(frozen=True, slots=True, eq=False)
class EngineGrid:
    """A measured map; cells that were not measured are NaN.

    speed_radps: (speed,), torque_nm: (torque,), fuel_kgps and nox_kgps: (speed, torque); nox_kgps None: unknown
    motoring_torque_nm: (speed,) torque of the unfired engine, negative
    """

    speed_radps: Array
    torque_nm: Array
    fuel_kgps: Array
    nox_kgps: Array | None
    motoring_torque_nm: Array


@dataclass(frozen=True, slots=True, eq=False)
class Engine:
    """An engine and its fuel. full_load_*: (point,) curve of the highest torque over speed."""

    name: str
    displacement_m3: float
    stroke_m: float
    idle_radps: float
    inertia_kgm2: float
    start_fuel_kg: float
    heating_value_jpkg: float
    fuel_density_kgpm3: float
    co2_kgpkg: float
    full_load_speed_radps: Array
    full_load_torque_nm: Array
    fuel: FuelCoefficients | EngineGrid
    nox: NoxCoefficients | None

    @property
    def speed_max_radps(self) -> float:
        """Highest speed of the full-load curve."""
        return float(self.full_load_speed_radps[-1])

    @property
    def nox_known(self) -> bool:
        """Whether there are data on NOx."""
        return (self.fuel.nox_kgps if isinstance(self.fuel, EngineGrid) else self.nox) is not None


def full_load_torque_nm(engine: Engine, speed_radps: Array) -> Array:
    """Highest torque at a speed within the full-load curve."""
    return np.interp(speed_radps, engine.full_load_speed_radps, engine.full_load_torque_nm)


def covered_torque_nm(engine: Engine, speed_radps: Array) -> Array:
    """Highest torque that the engine gives and its data cover: full load, or less where a grid ends below it.

    NaN where a grid knows nothing at a speed.
    """
    full = full_load_torque_nm(engine, speed_radps)
    if not isinstance(engine.fuel, EngineGrid):
        return full
    grid = engine.fuel
    known = grid.fuel_kgps if grid.nox_kgps is None else grid.fuel_kgps + grid.nox_kgps
    return np.minimum(full, highest_known(grid.speed_radps, grid.torque_nm, known, speed_radps))


def drag_torque_nm(engine: Engine, speed_radps: Array) -> Array:
    """Torque of the turning engine without fuel, negative; NaN at speeds beyond a measured grid's."""
    if isinstance(engine.fuel, EngineGrid):
        return along(engine.fuel.speed_radps, engine.fuel.motoring_torque_nm, speed_radps)
    k, cm = engine.fuel, _piston_speed_mps(engine, speed_radps)
    return (k.l + k.l2 * cm**2) * _PA_PER_BAR * engine.displacement_m3 / (4 * pi)


def fuel_kgps(engine: Engine, torque_nm: Array, speed_radps: Array) -> Array:
    """Fuel flow; 0 at or below the drag torque (fuel cut), NaN outside a measured grid."""
    if isinstance(engine.fuel, EngineGrid):
        inside = _on_grid(engine.fuel, engine.fuel.fuel_kgps, torque_nm, speed_radps)
        cut = torque_nm <= drag_torque_nm(engine, speed_radps) + 1e-9
        return np.where(cut, 0.0, inside)
    k, cm = engine.fuel, _piston_speed_mps(engine, speed_radps)
    p_me = _mean_pressure_bar(engine, torque_nm)
    slope = k.a + k.b * cm + k.c * cm**2
    load = np.maximum(p_me - k.l - k.l2 * cm**2, 0.0)
    # Drag torque recomputed from p_me differs from 0 by rounding; a fuel cut must be exactly 0.
    load = np.where(load < 1e-9, 0.0, load)
    p_mf = 2 * load / (slope + np.sqrt(np.maximum(slope**2 + 4 * k.a2 * load, 0.0)))
    power_w = p_mf * _PA_PER_BAR * engine.displacement_m3 * speed_radps / (4 * pi)
    return power_w / engine.heating_value_jpkg


def nox_kgps(engine: Engine, torque_nm: Array, speed_radps: Array) -> Array:
    """NOx flow; 0 while the fuel is cut is the caller's to apply. NaN outside a measured grid.

    0 everywhere where it is not known, so that sums stay finite; `Engine.nox_known` tells.
    """
    if not engine.nox_known:
        return np.zeros(np.broadcast(torque_nm, speed_radps).shape)
    if isinstance(engine.fuel, EngineGrid):
        return _on_grid(engine.fuel, engine.fuel.nox_kgps, torque_nm, speed_radps)
    k = engine.nox
    speed_rpm = speed_radps * 60 / (2 * pi)
    p_me = np.maximum(_mean_pressure_bar(engine, torque_nm), 0.0)
    steepness = (p_me - k.p0 - k.p1 * (speed_rpm / 1000 - 2)) / k.dp
    specific_gpkwh = k.lo + (k.hi - k.lo) / (1 + np.exp(-steepness))
    # 1 bar on 1 litre is 100 J per working cycle, and g/kWh x 100 J = mg / 36.
    mg_per_litre_cycle = k.m0 + specific_gpkwh * p_me * (speed_rpm / 2000) ** 0.19 / 36
    cycles_per_s = speed_radps / (4 * pi)
    return mg_per_litre_cycle * 1e-6 * (engine.displacement_m3 * 1e3) * cycles_per_s


def best_torque_nm(engine: Engine, speed_radps: Array) -> Array:
    """Torque of highest efficiency at each speed, from a grid of 1 % of full load.

    Of the closest speeds that a measured grid knows where it knows nothing: no control is possible there.
    """
    speeds = np.linspace(engine.full_load_speed_radps[0], engine.speed_max_radps, 101)[:, None]
    torques = full_load_torque_nm(engine, speeds) * np.linspace(0.01, 1.0, 100)
    fuel = fuel_kgps(engine, torques, speeds)
    with np.errstate(invalid="ignore", divide="ignore"):
        efficiency = torques * speeds / np.where(fuel > 0, fuel, np.nan)
    efficiency = np.where(np.isfinite(efficiency), efficiency, -1.0)
    best, known = np.argmax(efficiency, axis=1), (efficiency >= 0).any(axis=1)
    known |= ~known.any()
    return np.interp(speed_radps, speeds[known, 0], torques[np.arange(len(speeds)), best][known])


def _piston_speed_mps(engine: Engine, speed_radps: Array) -> Array:
    # Beyond its highest speed an engine is not used, and the polynomial means nothing there.
    return engine.stroke_m * np.minimum(speed_radps, engine.speed_max_radps) / pi


def _mean_pressure_bar(engine: Engine, torque_nm: Array) -> Array:
    return 4 * pi * torque_nm / engine.displacement_m3 / _PA_PER_BAR


def _on_grid(grid: EngineGrid, values: Array, torque_nm: Array, speed_radps: Array) -> Array:
    return interpolated(grid.speed_radps, grid.torque_nm, values, torque_nm, speed_radps)
