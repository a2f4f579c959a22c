"""The compact turbine map fitted to measured points.

Equations (21) and (22) of mean_value/_turbo_kernels: an effective area for each vane position and one exponent, by
relative deviations of flow; and a parabola of efficiency over blade speed ratio. Both go on to standstill by
themselves.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from hevopt.display.facts import Shown
from hevopt.errors import DataError
from hevopt.mean_value.parameters import Gas, Turbine
from hevopt.measured.maps.turbo_points import TurboPoints

Array = NDArray[np.float64]

# Gas of a hot bench: burning with much air, estimated; it moves the exponent of pressure by a few per cent.
_GAS_K, _GAS_BURNT = 873.0, 0.5
_EXPONENT = (0.5, 10.0)
_EFFICIENCY_MAX, _BLADE_SPEED = (0.05, 0.95), (0.2, 1.5)


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class TurbineFit(Shown):
    """A compact map and how far points lie from it.

    positions, areas_m2: (position,) of the vanes as the file has them, and their effective areas
    blade_speed: (point,) rim speed over spouting speed; off: (point,) share of the flow; efficiency_off:
    (point,); fitted less measured
    """

    wheel: Turbine
    positions: Array
    areas_m2: Array
    blade_speed: Array
    off: Array
    efficiency_off: Array


def fit_turbine(points: TurboPoints, radius_m: float, place: str) -> TurbineFit:
    """The compact map nearest to the points; DataError with `place` where none is a turbine's."""
    gas = Gas()
    positions, which = np.unique(points.vanes, return_inverse=True)
    flow = points.flow * np.sqrt(gas.constant_jpkgk)

    def areas_at(exponent: float) -> tuple[Array, Array]:
        passing = np.sqrt(1 - points.ratio**-exponent)
        share = passing / flow
        areas = np.bincount(which, share) / np.bincount(which, share**2)
        return areas, areas[which] * share - 1

    found = minimize_scalar(
        lambda k: float((areas_at(k)[1] ** 2).sum()), bounds=_EXPONENT, method="bounded"
    )
    exponent = float(found.x)
    areas, flow_off = areas_at(exponent)
    cp = gas.air_a_jpkgk + _GAS_BURNT * (gas.burnt_a_jpkgk - gas.air_a_jpkgk)
    cp += _GAS_K * (gas.air_b_jpkgk2 + _GAS_BURNT * (gas.burnt_b_jpkgk2 - gas.air_b_jpkgk2))
    spouting = np.sqrt(2 * cp * (1 - points.ratio ** (-gas.constant_jpkgk / cp)))
    blade = points.speed * radius_m / spouting
    most, best = _parabola(blade, points.efficiency, place)
    z = blade / best
    wheel = Turbine(radius_m, float(areas.max()), exponent, most, best)
    return TurbineFit(
        wheel, positions, areas, blade, flow_off, most * z * (2 - z) - points.efficiency
    )


def _parabola(blade: Array, efficiency: Array, place: str) -> tuple[float, float]:
    """Highest efficiency and where it lies, of a parabola through the origin."""
    rows = np.column_stack([blade, -(blade**2)])
    rise, bend = np.linalg.lstsq(rows, efficiency)[0]
    best = float(rise / (2 * bend)) if bend > 0 else np.inf
    most = float(rise * best / 2) if best < np.inf else np.inf
    low, high = _BLADE_SPEED
    if not (_EFFICIENCY_MAX[0] <= most <= _EFFICIENCY_MAX[1] and low <= best <= high):
        found = f"{most:.3g} at {best:.3g}" if best < np.inf else "none"
        raise DataError(
            f"{place}: highest efficiency over blade speed ratio: {found}, with points from {blade.min():.3g} to "
            f"{blade.max():.3g}; allowed: {_EFFICIENCY_MAX[0]:g} to {_EFFICIENCY_MAX[1]:g} at {low:g} to {high:g}; "
            "check speeds, units, reference and the wheel's diameter, or add points nearer to the best"
        )
    return most, best
