"""A machine component from a measured map: the loss of machine and inverter on a grid of speed and torque."""

from typing import Any

import numpy as np

from hevopt.car_files.machine import MachineFile
from hevopt.errors import DataError
from hevopt.files.toml import checked
from hevopt.measured.maps.grid import MapGrid, axes_of, on_axes
from hevopt.measured.maps.limits import cell_at, near
from hevopt.measured.maps.lines import in_lines
from hevopt.measured.maps.points import Curve, EngineFacts, Points, read_curve, read_points
from hevopt.measured.maps.request import (
    ImportedMap,
    Request,
    check_used,
    like_component,
    rpm_list,
    with_given,
)
from hevopt.measured.maps.rest import with_no_load, with_rest
from hevopt.measured.tables.rows import runs

# Below this share of the largest power a machine may well lose more than it generates.
_SENSIBLE = 0.1


def import_machine(request: Request) -> ImportedMap:
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
    _check_generating(request, points)
    measured = in_lines(points, proportional=False)
    symmetric = bool(measured.points.torque_nm.min() >= 0)
    lines, assumed = with_no_load(measured)
    axes = axes_of(lines)
    if axes.torque_nm[-1] <= 0:
        raise DataError(
            f"{request.source.path.name}: no torque above 0; a map needs motoring points"
        )
    grid, added = with_rest(on_axes(lines, axes.speed_radps, axes.torque_nm), bool(assumed))
    notes = [*points.notes, *lines.notes, axes.rule, *assumed, *added]
    if symmetric:
        notes.append(
            "no torque below 0: ASSUMED that generating loses what motoring does at equal torque"
        )
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
    curve = {} if limit is None else {"full_load": _curve(limit)}
    contents = (
        base
        | curve
        | {
            "loss_map": {
                "speed_rpm": rpm_list(grid.speed_radps),
                "torque_nm": grid.torque_nm.tolist(),
                "symmetric": symmetric,
                "loss_w": grid.values.tolist(),
            }
        }
    )
    file = checked(f"component from {request.source.path.name}", contents, MachineFile)
    return ImportedMap(contents, file, origins, tuple(notes), _both_signs(grid), measured)


def _within(grid: MapGrid, limit: Curve) -> tuple[MapGrid, list[str]]:
    """The grid without cells beyond a limit of torque over speed, but with the corners of those it cuts."""
    speed, torque = grid.speed_radps, grid.torque_nm
    values, known = grid.values.copy(), np.isfinite(grid.values)
    for i, row in enumerate(values):
        most = np.interp(near(speed, i), limit.speed_radps, limit.torque_nm).max()
        top, low = torque[cell_at(torque, most)], -(-torque[::-1])[cell_at(-torque[::-1], most)]
        row[(torque > top) | (torque < low)] = np.nan
    gone = int((known & np.isnan(values)).sum())
    return MapGrid(speed, torque, values), [
        "full-load curve: torque is straight between its points, and power nowhere above that of all of them; "
        "torque_max_nm, power_max_w and speed_max_rpm are its largest torque, power and speed; "
        f"{gone} cells of the map wholly beyond it are left out"
    ]


def _curve(limit: Curve) -> dict[str, list[float]]:
    return {"speed_rpm": rpm_list(limit.speed_radps), "torque_nm": limit.torque_nm.tolist()}


def _check_generating(request: Request, points: Points) -> None:
    """DataError where electric power was written without the sign that it has while the machine generates."""
    power = points.torque_nm * points.speed_radps
    generating = power < -_SENSIBLE * np.abs(power).max()
    if "electric" not in points.roles or not generating.any():
        return
    wrong = generating & (points.value >= -power)
    if 2 * wrong.sum() > generating.sum():
        lines = runs(sorted(set(points.lines[wrong].tolist())))
        raise DataError(
            f"{request.source.path.name}, {lines}: electric power takes more than the shaft gives at {wrong.sum()} "
            f"of {generating.sum()} generating points (torque below 0); electric power is negative while "
            "generating; turn its sign there"
        )


def _both_signs(grid: MapGrid) -> MapGrid:
    torque, values = grid.torque_nm, grid.values
    if torque[0] < 0:
        return grid
    above = torque > 0
    return MapGrid(
        grid.speed_radps,
        np.concatenate([-torque[above][::-1], torque]),
        np.hstack([values[:, above][:, ::-1], values]),
    )
