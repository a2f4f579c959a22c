"""What a measured map covers: shares, best point, idle, holes and places where fuel falls as torque rises."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from hevopt.car_files.engine import EngineFile
from hevopt.car_files.machine import MachineFile
from hevopt.measured.maps.envelope import FINE, Envelope, between, corners, envelope_of, place
from hevopt.measured.maps.faults import at_points, faults
from hevopt.measured.maps.gaps import lowest_fired_nm
from hevopt.measured.maps.grid import MapGrid
from hevopt.measured.maps.lines import Lines
from hevopt.measured.maps.request import ImportedMap
from hevopt.units import RPM_PER_RADPS

Array = NDArray[np.float64]

_SLACK = 0.01
_ABOVE = 1.05
_EFFICIENCIES = (0.15, 0.6)


def coverage(imported: ImportedMap) -> list[str]:
    """Lines of text about a component's map."""
    of = _engine if isinstance(imported.file, EngineFile) else _machine
    return of(imported, imported.file)


def _engine(imported: ImportedMap, file: EngineFile) -> list[str]:
    grid, envelope = imported.grid, envelope_of(file)
    heat = file.fuel.heating_value_mjpkg * 1e6
    said = [_extent(grid), *_engine_share(grid, imported.lines, envelope)]
    speed, torque = corners(grid, file)
    flow = grid.at(torque, speed)
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        efficiency = np.where(torque > 0, torque * speed / (flow * heat), np.nan)
    efficiency[~np.isfinite(efficiency)] = np.nan
    if np.isfinite(efficiency).any():
        k = np.nanargmax(efficiency)
        best, value = efficiency[k], flow[k]
        specific = value * 3.6e9 / (torque[k] * speed[k])
        said.append(
            f"peak efficiency: {best:.1%} ({specific:.1f} g/kWh) at {place(speed[k], torque[k])}"
        )
        least, most = _EFFICIENCIES
        if not least <= best <= most:
            than = "more than any engine reaches" if best > most else "less than any engine has"
            said.append(f"  WARNING: {than}; check units and heating value")
    said.append(_idle(grid, imported.lines, file))
    said += _above_full_load(imported.lines, file)
    said += faults(imported, envelope, "fuel")
    return said if imported.nox is None else said + _nox(imported, file, envelope)


def _machine(imported: ImportedMap, file: MachineFile) -> list[str]:
    grid, envelope = imported.grid, envelope_of(file)
    said = [_extent(grid), _share(grid, envelope, "within torque and power limit")]
    speed, torque = corners(grid, file)
    power, loss = np.abs(torque * speed), grid.at(torque, speed)
    for name, sign in (("motoring", 1), ("generating", -1)):
        one_way = np.where((sign * torque > 0) & (speed > 0), power, np.nan)
        with np.errstate(invalid="ignore"):
            efficiency = one_way / (one_way + loss) if sign > 0 else 1 - loss / one_way
        if np.isfinite(efficiency).any():
            k = np.nanargmax(efficiency)
            where = place(speed[k], torque[k])
            said.append(f"peak efficiency {name}: {efficiency[k]:.1%} at {where}")
    top = float(np.nanmax(loss[torque == 0]))
    said.append(f"loss without torque: up to {top:.0f} W")
    return said + faults(imported, envelope, "loss")


def _extent(grid: MapGrid) -> str:
    rpm, torque = grid.speed_radps * RPM_PER_RADPS, grid.torque_nm
    return (
        f"grid: {len(rpm)} speeds, {rpm[0]:.4g} to {rpm[-1]:.4g} rpm; {len(torque)} torques, {torque[0]:.4g} "
        f"to {torque[-1]:.4g} Nm"
    )


def _share(grid: MapGrid, envelope: Envelope, where: str) -> str:
    _, known = between(grid, envelope)
    height = (envelope.high_nm - envelope.low_nm)[:, None]
    share = (known * height).sum() / (height.sum() * FINE)
    return f"coverage: {share:.1%} of the area {where}; what the car asks for elsewhere is rejected"


def _engine_share(grid: MapGrid, lines: Lines, envelope: Envelope) -> list[str]:
    """Coverage by what was measured, what is assumed below it, and where the map ends below full load."""
    torque, known = between(grid, replace(envelope, low_nm=np.zeros_like(envelope.low_nm)))
    said = [
        f"coverage: {_shares(grid, lines, envelope)} as said next; what the car asks for elsewhere is rejected",
        f"ASSUMED below the lowest measured torque ({_lowest(lines, envelope)}): linear from there to no fuel at "
        "the motoring curve (hatched in the plot)",
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


def _shares(grid: MapGrid, lines: Lines, envelope: Envelope) -> str:
    """Shares of the area that were measured and that are assumed below the lowest measured torque."""
    torque, known = between(grid, replace(envelope, low_nm=np.zeros_like(envelope.low_nm)))
    lowest = lowest_fired_nm(lines, envelope.speed_radps)
    measured = known & (torque >= lowest[:, None] - _slack_nm(lines))
    high = envelope.high_nm[:, None]
    share, rest = (
        (part * high).sum() / (high.sum() * FINE) for part in (measured, known & ~measured)
    )
    return f"{share:.1%} of the area between torque 0 and full load is measured, {rest:.1%} assumed"


def _lowest(lines: Lines, envelope: Envelope) -> str:
    lowest = lowest_fired_nm(lines, envelope.speed_radps)
    ends = dict.fromkeys(f"{t:.4g}" for t in (lowest.min(), lowest.max()))
    return f"{' to '.join(ends)} Nm"


def _nox(imported: ImportedMap, file: EngineFile, envelope: Envelope) -> list[str]:
    """What the map of NOx covers, and what a car with this engine cannot do for want of it."""
    grid, lines = imported.nox
    said = [
        f"NOx: {_shares(grid, lines, envelope)} below the lowest measured torque ({_lowest(lines, envelope)}), "
        "linear from there to 0 at the motoring curve"
    ]
    low = replace(envelope, low_nm=np.zeros_like(envelope.low_nm))
    fuel, nox = (between(g, low)[1] for g in (imported.grid, grid))
    high = envelope.high_nm[:, None]
    lost = ((fuel & ~nox) * high).sum() / (high.sum() * FINE)
    if lost > 0:
        rpm = lines.speed_radps[[0, -1]] * RPM_PER_RADPS
        said.append(
            f"  WARNING: at {lost:.1%} of the area fuel is known and NOx is not, and what the car asks for there "
            f"is rejected (NOx was measured at {rpm[0]:.4g} to {rpm[1]:.4g} rpm); add points, or leave NOx out of "
            "the import to use all of the fuel map"
        )
    said.append(_idle_nox(grid, lines, file))
    return [*said, at_points(grid, lines, file, "NOx")]


def _slack_nm(lines: Lines) -> float:
    """By how much a torque that was to be held may miss."""
    return _SLACK * float(np.abs(lines.points.torque_nm).max())


def _above_full_load(lines: Lines, file: EngineFile) -> list[str]:
    """A warning where the engine was measured well above its full-load curve."""
    points, full = lines.points, file.full_load
    limit = np.interp(points.speed_radps * RPM_PER_RADPS, full.speed_rpm, full.torque_nm)
    with np.errstate(over="ignore"):  # a curve of next to nothing
        over = points.torque_nm / limit
    above = over > _ABOVE
    if not above.any():
        return []
    k = int(np.argmax(over))
    return [
        f"WARNING: {above.sum()} points were measured above full load, by up to {over[k] - 1:.0%} at "
        f"{place(points.speed_radps[k], points.torque_nm[k])}; check units, displacement and --full-load"
    ]


def _idle(grid: MapGrid, lines: Lines, file: EngineFile) -> str:
    flow, doubt = _at_idle(grid, lines, file)
    at = f"idle fuel ({file.idle_rpm:g} rpm, torque 0)"
    if np.isnan(flow):
        return (
            f"{at}: WARNING: outside the map; a car with this engine cannot idle; add points there"
        )
    litres = flow * 3600 / file.fuel.density_kgpl
    return f"{at}: {flow * 1e3:.4g} g/s, {litres:.3g} l/h{doubt}"


def _idle_nox(grid: MapGrid, lines: Lines, file: EngineFile) -> str:
    flow, doubt = _at_idle(grid, lines, file)
    at = f"idle NOx ({file.idle_rpm:g} rpm, torque 0)"
    if np.isnan(flow):
        return (
            f"{at}: WARNING: not known; a car with this engine cannot idle; add points there, or leave NOx out of "
            "the import"
        )
    return f"{at}: {flow * 1e6:.4g} mg/s{doubt}"


def _at_idle(grid: MapGrid, lines: Lines, file: EngineFile) -> tuple[float, str]:
    """Flow at idle without torque, and what is doubtful about it."""
    idle_radps = np.array(file.idle_rpm / RPM_PER_RADPS)
    lowest = float(lowest_fired_nm(lines, idle_radps))
    doubt = (
        f"; WARNING: NOT MEASURED but assumed, linear from {lowest:.4g} Nm to no fuel at the motoring curve, and "
        "may be far off; add points at torque 0"
    )
    return float(grid.at(np.array(0.0), idle_radps)), doubt * (lowest > _slack_nm(lines))
