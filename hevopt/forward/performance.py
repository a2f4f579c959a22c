"""How fast a car is: full pedal from rest and in each gear, top speed, slopes, and the forces behind them."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from hevopt.car.architecture import Architecture
from hevopt.display.facts import Shown
from hevopt.errors import DataError
from hevopt.forward import _pull_kernels as col
from hevopt.forward._acting_kernels import LoopCar
from hevopt.forward._pull_kernels import Foot
from hevopt.forward.lines import Line, line_of
from hevopt.forward.run import Handling, loop_car, shifting_of
from hevopt.problem.arrays import Array, Indices
from hevopt.problem.battery import energy_j
from hevopt.units import KMH_PER_MPS, RPM_PER_RADPS, STANDARD_GRAVITY_MPS2

STEP_S = 0.01
LAUNCH_RPM, UP_RPM = 1800.0, 4200.0
SPEEDS_KMH = tuple(range(20, 161, 20))
DISTANCES_M = (400.0, 1000.0)
IN_GEAR_KMH = ((60, 100), (80, 120))
FOURTH_KMH = (40, 80)
SUSTAINED_KMH = (50, 90, 130)
_LONGEST_S = 120.0
_NATURAL_SHARE = 0.45


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Performance(Shown):
    """Figures of a car at full pedal, on a level road; None where it does not get there.

    to_speed_s: km/h -> time from rest; to_distance: m -> time from rest, and speed there in m/s
    in_gear_s: (gear, from km/h, to km/h) -> time; top_mps: gear -> highest speed of the engine alone
    start_slope: highest slope, rise over run, to start off on, by clutch and engine or by grip
    slope: km/h -> highest slope at that speed, in the best gear
    to_100_j: energy from the battery up to 100 km/h; repeats: how often until its window is empty, from soc_start
    curves: the forces of `forces_of`; trace: (step, column) of the run from rest, see _pull_kernels
    """

    car: Architecture
    boosts: bool
    to_speed_s: Mapping[int, float | None]
    to_distance: Mapping[float, tuple[float, float] | None]
    in_gear_s: Mapping[tuple[int, int, int], float | None]
    top_mps: Mapping[int, float]
    start_slope: float
    slope: Mapping[int, float]
    to_100_j: float | None
    repeats: float | None
    curves: "Curves"
    trace: Array

    @property
    def name(self) -> str:
        """The car's name, and whether its machine helps."""
        return f"{self.car.name}, e-boost" if self.boosts else self.car.name

    def _facts(self) -> dict[str, object]:
        return {
            "car": self.car.name,
            "boosts": self.boosts,
            "to_100_s": self.to_speed_s[100],
            "top_kmh": max(self.top_mps.values()) * KMH_PER_MPS,
        }


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Curves(Shown):
    """Forces at the tyres over speed; speed_mps: (speed,), by_gear_n: (gear, speed), NaN where the engine cannot.

    resistance_n: (speed,) on a level road; grip_n: what the driven axle holds at steady speed
    """

    speed_mps: Array
    by_gear_n: Array
    resistance_n: Array
    grip_n: float


def performance(
    car: Architecture,
    *,
    boosts: bool = False,
    added_kg: float = 0.0,
    boost_lag_s: float = 0.0,
    handling: Handling | None = None,
) -> Performance:
    """How fast a car is; boosts: whether its machine helps (e_boost); added_kg: people and load.

    boost_lag_s: time constant by which full load comes, 0 for a steady map, which is too quick in the first seconds
    DataError for a car whose driveline cannot be driven forward, and for boost that its functions lack.
    """
    handling = handling or Handling()
    _check(car, boosts, added_kg, boost_lag_s, handling)
    heavy = replace(car.vehicle, mass_kg=car.vehicle.mass_kg + added_kg)
    car, line = replace(car, vehicle=heavy), line_of(car)
    shifting = (handling.shifting or shifting_of(car))._replace(between_s=0.0, reversal_s=0.0)
    driven = loop_car(car, line, handling._replace(shifting=shifting))
    foot = Foot(
        LAUNCH_RPM / RPM_PER_RADPS,
        UP_RPM / RPM_PER_RADPS,
        boosts,
        float(boost_lag_s),
        _NATURAL_SHARE,
    )
    by_gear = _by_gear(line)
    start_j = float(energy_j(car.battery, car.soc_start))
    trace = _pulled(driven, by_gear, foot, (0.0, 0, start_j))
    curves = forces_of(car, line, driven, boosts)
    engine = forces_of(car, line, driven, False) if boosts else curves
    to_100 = _first(trace[:, col.SPEED], 100 / KMH_PER_MPS)
    used = None if to_100 is None else start_j - _stored_j(trace, to_100)
    window = start_j - float(energy_j(car.battery, car.battery.soc_min))
    return Performance(
        car,
        boosts,
        {kmh: _first(trace[:, col.SPEED], kmh / KMH_PER_MPS) for kmh in SPEEDS_KMH},
        {distance: _at_distance(trace, distance) for distance in DISTANCES_M},
        _in_gear(driven, by_gear, foot, start_j),
        {gear + 1: _top(engine, gear) for gear in range(len(by_gear))},
        _start_slope(car, driven, handling),
        {kmh: _slope(car, curves, kmh / KMH_PER_MPS, handling) for kmh in SUSTAINED_KMH},
        used,
        window / used if boosts and used else None,
        curves,
        trace,
    )


def _check(
    car: Architecture, boosts: bool, added_kg: float, boost_lag_s: float, handling: Handling
) -> None:
    if boosts and "e_boost" not in car.functions:
        raise DataError(f"{car.name}: e_boost is none of this car's functions; leave --boost out")
    if not -200 <= added_kg <= 5000 or not 0 <= boost_lag_s <= 10:
        raise DataError(
            f"added mass {added_kg:g} kg, boost lag {boost_lag_s:g} s; allowed: -200 to 5000 kg, 0 to 10 s"
        )
    handling.check()


def _by_gear(line: Line) -> Indices:
    """The way of each gear at full pedal: where the machine has gears of its own, the next one not below."""
    found = []
    for gear in dict.fromkeys(gear for gear, _, _ in line.keys):
        fits = [n for n, (g, _, opened) in enumerate(line.keys) if g == gear and not opened]
        chosen = [[g for _, g in line.keys[n][1]] for n in fits]
        above = [n for n, own in zip(fits, chosen, strict=True) if all(g >= gear for g in own)]
        found.append(min(above, key=lambda n: line.keys[n][1]) if above else fits[-1])
    return np.array(found, dtype=np.int64)


def _pulled(
    driven: LoopCar, by_gear: Indices, foot: Foot, start: tuple[float, int, float]
) -> Array:
    record: Array = np.zeros((round(_LONGEST_S / STEP_S), col.COLUMNS))
    col.pull(driven, by_gear, foot, start, STEP_S, record)
    return record


def _stored_j(trace: Array, at_s: float) -> float:
    return float(np.interp(at_s, _times(trace), trace[:, col.ENERGY]))


def _times(trace: Array) -> Array:
    times: Array = np.arange(1.0, len(trace) + 1) * STEP_S
    return times


def _first(values: Array, wanted: float) -> float | None:
    """Time at which a value that rises is first reached, linear within the step."""
    reached = np.flatnonzero(values >= wanted)
    if not len(reached):
        return None
    k = int(reached[0])
    before = values[k - 1] if k else 0.0
    return float(STEP_S * (k + (wanted - before) / (values[k] - before)))


def _at_distance(trace: Array, distance_m: float) -> tuple[float, float] | None:
    time = _first(trace[:, col.DISTANCE], distance_m)
    if time is None:
        return None
    return time, float(np.interp(time, _times(trace), trace[:, col.SPEED]))


def _in_gear(
    driven: LoopCar, by_gear: Indices, foot: Foot, start_j: float
) -> dict[tuple[int, int, int], float | None]:
    """Times from third gear on, and 40 to 80 km/h in fourth; None where the engine turns too slowly or fast."""
    held = foot._replace(up_radps=np.inf)
    cases = [(gear, *pair) for gear in range(3, len(by_gear) + 1) for pair in IN_GEAR_KMH]
    if len(by_gear) >= 4:
        cases.append((4, *FOURTH_KMH))
    found: dict[tuple[int, int, int], float | None] = {}
    for gear, low, high in cases:
        ratio = driven.ways.wheel[by_gear[gear - 1], -1] / driven.body.radius_m / KMH_PER_MPS
        slow, fast = (
            ratio * low < driven.limits.idle_radps,
            ratio * high > driven.limits.engine_max_radps,
        )
        if slow or fast:
            found[gear, low, high] = None
            continue
        trace = _pulled(driven, by_gear, held, (low / KMH_PER_MPS, gear - 1, start_j))
        found[gear, low, high] = _first(trace[:, col.SPEED], high / KMH_PER_MPS)
    return found


def forces_of(car: Architecture, line: Line, driven: LoopCar, boosts: bool) -> Curves:
    """Highest force in each gear at steady speed, engine at full load, the machine's as well where it helps."""
    ways, radius, limits = line.ways, car.vehicle.tyre_radius_m, driven.limits
    speed = np.linspace(0.1, 300 / KMH_PER_MPS, 1200)
    wheel = speed / radius
    by_gear = []
    for way in _by_gear(line):
        ratio = ways.wheel[way, -1]
        side = np.maximum(ratio * wheel, LAUNCH_RPM / RPM_PER_RADPS if way == 0 else 0.0)
        full = _tabulated(limits.full_nm, limits.engine_step, side)
        machine_speed = ways.wheel[way, 1] * wheel + ways.side[way, 1] * side
        machine = np.zeros_like(speed)
        if len(limits.load_nm):
            machine = _tabulated(limits.load_nm, limits.engine_step, machine_speed)
        elif boosts:
            machine = _tabulated(limits.high_nm, limits.machine_step, machine_speed)
        on_side = full + ways.side[way, 1] * machine
        torque = ratio * ways.wheel_yield[way, 0, -1] * on_side
        torque += ways.wheel[way, 1] * ways.wheel_yield[way, 0, 1] * machine
        known = (side >= limits.idle_radps) & (side <= limits.engine_max_radps)
        by_gear.append(np.where(known, torque / radius, np.nan))
    powers = speed ** np.arange(4)[:, None]
    resistance = (np.array(driven.body.rolling_n) + np.array(driven.body.air_n)) @ powers
    tyre = driven.body.tyre
    grip = tyre.friction * tyre.driven_share * car.vehicle.mass_kg * STANDARD_GRAVITY_MPS2
    return Curves(speed, np.array(by_gear), resistance, float(grip))


def _tabulated(values: Array, step: float, speed: float | Array) -> Array:
    """A torque that is tabulated over even steps of speed, rad/s."""
    return np.asarray(np.interp(speed, step * np.arange(len(values)), values))


def _top(curves: Curves, gear: int) -> float:
    """Highest speed at which a gear's force still meets the resistance."""
    enough = np.flatnonzero(curves.by_gear_n[gear] >= curves.resistance_n)
    if not len(enough):
        return 0.0
    k = int(enough[-1])
    if k + 1 == len(curves.speed_mps) or np.isnan(curves.by_gear_n[gear, k + 1]):
        return float(curves.speed_mps[k])
    over = curves.by_gear_n[gear, k : k + 2] - curves.resistance_n[k : k + 2]
    return float(np.interp(0.0, over[::-1], curves.speed_mps[k : k + 2][::-1]))


def _slope(car: Architecture, curves: Curves, speed_mps: float, handling: Handling) -> float:
    """Highest slope, rise over run, held at a speed: by force in the best gear, and by grip."""
    at_speed = partial(np.interp, speed_mps, curves.speed_mps)
    forces = [float(at_speed(force)) for force in curves.by_gear_n]
    spare = max(filter(np.isfinite, forces), default=0.0) - float(at_speed(curves.resistance_n))
    return _tangent(spare / (car.vehicle.mass_kg * STANDARD_GRAVITY_MPS2), handling)


def _start_slope(car: Architecture, driven: LoopCar, handling: Handling) -> float:
    """Highest slope to start off on: what clutch and engine pass in first gear at launch speed, or the grip."""
    limits, ways = driven.limits, driven.ways
    launch = LAUNCH_RPM / RPM_PER_RADPS
    full = float(_tabulated(limits.full_nm, limits.engine_step, launch))
    passed = min(full, handling.clutch.slipping_nm)
    force = ways.wheel[0, -1] * ways.wheel_yield[0, 0, -1] * passed / driven.body.radius_m
    spare = force - driven.body.rolling_n[0]
    return _tangent(spare / (car.vehicle.mass_kg * STANDARD_GRAVITY_MPS2), handling)


def _tangent(sine: float, handling: Handling) -> float:
    """Rise over run of a force over weight, no more than grip holds with the load that the slope moves."""
    tyre = handling.tyre
    grip = tyre.friction * tyre.driven_share / (1 + tyre.friction * tyre.height_share)
    return float(min(np.tan(np.arcsin(min(max(sine, 0.0), 0.999999))), grip))
