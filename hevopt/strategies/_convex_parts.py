"""Parts of the convex model: lower hulls of the choices, a battery that loses no more than the true one."""

from typing import NamedTuple

import numpy as np

from hevopt.problem.arrays import Array, Indices
from hevopt.problem.battery import best_voltage_and_resistance, energy_j
from hevopt.problem.choices import Choices, without_dominated
from hevopt.problem.problem import Problem
from hevopt.strategies._convex_kernels import lower_hulls


class HullCorners(NamedTuple):
    """Corners of lower hulls as flat lists, block by block; a block is an open mode of a step.

    step, mode: (block,), steps rising; first: (block + 1,); cost_kg, power_w: (corner,); step_s: (time,)
    """

    step: Indices
    mode: Indices
    first: Indices
    cost_kg: Array
    power_w: Array
    step_s: Array

    @property
    def block(self) -> Indices:
        """(corner,) block of each corner."""
        return np.repeat(np.arange(len(self.step)), np.diff(self.first))


class Cell(NamedTuple):
    """A battery that loses no more than the true one at any state of charge of the window.

    intercept_v2, slope_v2pj: (line,) U² <= intercept + slope (E - low_j)
    """

    intercept_v2: Array
    slope_v2pj: Array
    discharge_ohm: float
    charge_ohm: float
    efficiency: float
    low_j: float
    high_j: float


def hulls_of(choices: Choices, modes: Indices | None = None) -> HullCorners:
    """Hulls of every mode that is open at a step; with (time,) `modes`, of that mode alone."""
    first = choices.first
    if modes is not None:
        steps = np.arange(choices.steps)
        first = np.column_stack([first[steps, modes], first[steps, modes + 1]])
    kept = without_dominated(choices._replace(first=first))
    corner, hull_first = lower_hulls(kept.first, kept.cost_kg, kept.power_w)
    counts = np.diff(hull_first, axis=1)
    step, column = np.nonzero(counts)
    ends = np.cumsum(counts[counts > 0])
    return HullCorners(
        step,
        column if modes is None else modes[step],
        np.concatenate([[0], ends]),
        kept.cost_kg[corner],
        kept.power_w[corner],
        choices.step_s,
    )


def cell_of(problem: Problem) -> Cell:
    """The battery of the convex model: concave envelope of U² over the window, lowest resistances."""
    pack = problem.battery
    inside = pack.soc[(pack.soc > pack.soc_min) & (pack.soc < pack.soc_max)]
    points = np.concatenate([[pack.soc_min], inside, [pack.soc_max]])
    energy = energy_j(pack, points)
    squared = np.interp(points, pack.soc, pack.open_circuit_v) ** 2
    corner, _ = lower_hulls(np.array([[0, len(points)]]), -squared, energy)
    slope = np.diff(squared[corner]) / np.diff(energy[corner])
    intercept = squared[corner][:-1] - slope * (energy[corner][:-1] - energy[0])
    discharge_ohm, charge_ohm = (
        best_voltage_and_resistance(pack, charging)[1] for charging in (False, True)
    )
    return Cell(
        intercept, slope, discharge_ohm, charge_ohm, pack.coulombic_efficiency, float(energy[0]), float(energy[-1])
    )  # fmt: skip
