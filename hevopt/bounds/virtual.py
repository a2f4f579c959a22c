"""Virtual controls: what stands, in a bound by prices, for all that lies between the levels of a table.

Claim. Let a cell of a step and mode hold controls u, t from 0 to 1, whose cost f and battery power P are each at
least the greater of two lines (problem/cells.py), and let r(P, x) be the rate at which the battery drains at the
stored energy x. Then a few points (f_v, P_v) can be found so that, for every c >= 0 and every x of the window,
    f(u) + c r(P(u), x)  >=  the least of  f_v + c r(P_v, x)  over these points and the cell's two ends.
So the points, counted as if they were controls of the step, make a bound by prices one on all that lies between
levels: of its terms (prices.py, step_prices.py) those that hang on the control are f(u) + c r(P(u), x), with
c = p_t+1 dt, and nothing else there asks where cost and power come from. They are for bounds alone. A recursion
over stored energy asks for more, as a cost-to-go is not convex; lower_dp.py stays with the levels.

1. r rises with P, so f and P may be replaced by the greater of their lines, which are piecewise linear. Their kinks
   n_1 <= n_2, of f and of P in whichever order, part the cell into pieces on which both are linear. Where there is
   none the middle of the cell is taken for one: any place is valid.
2. At a given x, r is convex in P: with U and R, and e the coulombic efficiency while charging, r = e U I with
   P = U I - R I², of slope e U / s, s² = U² - 4 R P, rising with P on either side of 0; at 0 the slope goes from e
   to 1, e <= 1, whatever the two resistances. So the tangent at any P_0 lies below r everywhere.
3. On the piece from the cell's low end to n_1 take the tangent at the end's power P_0: linear in t, it is r itself
   at the end. If r(P_v) is at most the tangent at n_1's power, the piece is above the line from the end to the
   point (f(n_1), P_v), and so above the lesser of both, for every c >= 0. Likewise from n_2 to the high end; and
   between n_1 and n_2 with the tangent at the mean of their powers, n_1 and n_2 being lowered for both pieces.
4. The tangent of P_0 reaches at P the value e U (I_0 + (P - P_0) / s_0), whose power under the same U, R and e is
   P - R (P - P_0)² / s_0²  exactly. R at its greatest and U at its least within the window make it least for every
   x. Where it lands on the other side of 0: discharging, y = U I of a power P' < 0 is at least P', so that a
   charging power of P'/e - R P'²/(e U)² drains no more; charging, y = e U I of P' > 0 is at least e P', and the
   discharging power e P' - R (e P')²/U² drains that, or 0 where that is beyond the peak.
5. Where s_0² is next to nothing no tangent is of use: then one point, the least cost and the least power of the
   cell, which r, rising, makes a bound by itself.
6. An end of a cell is a control of the table where it can be used. Where it cannot, or is none (a knot of a map),
   or the lines begin below it, it is added too. None of this is dropped for moving more than the window holds: what
   lies next to it need not.
7. What rounding may have done to the lines is taken off every cost of the step, of levels and of virtual controls.
"""

from typing import NamedTuple

import numpy as np

from hevopt.bounds.prices import EPSILON
from hevopt.problem.arrays import Array, Flags, Indices
from hevopt.problem.battery import Battery
from hevopt.problem.choices import Choices, choices_of, without_dominated
from hevopt.problem.once import once
from hevopt.problem.problem import Problem

# Least share of U² that s² may be where a tangent is taken.
_LEAST_ROOT = 1e-6


class Virtual(NamedTuple):
    """Virtual controls of a problem, (entry,), and what is taken off every cost of a step, (time,).

    control: a column of the table of the same mode
    """

    step: Indices
    control: Indices
    cost_kg: Array
    power_w: Array
    slack_kg: Array


class Worst(NamedTuple):
    """Least voltage and greatest resistances of the window, and the coulombic efficiency."""

    voltage: float
    discharge_ohm: float
    charge_ohm: float
    efficiency: float

    @classmethod
    def of(cls, battery: Battery) -> "Worst":
        inside = battery.within_window()
        return cls(
            float(inside.open_circuit_v.min()),
            float(inside.discharge_ohm.max()),
            float(inside.charge_ohm.max()),
            float(inside.coulombic_efficiency),
        )


class Split(NamedTuple):
    """What a bound on all that lies between levels counts: virtual controls by themselves, and with all others."""

    virtual: Virtual
    choices: Choices


@once
def split_of(problem: Problem) -> Split | None:
    """The virtual controls of a problem, but those that another of their step and mode beats in cost and power, and
    the choices with them; None where nothing is known of what lies between its levels."""
    virtual = _virtual_of(problem)
    if virtual is None:
        return None
    real, table = choices_of(problem), problem.table
    step = np.concatenate([real.spread(np.arange(real.steps)), virtual.step])
    control = np.concatenate([real.control, virtual.control])
    cost_kg = np.concatenate([real.cost_kg, virtual.cost_kg]) - virtual.slack_kg[step]
    power_w = np.concatenate([real.power_w, virtual.power_w])
    block = step * real.modes + table.mode[control]
    order = np.argsort(block, kind="stable")
    counts = np.bincount(block, minlength=real.steps * real.modes)
    ends = np.cumsum(counts).reshape(real.steps, real.modes)
    first = np.column_stack([ends[:, 0] - counts[:: real.modes], ends])
    # For a moment a choice bears the number of its entry in place of its column.
    choices = without_dominated(
        real._replace(first=first, control=order, cost_kg=cost_kg[order], power_w=power_w[order])
    )
    left = choices.control - len(real.control)
    left = np.sort(left[left >= 0])
    kept = Virtual(
        virtual.step[left],
        virtual.control[left],
        virtual.cost_kg[left],
        virtual.power_w[left],
        virtual.slack_kg,
    )
    return Split(kept, choices._replace(control=control[choices.control]))


def _virtual_of(problem: Problem) -> Virtual | None:
    cells = problem.table.cells()
    if cells is None:
        return None
    table = problem.table
    whole = table.fuel_kg, table.nox_kg, table.battery_power_w * table.step_s[:, None]
    if not np.allclose(_cost_kg(problem, *whole), problem.cost_kg, rtol=1e-12, atol=0.0):
        return None  # an objective of which the lines know nothing
    energy_j = cells.power_w * table.step_s[cells.step]
    cost = _cost_kg(problem, cells.fuel_kg, cells.nox_kg, energy_j)
    nodes_kg, nodes_w, needed = nodes_of(cost, cells.power_w, Worst.of(problem.battery))
    for n, column, apart in ((0, cells.low, cells.apart[0]), (3, cells.high, cells.apart[1])):
        at = cells.step, column
        below = nodes_kg[n] < problem.cost_kg[at]
        below |= nodes_w[n] < table.battery_power_w[at]
        needed[n] &= below | (table.reject[at] != 0) | apart
    entry, cell = np.nonzero(needed)
    return Virtual(
        cells.step[cell],
        cells.low[cell],
        nodes_kg[entry, cell],
        nodes_w[entry, cell],
        cells.slack_kg * (1.0 + problem.nox_weight),
    )


def _cost_kg(problem: Problem, fuel_kg: Array, nox_kg: Array, energy_j: Array) -> Array:
    """What fuel, NOx and energy at the terminals count; of lines below each a line below their sum."""
    cost_kg = fuel_kg
    if problem.nox_weight != 0:
        cost_kg = cost_kg + problem.nox_weight * nox_kg
    if problem.electricity_kgpj != 0:
        cost_kg = cost_kg + problem.electricity_kgpj * energy_j
    return cost_kg


def nodes_of(cost: Array, power: Array, worst: Worst) -> tuple[Array, Array, Flags]:
    """(4, cell) costs and powers of a cell's points, its ends first and last, and which of them there are.

    cost, power: (line, end, cell)
    """
    inner = np.sort(_kinks(cost, power), axis=0)
    place = np.concatenate([np.zeros((1, inner.shape[1])), inner, np.ones((1, inner.shape[1]))])
    nodes_kg, at_w = (_greater(lines, place) for lines in (cost, power))
    nodes_w = at_w.copy()
    middle = (at_w[1] + at_w[2]) / 2
    found = [_lowered(start, at_w[n], worst) for n, start in ((1, at_w[0]), (2, at_w[3]))]
    between = [_lowered(middle, at_w[n], worst) for n in (1, 2)]
    nodes_w[1:3] = np.minimum(found, between)
    hopeless = ~np.isfinite(nodes_w).all(axis=0)
    nodes_kg[1:3] -= 4.0 * EPSILON * np.abs(cost).max(axis=(0, 1))
    nodes_w[1:3] -= 4.0 * EPSILON * np.abs(power).max(axis=(0, 1))
    nodes_kg[1] = np.where(hopeless, nodes_kg.min(axis=0), nodes_kg[1])
    nodes_w[1] = np.where(hopeless, at_w.min(axis=0), nodes_w[1])
    needed = np.ones(nodes_kg.shape, dtype=bool)
    needed[2] = ~hopeless
    return nodes_kg, nodes_w, needed


def _greater(lines: Array, place: Array) -> Array:
    """(node, cell) the greater of two lines at places of their cells."""
    start, end = lines[:, 0], lines[:, 1]
    at = start[:, None] * (1.0 - place) + end[:, None] * place
    greater: Array = np.maximum(at[0], at[1])
    return greater


def _kinks(cost: Array, power: Array) -> Array:
    """(2, cell) where the lines of cost and of power cross; where they do not, at the other's or in the middle."""
    found = []
    for lines in (cost, power):
        before, after = lines[1] - lines[0]
        crosses = (before < 0) != (after < 0)
        share = np.divide(before, before - after, out=np.full(before.shape, 0.5), where=crosses)
        found.append(np.where(crosses, np.clip(share, 0.0, 1.0), np.nan))
    one, other = found
    both = np.array([np.where(np.isnan(one), other, one), np.where(np.isnan(other), one, other)])
    return np.where(np.isnan(both), 0.5, both)


def _lowered(touch: Array, power: Array, worst: Worst) -> Array:
    """(cell,) a power that drains no more than the tangent at `touch` says of `power`; NaN without use."""
    voltage, discharge, charge, efficiency = worst
    charging = (touch < 0) | ((touch == 0) & (power < 0))
    ohm = np.where(charging, charge, discharge)
    squared = voltage**2 - 4.0 * ohm * touch
    usable = squared > _LEAST_ROOT * voltage**2
    squared = np.where(usable, squared, voltage**2)
    grown = 1.0 + 16.0 * EPSILON * voltage**2 / squared
    moved = power - grown * ohm * (power - touch) ** 2 / squared
    stored = np.minimum(moved, 0.0) / efficiency
    stored = stored - charge * (stored / voltage) ** 2
    drained = efficiency * np.maximum(moved, 0.0)
    peak = discharge * drained > voltage**2 / 2
    drained = np.where(peak, 0.0, drained - discharge * (drained / voltage) ** 2)
    crossed = np.where(charging, drained, stored)
    result = np.where(np.where(charging, moved > 0, moved < 0), crossed, moved)
    return np.where(usable, result, np.nan)
