"""An engine component from a measured map: fuel, and NOx, on a grid of speed and torque, with its curves."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from hevopt.car_files.engine import EngineFile
from hevopt.errors import DataError
from hevopt.files.toml import checked
from hevopt.measured.maps.curves import check_idle, flow_grid, full_load, motoring_curve, on_speeds
from hevopt.measured.maps.grid import axes_of
from hevopt.measured.maps.limits import lowered
from hevopt.measured.maps.lines import Lines, in_lines, is_idle
from hevopt.measured.maps.points import Curve, EngineFacts, read_points
from hevopt.measured.maps.request import (
    ImportedMap,
    Request,
    check_used,
    like_component,
    rpm_list,
    with_given,
)
from hevopt.units import RPM_PER_RADPS, TO_SI

_ENGINE_KEYS = (
    "displacement_cm3", "bore_mm", "stroke_mm", "idle_rpm", "inertia_kgm2", "start_fuel_g", "fuel",
)  # fmt: skip
_FUEL_KEYS = ("heating_value_mjpkg", "density_kgpl", "co2_kgpkg")


def import_engine(request: Request) -> ImportedMap:
    """An engine with a measured map; DataError where something is missing or wrong."""
    like = like_component(request.like, EngineFile)
    base, origins = _engine_base(request, like)
    facts, idle_radps = _facts(base, request.given), base["idle_rpm"] / RPM_PER_RADPS
    lines = _fuel(request, facts, idle_radps)
    nox = _nox(request, facts, lines.points.rectangular, idle_radps)
    axes = axes_of(lines)
    motoring = motoring_curve(request, lines, like, base["displacement_cm3"], facts)
    full = _full_load(request, lines, facts, idle_radps)
    # The highest torque of a lattice is one of its torques, not a measurement of full load.
    flows = [] if axes.lattice else [lines] if nox is None else [lines, nox]
    full, notes = lowered(full, flows)
    grid, continued = flow_grid(lines, axes, motoring, full)
    notes = [*lines.points.notes, *lines.notes, axes.rule, motoring.note, full.note, *notes]
    if continued:
        notes.append(
            f"cells cut by the full-load curve: at {continued} of {len(grid.speed_radps)} speeds corners beyond "
            "it continue the row, so that the map reaches up to the curve there; the engine never goes beyond it"
        )
    maps = {
        "speed_rpm": rpm_list(grid.speed_radps),
        "torque_nm": grid.torque_nm.tolist(),
        "motoring_torque_nm": on_speeds(motoring, grid.speed_radps).tolist(),
        "fuel_gps": (grid.values * 1e3).tolist(),
    }
    used, of_nox = lines.points.roles | motoring.roles | full.roles, None
    if nox is None:
        notes.append("NOx: none given, so it is not known in any result")
    else:
        used |= nox.points.roles
        notes += _nox_notes(request, nox, notes)
        of_nox = flow_grid(nox, axes, motoring, full)[0], nox
        maps["nox_gps"] = (of_nox[0].values * 1e3).tolist()
    notes += _inherited_fuel(request, base)
    check_used(request, used)
    limit = {"speed_rpm": rpm_list(full.speed_radps), "torque_nm": full.torque_nm.tolist()}
    contents = base | {"full_load": limit, "fuel_map": maps}
    file = checked(f"component from {request.source.path.name}", contents, EngineFile)
    return ImportedMap(contents, file, origins, tuple(notes), grid, lines, of_nox)


def _fuel(request: Request, facts: EngineFacts, idle_radps: float) -> Lines:
    points = read_points(request.source, "fuel", facts)
    if points is None:
        raise DataError(
            f"{request.source.path.name}: no column of fuel, specific consumption or efficiency found; name it "
            "with --column fuel=NAME (or specific=, efficiency=)"
        )
    return in_lines(points, proportional=True, idle_radps=idle_radps)


def _full_load(request: Request, lines: Lines, facts: EngineFacts, idle_radps: float) -> Curve:
    """The curve, which starts at idle where it does so but for rounding."""
    full = full_load(request, lines, facts)
    speed = full.speed_radps
    if is_idle(speed[0], idle_radps):
        full = replace(full, speed_radps=np.concatenate([[idle_radps], speed[1:]]))
    check_idle(idle_radps * RPM_PER_RADPS, full)
    return full


def _engine_base(
    request: Request, like: EngineFile | None
) -> tuple[dict[str, Any], dict[str, str]]:
    """Every key but the maps, and where each comes from; DataError naming all that are missing."""
    base: dict[str, Any] = {"name": request.source.path.stem}
    origins = {"name": "the file's name"}
    if like is not None:
        base |= {key: value for key, value in like.model_dump().items() if key in _ENGINE_KEYS}
        origins |= dict.fromkeys((*_ENGINE_KEYS[:-1], *_dotted(_FUEL_KEYS)), f"from {request.like}")
    base, origins = with_given(base, origins, request.given)
    fuel = base.get("fuel") if isinstance(base.get("fuel"), dict) else {}
    missing = [key for key in _ENGINE_KEYS[:-1] if key not in base]
    missing += [f"fuel.{key}" for key in _FUEL_KEYS if key not in fuel]
    if missing:
        raise DataError(
            f"the component needs {', '.join(missing)}; give --like NAME (such as engine_diesel_1600) to take "
            "them from another engine, or --set KEY=VALUE for each"
        )
    return base, origins


def _inherited_fuel(request: Request, base: Mapping[str, Any]) -> list[str]:
    """A warning about what is another engine's fuel; it makes litres and CO2 of every result."""
    keys = (
        []
        if "fuel" in request.given
        else [k for k in _FUEL_KEYS if f"fuel.{k}" not in request.given]
    )
    if not keys or request.like is None:
        return []
    values = ", ".join(f"{key} {base['fuel'][key]:g}" for key in keys)
    options = " ".join(f"--set fuel.{key}=VALUE" for key in keys)
    return [
        f"WARNING: the fuel is that of {request.like}: {values}; another fuel gives other litres, CO2 and "
        f"efficiency (a petrol engine with diesel's density is 12 % off); if it burns another, give {options}"
    ]


def _dotted(keys: tuple[str, ...]) -> list[str]:
    return [f"fuel.{key}" for key in keys]


def _facts(base: Mapping[str, Any], given: Mapping[str, Any]) -> EngineFacts:
    """The figures that units need where they are given, checked as the component's file will be.

    Those of --like are another engine's, and measured data are not converted with them.
    """
    values = {
        "idle_rpm": base["idle_rpm"],
        "displacement_cm3": base["displacement_cm3"],
        "fuel.heating_value_mjpkg": base["fuel"]["heating_value_mjpkg"],
        "fuel.density_kgpl": base["fuel"]["density_kgpl"],
    }
    for key, value in values.items():
        if isinstance(value, bool) or not isinstance(value, int | float) or not value > 0:
            raise DataError(f"{key} = {value!r}: a number above 0 is needed")
    own = [
        values[key] * TO_SI[key[key.rindex("_") :]][1]
        if key in given or key.split(".")[0] in given
        else None
        for key in values
        if key != "idle_rpm"
    ]
    return EngineFacts(*own)


def _nox(request: Request, facts: EngineFacts, in_grid: bool, idle_radps: float) -> Lines | None:
    """NOx by speed lines; a grid of fuel holds none, it is a table of its own."""
    source, points = request.extra.get("nox"), None
    if source is not None or not in_grid:
        points = read_points(source or request.source, "nox", facts)
    if points is None and source is not None:
        raise DataError(
            f"{source.path.name}: no column of NOx found; name it with --column nox=NAME"
        )
    if points is None:
        return None
    lines = in_lines(points, proportional=True, idle_radps=idle_radps)
    if len(lines.speed_radps) < 2 or not np.ptp(points.torque_nm):
        name = (source or request.source).path.name
        raise DataError(f"{name}: NOx at one speed or one torque alone; several of both are needed")
    return lines


def _nox_notes(request: Request, nox: Lines, said: list[str]) -> list[str]:
    """How NOx was read; a table of its own is named, and what the fuel's table has said already is not repeated."""
    source = request.extra.get("nox")
    notes = [note for note in (*nox.points.notes, *nox.notes) if source or note not in said]
    return [f"{source.path.name if source else 'NOx'}: {note}" for note in notes]
