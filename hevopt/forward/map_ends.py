"""Where a driven engine is read in its map: a step that begins or ends within it may leave it on its way.

The loop knows idle speed and full load as a step begins; fuel is that of the step's mean speed.
"""

import numpy as np

from hevopt.car.engine import Engine
from hevopt.forward.burning import burnt_kgps
from hevopt.problem.arrays import Array, Flags

# Share by which the loop keeps idle speed, and knows full load by its table.
_EDGE = 1e-4


def within_map(
    engine: Engine, torque_nm: Array, side_radps: Array, turns: Flags
) -> tuple[Array, Array]:
    """(step,) torque and speed at which steps are read, those at the map's end that leave it on their way.

    torque_nm: (step,); side_radps: (step + 1,) speed around every step; turns: (step,) whether it turns by itself
    """
    idle, speed = engine.idle_radps, (side_radps[1:] + side_radps[:-1]) / 2
    begins = np.maximum(side_radps[:-1], idle)
    at = np.where(turns, speed, idle)
    unknown = turns & np.isnan(np.add(*burnt_kgps(engine, torque_nm, at)))
    reaches_idle = np.maximum(side_radps[1:], side_radps[:-1]) > idle * (1 - _EDGE)
    below = (speed < idle) & (speed > idle * (1 - _EDGE)) | (speed < idle) & unknown & reaches_idle
    speed = np.where(below, idle, speed)
    most = engine.covered_nm(np.where(turns, speed, idle))
    given = np.where(unknown, np.fmax(engine.covered_nm(begins), most), most) * (1 + _EDGE)
    return np.where((torque_nm > most) & (torque_nm < given), most, torque_nm), speed
