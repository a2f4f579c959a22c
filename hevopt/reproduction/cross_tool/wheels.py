"""Energy at the wheels of a real car in FASTSim: with our constants step by step, and what its own are worth.

FASTSim knows drag and rolling resistance, no resistance linear in speed. What grows with speed in a coast-down is
given to it as the grade that asks for the same force, step by step; the road is level in our model.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from hevopt.car.architecture import Architecture
from hevopt.display.facts import Shown
from hevopt.driving.cycle import Cycle
from hevopt.driving.demand import demand_of
from hevopt.problem.arrays import Array
from hevopt.reproduction.cross_tool.tool import (
    PLAIN,
    body,
    constants,
    drive,
    strong,
    template,
)
from hevopt.units import KMH_PER_MPS, STANDARD_GRAVITY_MPS2

# Speeds over which two coefficients stand for three: those of a coast-down, SAE J2263.
_FIT_KMH = (15.0, 115.0)


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class WheelsHeld(Shown):
    """The wheels of a car on a cycle, ours and those of FASTSim, set alike.

    off_w: largest difference of a step; highest_w: largest power of ours, either sign
    work_mjpkm: positive work of ours; work_off_percent: theirs above it
    density_percent, gravity_percent, linear_percent, wheels_percent: by how much the positive work rises with its
    own air density, its own gravity, two fitted coefficients in place of three, and its own wheels' inertia
    """

    off_w: float
    highest_w: float
    work_mjpkm: float
    work_off_percent: float
    density_percent: float
    gravity_percent: float
    linear_percent: float
    wheels_percent: float


@dataclass(frozen=True, slots=True)
class Road:
    """Resistance r0 + r1 v + r2 v^2, N, and by what it is told to FASTSim; inertia of all wheels together."""

    r0: float
    r1: float
    r2: float
    density_kgpm3: float
    gravity_mps2: float
    inertia_kgm2: float
    radius_m: float


def road_of(car: Architecture) -> Road:
    """A car's own resistance, told by what FASTSim computes with, so that it is the same there."""
    vehicle, known = car.vehicle, constants()
    r0, r1, r2 = (vehicle.rolling_n[n] + vehicle.air_n[n] for n in range(3))
    return Road(
        r0, r1, r2, known.density_kgpm3, known.gravity_mps2,
        vehicle.wheel_inertia_kgm2, vehicle.tyre_radius_m,
    )  # fmt: skip


def tell(vehicle: dict[str, Any], car: Architecture, road: Road, speed_mps: Array) -> Array:
    """Give a vehicle of FASTSim the road load of a car. speed_mps: (step,); returns their grades, rise / run.

    The grade asks for r1 v: m g sin + r0 cos = r0 + r1 v.
    """
    mass, weight = car.vehicle.mass_kg, car.vehicle.mass_kg * constants().gravity_mps2
    body(
        vehicle, mass,
        drag_area_m2=2 * road.r2 / road.density_kgpm3, rolling=road.r0 / (mass * road.gravity_mps2),
        inertia_kgm2=road.inertia_kgm2, radius_m=road.radius_m,
    )  # fmt: skip
    whole = np.hypot(weight, road.r0)
    slope_rad = np.arcsin((road.r0 + road.r1 * speed_mps) / whole) - np.arctan2(road.r0, weight)
    grade: Array = np.tan(slope_rad)
    return grade


def hold_wheels(car: Architecture, cycle: Cycle) -> WheelsHeld:
    """Both tools on the same car and cycle."""
    demand, ours, known = demand_of(cycle, car.vehicle, car.gearbox), road_of(car), constants()

    def there_w(road: Road) -> Array:
        vehicle = strong(template(PLAIN))
        grade = tell(vehicle, car, road, demand.speed_mps)
        return drive(vehicle, cycle, grade).wheel_w

    def work_j(power_w: Array) -> float:
        return float(np.sum(np.maximum(power_w, 0.0) * demand.step_s))

    own_w, same_w = demand.wheel_power_w, there_w(ours)

    def rise(**other: float) -> float:
        return 100 * (work_j(there_w(replace(ours, **other))) / work_j(same_w) - 1)

    constant, square = _two_of_three(ours)
    chassis = template(PLAIN)["chassis"]
    inertia = chassis["num_wheels"] * chassis["wheel_inertia_kilogram_square_meters"]
    return WheelsHeld(
        float(np.abs(same_w - own_w).max()),
        float(np.abs(own_w).max()),
        demand.wheel_work_jpm / 1e3,
        100 * (work_j(same_w) / work_j(own_w) - 1),
        rise(density_kgpm3=known.reported_kgpm3),
        rise(gravity_mps2=STANDARD_GRAVITY_MPS2),
        rise(r0=constant, r1=0.0, r2=square),
        rise(inertia_kgm2=inertia, radius_m=chassis["wheel_radius_meters"]),
    )


def _two_of_three(road: Road) -> tuple[float, float]:
    """Constant and square that come closest to all three, by least squares over a coast-down's speeds."""
    speeds = np.linspace(*_FIT_KMH, 21) / KMH_PER_MPS
    two = np.stack([np.ones_like(speeds), speeds**2], axis=1)
    force = road.r0 + road.r1 * speeds + road.r2 * speeds**2
    constant, square = np.linalg.lstsq(two, force, rcond=None)[0]
    return float(constant), float(square)
