"""What an engine burns in a driven car, where its map has no data because nobody drives it there for long.

Off the pedal an engine gives any torque between its drag, fuel cut, and that of no load. A map ends at no load, or
above it. Between the two the fuel is cut for part of the time: of drag D and the lowest mapped torque L a torque T
is the mean of both for shares of the time,

    T = (1 - s) D + s L,   fuel(T) = s fuel(L),   NOx(T) = s NOx(L)
"""

from collections.abc import Mapping

import numpy as np

from hevopt.car.engine import Engine
from hevopt.forward import _breathing_kernels as gas
from hevopt.problem.arrays import Array


def burnt_kgps(engine: Engine, torque_nm: Array, speed_radps: Array) -> tuple[Array, Array]:
    """(step,) fuel and NOx of an engine that turns; NaN where a map knows nothing, that lowest torque included."""
    fuel = engine.fuel_kgps(torque_nm, speed_radps)
    nox = np.where(fuel == 0, 0.0, engine.nox_kgps(torque_nm, speed_radps))
    lowest = engine.law.lowest_nm
    k = np.flatnonzero(np.isnan(fuel) & (torque_nm < lowest))
    k = k[torque_nm[k] > engine.drag_nm(speed_radps[k])]
    if len(k):
        drag = engine.drag_nm(speed_radps[k])
        share = (torque_nm[k] - drag) / (lowest - drag)
        at_lowest = np.full(len(k), lowest), speed_radps[k]
        fuel[k], nox[k] = (share * of(*at_lowest) for of in (engine.fuel_kgps, engine.nox_kgps))
    return fuel, nox


def breathed(flows: Mapping[str, Array], breath: Array) -> dict[str, Array]:
    """What the mean-value engine did beside burning. gas_lacking_nm: torque that it was to give and could not."""
    lacking = flows["engine_torque_nm"] - breath[:, gas.GIVEN]
    return {
        "turbo_speed_radps": breath[:, gas.TURBO],
        "boost_pa": breath[:, gas.BOOST],
        "excess_air": breath[:, gas.EXCESS],
        "engine_available_nm": breath[:, gas.AVAILABLE],
        "gas_lacking_nm": np.where(flows["fuel_kgps"] > 0, lacking, 0.0),
    }
