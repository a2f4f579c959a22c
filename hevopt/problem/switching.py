"""Going from mode to mode: the fuel and the stored energy that it takes, and where it is forbidden.

The energy s is taken from what the battery stores before the step:  y = x - s,  then the step at y. Like x, y must
keep to the window of the battery. s < 0 gives energy back.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from hevopt.problem.arrays import Array, Flags, Indices
from hevopt.problem.frozen import frozen
from hevopt.problem.table import ControlTable

Number = TypeVar("Number", bound=np.generic)


class Switching(NamedTuple):
    """What switching takes, as compiled loops read it.

    case: (time,) which of the matrices holds at a step
    kg, energy_j, allowed: (case, mode, mode) [from, to]
    """

    case: Indices
    kg: Array
    energy_j: Array
    allowed: Flags

    def part(self, begin: int, end: int) -> "Switching":
        """That of the steps begin <= k < end."""
        return self._replace(case=self.case[begin:end])


class Switched(NamedTuple):
    """The switches of a plan, all (time,): mode before, mode after, fuel, stored energy taken, whether allowed."""

    before: Indices
    mode: Indices
    kg: Array
    energy_j: Array
    allowed: Flags


def switching_of(table: ControlTable) -> Switching:
    """The switching of a table: one matrix where none depends on the step, else one for each step."""
    kg, energy_j, allowed = table.switch_fuel_kg, table.switch_energy_j, table.switch_allowed
    steps = len(table.step_s)
    if kg.ndim == energy_j.ndim == allowed.ndim == 2:
        return Switching(np.zeros(steps, np.int64), kg[None], energy_j[None], allowed[None])
    shape = steps, table.modes, table.modes
    return Switching(
        np.arange(steps),
        frozen("switch_fuel_kg", np.broadcast_to(kg, shape)),
        frozen("switch_energy_j", np.broadcast_to(energy_j, shape)),
        frozen("switch_allowed", np.broadcast_to(allowed, shape), np.bool_),
    )


def at_step(matrix: NDArray[Number], k: int) -> NDArray[Number]:
    """(mode, mode) of a table's switching at a step."""
    return matrix if matrix.ndim == 2 else matrix[k]


def joined_switching(parts: Sequence[Switching]) -> Switching:
    """That of one part's steps after the other's."""
    starts = np.cumsum([0, *(len(part.kg) for part in parts[:-1])])
    case = np.concatenate([part.case + start for part, start in zip(parts, starts, strict=True)])
    kg, energy_j, allowed = (
        frozen("switching", np.concatenate(matrices), matrices[0].dtype)
        for matrices in zip(*(part[1:] for part in parts), strict=True)
    )
    return Switching(case, kg, energy_j, allowed)


def switched(table: ControlTable, start_mode: int, control: Indices) -> Switched:
    """The switches of control indices, (time,)."""
    return switched_modes(table, start_mode, table.mode[control])


def switched_modes(table: ControlTable, start_mode: int, mode: Indices) -> Switched:
    """The switches of modes, (time,)."""
    before, switch, of_step = _places(table, start_mode, mode)
    kg, energy_j, allowed = (
        _taken(matrix, switch, of_step)
        for matrix in (table.switch_fuel_kg, table.switch_energy_j, table.switch_allowed)
    )
    return Switched(before, mode, kg, energy_j, allowed)


def switched_j(table: ControlTable, start_mode: int, control: Indices) -> Array:
    """Stored energy that the switches of control indices take, (time,)."""
    return _taken(table.switch_energy_j, *_places(table, start_mode, table.mode[control])[1:])


def _places(
    table: ControlTable, start_mode: int, mode: Indices
) -> tuple[Indices, Indices, Indices]:
    """Modes before the steps, and the places of the switches in a matrix for all steps, and in one for each.

    By their place in the whole array they are taken in a third of the time that three indices need.
    """
    before = np.concatenate([[start_mode], mode[:-1]])
    switch = before * table.modes + mode
    return before, switch, np.arange(len(mode)) * table.modes**2 + switch


def _taken(matrix: NDArray[Any], switch: Indices, of_step: Indices) -> NDArray[Any]:
    found: NDArray[Any] = matrix.take(switch if matrix.ndim == 2 else of_step)
    return found
