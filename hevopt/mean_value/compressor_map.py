"""The compact compressor map as it is drawn: speed lines, surge line, islands of efficiency.

The plain form of _turbo_kernels, head over flow; the loops use its inverse.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hevopt.mean_value.parameters import Ambient, Compressor, Gas

Array = NDArray[np.float64]

_POINTS, _LINES = 60, 60
_AIR_GAMMA = 1.4


class Line(NamedTuple):
    """A speed line from surge to no pressure rise. flow_kgps, ratio, efficiency: (point,)"""

    speed_radps: float
    flow_kgps: Array
    ratio: Array
    efficiency: Array


class Island(NamedTuple):
    """Where the map has one efficiency: left of the best of each speed line, nan, and right of it."""

    efficiency: float
    flow_kgps: Array
    ratio: Array


def speed_line(wheel: Compressor, speed_radps: float, gas: Gas, around: Ambient) -> Line:
    """The line of a shaft speed, equations (8), (9) and (11)."""
    kelvin = around.temperature_k
    cp = gas.air_a_jpkgk + gas.air_b_jpkgk2 * kelvin
    rim = speed_radps * wheel.wheel_diameter_m / 2
    mach = rim / np.sqrt(_AIR_GAMMA * gas.constant_jpkgk * kelvin)
    surge = wheel.surge_flow + wheel.surge_flow_per_mach * mach
    choke = max(wheel.choke_flow - wheel.choke_flow_fall_per_mach * mach, surge + 0.03)
    x = np.linspace(0.0, 1.0, _POINTS)
    phi = surge + x * (choke - surge)
    head = wheel.head_max * (1 - x**wheel.head_exponent)
    swept = (
        around.pressure_pa
        / (gas.constant_jpkgk * kelvin)
        * np.pi
        / 4
        * wheel.wheel_diameter_m**2
        * rim
    )
    ratio = (1 + head * rim**2 / (cp * kelvin)) ** (cp / gas.constant_jpkgk)
    taken = wheel.work - wheel.work_fall_with_flow * phi + wheel.disc_friction / phi
    return Line(speed_radps, phi * swept, ratio, head / taken)


def islands(
    wheel: Compressor, top_radps: float, levels: tuple[float, ...], gas: Gas, around: Ambient
) -> list[Island]:
    """Lines of equal efficiency, up to a shaft speed."""
    lines = [
        speed_line(wheel, speed, gas, around) for speed in np.linspace(0.1, 1.0, _LINES) * top_radps
    ]
    found = []
    for level in levels:
        left, right = [], []
        for line in lines:
            best = int(np.argmax(line.efficiency))
            if line.efficiency[best] < level:
                continue
            low = line.efficiency[: best + 1]
            if low[0] < level:
                left.append(_at(line, float(np.interp(level, low, np.arange(best + 1.0)))))
            high = line.efficiency[best:][::-1]
            at = len(line.efficiency) - 1 - np.interp(level, high, np.arange(len(high) * 1.0))
            right.append(_at(line, float(at)))
        if right:
            around_it = np.array([*left, (np.nan, np.nan), *right])
            found.append(Island(level, around_it[:, 0], around_it[:, 1]))
    return found


def _at(line: Line, place: float) -> tuple[float, float]:
    points = np.arange(float(_POINTS))
    return float(np.interp(place, points, line.flow_kgps)), float(
        np.interp(place, points, line.ratio)
    )
