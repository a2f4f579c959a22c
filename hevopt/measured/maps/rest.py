"""A machine's loss without torque, and at rest, where it was not measured.

Efficiency says nothing there. At each speed the loss without torque is assumed to be that at the lowest torque
measured, and between the two it is linear. At rest without torque the inverter is off, and nothing is lost.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from hevopt.measured.maps.grid import MapGrid
from hevopt.measured.maps.lines import Lines, groups
from hevopt.units import RPM_PER_RADPS

Array = NDArray[np.float64]

_SAME = 1e-6


def with_no_load(lines: Lines) -> tuple[Lines, list[str]]:
    """The points, and one without torque at every speed that lacks it; what was assumed."""
    points, (group, _) = lines.points, groups(lines)
    order = np.lexsort((np.abs(points.torque_nm), group))
    lowest = order[np.concatenate([[True], np.diff(group[order]) > 0])]
    lowest = lowest[points.torque_nm[lowest] != 0]
    if not len(lowest):
        return lines, []
    added = np.array([_loss_w(lines, group, k) for k in lowest])
    joined = replace(
        points,
        speed_radps=np.concatenate([points.speed_radps, points.speed_radps[lowest]]),
        torque_nm=np.concatenate([points.torque_nm, np.zeros(len(lowest))]),
        value=np.concatenate([points.value, added]),
        lines=np.concatenate([points.lines, points.lines[lowest]]),
    )
    at, rpm = np.abs(points.torque_nm[lowest]), points.speed_radps[lowest] * RPM_PER_RADPS
    note = (
        f"loss at torque 0: not measured at {len(lowest)} of {group.max() + 1} speeds ({rpm.min():.4g} to "
        f"{rpm.max():.4g} rpm); ASSUMED to be that of the lowest torque measured there ({at.min():.3g} to "
        f"{at.max():.3g} Nm), and linear up to it; add points at torque 0 (with a column of loss)"
    )
    line = np.concatenate([lines.line, lines.line[lowest]])
    return replace(lines, points=joined, line=line), [note]


def _loss_w(lines: Lines, group: NDArray[np.int64], k: int) -> float:
    """Loss at the lowest torque around a point, of either sign; none at rest."""
    points = lines.points
    if points.speed_radps[k] == 0:
        return 0.0
    torque = np.abs(points.torque_nm)
    alike = (points.speed_radps == points.speed_radps[k]) & (torque <= torque[k] * (1 + _SAME))
    return float(points.value[alike & (group == group[k])].mean())


def with_rest(grid: MapGrid, assumed: bool) -> tuple[MapGrid, list[str]]:
    """The grid with standstill, where without torque nothing is lost, and notes.

    assumed: the loss at torque 0 is, and so are the cells up to the next torque
    """
    speed, torque, values, notes = grid.speed_radps, grid.torque_nm, grid.values.copy(), []
    if speed[0] > 0:
        speed, values = np.insert(speed, 0, 0.0), np.vstack([np.full(len(torque), np.nan), values])
        notes.append(
            f"below {speed[1] * RPM_PER_RADPS:.4g} rpm: torque 0 alone can be used, its loss falling to 0 at rest; "
            "to drive off electrically, add points at lower speed (with a column of loss at standstill)"
        )
    zero = int(np.flatnonzero(torque == 0)[0])
    if np.isnan(values[0, zero]):
        values[0, zero] = 0.0
    known = ~np.isnan(values[:, zero])
    gaps = ~known & (speed < speed[known][-1])
    if gaps.any():
        values[gaps, zero] = np.interp(speed[gaps], speed[known], values[known, zero])
        rpm = speed[gaps] * RPM_PER_RADPS
        notes.append(
            f"loss at torque 0: linear in speed at {len(rpm)} speeds of the grid, {rpm.min():.4g} to "
            f"{rpm.max():.4g} rpm, where it is not measured"
        )
    if assumed:
        for row in values[1:]:
            _fill_around(row, torque, zero)
    return MapGrid(speed, torque, values), notes


def _fill_around(row: Array, torque: Array, zero: int) -> None:
    """Cells between torque 0 and the next known ones on either side: linear."""
    known = np.flatnonzero(~np.isnan(row))
    for side in (known[known < zero][-1:], known[known > zero][:1]):
        if len(side) and zero in known:
            between = slice(min(side[0], zero), max(side[0], zero) + 1)
            ends = [between.start, between.stop - 1]
            row[between] = np.interp(torque[between], torque[ends], row[ends])
