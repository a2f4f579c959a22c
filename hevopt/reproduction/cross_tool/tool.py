"""FASTSim as it is installed: its version, the constants it computes with, and a drive of one of its vehicles.

Nothing of it is in this package; its own vehicle files serve as the form that a vehicle has to have.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from typing import Any, NamedTuple

import numpy as np

from hevopt.display.facts import Shown
from hevopt.driving.cycle import Cycle
from hevopt.errors import DataError, SolverError
from hevopt.problem.arrays import Array

PLAIN, HYBRID = "2012_Ford_Fusion.yaml", "2016_TOYOTA_Prius_Two.yaml"
_KINDS = {PLAIN: "Conv", HYBRID: "HEV"}
# What a cycle of it holds beside time, speed and grade, and what it works out itself.
_AMBIENT = ("pwr_max_chrg_watts", "temp_amb_air_kelvin", "pwr_solar_load_watts")
_STEP = "veh.history."
_PROBE_KG, _PROBE_ROLLING = 1000.0, 0.01


class Constants(NamedTuple):
    """What it computes with, found in what it returns; reported_kgpm3: the density that it says it has used."""

    density_kgpm3: float
    gravity_mps2: float
    reported_kgpm3: float


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class OtherDrive(Shown):
    """A drive of FASTSim; arrays are (step,), power at the wheels, of the engine's shaft and of its fuel.

    soc_change: end less start; usable fraction of the whole store, 0 without a battery that drives
    """

    wheel_w: Array
    drag_w: Array
    rolling_w: Array
    engine_w: Array
    fuel_w: Array
    soc_change: float
    density_kgpm3: float


def tool() -> Any:
    """The package; DataError where it is missing."""
    try:
        return import_module("fastsim")
    except ImportError:
        raise DataError(
            '--fastsim drives the cars in FASTSim, which is not installed; run: pip install "hevopt[cross-tool]"'
        ) from None


def version() -> str:
    """Its version."""
    return str(tool().__version__)


def template(name: str) -> dict[str, Any]:
    """One of its own vehicles, to be changed."""
    found: dict[str, Any] = tool().Vehicle.from_resource(name).to_dict()
    return found


def powertrain(vehicle: Mapping[str, Any]) -> dict[str, Any]:
    """The part of a vehicle that holds engine, machine, battery and transmission."""
    found: dict[str, Any]
    (found,) = vehicle["pt_type"].values()
    return found


def curve(fractions: Array, values: Array) -> dict[str, Any]:
    """Values over a fraction of the highest power, linear between them, in its form."""
    grid, given = ({"v": 1, "dim": [len(x)], "data": x.tolist()} for x in (fractions, values))
    return {"data": {"grid": [grid], "values": given}, "strategy": "Linear", "extrapolate": "Error"}


def drive(vehicle: Mapping[str, Any], cycle: Cycle, grade: Array | None = None) -> OtherDrive:
    """Drive a vehicle over a cycle. grade: (step,) rise over run; SolverError where it gives up."""
    package = tool()
    steps = len(cycle.time_s) - 1
    form = package.Cycle.from_resource("hwfet.csv").to_dict()
    road = {key: [form[key][0]] * (steps + 1) for key in _AMBIENT} | {
        "init_elev_meters": form["init_elev_meters"],
        "time_seconds": cycle.time_s.tolist(),
        "speed_meters_per_second": cycle.speed_mps.tolist(),
        # It takes the grade of a step from the sample at its end.
        "grade": np.append(0.0, np.zeros(steps) if grade is None else grade).tolist(),
    }
    try:
        run = package.SimDrive(package.Vehicle.from_dict(vehicle), package.Cycle.from_dict(road))
        run.run()
        frame = run.to_dataframe()
    except RuntimeError as error:
        reason = str(error).split("Stack backtrace")[0].strip()
        raise SolverError(f"FASTSim {version()} on {cycle.name}: {reason}") from None
    kind = next(iter(vehicle["pt_type"]))

    def column(name: str) -> Array:
        found: Array = frame[name].to_numpy()[1:].astype(float)
        return found

    engine = f"veh.pt_type.{kind}.fc.history."
    soc = frame.get(f"veh.pt_type.{kind}.res.history.soc")
    return OtherDrive(
        column(_STEP + "pwr_tractive_for_cyc_watts"),
        column(_STEP + "pwr_drag_watts"),
        column(_STEP + "pwr_rr_watts"),
        column(engine + "pwr_prop_watts") + column(engine + "pwr_aux_watts"),
        column(engine + "pwr_fuel_watts"),
        0.0 if soc is None else float(soc.iloc[-1] - soc.iloc[0]),
        float(column(_STEP + "air_density_kilograms_per_cubic_meter")[-1]),
    )


def strong(vehicle: dict[str, Any]) -> dict[str, Any]:
    """The same with an engine and tyres that follow every trace, for what the wheels ask for."""
    engine = powertrain(vehicle)["fc"]
    engine.update(pwr_out_max_watts=1e6, pwr_out_max_init_watts=1e6, pwr_ramp_lag_seconds=1.0)
    vehicle["chassis"]["wheel_fric_coef"] = 10.0
    return vehicle


@cache
def constants() -> Constants:
    """Air density and gravity, from the drag and the rolling resistance of a probe at constant speed."""
    probe = strong(template(PLAIN))
    body(probe, _PROBE_KG, drag_area_m2=1.0, rolling=_PROBE_ROLLING)
    speed = np.concatenate([np.arange(0.0, 20.0), np.full(10, 20.0)])
    found = drive(probe, Cycle("probe", np.arange(len(speed), dtype=float), speed, 0 * speed))
    v = speed[-1]
    return Constants(
        float(found.drag_w[-1] / (v**3 / 2)),
        float(found.rolling_w[-1] / (_PROBE_KG * _PROBE_ROLLING * v)),
        found.density_kgpm3,
    )


def body(
    vehicle: dict[str, Any], mass_kg: float, *, drag_area_m2: float, rolling: float,
    inertia_kgm2: float = 0.0, radius_m: float = 0.3,
) -> None:  # fmt: skip
    """Change a vehicle's body. inertia_kgm2: of all wheels together"""
    vehicle["mass_kilograms"] = mass_kg
    vehicle["chassis"].update(
        drag_coef=drag_area_m2, frontal_area_square_meters=1.0, wheel_rr_coef=rolling,
        num_wheels=4, wheel_inertia_kilogram_square_meters=inertia_kgm2 / 4,
        wheel_radius_meters=radius_m, glider_mass_kilograms=None, cargo_mass_kilograms=None,
    )  # fmt: skip
