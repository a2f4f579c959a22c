"""Forces at the tyres over speed, and what follows of them without driving: top speed and slopes."""

from dataclasses import dataclass
from functools import partial

import numpy as np

from hevopt.car.architecture import Architecture
from hevopt.car.gear_loss import loss_at
from hevopt.car.handling import Handling
from hevopt.display.facts import Shown
from hevopt.forward._acting_kernels import LoopCar
from hevopt.forward._beside_kernels import floor_beside
from hevopt.forward._lever_kernels import resting_lever
from hevopt.forward.lines import Line
from hevopt.problem.arrays import Array, Indices
from hevopt.units import KMH_PER_MPS, RPM_PER_RADPS, STANDARD_GRAVITY_MPS2

LAUNCH_RPM = 1800.0
# Speeds of the engine between which it meets a torque converter.
_STALLS = 600
# Share within which ratios are the same.
_ALIKE = 1e-9


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Curves(Shown):
    """Forces at the tyres over speed; speed_mps: (speed,), by_gear_n: (gear, speed), NaN where the engine cannot.

    resistance_n: (speed,) on a level road; grip_n: what the driven axle holds at steady speed
    """

    speed_mps: Array
    by_gear_n: Array
    resistance_n: Array
    grip_n: float


def by_gear(line: Line) -> Indices:
    """The way of each gear at full pedal: where the machine has gears of its own, the next one not below."""
    found = []
    for gear in dict.fromkeys(gear for gear, _, _ in line.keys):
        fits = [n for n, (g, _, opened) in enumerate(line.keys) if g == gear and not opened]
        chosen = [[g for _, g in line.keys[n][1]] for n in fits]
        above = [n for n, own in zip(fits, chosen, strict=True) if all(g >= gear for g in own)]
        found.append(min(above, key=lambda n: line.keys[n][1]) if above else fits[-1])
    return np.array(found, dtype=np.int64)


def forces_of(car: Architecture, line: Line, driven: LoopCar, boosts: bool) -> Curves:
    """Highest force in each gear at steady speed, engine at full load, the machine's as well where it helps."""
    ways, radius, limits = line.ways, car.vehicle.tyre_radius_m, driven.limits
    speed = np.linspace(0.1, 300 / KMH_PER_MPS, 1200)
    wheel = speed / radius
    forces = []
    launch, highest = 0.0 if car.electric else LAUNCH_RPM / RPM_PER_RADPS, highest_radps(car, line)
    for way in by_gear(line):
        ratio = ways.wheel[way, -1]
        side = np.maximum(ratio * wheel, launch if way == 0 else 0.0)
        given = None
        if car.driveline.converter is not None:
            side, given = _stalled(car, driven, int(way), ratio * wheel, boosts)
        machines = _floored(driven, int(way), wheel, side, boosts)
        full = tabulated(limits.full_nm, limits.engine_step, side)
        on_side = full + ways.side[way, 1:-1] @ machines if given is None else given
        torque = ratio * ways.wheel_yield[way, 0, -1] * on_side
        torque += (ways.wheel[way, 1:-1] * ways.wheel_yield[way, 0, 1:-1]) @ machines
        if line.mapped:
            load = ways.load[way, 0, ways.lost.joint]
            through = load[-1] * on_side + load[1:-1] @ machines
            lost = lost_at(car, line.keys[way][0], ratio * wheel, through)
            torque -= ratio * ways.wheel_yield[way, 0, -1] * lost
        known = (side >= limits.idle_radps) & (side <= highest)
        forces.append(np.where(known, torque / radius, np.nan))
    tyre = driven.body.tyre
    grip = tyre.friction * tyre.driven_share * car.vehicle.mass_kg * STANDARD_GRAVITY_MPS2
    return Curves(speed, np.array(forces), resistance_n(driven, speed), float(grip))


def highest_radps(car: Architecture, line: Line) -> float:
    """Highest speed of the engine, or of a machine that turns with it in every gear, there."""
    highest, ways, places = car.engine.speed_max_radps, line.ways, by_gear(line)
    if len(places) == 1:
        return highest
    per = ways.wheel[places, 1:-1] / ways.wheel[places, -1:] + ways.side[places, 1:-1]
    for unit, machine in enumerate(line.order):
        if np.ptp(per[:, unit]) < _ALIKE * abs(per[0, unit]):
            highest = min(highest, car.machines[machine].speed_max_radps / abs(per[0, unit]))
    return float(highest)


def change_up_mps(car: Architecture, line: Line, driven: LoopCar, curves: Curves) -> Array:
    """(gear,) speed of the car from which on the next gear accelerates it more than this one; infinite without one.

    The time from one speed to another is ∫ dv/a, so that no other changes take less of it, but for their gaps. What
    turns with a gear is part of the mass that it accelerates.
    """
    ways, radius = line.ways, car.vehicle.tyre_radius_m
    accel = np.nan_to_num(curves.by_gear_n, nan=-np.inf) - curves.resistance_n
    for place, way in enumerate(by_gear(line)):
        to_side = ways.wheel[way, -1] * ways.side[way, :-1]
        rate, yields = ways.wheel[way, :-1] + to_side, ways.wheel_yield[way, 0]
        per_nm = ways.wheel[way, :-1] * yields[:-1] + to_side * yields[-1]
        turning_kg = float(np.sum(ways.inertia_kgm2[:-1] * rate * per_nm)) / radius**2
        accel[place] /= car.vehicle.equivalent_mass_kg + turning_kg
    found = np.full(len(accel), np.inf)
    for place in range(len(accel) - 1):
        better = np.flatnonzero((accel[place] >= accel[place + 1]) & np.isfinite(accel[place]))
        after = int(better[-1]) + 1 if len(better) else 0
        if after < len(curves.speed_mps) and np.isfinite(accel[place, after]):
            found[place] = curves.speed_mps[after]
    return found


def resistance_n(driven: LoopCar, speed_mps: Array) -> Array:
    """(speed,) rolling and air resistance on a level road."""
    powers = speed_mps ** np.arange(4)[:, None]
    resistance: Array = (np.array(driven.body.rolling_n) + np.array(driven.body.air_n)) @ powers
    return resistance


def _floored(driven: LoopCar, way: int, wheel: Array, side: Array, boosts: bool) -> Array:
    """(machine, speed) torques at full pedal: the first machine's, and what the battery has left for the others."""
    ways, limits = driven.ways, driven.limits
    machines = np.zeros((len(ways.inertia_kgm2) - 2, len(wheel)))
    speed = ways.wheel[way, 1] * wheel + ways.side[way, 1] * side
    if len(limits.load_nm):
        machines[0] = tabulated(limits.load_nm[0], limits.engine_step, speed)
    elif boosts:
        machines[0] = tabulated(limits.high_nm, limits.machine_step, speed)
    for k in range(len(wheel) if len(machines) > 1 else 0):
        own = np.ascontiguousarray(machines[:, k])
        floor_beside(
            driven.beside, ways, resting_lever(way), wheel[k], side[k], limits, boosts, own
        )
        machines[:, k] = own
    return machines


def _stalled(
    car: Architecture, driven: LoopCar, way: int, turbine: Array, boosts: bool
) -> tuple[Array, Array]:
    """Speed of the engine where it meets a torque converter at full pedal, and what this gives, at turbine speeds.

    From idle speed on it is the first at which the impeller takes all there is; locked it is the turbine's.
    """
    part = car.driveline.converter
    assert part is not None  # asked for where there is one
    limits, fluid = driven.limits, driven.ways.fluid
    side = np.linspace(limits.idle_radps, limits.engine_max_radps, _STALLS)
    machines = _floored(driven, way, np.zeros(_STALLS), side, boosts)
    most = (
        tabulated(limits.full_nm, limits.engine_step, side) + driven.ways.side[way, 1:-1] @ machines
    )
    taken, _ = part.data.torques_nm(side, turbine[:, None])
    over = taken - most
    met = np.where((over >= 0).any(axis=1), np.argmax(over >= 0, axis=1), _STALLS - 1)
    rows, below = np.arange(len(turbine)), np.maximum(met - 1, 0)
    low, high = over[rows, below], over[rows, met]
    share = np.where(
        high > low, np.clip(-low / np.where(high > low, high - low, 1.0), 0.0, 1.0), 1.0
    )
    meets = side[below] + share * (side[met] - side[below])
    locked = fluid.locks[way] & (turbine >= fluid.lock_radps)
    engine = np.where(locked, turbine, meets)
    _, given = part.data.torques_nm(meets, turbine)
    full = tabulated(limits.full_nm, limits.engine_step, engine)
    machines = _floored(driven, way, np.zeros(len(turbine)), engine, boosts)
    return engine, np.where(locked, full + driven.ways.side[way, 1:-1] @ machines, given)


def lost_at(car: Architecture, gear: int, speed_radps: Array, torque_nm: Array) -> Array:
    """(state,) torque that the car's gearbox loses at its input by a map; 0 without one."""
    loss = None if car.gearbox is None else car.gearbox.loss
    if loss is None:
        return np.zeros_like(torque_nm)
    knots = loss.knots(np.full(len(torque_nm), gear), speed_radps)
    return loss_at(*knots, torque_nm[:, None])[:, 0]


def tabulated(values: Array, step: float, speed: float | Array) -> Array:
    """A torque that is tabulated over even steps of speed, rad/s."""
    return np.asarray(np.interp(speed, step * np.arange(len(values)), values))


def top_mps(curves: Curves, gear: int) -> float:
    """Highest speed at which a gear's force still meets the resistance."""
    enough = np.flatnonzero(curves.by_gear_n[gear] >= curves.resistance_n)
    if not len(enough):
        return 0.0
    k = int(enough[-1])
    if k + 1 == len(curves.speed_mps) or np.isnan(curves.by_gear_n[gear, k + 1]):
        return float(curves.speed_mps[k])
    over = curves.by_gear_n[gear, k : k + 2] - curves.resistance_n[k : k + 2]
    return float(np.interp(0.0, over[::-1], curves.speed_mps[k : k + 2][::-1]))


def slope_at(car: Architecture, curves: Curves, speed_mps: float, handling: Handling) -> float:
    """Highest slope, rise over run, held at a speed: by force in the best gear, and by grip."""
    at_speed = partial(np.interp, speed_mps, curves.speed_mps)
    forces = [float(at_speed(force)) for force in curves.by_gear_n]
    spare = max(filter(np.isfinite, forces), default=0.0) - float(at_speed(curves.resistance_n))
    return _tangent(spare / (car.vehicle.mass_kg * STANDARD_GRAVITY_MPS2), handling)


def start_slope(car: Architecture, driven: LoopCar, handling: Handling, curves: Curves) -> float:
    """Highest slope to start off on: what clutch and engine pass in first gear at launch speed, or the grip.

    Without an engine, with one of a speed of its own, and with a torque converter, what the slowest speed of the
    curves has.
    """
    line = car.driveline
    if car.electric or line.free_engine_speed or line.converter is not None:
        return slope_at(car, curves, float(curves.speed_mps[0]), handling)
    limits, ways = driven.limits, driven.ways
    launch = LAUNCH_RPM / RPM_PER_RADPS
    full = float(tabulated(limits.full_nm, limits.engine_step, launch))
    passed = min(full, handling.clutch.slipping_nm)
    passed -= float(lost_at(car, 1, np.zeros(1), np.array([passed]))[0])
    force = ways.wheel[0, -1] * ways.wheel_yield[0, 0, -1] * passed / driven.body.radius_m
    spare = force - driven.body.rolling_n[0]
    return _tangent(spare / (car.vehicle.mass_kg * STANDARD_GRAVITY_MPS2), handling)


def _tangent(sine: float, handling: Handling) -> float:
    """Rise over run of a force over weight, no more than grip holds with the load that the slope moves."""
    tyre = handling.tyre
    grip = tyre.friction * tyre.driven_share / (1 + tyre.friction * tyre.height_share)
    return float(min(np.tan(np.arcsin(min(max(sine, 0.0), 0.999999))), grip))
