"""What receding-horizon control knows of each step: its own row of the table, the past and the preview.

Everything is computed for the whole cycle at once, but entry k of every array comes from the steps that are seen at
step k alone: those that start before the preview of step k ends. Later steps change nothing in it.
"""

from dataclasses import dataclass

import numpy as np

from hevopt.bounds.bounded import drain_at_j
from hevopt.display.facts import Shown
from hevopt.problem.arrays import Array, Indices
from hevopt.problem.choices import Choices, choices_of, require_choices
from hevopt.problem.problem import Problem
from hevopt.problem.table import Signals
from hevopt.strategies import _mpc_kernels as kernels

# A price must be positive to count in; this one holds while nothing seen trades cost for charge.
_LEAST_PRICE_KGPJ = 1e-12
# A step starts within the preview if it does so by more than rounding.
_ROUNDING = 1e-9


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class PreviewModel(Shown):
    """Steps, controls and the feedback's two references.

    drain_j: (entry,) fall of stored energy at the start's state of charge
    fit: (time, mode, 5) cost over drain of each mode, see _mpc_kernels.fits
    end: (time,) first step beyond the preview
    price_kgpj: (time,) price at which the steps seen would have drained nothing in all
    wanted_j: (time,) stored energy wanted at the preview's end: the asked one less what braking will return
    """

    choices: Choices
    drain_j: Array
    fit: Array
    end: Indices
    price_kgpj: Array
    wanted_j: Array


def model_of(problem: Problem, horizon_s: float) -> PreviewModel:
    """The model of a problem under a preview of `horizon_s`."""
    choices, time_s = choices_of(problem), problem.table.time_s
    require_choices(problem, choices, "mpc")
    drain_j = drain_at_j(problem, choices, problem.start_j)
    listed = choices.cost_kg, drain_j
    fit = kernels.fits(choices.first, *listed, kernels.falling_hull(choices.first, *listed))
    whole_steps = np.ascontiguousarray(choices.first[:, [0, -1]])
    hulls = kernels.falling_hull(whole_steps, *listed)
    end = np.searchsorted(time_s, time_s + horizon_s * (1 - _ROUNDING))
    price = kernels.neutral_prices(hulls, *listed, end, _LEAST_PRICE_KGPJ)
    cheapest_j = drain_j[hulls.entry[hulls.first[:, 1] - 1]]
    returned_j = _recoverable_j(problem.table.signals, cheapest_j, end - 1)
    return PreviewModel(choices, drain_j, fit, end, price, problem.end_min_j - returned_j)


def _recoverable_j(signals: Signals | None, cheapest_j: Array, last: Indices) -> Array:
    """(time,) energy that braking from the speed of the preview's last step to rest would return.

    In proportion to the speed squared, at the rate of the braking seen so far: steps that slow down and whose
    choice of least cost charges.
    """
    if signals is None:
        return np.zeros(len(last))
    square = signals.speed_mps**2
    drop = np.maximum(-np.diff(square, prepend=square[0]), 0.0)
    braking = (drop > 0) & (cheapest_j < 0)
    returned = np.cumsum(np.where(braking, -cheapest_j, 0.0))[last]
    dropped = np.cumsum(np.where(braking, drop, 0.0))[last]
    rate = np.divide(returned, dropped, out=np.zeros_like(returned), where=dropped > 0)
    energy_j: Array = rate * square[last]
    return energy_j
