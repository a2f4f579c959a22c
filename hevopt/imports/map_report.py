"""What a measured map covers: shares, best point, idle, holes and places where fuel falls as torque rises."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hevopt.engine_file import EngineFile
from hevopt.imports.map_grid import Grid, Lines
from hevopt.imports.map_import import Imported
from hevopt.machine_file import MachineFile
from hevopt.units import RPM_PER_RADPS

Array = NDArray[np.float64]

_FINE = 200
_LISTED = 6
_ROUNDING = 1e-6
_TINY = 1e-300


@dataclass(frozen=True, slots=True, eq=False)
class Envelope:
    """Where the car may ask for: between two torques at each speed; all (speed,)."""

    speed_radps: Array
    low_nm: Array
    high_nm: Array


def coverage(imported: Imported) -> list[str]:
    """Lines of text about a component's map."""
    of = _engine if isinstance(imported.file, EngineFile) else _machine
    return of(imported, imported.file)


def envelope_of(file: EngineFile | MachineFile, count: int = _FINE) -> Envelope:
    """Torques between which the car may use the component: motoring and full load, or a machine's limits."""
    if isinstance(file, EngineFile):
        full, grid = file.full_load, file.fuel_map
        rpm = np.linspace(file.idle_rpm, full.speed_rpm[-1], count)
        low = np.interp(rpm, grid.speed_rpm, grid.motoring_torque_nm)
        return Envelope(rpm / RPM_PER_RADPS, low, np.interp(rpm, full.speed_rpm, full.torque_nm))
    speed = np.linspace(0.0, file.speed_max_rpm, count) / RPM_PER_RADPS
    with np.errstate(divide="ignore"):
        high = np.minimum(file.torque_max_nm, file.power_max_w / speed)
    return Envelope(speed, -high, high)


def _engine(imported: Imported, file: EngineFile) -> list[str]:
    grid, envelope = imported.grid, envelope_of(file)
    heat = file.fuel.heating_value_mjpkg * 1e6
    said = [_extent(grid), _share(grid, envelope, "between motoring and full load")]
    speed, torque = _mesh(grid)
    with np.errstate(invalid="ignore", divide="ignore"):
        efficiency = np.where(torque > 0, torque * speed / (grid.values * heat), np.nan)
    efficiency[~np.isfinite(efficiency)] = np.nan
    if np.isfinite(efficiency).any():
        k = np.unravel_index(np.nanargmax(efficiency), efficiency.shape)
        best, value = efficiency[k], grid.values[k]
        specific = value * 3.6e9 / (torque[k] * speed[k])
        said.append(
            f"peak efficiency: {best:.1%} ({specific:.1f} g/kWh) at {_place(speed[k], torque[k])}"
        )
        if best > 0.6:
            said.append("  WARNING: more than any engine reaches; check units and heating value")
    said.append(_idle(grid, file))
    return said + _faults(imported, envelope, "fuel")


def _machine(imported: Imported, file: MachineFile) -> list[str]:
    grid, envelope = imported.grid, envelope_of(file)
    said = [_extent(grid), _share(grid, envelope, "within torque and power limit")]
    speed, torque = _mesh(grid)
    power = np.abs(torque * speed)
    for name, sign in (("motoring", 1), ("generating", -1)):
        one_way = np.where((sign * torque > 0) & (speed > 0), power, np.nan)
        with np.errstate(invalid="ignore"):
            efficiency = (
                one_way / (one_way + grid.values) if sign > 0 else 1 - grid.values / one_way
            )
        if np.isfinite(efficiency).any():
            k = np.unravel_index(np.nanargmax(efficiency), efficiency.shape)
            place = _place(speed[k], torque[k])
            said.append(f"peak efficiency {name}: {efficiency[k]:.1%} at {place}")
    top = float(np.nanmax(grid.values[:, np.flatnonzero(grid.torque_nm == 0)[0]]))
    said.append(f"loss without torque: up to {top:.0f} W")
    return said + _faults(imported, envelope, "loss")


def _extent(grid: Grid) -> str:
    rpm, torque = grid.speed_radps * RPM_PER_RADPS, grid.torque_nm
    return (
        f"grid: {len(rpm)} speeds, {rpm[0]:.4g} to {rpm[-1]:.4g} rpm; {len(torque)} torques, {torque[0]:.4g} "
        f"to {torque[-1]:.4g} Nm"
    )


def _share(grid: Grid, envelope: Envelope, where: str) -> str:
    shares = np.linspace(0.0, 1.0, _FINE)
    torque = envelope.low_nm[:, None] * (1 - shares) + envelope.high_nm[:, None] * shares
    known = ~np.isnan(grid.at(torque, envelope.speed_radps[:, None]))
    height = (envelope.high_nm - envelope.low_nm)[:, None]
    share = (known * height).sum() / (height.sum() * _FINE)
    return f"coverage: {share:.1%} of the area {where}; what the car asks for elsewhere is rejected"


def _idle(grid: Grid, file: EngineFile) -> str:
    flow = float(grid.at(np.array(0.0), np.array(file.idle_rpm / RPM_PER_RADPS)))
    at = f"idle fuel ({file.idle_rpm:g} rpm, torque 0)"
    if np.isnan(flow):
        return (
            f"{at}: WARNING: outside the map; a car with this engine cannot idle; add points there"
        )
    litres = flow * 3600 / file.fuel.density_kgpl
    return f"{at}: {flow * 1e3:.4g} g/s, {litres:.3g} l/h"


def _faults(imported: Imported, envelope: Envelope, what: str) -> list[str]:
    grid, lines = imported.grid, imported.lines
    speed, torque = _mesh(grid)
    axis = grid.speed_radps
    low, high = (
        np.interp(axis, envelope.speed_radps, t)[:, None]
        for t in (envelope.low_nm, envelope.high_nm)
    )
    used = (axis >= envelope.speed_radps[0]) & (axis <= envelope.speed_radps[-1])
    holes = np.isnan(grid.values) & (torque >= low) & (torque <= high) & used[:, None]
    said = [f"holes: {_listed(holes, speed, torque)}"]
    if what == "fuel":
        with np.errstate(invalid="ignore"):
            falls = np.diff(grid.values, axis=1) < -_ROUNDING * np.nanmax(grid.values)
        falls &= grid.torque_nm[1:] > 0
        said.append(
            f"fuel falling as torque rises at one speed: {_listed(falls, speed[:, 1:], torque[:, 1:])}"
        )
    return [*said, _at_points(grid, lines, what), *_widest_gap(grid, lines)]


def _listed(where: NDArray[np.bool_], speed: Array, torque: Array) -> str:
    places = [_place(s, t) for s, t in zip(speed[where], torque[where], strict=True)]
    more = f" and {len(places) - _LISTED} more" if len(places) > _LISTED else ""
    return f"{len(places)}: {'; '.join(places[:_LISTED])}{more}" if places else "none"


def _at_points(grid: Grid, lines: Lines, what: str) -> str:
    """How far the grid is from the points behind it."""
    points = lines.points
    there = grid.at(points.torque_nm, points.speed_radps)
    known = ~np.isnan(there)
    if not known.any():
        return f"measured points: none of {len(there)} lies in a full cell of the grid"
    off = np.abs(there - points.value)[known]
    k = int(np.argmax(off))
    speed, torque = points.speed_radps[known][k], points.torque_nm[known][k]
    of_top = off[k] / max(points.value.max(), _TINY)
    outside = f"; {np.sum(~known)} lie at the edge, outside full cells" if (~known).any() else ""
    return (
        f"grid against {known.sum()} measured points: {what} differs by {of_top:.2g} of the largest at most, at "
        f"{_place(speed, torque)}{outside}"
    )


def _widest_gap(grid: Grid, lines: Lines) -> list[str]:
    """Where the grid leans on points that are furthest away, between the lowest and highest measured torque."""
    from scipy.spatial import cKDTree

    points = lines.points
    speed, torque = _mesh(grid)
    used = ~np.isnan(grid.values) & (torque >= points.torque_nm.min())
    span = np.array([np.ptp(points.speed_radps), np.ptp(points.torque_nm)])
    cells = np.column_stack([speed[used], torque[used]])
    away, nearest = cKDTree(np.column_stack([points.speed_radps, points.torque_nm]) / span).query(
        cells / span
    )
    k = int(np.argmax(away))
    if away[k] < _ROUNDING:
        return []
    near = points.speed_radps[nearest[k]], points.torque_nm[nearest[k]]
    return [
        f"widest gap between measured points: the cell at {_place(*cells[k])}, whose nearest point is at "
        f"{_place(*near)}"
    ]


def _mesh(grid: Grid) -> tuple[Array, Array]:
    return np.meshgrid(grid.speed_radps, grid.torque_nm, indexing="ij")


def _place(speed_radps: float, torque_nm: float) -> str:
    return f"{speed_radps * RPM_PER_RADPS:.4g} rpm, {torque_nm:.4g} Nm"
