"""Lines below fuel and NOx of a way between levels of its chosen torque; why, cells.py says, 1 to 3 and 5 to 7."""

from typing import NamedTuple

import numpy as np

from hevopt.car.driveline import ENGINE
from hevopt.car.slopes import Slopes, cut_nm, fuel_slopes, nox_bend, nox_slopes
from hevopt.powertrain.knots import TOUCH_NM, Inside, Straight, has_engine_map
from hevopt.powertrain.split_levels import CellLevels, Sides, Worked, tangents
from hevopt.problem.arrays import Array, Flags

# Share of a flow that rounding may add to a line through two points of it.
_ROUNDING = 1e-12


class BurntLines(NamedTuple):
    """(line, end, cell) lines of fuel and NOx, kg, and by how much they may be too high, (state, level), kg/s."""

    fuel: Array
    nox: Array
    slack: Array


def burnt_lines(
    levels: CellLevels, worked: Worked, between: Inside | None, *, nox: bool
) -> BurntLines | None:
    """The lines of all cells; without `nox` those of NOx are 0. None where something is not shown."""
    if between is not None and has_engine_map(levels.here):
        return _mapped_lines(levels, worked, between, nox=nox)
    burnt = _burnt(levels, worked.engine_nm, nox=nox)
    if burnt is None:
        return None
    sides = Sides(*(side * worked.length_s for side in burnt.fuel))
    fuel = tangents(levels, worked.fuel_kg, sides)
    if burnt.nox is None:
        return BurntLines(fuel, np.zeros(fuel.shape), burnt.slack)
    length = worked.length_s[levels.state, 0]
    sides = Sides(*(side * worked.length_s for side in burnt.nox.slopes))
    lines = tangents(levels, worked.nox_kg, sides)
    lines[0, 1] -= levels.start(burnt.nox.fall[0]) * length
    lines[1, 0] -= levels.start(burnt.nox.fall[1]) * length
    return BurntLines(fuel, np.where(levels.start(burnt.nox.apart), 0.0, lines), burnt.slack)


def _mapped_lines(
    levels: CellLevels, worked: Worked, between: Inside, *, nox: bool
) -> BurntLines | None:
    """Of a measured map: straight over the engine's torque, which is convex and goes one way within a cell."""
    sides = _torque_sides(levels)
    if sides is None or worked.engine_nm is None:
        return None
    known = levels.cell(between.known)
    turns = (levels.start(sides.right) < -TOUCH_NM) & (levels.end(sides.left) > TOUCH_NM)
    if (turns & known).any():
        return None
    touching = tangents(levels, worked.engine_nm, sides)
    chord = np.array([levels.start(worked.engine_nm), levels.end(worked.engine_nm)])
    lines = np.zeros((2, *touching.shape))
    slack, length_s = np.zeros(levels.torque_nm.shape), worked.length_s[levels.state, 0]
    for n, flow in enumerate((between.fuel, between.nox) if nox else (between.fuel,)):
        own = Straight(*(levels.cell(values) for values in flow))
        lines[n] = own.along(np.where(own.slope >= 0, touching, chord)) * length_s
        known_slopes = np.where(between.known, np.abs(flow.slope), 0.0)
        values = np.where(between.known, np.abs(flow.value), 0.0)
        rounding = 2 * TOUCH_NM * known_slopes.max(axis=1) + _ROUNDING * values.max(axis=1)
        slack = np.maximum(slack, rounding[:, None])
    return BurntLines(lines[0], lines[1], slack)


class _BurntNox(NamedTuple):
    """Slopes of NOx flow; fall: what lines from the low and from the high end lose across a cell; apart: cells in
    which NOx may be none. All (state, level), of cells at their low end."""

    slopes: Sides
    fall: tuple[Array, Array]
    apart: Flags


class _Burnt(NamedTuple):
    """Slopes of fuel flow and NOx, None where there is none or it is not asked for; slack: (state, level), kg/s."""

    fuel: Sides
    nox: _BurntNox | None
    slack: Array


def _burnt(levels: CellLevels, torque_nm: Array | None, *, nox: bool) -> _Burnt | None:
    here, shape = levels.here, levels.torque_nm.shape
    if torque_nm is None or ENGINE not in here.way.active:
        none = np.zeros(shape)
        return _Burnt(Sides(none, none), None, none)
    engine, speed = here.car.engine, here.engine_radps[:, None]
    over = _torque_sides(levels)
    own = np.broadcast_to(torque_nm / here.active(ENGINE)[:, None], shape)
    fuel = fuel_slopes(engine, own, speed)
    if over is None or fuel is None or np.isnan(own).any():
        return None
    touch = cut_nm(engine) + TOUCH_NM
    slack = 2 * touch * np.maximum(fuel.right, fuel.left)
    fuel_sides = _chained(over, *fuel)
    if not (nox and engine.nox_known):
        return _Burnt(fuel_sides, None, slack)
    rises = nox_slopes(engine, own, speed)
    if rises is None:
        return None
    slack = np.maximum(slack, 2 * touch * np.maximum(rises.right, rises.left))
    return _Burnt(fuel_sides, _burnt_nox(levels, own, over, rises), slack)


def _burnt_nox(levels: CellLevels, own: Array, over: Sides, rises: Slopes) -> _BurntNox:
    """Of NOx whose flow rises with the engine's torque, `own`, its slopes given."""
    here, engine = levels.here, levels.here.car.engine
    speed, share = here.engine_radps[:, None], here.active(ENGINE)[:, None]
    width = np.diff(levels.torque_nm, axis=1, append=levels.torque_nm[:, -1:])
    cut = engine.fuel_kgps(own, speed) == 0
    sides = _chained(over, *(np.where(cut, 0.0, side) for side in rises))
    right, left = over.right, np.roll(over.left, -1, axis=1)
    after = np.roll(own, -1, axis=1)
    # A torque that falls first and then rises may come to the cut in between.
    apart = (cut != np.roll(cut, -1, axis=1)) | ((right < 0) & (left > 0))
    fall = []
    for slope, start in ((right, own), (-left, after)):
        reached = start + slope * width / share
        bend = nox_bend(engine, np.minimum(start, reached), np.maximum(start, reached), speed)
        fall.append(bend / share * slope**2 * width**2 / 2)
    return _BurntNox(sides, (fall[0], fall[1]), apart)


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
