"""A torque converter by its curves, forward and backward. Compiled.

Between two points of its speed ratio nu = w_t / w_p, where capacity a + b nu and torque ratio c + d nu are
straight, both torques are quadratic in the speeds of impeller and turbine,

    T_p = a w_p^2 + b w_p w_t,    T_t = a c w_p^2 + (a d + b c) w_p w_t + b d w_t^2
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hevopt._compile import compiled

Array = NDArray[np.float64]


class Pieces(NamedTuple):
    """The curves: speed_ratio, given_nms2: (point,) turbine's torque over the impeller's speed squared

    capacity, multiple: (piece, 2) a and b, c and d; none for a car without a converter
    """

    speed_ratio: Array
    given_nms2: Array
    capacity: Array
    multiple: Array


NO_PIECES = Pieces(np.zeros(0), np.zeros(0), np.zeros((0, 2)), np.zeros((0, 2)))


class Passed(NamedTuple):
    """What impeller and turbine take and give, and how both rise with the speed of each."""

    taken_nm: float
    taken_per_p: float
    taken_per_t: float
    given_nm: float
    given_per_p: float
    given_per_t: float


@compiled()
def passed(pieces: Pieces, impeller: float, turbine: float) -> Passed:
    """The torques at two speeds, rad/s; none where the impeller rests or the turbine is beyond the last ratio."""
    last = len(pieces.speed_ratio) - 1
    if impeller <= 0.0 or turbine >= pieces.speed_ratio[last] * impeller:
        return Passed(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    p, t = impeller, max(turbine, 0.0)
    k = min(int(np.searchsorted(pieces.speed_ratio, t / p, "right")) - 1, last - 1)
    a, b = pieces.capacity[k, 0], pieces.capacity[k, 1]
    c, d = pieces.multiple[k, 0], pieces.multiple[k, 1]
    squared, product, own = a * c, a * d + b * c, b * d
    return Passed(
        a * p * p + b * p * t, 2.0 * a * p + b * t, b * p,
        squared * p * p + product * p * t + own * t * t,
        2.0 * squared * p + product * t, product * p + 2.0 * own * t,
    )  # fmt: skip


@compiled()
def impeller_radps(pieces: Pieces, turbine_nm: float, turbine: float) -> float:
    """Speed of the impeller at which the turbine gives a torque; 0 where none is asked of it."""
    wanted = max(turbine_nm, 0.0)
    if not wanted > 0.0:
        return 0.0
    k = 0
    while pieces.given_nms2[k + 1] * (turbine / pieces.speed_ratio[k + 1]) ** 2 > wanted:
        k += 1
    a, b = pieces.capacity[k, 0], pieces.capacity[k, 1]
    c, d = pieces.multiple[k, 0], pieces.multiple[k, 1]
    squared, linear = a * c, (a * d + b * c) * turbine
    constant = b * d * turbine**2 - wanted
    root = np.sqrt(max(linear**2 - 4 * squared * constant, 0.0))
    # Both terms of the quotient have one sign, so that nothing cancels.
    found = -2 * constant / (linear + root) if linear > 0.0 else (root - linear) / (2 * squared)
    lowest = turbine / pieces.speed_ratio[k + 1]
    highest = turbine / pieces.speed_ratio[k] if k > 0 else np.inf
    return float(min(max(found, lowest), highest))


@compiled()
def all_impeller_radps(pieces: Pieces, turbine_nm: Array, turbine: Array) -> Array:
    """(state,) speeds of the impeller."""
    found = np.empty(len(turbine_nm))
    for n in range(len(turbine_nm)):
        found[n] = impeller_radps(pieces, turbine_nm[n], turbine[n])
    return found
