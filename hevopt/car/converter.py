"""A DC converter between the battery and the electric bus that machines and on-board network hang on."""

from dataclasses import dataclass

import numpy as np

from hevopt.display.facts import Shown
from hevopt.problem.arrays import Array


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Converter(Shown):
    """A converter that loses a share of what passes, either way; none where nothing does.

    power_w, efficiency: (point,) share that leaves it, over the power at the bus of either sign; linear between,
    held beyond the ends
    """

    power_w: Array
    efficiency: Array

    def share(self, bus_w: Array) -> Array:
        """Efficiency at a power at the bus."""
        return np.interp(np.abs(bus_w), self.power_w, self.efficiency)

    def terminal_w(self, bus_w: Array) -> Array:
        """Power at the battery's terminals for one at the bus, > 0 out of the battery: it rises with that."""
        share = self.share(bus_w)
        return np.where(bus_w > 0, bus_w / share, bus_w * share)

    def loss_w(self, bus_w: Array) -> Array:
        """What it loses, never negative: of what it takes in from either side."""
        share = self.share(bus_w)
        taken_w = np.where(bus_w > 0, bus_w / share, -bus_w)
        return taken_w * (1 - share)
