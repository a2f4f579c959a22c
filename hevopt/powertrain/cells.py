"""What is known of a car between neighbouring torques of a table: lines below fuel, NOx and battery power.

One torque u is chosen at a step of a state. Between two levels of it:
1. The engine's torque T is convex in u where torques.py shows it (`engine_slopes`); while the car does not drive it
   is the greater of that and the engine's lowest torque, friction brakes taking the rest: convex again.
2. Fuel is convex in T and rises with it where car/slopes.py shows it, so that it is convex in u. While gears change
   both are means over the step, T / share for a share of it: convex as well.
3. A line through a level: fuel is at least that at the level and its slope by T times T less the level's, and T is
   at least its own line; of the two slopes at a kink that which makes the line steeper away from the level.
4. Battery power is u w, a constant and the machine's loss, convex in u where car/slopes.py shows it. It is one
   machine's: of ways in which another has a torque too nothing is claimed.
5. NOx rises with T, so that T may be replaced by its line. Its slope may fall, by m per Nm of u at most (`nox_bend`
   over what the line of T passes): over a cell of width h a line that is m h / 2 flatter stays below. Where fuel is
   cut on a part of the cell NOx is none there; both lines are then 0.
6. Fuel may count as cut a little above the drag torque, and two torques be taken for one within rounding: the
   slack, the slope times that.
7. Where fuel, or the machine's loss, is a measured map, a cell ends where the map bends as well, and it is straight
   in between (knots.py).
So for all levels of a step between the lowest and the highest that can be used. Torques beyond these, next to a
limit that is no level, are not spoken of. Where a part of a car shows none of this, nothing is claimed of the car.
"""

from collections.abc import Sequence

import numpy as np

from hevopt.car.driveline import ENGINE
from hevopt.car.slopes import loss_slopes
from hevopt.powertrain.branches import Driven, Piece
from hevopt.powertrain.burnt import burnt_lines
from hevopt.powertrain.knots import (
    TOUCH_NM,
    Inside,
    Straight,
    has_engine_map,
    has_machine_map,
    inside,
)
from hevopt.powertrain.operation import completed, flowing, setting
from hevopt.powertrain.split_levels import CellLevels, Sides, Worked, tangents
from hevopt.problem.arrays import Array, Flags
from hevopt.problem.cells import SplitCells, TableFigures, joined

# Share of a step's greatest figure by which a level worked out again may differ from the table's.
_SAME = 1e-12
# Powers of so little count as none.
_ZEROED_W = 4e-9


def cells_of(
    branches: Sequence[Driven], figures: TableFigures, *, nox: bool = True
) -> SplitCells | None:
    """The cells of a table that the branches made; None where a part of it is not shown to be convex.

    nox: without it the lines of NOx are 0
    """
    widths = [len(branch.labels) for branch in branches]
    steps, columns = figures.fuel_kg.shape
    if sum(widths) != columns:
        return None
    parts, first = [], 0
    for branch, width in zip(branches, widths, strict=True):
        for piece in branch.pieces:
            if piece.slot is not None or piece.here.shafts.step[-1] >= steps:
                return None
            levels = _levels(piece, first, figures)
            if levels is None:
                continue
            found = _cells(levels, figures, nox=nox)
            if found is None:
                return None
            parts.append(found)
        first += width
    return joined(parts, steps)


def _levels(piece: Piece, first: int, figures: TableFigures) -> CellLevels | None:
    """The levels at the states of a piece that have more than one to choose; None where no state has."""
    if not piece.given:
        return None
    (name, torque), here = next(iter(piece.given.items())), piece.here
    usable = figures.usable[here.shafts.step, first : first + torque.shape[1]]
    some = np.flatnonzero(usable.sum(axis=1) > 1)
    if not len(some):
        return None
    if len(some) < len(usable):
        torque, usable = torque[some], usable[some]
        here = setting(here.car, here.way, here.shafts.picked(some))
    low = np.where(usable, torque, np.inf).min(axis=1, keepdims=True)
    high = np.where(usable, torque, -np.inf).max(axis=1, keepdims=True)
    # What cannot be used stands in between, where it may be where a map bends, or else beyond.
    torque = np.where(usable | ((torque > low) & (torque < high)), torque, high + 1.0)
    order = np.argsort(torque, axis=1, kind="stable")
    torque = np.take_along_axis(torque, order, axis=1)
    usable = np.take_along_axis(usable, order, axis=1)
    begins = np.zeros_like(usable)
    begins[:, :-1] = (torque[:, 1:] <= high) & (torque[:, 1:] > torque[:, :-1])
    begin = np.flatnonzero(begins)
    return CellLevels(
        here, name, torque, first + order, usable, begins, begin // torque.shape[1], begin
    )


def _cells(levels: CellLevels, figures: TableFigures, *, nox: bool) -> SplitCells | None:
    here, name = levels.here, levels.name
    worked = _worked(levels, figures) if set(here.machines) == {name} else None
    if worked is None:
        return None
    maps = has_engine_map(here) or has_machine_map(here, name)
    between = inside(here, name, levels.torque_nm, levels.open) if maps else None
    burnt = None if maps and between is None else burnt_lines(levels, worked, between, nox=nox)
    power = None if burnt is None else _power_lines(levels, worked, between)
    if burnt is None or power is None:
        return None
    step = here.shafts.step
    slack = np.zeros(len(figures.step_s))
    np.maximum.at(slack, step, np.max(burnt.slack * worked.length_s, axis=1))
    ends = levels.start(levels.column), levels.end(levels.column)
    none = np.zeros((2, len(levels.low)), dtype=bool)
    cells = SplitCells(step[levels.state], *ends, burnt.fuel, burnt.nox, power, slack, none)
    if between is None:
        return cells
    known = cells.kept(levels.cell(between.known))
    return joined([known, _at_knots(levels, worked, slack)], len(slack))


def _worked(levels: CellLevels, figures: TableFigures) -> Worked | None:
    """None where a level is not what the table says."""
    here = levels.here
    torques = completed(here, {levels.name: levels.torque_nm})
    found, step = flowing(here, torques), here.shafts.step
    at, length_s = (step[:, None], levels.column), figures.step_s[step][:, None]
    fuel, nox, power = (values[at] for values in figures[:3])
    machines_w = np.broadcast_to(found.machines_w, power.shape)
    usable, rest = levels.usable, power - machines_w
    first = np.argmax(usable, axis=1)[:, None]
    rest_w = np.take_along_axis(rest, first, axis=1)
    if not _same(usable, fuel - found.fuel_kgps * length_s, fuel) or not _same(
        usable, rest - rest_w, power, _ZEROED_W
    ):
        return None
    return Worked(fuel, nox, power, rest_w, torques.get(ENGINE), found, length_s)


def _power_lines(levels: CellLevels, worked: Worked, between: Inside | None) -> Array | None:
    if between is not None and has_machine_map(levels.here, levels.name):
        ends = np.array([levels.start(levels.torque_nm), levels.end(levels.torque_nm)])
        own = Straight(*(levels.cell(values) for values in between.power))
        chord = own.along(ends) + worked.rest_w[levels.state, 0]
        return np.array([chord, chord]) - _touched_w(levels, worked)[levels.state]
    sides = _power_sides(levels)
    lines = None if sides is None else tangents(levels, worked.power_w, sides)
    if between is None or lines is None:
        return lines
    return lines - _touched_w(levels, worked)[levels.state]


def _touched_w(levels: CellLevels, worked: Worked) -> Array:
    """(state,) what power may change by where a torque is taken for the knot beside it."""
    width = np.diff(levels.torque_nm, axis=1)
    wide = levels.open[:, :-1] & (width > 1e3 * TOUCH_NM)
    steep = np.abs(np.diff(worked.power_w, axis=1)) / np.where(wide, width, 1.0)
    steepest: Array = np.where(wide, steep, 0.0).max(axis=1)
    return 4 * TOUCH_NM * steepest


def _at_knots(levels: CellLevels, worked: Worked, slack: Array) -> SplitCells:
    """What is at a level that cannot be used, and at one where fuel is cut, which what is next to it may jump down
    to: cells of no width."""
    within = levels.open.copy()
    within[:, 1:] |= levels.open[:, :-1]
    off: Flags = worked.found.off_engine_map | worked.found.off_machine_map
    state, level = np.nonzero(within & ~off & (~levels.usable | (worked.fuel_kg == 0)))
    lowered = worked.power_w - _touched_w(levels, worked)[:, None]
    fuel, nox, power = (
        np.broadcast_to(values[state, level], (2, 2, len(state)))
        for values in (worked.fuel_kg, worked.nox_kg, lowered)
    )
    column, apart = levels.column[state, level], np.ones((2, len(state)), dtype=bool)
    step = levels.here.shafts.step[state]
    return SplitCells(step, column, column, fuel, nox, power, slack, apart)


def _same(usable: Flags, error: Array, values: Array, slack: float = 0.0) -> bool:
    """Whether levels worked out again are those of the table where they can be used."""
    scale = np.abs(values).max(axis=1, keepdims=True)
    return bool((np.abs(error) <= _SAME * scale + slack)[usable].all())


def _power_sides(levels: CellLevels) -> Sides | None:
    here, name = levels.here, levels.name
    speed, share = here.speed_radps(name)[:, None], here.active(name)[:, None]
    slopes = loss_slopes(here.machines[name], levels.torque_nm / share, speed)
    return None if slopes is None else Sides(*(speed + side for side in slopes))
