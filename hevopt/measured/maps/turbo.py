"""An engine's file with the compressor or turbine of a measured map in its mean_value part."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hevopt.car_files.engine import EngineFile
from hevopt.display.facts import Shown
from hevopt.errors import DataError
from hevopt.files.keypaths import with_changes
from hevopt.files.shown import shown
from hevopt.files.toml import checked
from hevopt.measured.maps.compressor import CompressorFit, fit_compressor
from hevopt.measured.maps.request import like_component
from hevopt.measured.maps.turbine import TurbineFit, fit_turbine
from hevopt.measured.maps.turbo_points import TurboPoints, turbo_points
from hevopt.units import RPM_PER_RADPS

Array = NDArray[np.float64]

KINDS = ("compressor", "turbine")
_NAME_MAX = 80
_WIDE_FLOW, _WIDE_EFFICIENCY = 0.05, 0.03
# Estimates: brake efficiency at rated power, and a suitable map's largest flow over what the engine takes there.
_RATED_EFFICIENCY, _SUITS = 0.36, (0.6, 4.0)


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class ImportedTurbo(Shown):
    """An engine with a measured compressor or turbine: as `ImportedMap`; said: what the map covers and how near
    the compact form comes to it."""

    contents: Mapping[str, Any]
    file: EngineFile
    origins: Mapping[str, str]
    notes: tuple[str, ...]
    points: TurboPoints
    fit: CompressorFit | TurbineFit
    said: tuple[str, ...]


def import_turbo(
    path: Path, kind: str, *, like: str | None, columns: Mapping[str, str], units: Mapping[str, str],
    sheet: str | None, values: Mapping[str, Any], reference: tuple[float, float] | None,
) -> ImportedTurbo:  # fmt: skip
    """An engine's file with another compressor or turbine; DataError where something is missing or wrong."""
    part = f"mean_value.{kind}"
    base, origins = _base(kind, like, values, path.stem)
    diameter_mm = base["mean_value"][kind]["wheel_diameter_mm"]
    points = turbo_points(path, kind, sheet, columns, units, reference)
    place = path.name
    fit: CompressorFit | TurbineFit
    if kind == "compressor":
        fit = fit_compressor(points, diameter_mm / 1e3, place)
        keys = _compressor_keys(fit, diameter_mm)
        said = _compressor_said(points, fit)
    else:
        fit = fit_turbine(points, diameter_mm / 2e3, place)
        keys = _turbine_keys(fit, diameter_mm)
        said = _turbine_said(points, fit)
    base["mean_value"][kind] = keys
    origins |= {f"{part}.{key}": "fitted to the map" for key in keys if key != "wheel_diameter_mm"}
    file = checked(f"component from {place}", base, EngineFile)
    notes = [*points.notes, *_kept(kind, like, values)]
    if isinstance(fit, CompressorFit):
        notes += _unsuited(file, float(fit.flow_kgps.max()))
    return ImportedTurbo(base, file, origins, tuple(notes), points, fit, tuple(said))


def _base(
    kind: str, like: str | None, values: Mapping[str, Any], source: str
) -> tuple[dict[str, Any], dict[str, str]]:
    """The engine's keys with those given in their place, and where these come from. source: the map's name"""
    if like is None:
        raise DataError(
            f"a {kind} is a part of an engine; give --like ENGINE, such as engine_diesel_1300, whose other keys "
            "stay"
        )
    engine = like_component(like, EngineFile)
    assert engine is not None
    if engine.mean_value is None:
        raise DataError(
            f"--like {like}: engine {shown(engine.name)} has no [mean_value] part, into which the {kind} goes; use "
            "one that has it, such as engine_diesel_1300"
        )
    diameter = f"mean_value.{kind}.wheel_diameter_mm"
    for key in values:
        if key == "scale" or key.startswith("scale."):
            raise DataError(f"--set {shown(key)}: a map is written as measured; scale it in a car")
        if (key + ".").startswith(f"mean_value.{kind}.") and key != diameter:
            raise DataError(
                f"--set {shown(key)}: that is what the import writes from the measured points; leave it out"
            )
    contents = engine.model_dump(exclude_none=True)
    contents["name"] = f"{engine.name} ({source})"[:_NAME_MAX]
    base = checked(f"--like {like} with --set", with_changes(contents, values), EngineFile)
    origins = {key: "given" for key in values}
    return base.model_dump(exclude_none=True), origins


def _compressor_keys(fit: CompressorFit, diameter_mm: float) -> dict[str, float]:
    found = fit.wheel._asdict()
    del found["wheel_diameter_m"]
    return {"wheel_diameter_mm": diameter_mm, **{key: float(v) for key, v in found.items()}}


def _turbine_keys(fit: TurbineFit, diameter_mm: float) -> dict[str, float]:
    wheel = fit.wheel
    return {
        "wheel_diameter_mm": diameter_mm,
        "area_cm2": wheel.area_m2 * 1e4,
        "flow_exponent": wheel.flow_exponent,
        "efficiency_max": wheel.efficiency_max,
        "blade_speed_ratio": wheel.blade_speed_ratio,
    }


def _kept(kind: str, like: str | None, values: Mapping[str, Any]) -> list[str]:
    """Warnings of what is another turbocharger's."""
    said = []
    if f"mean_value.{kind}.wheel_diameter_mm" not in values:
        said.append(
            f"WARNING: the wheel's diameter is that of {like}; give this one's with --set "
            f"mean_value.{kind}.wheel_diameter_mm=VALUE"
        )
    if "mean_value.rotor.inertia_kgm2" not in values:
        said.append(
            f"WARNING: the rotor's inertia is that of {like}; give this one's with --set "
            "mean_value.rotor.inertia_kgm2=VALUE"
        )
    said.append(
        f"the control unit is that of {like}: hevopt engine full-load says whether its vanes and boost suit the "
        f"{kind}"
    )
    return said


def _unsuited(file: EngineFile, most_kgps: float) -> list[str]:
    """A warning where an engine takes far more or less air than a map has: kg/h for g/s fits as well."""
    assert file.mean_value is not None
    speed, torque = np.array(file.full_load.speed_rpm), np.array(file.full_load.torque_nm)
    rated = int(np.argmax(speed * torque))
    control = file.mean_value.control
    excess = float(np.interp(speed[rated], control.lambda_rpm, control.lambda_full_load))
    power = speed[rated] * torque[rated] / RPM_PER_RADPS
    fuel = power / (_RATED_EFFICIENCY * file.fuel.heating_value_mjpkg * 1e6)
    air = fuel * file.mean_value.cylinders.stoichiometric_air * excess
    if _SUITS[0] * air <= most_kgps <= _SUITS[1] * air:
        return []
    return [
        f"WARNING: the engine takes about {1e3 * air:.2g} g/s at rated power, and the map goes up to "
        f"{1e3 * most_kgps:.2g} g/s; check the unit of flow, the reference, or whether it is this engine's"
    ]


def _compressor_said(points: TurboPoints, fit: CompressorFit) -> list[str]:
    krpm = fit.speed_radps * RPM_PER_RADPS / 1e3
    wheel = fit.wheel
    return [
        f"{len(points.line_speed)} speed lines, {krpm.min():.4g} to {krpm.max():.4g} krpm at 25 °C, "
        f"{len(krpm)} points; pressure ratio up to {points.ratio.max():.3g}, efficiency up to "
        f"{points.efficiency.max():.3g}",
        f"compact map: head {wheel.head_max:.3g} (1 - x^{wheel.head_exponent:.3g}), flow number from "
        f"{wheel.surge_flow:.3g} + {wheel.surge_flow_per_mach:.3g} Mach at surge to {wheel.choke_flow:.3g} - "
        f"{wheel.choke_flow_fall_per_mach:.3g} Mach at choke",
        *_off(points, fit.off, fit.efficiency_off, "pressure ratio or flow, whichever is nearer"),
        f"below {krpm.min():.4g} krpm the form goes on by similarity, down to standstill; no line is held",
    ]  # fmt: skip


def _turbine_said(points: TurboPoints, fit: TurbineFit) -> list[str]:
    wheel = fit.wheel
    said = [
        f"{len(points.line_speed)} speed lines, {len(points.ratio)} points; expansion ratio up to "
        f"{points.ratio.max():.3g}, blade speed ratio {fit.blade_speed.min():.2g} to {fit.blade_speed.max():.2g}",
        f"compact map: {1e4 * wheel.area_m2:.3g} cm² with open vanes, exponent {wheel.flow_exponent:.3g}, "
        f"efficiency up to {wheel.efficiency_max:.3g} at blade speed ratio {wheel.blade_speed_ratio:.3g}",
    ]
    if len(fit.positions) > 1:
        shares = ", ".join(
            f"{position:g}: {area / wheel.area_m2:.3g}"
            for position, area in zip(fit.positions, fit.areas_m2, strict=True)
        )
        said.append(f"share of the open area by vane position: {shares}")
    said += _off(points, fit.off, fit.efficiency_off, "flow")
    return [
        *said,
        "efficiency at low speed is what the parabola gives, 0 at standstill with a finite torque",
    ]


def _off(points: TurboPoints, flow_off: Array, efficiency_off: Array, what: str) -> list[str]:
    """How far points lie from the form, and where that is much."""
    said = []
    for name, off, wide in (
        (what, flow_off, _WIDE_FLOW), ("efficiency", efficiency_off, _WIDE_EFFICIENCY),
    ):  # fmt: skip
        rms, worst = float(np.sqrt(np.mean(off**2))), int(np.argmax(np.abs(off)))
        said.append(
            f"{name}: points lie {100 * rms:.2g} % from the compact map (root mean square), at most "
            f"{100 * abs(off[worst]):.2g} % (line {points.lines[worst]} of the file)"
        )
        if rms > wide:
            said.append(
                f"  WARNING: more than {100 * wide:g} %; check speeds, units, reference and the wheel's diameter, "
                "or expect results no better than that"
            )
    return said
