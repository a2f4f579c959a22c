"""Levels of a chosen torque as cells are made of them: where they stand, what they burn, and lines through them."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hevopt.powertrain.operation import Flowing, Setting
from hevopt.problem.arrays import Array, Flags, Indices
from hevopt.problem.switching import Number


class Sides(NamedTuple):
    """Slopes over the chosen torque towards less and towards more of it, (state, level)."""

    left: Array
    right: Array


class CellLevels(NamedTuple):
    """Levels of a piece by rising torque, and their columns in the table, (state, level).

    usable: whether it can be used
    open: whether a cell begins at a level: within those that can be used, and not at the highest
    state, low: (cell,) state of each cell, and place of its low end in (state, level) levels taken as one row
    """

    here: Setting
    name: str
    torque_nm: Array
    column: Indices
    usable: Flags
    open: Flags
    state: Indices
    low: Indices

    def start(self, values: NDArray[Number]) -> NDArray[Number]:
        """(cell,) of (state, level) values those at the low end of each cell."""
        return np.broadcast_to(values, self.open.shape).reshape(-1).take(self.low)

    def end(self, values: NDArray[Number]) -> NDArray[Number]:
        """(cell,) those at the high end."""
        return np.broadcast_to(values, self.open.shape).reshape(-1).take(self.low + 1)

    def cell(self, values: NDArray[Number]) -> NDArray[Number]:
        """(cell,) of (state, level - 1) values between neighbouring levels."""
        return values.reshape(-1).take(self.low - self.state)


class Worked(NamedTuple):
    """Levels worked out again: fuel, NOx, battery power, (state, level), as in the table; power of what is
    beside the machine, (state, 1), torque of the engine, None without one, and all flows."""

    fuel_kg: Array
    nox_kg: Array
    power_w: Array
    rest_w: Array
    engine_nm: Array | None
    found: Flowing
    length_s: Array


def tangents(levels: CellLevels, values: Array, sides: Sides) -> Array:
    """(line, end, cell) lines through the ends of cells by their slopes there."""
    lines = np.empty((2, 2, len(levels.low)))
    lines[0, 0], lines[1, 1] = levels.start(values), levels.end(values)
    width = levels.end(levels.torque_nm) - levels.start(levels.torque_nm)
    lines[0, 1] = lines[0, 0] + levels.start(sides.right) * width
    lines[1, 0] = lines[1, 1] - levels.end(sides.left) * width
    return lines
