"""Torque that a gearbox loses, over gear, input speed and input torque: efficiency (13) where it depends on them.

    T_out / i = T_in - D(gear, w_in, T_in),   eta = 1 - D / T_in  driving, 1 / (1 - D / T_in) in overrun

D, at the input, is what a test bench measures and stays finite where no power passes, as eta does not. It is linear
between the points of its grid, and known nowhere beyond them; below the lowest speed it is that of the lowest.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hevopt.car.grid import interpolated
from hevopt.display.facts import Shown

Array = NDArray[np.float64]
Indices = NDArray[np.int64]


class Steep(NamedTuple):
    """Where a loss rises with torque: row of its speed, the torque below and above, and Nm per Nm."""

    row: int
    low_nm: float
    high_nm: float
    rise: float


def too_steep(torque_nm: Array, loss_nm: Array) -> Steep | None:
    """The first place where a loss rises as fast as the torque: more at the input would give no more at the output.

    torque_nm: (torque,) rising; loss_nm: (speed, torque), NaN where not measured. None where nowhere.
    """
    rise = np.diff(loss_nm, axis=1) / np.diff(torque_nm)
    if not (rise >= 1).any():
        return None
    i, j = np.argwhere(rise >= 1)[0]
    return Steep(int(i), float(torque_nm[j]), float(torque_nm[j + 1]), float(rise[i, j]))


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class LossInGear(Shown):
    """One gear's losses. speed_radps: (speed,), torque_nm: (torque,) at the input, both rising

    loss_nm: (speed, torque) torque lost, referred to the input; NaN where not measured
    """

    speed_radps: Array
    torque_nm: Array
    loss_nm: Array

    def filled(self) -> Array:
        """(speed, torque) with what was not measured from its neighbours: to solve with, never to use."""
        measured = ~np.isnan(self.loss_nm).all(axis=1)
        rows = []
        for row in self.loss_nm[measured]:
            known = ~np.isnan(row)
            rows.append(np.interp(self.torque_nm, self.torque_nm[known], row[known]))
        speed = self.speed_radps[measured]
        columns = [np.interp(self.speed_radps, speed, column) for column in np.transpose(rows)]
        return np.column_stack(columns)


class GearLoss:
    """The losses of all gears, by number; neutral, number 0, loses nothing."""

    def __init__(self, gears: Sequence[LossInGear]) -> None:
        self.gears = tuple(gears)
        self._filled = [gear.filled() for gear in self.gears]
        self._width = max(len(gear.torque_nm) for gear in self.gears)

    def knots(self, gear: Indices, speed_radps: Array) -> tuple[Array, Array]:
        """(state, knot) torques and losses at each state's gear and speed, as wide as the widest gear's."""
        torque = np.zeros((len(gear), self._width))
        torque += np.arange(self._width)
        loss = np.zeros((len(gear), self._width))
        for number, (data, filled) in enumerate(
            zip(self.gears, self._filled, strict=True), start=1
        ):
            own = np.flatnonzero(gear == number)
            if not len(own):
                continue
            speeds = data.speed_radps
            at = np.clip(speed_radps[own], speeds[0], speeds[-1])
            i = np.clip(np.searchsorted(speeds, at, "right") - 1, 0, len(speeds) - 2)
            share = ((at - speeds[i]) / (speeds[i + 1] - speeds[i]))[:, None]
            width = len(data.torque_nm)
            torque[own, :width] = data.torque_nm
            loss[own, :width] = filled[i] * (1 - share) + filled[i + 1] * share
            # Further knots go on as the last one.
            torque[own, width:] = data.torque_nm[-1] + 1.0 + np.arange(self._width - width)
            loss[own, width:] = loss[own, width - 1 : width]
        return torque, loss

    def unknown(self, gear: Indices, speed_radps: Array, torque_nm: Array) -> NDArray[np.bool_]:
        """(state, level) where the loss at an input torque is not known. gear, speed_radps: (state,)"""
        found = np.zeros(np.broadcast_shapes((len(gear), 1), torque_nm.shape), dtype=bool)
        torque = np.broadcast_to(torque_nm, found.shape)
        for number, data in enumerate(self.gears, start=1):
            own = np.flatnonzero(gear == number)
            if len(own):
                speed = np.maximum(speed_radps[own], data.speed_radps[0])[:, None]
                loss = interpolated(
                    data.speed_radps, data.torque_nm, data.loss_nm, torque[own], speed
                )
                found[own] = np.isnan(loss)
        return found

    def input_nm(self, gear: Indices, speed_radps: Array, output_nm: Array) -> Array:
        """(state,) input torque for a torque at the output, referred to the input."""
        torque, loss = self.knots(gear, speed_radps)
        passed = torque - loss
        found = [float(y + _held(y, p, x)) for y, p, x in zip(output_nm, passed, loss, strict=True)]
        return np.where(gear > 0, found, output_nm)


def loss_at(knot_nm: Array, lost_nm: Array, torque_nm: Array) -> Array:
    """(state, level) loss at input torques, from the (state, knot) of `knots`; held beyond them."""
    rows = [np.interp(t, k, d) for t, k, d in zip(torque_nm, knot_nm, lost_nm, strict=True)]
    return np.array(rows).reshape(torque_nm.shape)


def _held(at: float, axis: Array, values: Array) -> float:
    return float(np.interp(at, axis, values))
