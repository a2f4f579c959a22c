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
So for all levels of a step between the lowest and the highest that can be used. Torques beyond these, next to a
limit that is no level, are not spoken of. Where a part of a car shows none of this, nothing is claimed of the car.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from hevopt.car.driveline import ENGINE
from hevopt.car.slopes import cut_nm, fuel_slopes, loss_slopes, nox_bend, nox_slopes
from hevopt.powertrain.branches import Driven, Piece
from hevopt.powertrain.operation import Flowing, Setting, completed, flowing, setting
from hevopt.problem.arrays import Array, Flags, Indices
from hevopt.problem.cells import SplitCells, TableFigures, joined

_TOUCH_NM = 1e-9
# Share of a step's greatest figure by which a level worked out again may differ from the table's.
_SAME = 1e-12
# Powers of so little count as none.
_ZEROED_W = 4e-9


class _Sides(NamedTuple):
    """Slopes over the chosen torque towards less and towards more of it, (state, level)."""

    left: Array
    right: Array


class _Levels(NamedTuple):
    """Levels of a piece by rising torque, (state, level), and where they stand in the table.

    open: whether a cell begins at a level: within those that can be used, and not at the highest
    """

    here: Setting
    name: str
    torque_nm: Array
    column: Indices
    open: Flags


def cells_of(branches: Sequence[Driven], figures: TableFigures) -> SplitCells | None:
    """The cells of a table that the branches made; None where a part of it is not shown to be convex."""
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
            found = _cells(levels, figures)
            if found is None:
                return None
            parts.append(found)
        first += width
    return joined(parts, steps)


def _levels(piece: Piece, first: int, figures: TableFigures) -> _Levels | None:
    """The levels at the states of a piece that have more than one to choose; None where no state has."""
    if not piece.given:
        return None
    (name, torque), step = next(iter(piece.given.items())), piece.here.shafts.step
    usable = figures.usable[step, first : first + torque.shape[1]]
    some = np.flatnonzero(usable.sum(axis=1) > 1)
    if not len(some):
        return None
    torque, usable = torque[some], usable[some]
    order = np.argsort(torque, axis=1, kind="stable")
    torque = np.take_along_axis(torque, order, axis=1)
    usable = np.take_along_axis(usable, order, axis=1)
    open_ = np.maximum.accumulate(usable, axis=1)
    open_ &= np.maximum.accumulate(usable[:, ::-1], axis=1)[:, ::-1]
    begins = np.zeros_like(open_)
    begins[:, :-1] = open_[:, 1:] & open_[:, :-1] & (np.diff(torque, axis=1) > 0)
    here = setting(piece.here.car, piece.here.way, piece.here.shafts.picked(some))
    return _Levels(here, name, torque, first + order, begins)


def _cells(levels: _Levels, figures: TableFigures) -> SplitCells | None:
    here, name, torque = levels.here, levels.name, levels.torque_nm
    if set(here.machines) != {name}:
        return None
    torques = completed(here, {name: torque})
    found, step = flowing(here, torques), here.shafts.step
    at = step[:, None], levels.column
    length_s = figures.step_s[step][:, None]
    fuel, nox, power = (values[at] for values in figures[:3])
    machines_w = np.broadcast_to(found.machines_w, power.shape)
    if not _same(figures.usable[at], fuel - found.fuel_kgps * length_s, fuel) or not _same(
        figures.usable[at], _apart(power - machines_w, figures.usable[at]), power, _ZEROED_W
    ):
        return None
    power_sides = _power_sides(levels)
    burnt = _burnt(levels, torques.get(ENGINE), found)
    if power_sides is None or burnt is None:
        return None
    state, low = np.nonzero(levels.open)
    width = torque[state, low + 1] - torque[state, low]
    length = figures.step_s[step[state]]

    def lines(values: Array, sides: _Sides, fall: Array | float = 0.0) -> Array:
        start, end = values[state, low], values[state, low + 1]
        right, left = sides.right[state, low], sides.left[state, low + 1]
        return np.array([[start, start + right * width - fall], [end - left * width - fall, end]])

    fuel_lines = lines(fuel, _Sides(*(side * length_s for side in burnt.fuel)))
    flat = burnt.nox_apart[state, low]
    nox_lines = lines(nox, _Sides(*(side * length_s for side in burnt.nox)))
    nox_lines[0, 1] -= burnt.nox_fall[0][state, low] * length
    nox_lines[1, 0] -= burnt.nox_fall[1][state, low] * length
    nox_lines = np.where(flat, 0.0, nox_lines)
    slack = np.zeros(len(figures.step_s))
    np.maximum.at(slack, step, np.max(burnt.slack * length_s, axis=1))
    return SplitCells(
        step[state],
        levels.column[state, low],
        levels.column[state, low + 1],
        fuel_lines,
        nox_lines,
        lines(power, power_sides),
        slack,
    )


def _same(usable: Flags, error: Array, values: Array, slack: float = 0.0) -> bool:
    """Whether levels worked out again are those of the table where they can be used."""
    scale = np.abs(values).max(axis=1, keepdims=True)
    return bool((np.abs(error) <= _SAME * scale + slack)[usable].all())


def _apart(rest: Array, usable: Flags) -> Array:
    """(state, level) how far the load beside the machines is from that at the state's first usable level."""
    first = np.argmax(usable, axis=1)[:, None]
    apart: Array = rest - np.take_along_axis(rest, first, axis=1)
    return apart


def _power_sides(levels: _Levels) -> _Sides | None:
    here, name = levels.here, levels.name
    speed, share = here.speed_radps(name)[:, None], here.active(name)[:, None]
    slopes = loss_slopes(here.machines[name], levels.torque_nm / share, speed)
    return None if slopes is None else _Sides(*(speed + side for side in slopes))


class _Burnt(NamedTuple):
    """Slopes of fuel and NOx flow; all (state, level), where of cells at their low end.

    nox_fall: what lines of NOx from the low and from the high end lose across a cell; nox_apart: cells in which NOx
    may be none; slack: kg/s
    """

    fuel: _Sides
    nox: _Sides
    nox_fall: tuple[Array, Array]
    nox_apart: Flags
    slack: Array


def _burnt(levels: _Levels, torque_nm: Array | None, found: Flowing) -> _Burnt | None:
    here, shape = levels.here, levels.torque_nm.shape
    none = np.zeros(shape)
    if torque_nm is None or ENGINE not in here.way.active:
        return _Burnt(_Sides(none, none), _Sides(none, none), (none, none), none > 1, none)
    engine, speed, share = here.car.engine, here.engine_radps[:, None], here.active(ENGINE)[:, None]
    over = _torque_sides(levels)
    own = np.broadcast_to(torque_nm / share, shape)
    fuel = fuel_slopes(engine, own, speed)
    if over is None or fuel is None or np.isnan(own).any():
        return None
    touch = cut_nm(engine) + _TOUCH_NM
    slack = 2 * touch * np.maximum(fuel.right, fuel.left)
    fuel_sides = _chained(over, *fuel)
    if not engine.nox_known:
        return _Burnt(fuel_sides, _Sides(none, none), (none, none), none > 1, slack)
    nox = nox_slopes(engine, own, speed)
    if nox is None:
        return None
    width = np.diff(levels.torque_nm, axis=1, append=levels.torque_nm[:, -1:])
    cut = engine.fuel_kgps(own, speed) == 0
    nox_sides = _chained(over, *(np.where(cut, 0.0, side) for side in nox))
    right, left = over.right, np.roll(over.left, -1, axis=1)
    after = np.roll(own, -1, axis=1)
    # A torque that falls first and then rises may come to the cut in between.
    apart = (cut != np.roll(cut, -1, axis=1)) | ((right < 0) & (left > 0))
    fall = []
    for slope, start in ((right, own), (-left, after)):
        reached = start + slope * width / share
        bend = nox_bend(engine, np.minimum(start, reached), np.maximum(start, reached), speed)
        fall.append(bend / share * slope**2 * width**2 / 2)
    slack = np.maximum(slack, 2 * touch * np.maximum(nox.right, nox.left))
    return _Burnt(fuel_sides, nox_sides, (fall[0], fall[1]), apart, slack)


def _torque_sides(levels: _Levels) -> _Sides | None:
    """Slopes of the engine's torque over the chosen one, friction brakes and lowest torque included."""
    here = levels.here
    found = here.torques.engine_slopes(levels.name, levels.torque_nm)
    if found is None:
        return None
    left, right = found
    if here.way.slack == ENGINE:
        free = here.torques.solve(here.unbraked({levels.name: levels.torque_nm}), [ENGINE])[ENGINE]
        above, stops = free - here.least_nm[:, None], (here.shafts.wheel_nm <= 0)[:, None]
        held, edge = stops & (above < -_TOUCH_NM), stops & (np.abs(above) <= _TOUCH_NM)
        left = np.where(held, 0.0, np.where(edge, np.minimum(left, 0.0), left))
        right = np.where(held, 0.0, np.where(edge, np.maximum(right, 0.0), right))
    return _Sides(left, right)


def _chained(over: _Sides, left: Array, right: Array) -> _Sides:
    """Slopes over the chosen torque from those over the engine's, whose own rise with it."""
    return _Sides(
        over.left * np.where(over.left > 0, left, right),
        over.right * np.where(over.right > 0, right, left),
    )
