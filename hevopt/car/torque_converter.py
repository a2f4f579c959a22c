"""A torque converter: what impeller and turbine take and give over the ratio of their speeds.

    T_p = lambda(nu) w_p^2,   T_t = mu(nu) T_p,   nu = w_t / w_p

With capacity lambda and torque ratio mu linear in nu between points, the turbine's torque at a speed w_t of its own
is a parabola of w_p between two of them,

    T_t = a c w_p^2 + (a d + b c) w_t w_p + b d w_t^2,   lambda = a + b nu,   mu = c + d nu

so that the impeller's speed for a torque at the turbine follows in closed form, the piece being found by the
torques at its ends. It is the only one, as both torques rise with w_p, which `flaw` makes sure of. Past the last
ratio, where the capacity is 0, nothing passes: a turbine that is faster than the impeller runs free.
"""

from dataclasses import dataclass
from math import inf
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from hevopt.display.facts import Shown

if TYPE_CHECKING:
    from hevopt.car._converter_kernels import Pieces

Array = NDArray[np.float64]
# An efficiency of 1 by rounding is none above it.
_ROUNDING = 1e-12


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class HydraulicConverter(Shown):
    """Curves of a torque converter, (point,), and when its lock-up clutch is closed.

    speed_ratio: turbine over impeller, rising from 0; capacity_nms2: impeller's torque over its speed squared, 0 at
    the last point; lock_up_radps: speed of the turbine from which it is locked, infinite where it never is
    lock_up_gear: the lowest gear in which it is; in_gear_at_rest: whether a gear is engaged at standstill
    """

    speed_ratio: Array
    torque_ratio: Array
    capacity_nms2: Array
    lock_up_radps: float = inf
    lock_up_gear: int = 1
    in_gear_at_rest: bool = True

    def least_lock_radps(self, idle_radps: float) -> float:
        """Speed of the turbine from which it is locked in the gears that allow it: never below idle speed."""
        return max(self.lock_up_radps, idle_radps)

    def locks(
        self, gear: NDArray[np.int64], turbine_radps: Array, idle_radps: float
    ) -> NDArray[np.bool_]:
        """(state,) whether it is locked in a gear at a speed of the turbine."""
        fast: NDArray[np.bool_] = turbine_radps >= self.least_lock_radps(idle_radps)
        return fast & (gear >= self.lock_up_gear)

    @property
    def pieces(self) -> "Pieces":
        """The curves between their points, as compiled loops read them."""
        from hevopt.car._converter_kernels import Pieces

        ratio, capacity, multiple = (
            np.ascontiguousarray(curve, dtype=np.float64)
            for curve in (self.speed_ratio, self.capacity_nms2, self.torque_ratio)
        )
        rises = [np.diff(curve) / np.diff(ratio) for curve in (capacity, multiple)]
        straight = [
            np.column_stack([curve[:-1] - rise * ratio[:-1], rise])
            for curve, rise in zip((capacity, multiple), rises, strict=True)
        ]
        return Pieces(ratio, multiple * capacity, *map(np.ascontiguousarray, straight))

    def torques_nm(self, impeller_radps: Array, turbine_radps: Array) -> tuple[Array, Array]:
        """(state,) torque that the impeller takes and that the turbine gives; impeller_radps above 0."""
        ratio = turbine_radps / impeller_radps
        taken = np.interp(ratio, self.speed_ratio, self.capacity_nms2) * impeller_radps**2
        given: Array = np.interp(ratio, self.speed_ratio, self.torque_ratio) * taken
        return taken, given

    def impeller_radps(self, turbine_nm: Array, turbine_radps: Array) -> Array:
        """(state,) speed at which the turbine gives a torque; 0 where none is asked of it."""
        from hevopt.car._converter_kernels import all_impeller_radps

        torque, speed = np.broadcast_arrays(
            np.asarray(turbine_nm, dtype=np.float64), np.asarray(turbine_radps, dtype=np.float64)
        )
        return all_impeller_radps(self.pieces, torque.copy(), speed.copy())


def flaw(speed_ratio: Array, torque_ratio: Array, torque_nm: Array) -> str | None:
    """What is wrong with curves at one speed of the impeller, in words; None where nothing is."""
    if (np.diff(speed_ratio) <= 0).any() or speed_ratio[0] != 0 or speed_ratio[-1] > 1:
        return "speed_ratio must rise from 0, and to 1 at the most"
    if torque_nm[-1] != 0 or (torque_nm[:-1] <= 0).any():
        return (
            "impeller_torque_nm must be above 0, and 0 at the last speed_ratio: at equal speeds, or a little "
            "below, nothing passes; add that point"
        )
    for k in range(len(speed_ratio) - 1):
        ends, width = speed_ratio[k : k + 2], speed_ratio[k + 1] - speed_ratio[k]
        b, d = (float(curve[k + 1] - curve[k]) / width for curve in (torque_nm, torque_ratio))
        a, c = torque_nm[k] - b * ends[0], torque_ratio[k] - d * ends[0]
        between = f"between speed_ratio {ends[0]:g} and {ends[1]:g}"
        peak = np.append(ends, np.clip(-c / (2 * d), *ends) if d < 0 else ends)
        share = float(np.max((c + d * peak) * peak))
        if share > 1 + _ROUNDING:
            return (
                f"torque_ratio {between} makes {100 * share:.4g} % of the power; allowed: torque_ratio times "
                "speed_ratio up to 1"
            )
        if (2 * a + b * ends <= 0).any() or (2 * a * c + (a * d + b * c) * ends <= 0).any():
            return (
                f"impeller_torque_nm or its product with torque_ratio rises so fast {between} that a faster "
                "impeller would pass less torque; check both lists"
            )
    return None
