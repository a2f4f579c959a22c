"""Where a driven engine is read in its map: a step that begins or ends within it may leave it on its way.

The loop knows idle speed and full load as a step begins; fuel is that of the step's mean speed.
"""

from typing import NamedTuple

import numpy as np

from hevopt.car.engine import Engine
from hevopt.forward.burning import burnt_kgps
from hevopt.problem.arrays import Array

# Share by which the loop keeps idle speed, and knows full load by its table.
_EDGE = 1e-4


class Burning(NamedTuple):
    """Torque and speed at which steps are read, and fuel and NOx there; all (step,)."""

    torque_nm: Array
    speed_radps: Array
    fuel_kgps: Array
    nox_kgps: Array


def within_map(engine: Engine, torque_nm: Array, begins_radps: Array, ends_radps: Array) -> Burning:
    """What an engine burns that turns by itself, steps at the map's end that leave it on their way read there.

    torque_nm: (step,); begins_radps, ends_radps: (step,) speed as each step begins and ends
    """
    idle, speed = engine.idle_radps, (ends_radps + begins_radps) / 2
    fuel, nox = burnt_kgps(engine, torque_nm, speed)
    unknown = np.isnan(fuel + nox)
    reaches_idle = np.maximum(ends_radps, begins_radps) > idle * (1 - _EDGE)
    below = (speed < idle) & ((speed > idle * (1 - _EDGE)) | unknown & reaches_idle)
    at = np.where(below, idle, speed)
    most = engine.covered_nm(at)
    given = most * (1 + _EDGE)
    if unknown.any():
        begun = engine.covered_nm(np.maximum(begins_radps[unknown], idle))
        given[unknown] = np.fmax(begun, most[unknown]) * (1 + _EDGE)
    beyond = (torque_nm > most) & (torque_nm < given)
    torque = np.where(beyond, most, torque_nm)
    k = np.flatnonzero(below | beyond)
    if len(k):
        fuel[k], nox[k] = burnt_kgps(engine, torque[k], at[k])
    return Burning(torque, at, fuel, nox)
