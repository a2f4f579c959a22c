"""What is wrong with a measured map: holes, flows that fall as torque rises, points it does not meet, wide gaps."""

import numpy as np
from numpy.typing import NDArray

from hevopt.car_files.engine import EngineFile
from hevopt.car_files.machine import MachineFile
from hevopt.measured.maps.envelope import Envelope, in_reach, mesh, place
from hevopt.measured.maps.gaps import WIDE, fired, widest_gap
from hevopt.measured.maps.grid import MapGrid
from hevopt.measured.maps.lines import Lines
from hevopt.measured.maps.request import ImportedMap
from hevopt.units import RPM_PER_RADPS

Array = NDArray[np.float64]

_LISTED = 6
_ROUNDING = 1e-6
_TINY = 1e-12
_SMALL = 0.01
_OFF = 0.02


def faults(imported: ImportedMap, envelope: Envelope, what: str) -> list[str]:
    """Lines of text about the map of "fuel" or "loss", as far as the component gets."""
    grid, lines = imported.grid, imported.lines
    speed, torque = mesh(grid)
    axis = grid.speed_radps
    low, high = (
        np.interp(axis, envelope.speed_radps, t)[:, None]
        for t in (envelope.low_nm, envelope.high_nm)
    )
    used = (axis >= envelope.speed_radps[0]) & (axis <= envelope.speed_radps[-1])
    holes = np.isnan(grid.values) & (torque >= low) & (torque <= high) & used[:, None]
    said = [f"holes: {_listed(holes, speed, torque, _enclosed(grid))}"]
    if what == "fuel":
        with np.errstate(invalid="ignore"):
            falls = np.diff(grid.values, axis=1) < -_ROUNDING * np.nanmax(grid.values)
        falls &= (grid.torque_nm[1:] > 0) & (torque[:, :-1] < high) & used[:, None]
        falling = _listed(falls, speed[:, 1:], torque[:, 1:], np.zeros(falls.shape))
        said.append(f"fuel falling as torque rises at one speed: {falling}")
    return [
        *said,
        at_points(grid, lines, imported.file, what),
        *_widest_gap(grid, lines, envelope),
    ]


def _enclosed(grid: MapGrid) -> Array:
    """(speed, torque) on how many of its four sides a cell has known ones: the car is driven amid those."""
    known, sides = ~np.isnan(grid.values), np.zeros(grid.values.shape)
    for axis in (0, 1):
        sides += np.maximum.accumulate(known, axis=axis)
        sides += np.flip(np.maximum.accumulate(np.flip(known, axis), axis=axis), axis)
    return sides


def _listed(where: NDArray[np.bool_], speed: Array, torque: Array, weight: Array) -> str:
    """Places in words, those of most weight first."""
    order = np.argsort(-weight[where], kind="stable")
    found = zip(speed[where][order], torque[where][order], strict=True)
    places = [place(s, t) for s, t in found]
    more = f" and {len(places) - _LISTED} more" if len(places) > _LISTED else ""
    return f"{len(places)}: {'; '.join(places[:_LISTED])}{more}" if places else "none"


def at_points(grid: MapGrid, lines: Lines, file: EngineFile | MachineFile, what: str) -> str:
    """How far the grid is from the points behind it; at the drag, where fuel is cut, it is 0 by rule."""
    points, burning = lines.points, fired(lines)
    reached = in_reach(file, points.speed_radps, points.torque_nm)
    beyond = int((burning & ~reached).sum())
    burning &= reached
    value, there = points.value, grid.at(points.torque_nm, points.speed_radps)
    known = ~np.isnan(there) & burning
    if not known.any():
        return f"measured points: none of {burning.sum()} lies in a full cell of the grid"
    off, top = np.abs(there - value)[known], max(float(value.max()), _TINY)
    relative = off / np.maximum(value[known], _SMALL * top)
    k, many = int(np.argmax(relative)), int((relative > _OFF).sum())
    where = place(points.speed_radps[known][k], points.torque_nm[known][k])
    steps = np.diff(grid.speed_radps).max() * RPM_PER_RADPS, np.diff(grid.torque_nm).max()
    warning = (
        f"; WARNING: more than {_OFF:.0%} at {many} points between those of the grid (up to {steps[0]:.3g} rpm and "
        f"{steps[1]:.3g} Nm apart): {what} bends there within one step, or the points scatter"
    ) * (many > 0)
    edge = int((burning & ~known).sum())
    outside = f"; {edge} lie at the edge, outside full cells" * (edge > 0)
    outside += f"; {beyond} more lie where it cannot get" * (beyond > 0)
    return (
        f"grid against {known.sum()} measured points: {what} differs by {relative[k]:.2%} at most, at {where}, and "
        f"by {off.max() / top:.2%} of the largest value{outside}{warning}"
    )


def _widest_gap(grid: MapGrid, lines: Lines, envelope: Envelope) -> list[str]:
    """Where the map leans on points that are furthest away, between the lowest and highest measured torque."""
    gap = widest_gap(lines, envelope)
    if gap is None:
        return []
    said = (
        f"widest gap between measured points: around {place(gap.speed_radps, gap.torque_nm)}, "
        f"{gap.times:.1f} times the usual distance from a point (the nearest is at {place(*gap.near)})"
    )
    filled = not np.isnan(grid.at(np.array(gap.torque_nm), np.array(gap.speed_radps)))
    how = (
        "filled by interpolation" if filled else "not filled: what a car asks for there is rejected"
    )
    wide = f"; WARNING: a hole in the measurement, {how}; add points there"
    return [said + wide * (gap.times > WIDE)]
