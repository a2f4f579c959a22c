"""A machine component from a measured map: the loss of machine and inverter on a grid of speed and torque.

At rest without torque the inverter is off, which is the one point added to those measured.
"""

from typing import Any

import numpy as np

from hevopt.datafile import checked
from hevopt.errors import DataError
from hevopt.imports.map_grid import Grid, axes_of, in_lines, on_axes
from hevopt.imports.map_import import (
    Imported,
    Request,
    check_used,
    like_component,
    rpm_list,
    with_given,
)
from hevopt.imports.map_limits import cell_at, near
from hevopt.imports.map_points import Curve, EngineFacts, read_curve, read_points
from hevopt.machine_file import MachineFile
from hevopt.units import RPM_PER_RADPS


def import_machine(request: Request) -> Imported:
    """A machine with a measured loss map; DataError where something is missing or wrong."""
    engines = sorted({*request.extra} - {"full"})
    if engines:
        raise DataError(
            f"{', '.join(engines)}: of an engine only; a machine's map is its loss at torques of both signs"
        )
    like = like_component(request.like, MachineFile)
    points = read_points(request.source, "loss", EngineFacts(None, None, None))
    if points is None:
        raise DataError(
            f"{request.source.path.name}: no column of loss, electric power or efficiency found; name it with "
            "--column loss=NAME (or electric=, efficiency=)"
        )
    limit = None
    if "full" in request.extra:
        limit = read_curve(request.extra["full"], "full", EngineFacts(None, None, None), plain=True)
    check_used(request, points.roles | (limit.roles if limit is not None else frozenset()))
    lines = in_lines(points, proportional=False)
    axes = axes_of(lines)
    if axes.torque_nm[-1] <= 0:
        raise DataError(
            f"{request.source.path.name}: no torque above 0; a map needs motoring points"
        )
    symmetric = bool(axes.torque_nm[0] >= 0)
    grid, added = _with_rest(on_axes(lines, axes.speed_radps, axes.torque_nm), symmetric)
    notes = [*points.notes, *lines.notes, axes.rule, *added]
    power = np.abs(lines.points.torque_nm * lines.points.speed_radps)
    torque, top_radps, whence = np.abs(lines.points.torque_nm), lines.speed_radps[-1], "the points"
    if limit is not None:
        torque, power = limit.torque_nm, limit.torque_nm * limit.speed_radps
        top_radps, whence = limit.speed_radps[-1], "the full-load curve"
        grid, masked = _within(grid, limit)
        notes += [limit.note, *masked]
    base: dict[str, Any] = {
        "name": request.source.path.stem,
        "kind": "map",
        "power_max_w": float(f"{power.max():.6g}"),
        "torque_max_nm": float(torque.max()),
        "speed_max_rpm": rpm_list([top_radps])[0],
        "inertia_kgm2": 0.0 if like is None else like.inertia_kgm2,
    }
    origins = dict.fromkeys(base, f"largest of {whence}") | {
        "name": "the file's name",
        "kind": "",
        "inertia_kgm2": "assumed: no --like" if like is None else f"from {request.like}",
    }
    base, origins = with_given(base, origins, request.given)
    contents = base | {
        "loss_map": {
            "speed_rpm": rpm_list(grid.speed_radps),
            "torque_nm": grid.torque_nm.tolist(),
            "symmetric": symmetric,
            "loss_w": grid.values.tolist(),
        }
    }
    file = checked(f"component from {request.source.path.name}", contents, MachineFile)
    return Imported(contents, file, origins, tuple(notes), _both_signs(grid), lines)


def _within(grid: Grid, limit: Curve) -> tuple[Grid, list[str]]:
    """The grid without cells beyond a limit of torque over speed, but with the corners of those it cuts."""
    if (limit.torque_nm <= 0).any():
        raise DataError(
            f"full-load curve: torque {limit.torque_nm.min():g} Nm; every torque must be above 0"
        )
    speed, torque = grid.speed_radps, grid.torque_nm
    values, known = grid.values.copy(), np.isfinite(grid.values)
    for i, row in enumerate(values):
        most = np.interp(near(speed, i), limit.speed_radps, limit.torque_nm).max()
        top, low = torque[cell_at(torque, most)], -(-torque[::-1])[cell_at(-torque[::-1], most)]
        row[(torque > top) | (torque < low)] = np.nan
    gone = int((known & np.isnan(values)).sum())
    return Grid(speed, torque, values), [
        "full-load curve: torque_max_nm, power_max_w and speed_max_rpm are its largest torque, power and speed; "
        f"{gone} cells of the map wholly beyond it are left out"
    ]


def _with_rest(grid: Grid, symmetric: bool) -> tuple[Grid, list[str]]:
    """The grid with torque 0 at every speed, and with standstill, where without torque nothing is lost."""
    speed, torque, values = grid.speed_radps, grid.torque_nm, grid.values
    notes = []
    if symmetric:
        notes.append(
            "no torque below 0: ASSUMED that generating loses what motoring does at equal torque"
        )
    if not (torque == 0).any():
        at = int(np.searchsorted(torque, 0.0))
        beside = values[:, [0, 0]] if at == 0 else values[:, at - 1 : at + 1]
        part = 0.0 if at == 0 else -torque[at - 1] / (torque[at] - torque[at - 1])
        torque = np.insert(torque, at, 0.0)
        values = np.insert(values, at, beside @ [1 - part, part], axis=1)
        notes.append("loss at torque 0: not measured, linear between the torques beside it")
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
        notes.append(
            f"loss at torque 0: linear in speed at {rpm_list(speed[gaps])} rpm, where it is not measured"
        )
    return Grid(speed, torque, values), notes


def _both_signs(grid: Grid) -> Grid:
    torque, values = grid.torque_nm, grid.values
    if torque[0] < 0:
        return grid
    above = torque > 0
    return Grid(
        grid.speed_radps,
        np.concatenate([-torque[above][::-1], torque]),
        np.hstack([values[:, above][:, ::-1], values]),
    )
