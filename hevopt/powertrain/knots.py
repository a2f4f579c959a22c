"""Where measured maps bend along a chosen torque, and the straight lines between these knots.

At a given speed a measured map is linear in torque between its rows, and on a triangle of three measured corners as
far as its slanted edge (car/grid.py). So with the rows of the machine's map, the rows of the engine's, met by the
torque that leaves the engine just so much, both with their slanted edges, the engine's drag torque and its lowest,
and no torque at all, as ends of cells: within a cell
1. the machine's loss, and with it battery power, is linear in the chosen torque;
2. fuel and NOx are linear in the engine's torque T, whether they rise with it or not. T is convex in the chosen
   torque (torques.py) and goes one way within a cell: a flow that rises with T is at least what T's own lines give,
   one that falls at least what T's chord gives. No map need be convex for that.
3. Each line is that through two points inside the cell, a quarter of it from either end, so that a jump at an end
   (fuel that is cut, a machine that is switched off) does not count as part of the cell. What is at such an end
   counts by itself.
Where T turns round within a cell, or passes a knot there, nothing is claimed. All knots are levels of the table
(levels.py), so that a plan can choose them: the least of what is straight in between stands at one.
"""

from typing import NamedTuple

import numpy as np

from hevopt.car.architecture import Architecture
from hevopt.car.driveline import ENGINE
from hevopt.car.engine_laws import EngineMap
from hevopt.car.machine_laws import LossMap
from hevopt.powertrain.operation import Flowing, Setting, completed, flowing
from hevopt.problem.arrays import Array, Flags, Indices

# Torques that are one within rounding, and what may be taken for the knot beside it.
TOUCH_NM, _BESIDE_NM = 1e-9, 1e-6


class Straight(NamedTuple):
    """Straight lines of cells, (state, cell): a place, the quantity there, and its slope."""

    at_nm: Array
    value: Array
    slope: Array

    def along(self, torque_nm: Array) -> Array:
        """The quantity at torques, of as many cells."""
        return self.value + self.slope * (torque_nm - self.at_nm)


class Inside(NamedTuple):
    """What is between neighbouring torques, (state, cell): fuel and NOx flow, kg/s, over the engine's torque, and
    the machine's power, W, over its own; known: where there are data"""

    fuel: Straight
    nox: Straight
    power: Straight
    known: Flags


class Quarters(NamedTuple):
    """A quantity at a quarter of each cell from its ends, and at these, (state, cell) each."""

    one: Array
    other: Array
    start: Array
    end: Array


def has_engine_map(here: Setting) -> bool:
    """Whether a way's engine burns by a measured map."""
    return ENGINE in here.way.active and isinstance(here.car.engine.law, EngineMap)


def has_machine_map(here: Setting, name: str) -> bool:
    """Whether a machine loses by a measured map."""
    return isinstance(here.machines[name].loss, LossMap)


def knot_count(car: Architecture, *, engine_on: bool) -> int:
    """How many torques `knots_nm` gives at most, whichever machine is chosen."""
    maps = [m.loss for m in car.machines if isinstance(m.loss, LossMap)]
    count = max((len(law.torque_nm) + _edges(law.loss).low.shape[1] + 1 for law in maps), default=0)
    law = car.engine.law
    if engine_on and isinstance(law, EngineMap):
        count += len(law.torque_nm) + _edges(*_burning(law)).low.shape[1] + 2
    return count


def knots_nm(here: Setting, name: str) -> Array:
    """(state, knot) torques of the machine that is chosen where a map bends, NaN where one is not met."""
    states, found = len(here.shafts.step), []
    law = here.machines[name].loss
    if isinstance(law, LossMap):
        speed = here.speed_radps(name)
        rows = _rows_nm(law.speed_radps, law.torque_nm, _edges(law.loss), np.abs(speed))
        mirrored = np.where((speed < 0)[:, None], -rows, rows)
        found += [mirrored * here.active(name)[:, None], np.zeros((states, 1))]
    if (
        has_engine_map(here) and name in here.way.chosen
    ):  # else its torque does not hang on the machine's
        wanted = _engine_knots_nm(here)
        given = here.unbraked({ENGINE: wanted})
        pinned = here.torques.solve(given, [name])[name]
        found.append(np.broadcast_to(pinned, wanted.shape))
    return np.hstack(found) if found else np.zeros((states, 0))


def _engine_knots_nm(here: Setting) -> Array:
    """(state, knot) torques of the engine at which its flows bend or jump."""
    engine, speed, share = here.car.engine, here.engine_radps, here.active(ENGINE)[:, None]
    law = engine.law
    assert isinstance(law, EngineMap)  # asked for where it is
    rows = _rows_nm(law.speed_radps, law.torque_nm, _edges(*_burning(law)), speed)
    drag = np.nan_to_num(engine.drag_nm(speed))[:, None]
    return np.hstack([rows * share, drag * share, here.least_nm[:, None]])


def _burning(law: EngineMap) -> list[Array]:
    return [law.fuel] if law.nox is None else [law.fuel, law.nox]


class _Edges(NamedTuple):
    """Slanted edges of a map between two of its speeds, (speed, edge): the row below each, whether it rises with
    speed, and whether there is one."""

    low: Indices
    rises: Flags
    there: Flags


def _edges(*maps: Array) -> _Edges:
    """Of all cells of which three corners are measured, that between the fourth and these (car/grid.py)."""
    rising, falling = False, False
    for values in maps:
        gap = np.isnan(values)
        corners = np.array([gap[:-1, :-1], gap[1:, 1:], gap[:-1, 1:], gap[1:, :-1]])
        single = corners.sum(axis=0) == 1
        falling |= single & corners[:2].any(axis=0)
        rising |= single & corners[2:].any(axis=0)
    there = np.hstack([rising, falling])
    first = np.argsort(~there, axis=1, kind="stable")[:, : there.sum(axis=1).max()]
    cells = there.shape[1] // 2
    return _Edges(first % cells, first < cells, np.take_along_axis(there, first, 1))


def _rows_nm(speeds: Array, torques: Array, edges: _Edges, speed: Array) -> Array:
    """(state, knot) rows of a map and, where it is not measured all over, its slanted edges; NaN where none is."""
    rows = np.broadcast_to(torques, (len(speed), len(torques)))
    if not edges.low.shape[1]:
        return rows
    i = np.clip(np.searchsorted(speeds, speed, "right") - 1, 0, len(speeds) - 2)
    x = ((speed - speeds[i]) / (speeds[i + 1] - speeds[i]))[:, None]
    low = edges.low[i]
    step = torques[low + 1] - torques[low]
    slanted = torques[low] + np.where(edges.rises[i], x, 1 - x) * step
    return np.hstack([rows, np.where(edges.there[i], slanted, np.nan)])


def inside(here: Setting, name: str, torque_nm: Array, cells: Flags) -> Inside | None:
    """Straight lines between rising torques of a machine, (state, torque), where a cell begins, `cells`; None where
    something bends there."""
    width = np.diff(torque_nm, axis=1)
    cells = cells[:, :-1]
    starts = torque_nm[:, :-1]
    chosen = np.hstack([starts + width * 0.25, starts + width * 0.75, torque_nm])
    torques = completed(here, {name: chosen})
    flows = flowing(here, torques)

    def parts(values: Array) -> Quarters:
        count = width.shape[1]
        one, other, ends = np.split(np.broadcast_to(values, chosen.shape), [count, 2 * count], 1)
        return Quarters(one, other, ends[:, :-1], ends[:, 1:])

    engine = parts(torques.get(ENGINE, np.zeros((1, 1))))
    off = parts(_off(flows).astype(float))
    if (cells & (off.one != off.other)).any():
        return None
    known = off.one == 0
    if has_engine_map(here) and not _one_piece(here, engine, cells & known):
        return None
    wide = width > _BESIDE_NM
    fuel, nox, power = (
        _line(at, parts(np.where(_off(flows), np.inf, values)), cells & known & wide, width)
        for at, values in (
            (engine, flows.fuel_kgps),
            (engine, flows.nox_kgps),
            (parts(chosen), flows.machines_w),
        )
    )
    return Inside(fuel, nox, power, known)


def _off(flows: Flowing) -> Flags:
    off: Flags = flows.off_engine_map | flows.off_machine_map
    return off


def _line(at: Quarters, values: Quarters, wide: Flags, width: Array) -> Straight:
    """Through the inner points; in cells next to nothing wide, and where the points are one, below all of them."""
    apart = at.other - at.one
    same = ~wide | (np.abs(apart) <= TOUCH_NM)
    with np.errstate(invalid="ignore"):
        rise = (values.other - values.one) / np.where(same, 1.0, apart)
    slope = np.where(same, 0.0, rise)
    steepest = np.abs(slope).max(axis=1, keepdims=True, initial=0.0)
    least = np.min(values, axis=0) - steepest * np.minimum(width, _BESIDE_NM)
    value = np.where(wide, np.minimum(values.one, values.other), least)
    return Straight(at.one, np.where(same, value, values.one), slope)


def _one_piece(here: Setting, engine_nm: Quarters, cells: Flags) -> bool:
    """Whether the engine's torque in each cell lies between two neighbouring knots, or stands still."""
    low, high = np.min(engine_nm, axis=0) + _BESIDE_NM, np.max(engine_nm, axis=0) - _BESIDE_NM
    passed = np.zeros(cells.shape, dtype=bool)
    for knot in _engine_knots_nm(here).T[:, :, None]:
        passed |= (knot > low) & (knot < high)
    moved = (np.abs(engine_nm.other - engine_nm.one) <= TOUCH_NM) & (high > low)
    return not (cells & (passed | moved)).any()
