"""The convex model of a problem, and its dual: a second-order cone program over steps and modes.

In every step t and mode m the choices become the lower convex hull of cost over battery power P. The battery is
exact where its voltage is linear in SOC and its resistance constant, and loses least elsewhere: with the chemical
power y = U I, a = max(y, 0), b = max(-y, 0), stored energy E, coulombic efficiency n and loss l,

    P = a - b - l,    Rd a² + Rc b² <= l w,    w <= U²(E),    E_t+1 <= E_t - dt (a - n b)

Between two points of the battery's curves U² is linear in E; over the window its concave envelope takes its
place, and the lowest resistances theirs. Where several modes are open the model is the convex hull of their union:
each has a share s_m of the step and its own P, a, b, l and E_m, all in proportion to the share, so that
w <= s_m U²(E_m / s_m); E is the sum of E_m. With one mode the share is 1.
"""

from typing import Any, NamedTuple

import numpy as np

from hevopt.errors import InfeasibleError, SolverError
from hevopt.problem.arrays import Array, Indices
from hevopt.problem.battery import source_power_w
from hevopt.problem.problem import Problem
from hevopt.strategies._convex_dual import dual_value_kg
from hevopt.strategies._convex_parts import Cell, HullCorners, cell_of

SOLVER = "CLARABEL"
# Segments kept for the solver: those whose slope lies within this share of the expected price, else every fourth.
_NEAR, _SPARSE = 0.1, 4
# Where the expected slope of the battery's losses ends, near the voltage's peak.
_LEAST_ROOT = 0.03


class Solution(NamedTuple):
    """An optimum. value_kg: the solver's; bound_kg: its dual evaluated afresh, never above the true optimum.

    price_kgpj: (time,) of stored energy after each step; energy_j: (time + 1,)
    """

    value_kg: float
    bound_kg: float
    price_kgpj: Array
    energy_j: Array


class _Lines(NamedTuple):
    """Segments of hulls: cost >= level + slope x power; all (segment,)."""

    block: Indices
    level_kg: Array
    slope_kgpw: Array


def optimum(
    problem: Problem, hulls: HullCorners, price_guess_kgpj: float, switch_j: Array | None = None
) -> Solution:
    """The optimum of the convex model; the guess says where its hulls must be fine.

    switch_j: (time,) what switching takes along a mode path; without it switching is for nothing
    InfeasibleError where there is none, SolverError where none was found.
    """
    import cvxpy as cp

    cell = cell_of(problem)
    # Units of the model, so that power, cost and energy are of order one.
    unit_w = float(np.abs(hulls.power_w).max()) or 1.0
    unit_kg = float(np.abs(hulls.cost_kg).max()) or 1.0
    unit_j = cell.high_j - cell.low_j
    blocks, steps = len(hulls.step), len(hulls.step_s)
    taken = np.zeros(steps + 1)
    taken[:-1] = 0.0 if switch_j is None else switch_j / unit_j
    start, end = ((x - cell.low_j) / unit_j for x in (problem.start_j, problem.end_min_j))
    share, discharge, charge = (cp.Variable(blocks, nonneg=True) for _ in range(3))
    power, cost, loss, energy = (cp.Variable(blocks) for _ in range(4))
    last = cp.Variable(1)
    of_step = _rows_of(hulls.step, np.ones(blocks), steps).T
    at_step = of_step @ energy
    drain = of_step @ (discharge - cell.efficiency * charge)
    # Stored energy is that between switching and step, but for the last, at the end.
    fall = at_step - cp.hstack([at_step[1:], last]) - taken[1:]
    # In units of a step's energy rather than the window's: the solver's tolerance is per row.
    unit_step_j = unit_w * float(hulls.step_s.mean())
    stored = cp.multiply(hulls.step_s * (unit_w / unit_step_j), drain) <= fall * (
        unit_j / unit_step_j
    )
    lines = _segments(hulls, cell, price_guess_kgpj)
    model = cp.Problem(
        cp.Minimize(cp.sum(cost)),
        [
            stored, of_step @ share == 1, power == discharge - charge - loss,
            at_step[0] == start - taken[0], energy >= 0, energy <= share, last >= end, last <= 1,
            *_within_hulls(hulls, lines, power, cost, share, unit_w, unit_kg),
            *_cones(cell, share, energy, discharge, charge, loss, unit_w),
        ],
    )  # fmt: skip
    _run(model, exact=switch_j is not None or not problem.table.switch_energy_j.any())
    price = np.maximum(stored.dual_value, 0.0) * (unit_kg / unit_step_j)
    place_j = cell.low_j + unit_j * energy.value / np.maximum(share.value, 1e-9)
    bound = dual_value_kg(problem, hulls, cell, price, place_j)
    path = cell.low_j + unit_j * (np.concatenate([at_step.value, last.value]) + taken)
    return Solution(float(model.value) * unit_kg, bound, price, path)


def _segments(hulls: HullCorners, cell: Cell, price_kgpj: float) -> _Lines:
    """The segments the solver gets. Fewer lie below all of them: what it finds stays below the optimum."""
    block = hulls.block
    one_block = np.diff(block) == 0
    left = np.flatnonzero(one_block)
    slope = (np.diff(hulls.cost_kg)[left]) / np.diff(hulls.power_w)[left]
    ohm = np.where(hulls.power_w < 0, cell.charge_ohm, cell.discharge_ohm)
    lowest_v = np.sqrt(cell.intercept_v2[0])
    root = source_power_w(hulls.power_w, lowest_v, ohm)[1] / lowest_v
    root = np.maximum(np.nan_to_num(root), _LEAST_ROOT)
    expected = (price_kgpj * hulls.step_s[hulls.step][block] / root)[left]
    near = np.abs(-slope - expected) <= _NEAR * expected
    place = left - hulls.first[block[left]]
    last = left + 2 == hulls.first[block[left] + 1]
    kept = near | last | (place % _SPARSE == 0)
    single = hulls.first[:-1][np.diff(hulls.first) == 1]
    corner = np.concatenate([left[kept], single])
    slopes = np.concatenate([slope[kept], np.zeros(len(single))])
    return _Lines(block[corner], hulls.cost_kg[corner] - slopes * hulls.power_w[corner], slopes)


def _within_hulls(
    hulls: HullCorners,
    lines: _Lines,
    power: Any,
    cost: Any,
    share: Any,
    unit_w: float,
    unit_kg: float,
) -> list[Any]:
    """Cost above every segment, power between the hull's ends, all in proportion to the share."""
    import cvxpy as cp

    blocks = len(hulls.step)
    slope = _rows_of(lines.block, lines.slope_kgpw * (unit_w / unit_kg), blocks)
    level = _rows_of(lines.block, lines.level_kg / unit_kg, blocks)
    ones = _rows_of(lines.block, np.ones(len(lines.block)), blocks)
    lowest, highest = hulls.power_w[hulls.first[:-1]], hulls.power_w[hulls.first[1:] - 1]
    return [
        ones @ cost >= slope @ power + level @ share,
        power >= cp.multiply(lowest / unit_w, share),
        power <= cp.multiply(highest / unit_w, share),
    ]


def _rows_of(column: Indices, value: Array, columns: int) -> Any:
    """Sparse matrix whose row i holds value[i] in column[i]."""
    from scipy.sparse import csr_array

    rows = np.arange(len(column))
    return csr_array((value, (rows, column)), shape=(len(column), columns))


def _cones(
    cell: Cell, share: Any, energy: Any, discharge: Any, charge: Any, loss: Any, unit_w: float
) -> list[Any]:
    """Rd a² + Rc b² <= l w and w <= every line of U², in units of the highest U²."""
    import cvxpy as cp

    if cell.discharge_ohm == 0 and cell.charge_ohm == 0:
        return [loss >= 0]
    unit_j = cell.high_j - cell.low_j
    unit_v2 = float(np.min(cell.intercept_v2 + cell.slope_v2pj * unit_j))
    lines = [
        (level / unit_v2) * share + (slope * unit_j / unit_v2) * energy
        for level, slope in zip(cell.intercept_v2, cell.slope_v2pj, strict=True)
    ]
    squared, below = lines[0], []
    if len(lines) > 1:
        squared = cp.Variable(share.shape)
        below = [squared <= line for line in lines]
    ratio = [2 * np.sqrt(ohm * unit_w / unit_v2) for ohm in (cell.discharge_ohm, cell.charge_ohm)]
    parts = cp.vstack([ratio[0] * discharge, ratio[1] * charge, loss - squared])
    return [*below, cp.SOC(loss + squared, parts, axis=0)]


def _run(model: Any, *, exact: bool) -> None:
    """Solve, or say why not; only an exact model can say that there is no plan."""
    import warnings

    import cvxpy as cp

    try:
        with warnings.catch_warnings():
            # Its one warning is that of an inexact solution, which the status tells as well.
            warnings.simplefilter("ignore")
            model.solve(solver=SOLVER)
        status = model.status
    except cp.SolverError as error:
        status = str(error)
    if status == cp.INFEASIBLE and exact:
        raise InfeasibleError(
            f"convex: {SOLVER} proves that no mixture of controls keeps the charge within its window and "
            "reaches the asked end charge; ask for a lower soc_end or widen the window"
        )
    if status != cp.OPTIMAL:
        raise SolverError(
            f"convex: {SOLVER} stopped with status {status}; allowed: {cp.OPTIMAL}; widen the SOC window "
            "a little, or use dp, which needs no solver"
        )
