"""Full-load and motoring curve of a measured engine, and a flow on its grid from one to the other.

Below the motoring curve the fuel is cut; between it and the lowest measured torque the flow is assumed to be
linear.
"""

from math import pi

import numpy as np
from numpy.typing import NDArray

from hevopt.car_files.engine import EngineFile
from hevopt.errors import DataError
from hevopt.measured.maps.grid import Axes, MapGrid, on_axes, torque_axis
from hevopt.measured.maps.limits import cell_at, encloses, near
from hevopt.measured.maps.lines import Lines, envelope_nm
from hevopt.measured.maps.points import Curve, EngineFacts, Points, above_zero, read_curve
from hevopt.measured.maps.request import Request
from hevopt.units import RPM_PER_RADPS, TO_SI

Array = NDArray[np.float64]

_PA_PER_BAR = 1e5
_MOTORING_POINTS = 21


def motoring_curve(
    request: Request,
    lines: Lines,
    like: EngineFile | None,
    displacement_cm3: float,
    facts: EngineFacts,
) -> Curve:
    """The curve given; else the highest torque without fuel at each speed; else the drag of `like`, scaled.

    Raises DataError where there is none of these.
    """
    points = lines.points
    curve = None
    if "motoring" in request.extra:
        curve = read_curve(request.extra["motoring"], "motoring", facts, plain=True)
    elif not points.rectangular:
        curve = read_curve(request.source, "motoring", facts, plain=False)
    if curve is None and "full" in request.extra:
        curve = read_curve(request.extra["full"], "motoring", facts, plain=False)
    if curve is not None:
        return curve
    unfired = (points.value == 0) & (points.torque_nm < 0)
    if len(np.unique(lines.line[unfired])) == len(lines.speed_radps):
        torque = np.full(len(lines.speed_radps), -np.inf)
        np.maximum.at(torque, lines.line[unfired], points.torque_nm[unfired])
        note = "motoring curve: highest torque without fuel at each speed"
        return Curve(lines.speed_radps, torque, note)
    if like is None:
        raise DataError(
            "no motoring curve (the torque of the unfired engine); give --motoring FILE with columns of speed "
            "and torque, or --like NAME to take the drag of another engine, scaled by displacement"
        )
    note = f"motoring curve: ASSUMED, drag mean pressure of {request.like} times the displacement"
    scale = displacement_cm3 / like.displacement_cm3
    if like.fuel_map is not None:  # a curve of its own, which ends where it was measured
        speed = np.array(like.fuel_map.speed_rpm) / RPM_PER_RADPS
        return Curve(speed, np.array(like.fuel_map.motoring_torque_nm) * scale, note)
    return Curve(lines.speed_radps, _drag_nm(like, lines.speed_radps) * scale, note)


def _drag_nm(like: EngineFile, speed_radps: Array) -> Array:
    rpm = speed_radps * RPM_PER_RADPS
    k, piston_mps = like.fuel_coefficients, 2 * like.stroke_mm / 1e3 * rpm / 60
    volume_m3 = like.displacement_cm3 * TO_SI["_cm3"][1]
    return (k.l + k.l2 * piston_mps**2) * _PA_PER_BAR * volume_m3 / (4 * pi)


def on_speeds(motoring: Curve, speed_radps: Array) -> Array:
    """(speed,) motoring torque; DataError beyond the ends of its curve."""
    low, high = motoring.speed_radps[0], motoring.speed_radps[-1]
    # Points were moved to speed lines, whose ends may lie beyond the curve's by as much.
    slack = 0.01 * high
    if speed_radps[0] < low - slack or speed_radps[-1] > high + slack:
        ends = [f"{s * RPM_PER_RADPS:.0f}" for s in (low, high, speed_radps[0], speed_radps[-1])]
        raise DataError(
            f"the motoring curve covers {ends[0]} to {ends[1]} rpm, the map {ends[2]} to {ends[3]} rpm; extend the "
            "curve, nothing is extrapolated"
        )
    return np.interp(speed_radps, motoring.speed_radps, motoring.torque_nm)


def full_load(request: Request, lines: Lines, facts: EngineFacts) -> Curve:
    """The curve given, else the highest torque measured at each speed."""
    if "full" in request.extra:
        return read_curve(request.extra["full"], "full", facts, plain=True)
    if not lines.points.rectangular:
        curve = read_curve(request.source, "full", facts, plain=False)
        if curve is not None:
            return curve
    note = "full load: no curve given, so the highest torque measured at each speed"
    return above_zero(Curve(*envelope_nm(lines), note))


def check_idle(idle_rpm: float, full: Curve) -> None:
    """DataError unless the engine can idle below its full-load curve."""
    low, high = full.speed_radps[0] * RPM_PER_RADPS, full.speed_radps[-1] * RPM_PER_RADPS
    if not low * (1 - 1e-9) <= idle_rpm < high:
        raise DataError(
            f"idle_rpm {idle_rpm:g} lies outside the full-load curve, {low:g} to {high:g} rpm: the engine could "
            "not idle; add points at idle speed, give a wider --full-load, or set another --set idle_rpm=VALUE"
        )


def flow_grid(lines: Lines, axes: Axes, motoring: Curve, full: Curve) -> tuple[MapGrid, int]:
    """The grid of a flow from the motoring curve, where and below which it is 0, up to the full-load curve.

    Second, at how many of its speeds measured rows were continued up to that curve.
    """
    speed, torque = axes.speed_radps, axes.torque_nm
    drag = on_speeds(motoring, speed)
    axis = torque_axis(min(drag.min(), torque[0]), torque[-1])
    if axes.lattice:
        below = axis[axis < torque[0] - 1e-3 * (axis[-1] - axis[0])]
        axis = np.concatenate([below, torque])
        values = on_axes(lines, speed, torque).values
        values = np.hstack([np.full((len(speed), len(below)), np.nan), values])
        for row, least in zip(values, drag, strict=True):
            _fill_down_to(row, axis, least)
    else:
        values = on_axes(_and_motoring(lines, motoring), speed, axis).values
    unfired = axis <= drag[:, None]
    # At a speed without any measurement nothing is known, and the 0 of the unfired engine would pass for it.
    measured = (~np.isnan(values) & ~unfired).any(axis=1, keepdims=True)
    grid = MapGrid(
        speed, axis, np.where(unfired & measured, 0.0, np.where(measured, values, np.nan))
    )
    return _up_to_full_load(grid, drag, lines, full) if lines.regular else (grid, 0)


def _fill_down_to(row: Array, axis: Array, least: float) -> None:
    """Cells between the motoring torque and the lowest measured one: linear from 0."""
    known = np.flatnonzero(~np.isnan(row) & (axis > least))
    if len(known):
        gap = np.isnan(row) & (axis < axis[known[0]])
        row[gap] = np.interp(axis[gap], [least, axis[known[0]]], [0.0, row[known[0]]])


def _up_to_full_load(
    grid: MapGrid, drag_nm: Array, lines: Lines, full: Curve
) -> tuple[MapGrid, int]:
    """The grid with corners of cells that the full-load curve cuts, each row continued linearly beyond its top.

    A rectangular cell needs them to be used up to the curve; beyond it the engine cannot go. Left out where the
    curve lies above the measured points, so that nothing is used that they do not enclose.
    """
    speed, torque, values = grid.speed_radps, grid.torque_nm, grid.values.copy()
    continued = 0
    for i, row in enumerate(values):
        wanted = np.interp(near(speed, i), full.speed_radps, full.torque_nm)
        # The 0 at and below the drag is no measurement that a line could be drawn through.
        known = np.flatnonzero(~np.isnan(row) & (torque > drag_nm[i]))
        if len(known) < 2 or not encloses(lines, wanted, near(speed, i)):
            continue
        continued += 1
        j, k = known[-2:]
        beyond = slice(k + 1, cell_at(torque, wanted.max()) + 1)
        slope = (row[k] - row[j]) / (torque[k] - torque[j])
        row[beyond] = np.maximum(row[k] + slope * (torque[beyond] - torque[k]), 0.0)
    return MapGrid(speed, torque, values), continued


def _and_motoring(lines: Lines, motoring: Curve) -> Lines:
    """The points and those of the motoring curve at the speeds of the lines; fired points below it left out.

    Without speed lines the curve's are a few, evenly apart: one at every point's speed would part close points.
    """
    points, own = lines.points, lines.speed_radps
    above = points.torque_nm > on_speeds(motoring, own)[lines.line]
    first = 0
    if not lines.regular:
        first, own = len(own), np.linspace(own[0], own[-1], _MOTORING_POINTS)
    drag = on_speeds(motoring, own)
    count = len(own)
    joined = Points(
        np.concatenate([points.speed_radps[above], own]),
        np.concatenate([points.torque_nm[above], drag]),
        np.concatenate([points.value[above], np.zeros(count)]),
        np.concatenate([points.lines[above], np.zeros(count, dtype=np.int64)]),
        points.rectangular,
        points.roles,
        points.notes,
    )
    line = np.concatenate([lines.line[above], first + np.arange(count)])
    speed = np.concatenate([lines.speed_radps[:first], own])
    return Lines(joined, line, speed, lines.regular, lines.notes)
