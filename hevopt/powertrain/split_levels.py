"""Levels of a chosen torque as cells are made of them: where they stand, what they burn, and lines through them."""

from typing import NamedTuple

import numpy as np

from hevopt.powertrain.operation import Flowing, Setting
from hevopt.problem.arrays import Array, Flags, Indices


class Sides(NamedTuple):
    """Slopes over the chosen torque towards less and towards more of it, (state, level)."""

    left: Array
    right: Array


class CellLevels(NamedTuple):
    """Levels of a piece by rising torque, and their columns in the table, (state, level).

    usable: whether it can be used
    open: whether a cell begins at a level: within those that can be used, and not at the highest
    """

    here: Setting
    name: str
    torque_nm: Array
    column: Indices
    usable: Flags
    open: Flags


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


def tangents(levels: CellLevels, values: Array, sides: Sides, fall: Array | float = 0.0) -> Array:
    """(line, end, cell) lines through the ends of cells by their slopes there."""
    state, low = np.nonzero(levels.open)
    start, end = values[state, low], values[state, low + 1]
    width = levels.torque_nm[state, low + 1] - levels.torque_nm[state, low]
    right, left = sides.right[state, low], sides.left[state, low + 1]
    return np.array([[start, start + right * width - fall], [end - left * width - fall, end]])
