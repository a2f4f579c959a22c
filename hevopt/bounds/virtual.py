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

from hevopt.bounds._virtual_kernels import Worst, among, nodes
from hevopt.bounds.prices import EPSILON
from hevopt.problem.arrays import Array, Flags, Indices
from hevopt.problem.battery import Battery
from hevopt.problem.cells import SplitCells
from hevopt.problem.choices import Choices, choices_of, without_dominated
from hevopt.problem.once import once
from hevopt.problem.problem import Problem
from hevopt.problem.table import ControlTable


class Virtual(NamedTuple):
    """Virtual controls of a problem, (entry,), and what is taken off every cost of a step, (time,).

    control: a column of the table of the same mode
    """

    step: Indices
    control: Indices
    cost_kg: Array
    power_w: Array
    slack_kg: Array


def worst_of(battery: Battery) -> Worst:
    """Least voltage and greatest resistances of a battery's window."""
    inside = battery.within_window()
    return Worst(
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
    entry, first = among(real.first, virtual.step * real.modes + table.mode[virtual.control])
    # For a moment a choice bears the number of its entry in place of its column.
    choices = without_dominated(
        real._replace(first=first, control=entry, cost_kg=cost_kg[entry], power_w=power_w[entry])
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
    table, counts_nox = problem.table, problem.nox_weight != 0
    cells = _with_nox(table) if counts_nox else _without_nox(table)
    if cells is None:
        return None
    known = _cost_kg(
        problem, table.fuel_kg, table.nox_kg, table.battery_power_w, table.step_s[:, None]
    )
    if not np.array_equal(known, problem.cost_kg) and not np.allclose(
        known, problem.cost_kg, rtol=1e-12, atol=0.0
    ):
        return None  # an objective of which the lines know nothing
    lines = cells.fuel_kg, cells.nox_kg, cells.power_w
    cost = _cost_kg(problem, *lines, table.step_s[cells.step])
    nodes_kg, nodes_w, needed = nodes_of(cost, cells.power_w, worst_of(problem.battery))
    for n, column, apart in ((0, cells.low, cells.apart[0]), (3, cells.high, cells.apart[1])):
        at = cells.step * table.mode.size + column
        below = nodes_kg[n] < problem.cost_kg.take(at)
        below |= nodes_w[n] < table.battery_power_w.take(at)
        needed[n] &= below | (table.reject.take(at) != 0) | apart
    entry = np.flatnonzero(needed)
    cell = entry % len(cells.step)
    return Virtual(
        cells.step[cell],
        cells.low[cell],
        nodes_kg.take(entry),
        nodes_w.take(entry),
        cells.slack_kg * (1.0 + problem.nox_weight),
    )


@once
def _with_nox(table: ControlTable) -> SplitCells | None:
    """A table's cells, which problems of every weight on NOx share."""
    return table.cells()


@once
def _without_nox(table: ControlTable) -> SplitCells | None:
    """Those that say nothing of NOx."""
    return table.cells(nox=False)


def _cost_kg(
    problem: Problem, fuel_kg: Array, nox_kg: Array, power_w: Array, step_s: Array
) -> Array:
    """What fuel, NOx and energy at the terminals count; of lines below each a line below their sum."""
    cost_kg = fuel_kg
    if problem.nox_weight != 0:
        cost_kg = cost_kg + problem.nox_weight * nox_kg
    if problem.electricity_kgpj != 0:
        cost_kg = cost_kg + problem.electricity_kgpj * (power_w * step_s)
    return cost_kg


def nodes_of(cost: Array, power: Array, worst: Worst) -> tuple[Array, Array, Flags]:
    """(4, cell) costs and powers of a cell's points, its ends first and last, and which of them there are.

    cost, power: (line, end, cell)
    """
    return nodes(cost, power, worst, EPSILON)
