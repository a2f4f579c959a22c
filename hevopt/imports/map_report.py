"""What a measured map covers: shares, best point, idle, holes and places where fuel falls as torque rises."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from hevopt.engine_file import EngineFile
from hevopt.imports.map_gaps import WIDE, lowest_fired_nm, widest_gap
from hevopt.imports.map_grid import Grid, Lines
from hevopt.imports.map_import import Imported
from hevopt.machine_file import MachineFile
from hevopt.units import RPM_PER_RADPS

Array = NDArray[np.float64]

_FINE = 200
_LISTED = 6
_ROUNDING = 1e-6
_TINY = 1e-12
_SLACK = 0.01
_OFF = 0.02
_ABOVE = 1.05
_EFFICIENCIES = (0.15, 0.6)


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
    said = [_extent(grid), *_engine_share(imported, envelope)]
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
        least, most = _EFFICIENCIES
        if not least <= best <= most:
            than = "more than any engine reaches" if best > most else "less than any engine has"
            said.append(f"  WARNING: {than}; check units and heating value")
    said.append(_idle(imported, file))
    said += _above_full_load(imported.lines, file)
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
    _, known = _between(grid, envelope)
    height = (envelope.high_nm - envelope.low_nm)[:, None]
    share = (known * height).sum() / (height.sum() * _FINE)
    return f"coverage: {share:.1%} of the area {where}; what the car asks for elsewhere is rejected"


def _between(grid: Grid, envelope: Envelope) -> tuple[Array, NDArray[np.bool_]]:
    """(speed, share) torques evenly from the lowest to the highest at each speed, and which are known."""
    shares = np.linspace(0.0, 1.0, _FINE)
    torque = envelope.low_nm[:, None] * (1 - shares) + envelope.high_nm[:, None] * shares
    return torque, ~np.isnan(grid.at(torque, envelope.speed_radps[:, None]))


def _engine_share(imported: Imported, envelope: Envelope) -> list[str]:
    """Coverage by what was measured, what is assumed below it, and where the map ends below full load."""
    grid, lines = imported.grid, imported.lines
    torque, known = _between(grid, replace(envelope, low_nm=np.zeros_like(envelope.low_nm)))
    lowest = lowest_fired_nm(lines, envelope.speed_radps)
    measured = known & (torque >= lowest[:, None] - _slack_nm(lines))
    high = envelope.high_nm[:, None]
    area = high.sum() * _FINE
    share, rest = (measured * high).sum() / area, ((known & ~measured) * high).sum() / area
    ends = dict.fromkeys(f"{t:.4g}" for t in (lowest.min(), lowest.max()))
    said = [
        f"coverage: {share:.1%} of the area between torque 0 and full load is measured, {rest:.1%} assumed as "
        "said next; what the car asks for elsewhere is rejected",
        f"ASSUMED below the lowest measured torque ({' to '.join(ends)} Nm): linear from there to no fuel at the "
        "motoring curve (hatched in the plot)",
    ]
    short = envelope.high_nm - np.where(known, torque, 0.0).max(axis=1)
    inside = (envelope.speed_radps >= grid.speed_radps[0]) & (
        envelope.speed_radps <= grid.speed_radps[-1]
    )
    short = np.where(inside, short, 0.0)
    ending = short > _SLACK * envelope.high_nm
    if ending.any():
        rpm = envelope.speed_radps * RPM_PER_RADPS
        k = int(np.argmax(short))
        said.append(
            f"full load: the map ends below the curve at {np.mean(ending):.0%} of the speeds ("
            f"{rpm[ending][0]:.0f} to {rpm[ending][-1]:.0f} rpm), by up to {short[k]:.3g} Nm at {rpm[k]:.0f} rpm; "
            "the engine gives no more than the map covers; add points up to the curve"
        )
    if not inside.all():
        ends = [f"{s * RPM_PER_RADPS:.4g}" for s in grid.speed_radps[[0, -1]]]
        said.append(
            f"full load: its curve or idle lies beyond the map's speeds, {ends[0]} to {ends[1]} rpm; what "
            "the car asks for there is rejected"
        )
    return said


def _slack_nm(lines: Lines) -> float:
    """By how much a torque that was to be held may miss."""
    return _SLACK * float(np.abs(lines.points.torque_nm).max())


def _above_full_load(lines: Lines, file: EngineFile) -> list[str]:
    """A warning where the engine was measured well above its full-load curve."""
    points, full = lines.points, file.full_load
    limit = np.interp(points.speed_radps * RPM_PER_RADPS, full.speed_rpm, full.torque_nm)
    over = points.torque_nm / limit
    above = over > _ABOVE
    if not above.any():
        return []
    k = int(np.argmax(over))
    return [
        f"WARNING: {above.sum()} points were measured above full load, by up to {over[k] - 1:.0%} at "
        f"{_place(points.speed_radps[k], points.torque_nm[k])}; check units, displacement and --full-load"
    ]


def _idle(imported: Imported, file: EngineFile) -> str:
    grid, lines = imported.grid, imported.lines
    flow = float(grid.at(np.array(0.0), np.array(file.idle_rpm / RPM_PER_RADPS)))
    at = f"idle fuel ({file.idle_rpm:g} rpm, torque 0)"
    if np.isnan(flow):
        return (
            f"{at}: WARNING: outside the map; a car with this engine cannot idle; add points there"
        )
    litres = flow * 3600 / file.fuel.density_kgpl
    said = f"{at}: {flow * 1e3:.4g} g/s, {litres:.3g} l/h"
    lowest = float(lowest_fired_nm(lines, np.array(file.idle_rpm / RPM_PER_RADPS)))
    if lowest <= _slack_nm(lines):
        return said
    return (
        f"{said}; WARNING: NOT MEASURED but assumed, linear from {lowest:.4g} Nm to no fuel at the motoring "
        "curve, and may be far off; add points at torque 0"
    )


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
    return [*said, _at_points(grid, lines, what), *_widest_gap(lines)]


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
    off, top = np.abs(there - points.value)[known], max(float(points.value.max()), _TINY)
    relative = off / np.maximum(points.value[known], _SLACK * top)
    k = int(np.argmax(relative))
    place = _place(points.speed_radps[known][k], points.torque_nm[known][k])
    many = int((relative > _OFF).sum())
    warning = f"; WARNING: more than {_OFF:.0%} at {many} points, whose neighbours disagree" * (
        many > 0
    )
    outside = f"; {np.sum(~known)} lie at the edge, outside full cells" if (~known).any() else ""
    return (
        f"grid against {known.sum()} measured points: {what} differs by {relative[k]:.2%} at most, at {place}, and "
        f"by {off.max() / top:.2%} of the largest value{outside}{warning}"
    )


def _widest_gap(lines: Lines) -> list[str]:
    """Where the map leans on points that are furthest away, between the lowest and highest measured torque."""
    gap = widest_gap(lines)
    if gap is None:
        return []
    said = (
        f"widest gap between measured points: around {_place(gap.speed_radps, gap.torque_nm)}, "
        f"{gap.times:.1f} times the usual distance from a point (the nearest is at {_place(*gap.near)})"
    )
    wide = "; WARNING: a hole in the measurement, filled by interpolation; add points there"
    return [said + wide * (gap.times > WIDE)]


def _mesh(grid: Grid) -> tuple[Array, Array]:
    return np.meshgrid(grid.speed_radps, grid.torque_nm, indexing="ij")


def _place(speed_radps: float, torque_nm: float) -> str:
    return f"{speed_radps * RPM_PER_RADPS:.4g} rpm, {torque_nm:.4g} Nm"
