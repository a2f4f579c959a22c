"""How much of the braking a machine may take through its axle; the friction brakes take the rest."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from hevopt.display.facts import Shown

Array = NDArray[np.float64]
# UN Regulation 13-H, annex 5: z >= 0.1 + 0.85 (k - 0.2), k the adhesion that an axle uses at braking rate z.
_RATE, _ADHESION, _SLOPE = 0.1, 0.2, 0.85


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Braking(Shown):
    """Limits of regenerative braking.

    speed_mps, machine_share: (point,) share of the wheels' braking over speed, from a low speed's, where
    regeneration fades out, on; axle: that of the machine, load_share of the weight being on it at rest
    height_share: height of the centre of mass over the wheelbase
    """

    speed_mps: Array
    machine_share: Array
    axle: Literal["front", "rear"]
    load_share: float
    height_share: float

    def share(self, speed_mps: Array, rate: Array) -> Array:
        """Share that may pass the machine's axle at a speed and a braking rate, braking force over weight, >= 0.

        So that the car stays stable a front axle uses no more adhesion than UN Regulation 13-H grants, and a rear
        one no more than the rate itself, by which the front axle locks first.
        """
        shifted = self.height_share * rate
        if self.axle == "front":
            load, most = self.load_share + shifted, (rate - _RATE) / _SLOPE + _ADHESION
        else:
            load, most = np.maximum(self.load_share - shifted, 0.0), rate
        stable = most * load / np.where(rate > 0, rate, np.inf)
        stable = np.where(rate > 0, stable, 1.0)
        return np.minimum(np.interp(speed_mps, self.speed_mps, self.machine_share), stable)
