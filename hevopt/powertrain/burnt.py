"""Lines below fuel and NOx of a way between levels of its chosen torque; why, cells.py says, 1 to 3 and 5 to 7."""

from typing import NamedTuple

import numpy as np

from hevopt.car.driveline import ENGINE
from hevopt.car.slopes import cut_nm, fuel_slopes, nox_bend, nox_slopes
from hevopt.powertrain.knots import TOUCH_NM, Inside, has_engine_map
from hevopt.powertrain.operation import Flowing
from hevopt.powertrain.split_levels import CellLevels, Sides, Worked, tangents
from hevopt.problem.arrays import Array, Flags

# Share of a flow that rounding may add to a line through two points of it.
_ROUNDING = 1e-12


class BurntLines(NamedTuple):
    """(line, end, cell) lines of fuel and NOx, kg, and by how much they may be too high, (state, level), kg/s."""

    fuel: Array
    nox: Array
    slack: Array


def burnt_lines(levels: CellLevels, worked: Worked, between: Inside | None) -> BurntLines | None:
    state, low = np.nonzero(levels.open)
    length = worked.length_s[state, 0]
    if between is not None and has_engine_map(levels.here):
        return _mapped_lines(levels, worked, between)
    burnt = _burnt(levels, worked.engine_nm, worked.found)
    if burnt is None:
        return None
    fuel, nox = (
        tangents(levels, values, Sides(*(side * worked.length_s for side in sides)))
        for values, sides in ((worked.fuel_kg, burnt.fuel), (worked.nox_kg, burnt.nox))
    )
    nox[0, 1] -= burnt.nox_fall[0][state, low] * length
    nox[1, 0] -= burnt.nox_fall[1][state, low] * length
    return BurntLines(fuel, np.where(burnt.nox_apart[state, low], 0.0, nox), burnt.slack)


def _mapped_lines(levels: CellLevels, worked: Worked, between: Inside) -> BurntLines | None:
    """Of a measured map: straight over the engine's torque, which is convex and goes one way within a cell."""
    sides, (state, low) = _torque_sides(levels), np.nonzero(levels.open)
    if sides is None or worked.engine_nm is None:
        return None
    known = between.known[state, low]
    turns = (sides.right[state, low] < -TOUCH_NM) & (sides.left[state, low + 1] > TOUCH_NM)
    if (turns & known).any():
        return None
    engine = np.broadcast_to(worked.engine_nm, levels.torque_nm.shape)
    touching = tangents(levels, engine, sides)
    chord = np.broadcast_to(engine[state, np.array([low, low + 1])], touching.shape)
    lines, slack = [], np.zeros(levels.torque_nm.shape)
    for flow in (between.fuel, between.nox):
        own = flow.of(state, low)
        lines.append(
            own.along(np.where(own.slope >= 0, touching, chord)) * worked.length_s[state, 0]
        )
        known_slopes = np.where(between.known, np.abs(flow.slope), 0.0)
        values = np.where(between.known, np.abs(flow.value), 0.0)
        rounding = 2 * TOUCH_NM * known_slopes.max(axis=1) + _ROUNDING * values.max(axis=1)
        slack = np.maximum(slack, rounding[:, None])
    return BurntLines(lines[0], lines[1], slack)


class _Burnt(NamedTuple):
    """Slopes of fuel and NOx flow; all (state, level), where of cells at their low end.

    nox_fall: what lines of NOx from the low and from the high end lose across a cell; nox_apart: cells in which NOx
    may be none; slack: kg/s
    """

    fuel: Sides
    nox: Sides
    nox_fall: tuple[Array, Array]
    nox_apart: Flags
    slack: Array


def _burnt(levels: CellLevels, torque_nm: Array | None, found: Flowing) -> _Burnt | None:
    here, shape = levels.here, levels.torque_nm.shape
    none = np.zeros(shape)
    if torque_nm is None or ENGINE not in here.way.active:
        return _Burnt(Sides(none, none), Sides(none, none), (none, none), none > 1, none)
    engine, speed, share = here.car.engine, here.engine_radps[:, None], here.active(ENGINE)[:, None]
    over = _torque_sides(levels)
    own = np.broadcast_to(torque_nm / share, shape)
    fuel = fuel_slopes(engine, own, speed)
    if over is None or fuel is None or np.isnan(own).any():
        return None
    touch = cut_nm(engine) + TOUCH_NM
    slack = 2 * touch * np.maximum(fuel.right, fuel.left)
    fuel_sides = _chained(over, *fuel)
    if not engine.nox_known:
        return _Burnt(fuel_sides, Sides(none, none), (none, none), none > 1, slack)
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


def _torque_sides(levels: CellLevels) -> Sides | None:
    """Slopes of the engine's torque over the chosen one, friction brakes and lowest torque included."""
    here = levels.here
    found = here.torques.engine_slopes(levels.name, levels.torque_nm)
    if found is None:
        return None
    left, right = found
    if here.way.slack == ENGINE:
        free = here.torques.solve(here.unbraked({levels.name: levels.torque_nm}), [ENGINE])[ENGINE]
        above, stops = free - here.least_nm[:, None], (here.shafts.wheel_nm <= 0)[:, None]
        held, edge = stops & (above < -TOUCH_NM), stops & (np.abs(above) <= TOUCH_NM)
        left = np.where(held, 0.0, np.where(edge, np.minimum(left, 0.0), left))
        right = np.where(held, 0.0, np.where(edge, np.maximum(right, 0.0), right))
    return Sides(left, right)


def _chained(over: Sides, left: Array, right: Array) -> Sides:
    """Slopes over the chosen torque from those over the engine's, whose own rise with it."""
    return Sides(
        over.left * np.where(over.left > 0, left, right),
        over.right * np.where(over.right > 0, right, left),
    )
