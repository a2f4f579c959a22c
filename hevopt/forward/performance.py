"""How fast a car is: full pedal from rest and in each gear, top speed, slopes, and the forces behind them."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from hevopt.car.architecture import Architecture
from hevopt.car.handling import Handling
from hevopt.display.facts import Shown
from hevopt.errors import DataError
from hevopt.forward import _pull_kernels as col
from hevopt.forward._acting_kernels import LoopCar
from hevopt.forward._contact_kernels import resistance
from hevopt.forward._pull_kernels import Foot
from hevopt.forward.breathing import Breathing, EngineModel, check_engine_model
from hevopt.forward.forces import (
    LAUNCH_RPM,
    Curves,
    by_gear,
    change_up_mps,
    forces_of,
    highest_radps,
    slope_at,
    start_slope,
    tabulated,
    top_mps,
)
from hevopt.forward.free_pull import FreePull, check_free_pull
from hevopt.forward.lines import Line, line_of
from hevopt.forward.run import loop_car, shifting_of
from hevopt.problem.arrays import Array, Indices
from hevopt.problem.battery import energy_j
from hevopt.units import KMH_PER_MPS, RPM_PER_RADPS

STEP_S = 0.01
# How far below its highest speed an engine is changed up at the latest: twice what a step gains in first gear [E].
_UP_BELOW_RADPS = 4.0
SPEEDS_KMH = tuple(range(20, 161, 20))
DISTANCES_M = (400.0, 1000.0)
IN_GEAR_KMH = ((60, 100), (80, 120))
FOURTH_KMH = (40, 80)
SUSTAINED_KMH = (50, 90, 130)
_LONGEST_S = 120.0
# A mean-value engine is driven so far at a time, until all is reached.
_PIECE_S = 1.0
_NATURAL_SHARE = 0.45


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Performance(Shown):
    """Figures of a car at full pedal, on a level road; None where it does not get there.

    to_speed_s: km/h -> time from rest; to_distance: m -> time from rest, and speed there in m/s
    in_gear_s, in_gear_j: (gear, from km/h, to km/h) -> time, and energy from the battery until then
    top_mps: gear -> highest speed of the engine alone; of the machine where there is no engine
    start_slope: highest slope, rise over run, to start off on, by clutch and engine or by grip
    slope: km/h -> highest slope at that speed, in the best gear
    to_100_j: energy from the battery up to 100 km/h; repeats: how often until its window is empty, from soc_start
    boosts: whether the machine helps the engine; False without one, where it drives alone
    engine_model: of what is driven; top speeds and slopes are by the file's full load
    fills: the machine adds no more than what the engine lacks of its steady full load
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
    curves: Curves
    trace: Array
    in_gear_j: Mapping[tuple[int, int, int], float | None]
    engine_model: EngineModel = "map"
    fills: bool = False

    @property
    def name(self) -> str:
        """The car's name, how its engine is modelled, and whether its machine helps."""
        model = ", mean value" if self.engine_model == "mean_value" else ""
        help_ = ", hole filled" if self.fills else ", e-boost" if self.boosts else ""
        return f"{self.car.name}{model}{help_}"

    def _facts(self) -> dict[str, object]:
        return {
            "car": self.car.name,
            "boosts": self.boosts,
            "to_100_s": self.to_speed_s[100],
            "top_kmh": max(self.top_mps.values()) * KMH_PER_MPS,
        }


class _Floored(NamedTuple):
    """A car at full pedal, as all its manoeuvres have it; ways: of every gear."""

    car: Architecture
    driven: LoopCar
    ways: Indices
    foot: Foot
    start_j: float
    engine_model: EngineModel
    free: FreePull | None


def performance(
    car: Architecture,
    *,
    boosts: bool = False,
    fills: bool = False,
    added_kg: float = 0.0,
    boost_lag_s: float = 0.0,
    handling: Handling | None = None,
    engine_model: EngineModel = "map",
) -> Performance:
    """How fast a car is; boosts: whether its machine helps (e_boost); added_kg: people and load.

    fills: the machine adds only what the engine lacks of its steady full load while its boost comes
    boost_lag_s: time constant by which full load comes, 0 for a steady map, which is too quick in the first seconds
    engine_model: "map", or "mean_value", whose turbocharger has a lag of its own
    DataError for a car whose driveline cannot be driven forward, and for boost that its functions lack.
    """
    handling = handling or car.handling
    _check(car, boosts or fills, added_kg, boost_lag_s, handling, engine_model)
    loaded, line = car.of_mass(car.vehicle.mass_kg + added_kg), line_of(car)
    shifting = (handling.shifting or shifting_of(car))._replace(between_s=0.0, reversal_s=0.0)
    driven = loop_car(loaded, line, handling._replace(shifting=shifting))
    start_j = float(energy_j(car.battery, car.soc_start))
    free = FreePull(loaded, line, driven, boosts, engine_model) if line.free else None
    curves, engine = (
        free.curves(helps) if free else forces_of(loaded, line, driven, helps)
        for helps in (boosts or car.electric, car.electric)
    )  # fmt: skip
    up_mps = np.full(1, np.inf) if free else change_up_mps(loaded, line, driven, curves)
    foot, ways = _foot(car, line, boosts, fills, boost_lag_s, up_mps), by_gear(line)
    floored = _Floored(loaded, driven, ways, foot, start_j, engine_model, free)
    trace = _pulled(floored, 0.0, 0, max(SPEEDS_KMH), max(DISTANCES_M))
    in_gear, used, helps = _in_gear(floored), _to_100_j(trace, start_j), boosts or fills
    return Performance(
        loaded,
        helps,
        {kmh: _first(trace[:, col.SPEED], kmh / KMH_PER_MPS) for kmh in SPEEDS_KMH},
        {distance: _at_distance(trace, distance) for distance in DISTANCES_M},
        {case: None if at is None else at[0] for case, at in in_gear.items()},
        {gear + 1: top_mps(engine, gear) for gear in range(len(floored.ways))},
        start_slope(loaded, driven, handling, curves),
        {kmh: slope_at(loaded, curves, kmh / KMH_PER_MPS, handling) for kmh in SUSTAINED_KMH},
        used,
        _window_j(car, start_j) / used if (helps or car.electric) and used else None,
        curves,
        trace,
        {case: None if at is None else at[1] for case, at in in_gear.items()},
        engine_model,
        fills,
    )


def _foot(
    car: Architecture, line: Line, boosts: bool, fills: bool, boost_lag_s: float, up_mps: Array
) -> Foot:
    """The pedal floored; a car without an engine launches and changes up at no speed of it, all by its machine."""
    check_free_pull(car, fills, boost_lag_s)
    up = np.inf if car.electric or line.free else highest_radps(car, line) - _UP_BELOW_RADPS
    launch = 0.0 if car.electric else LAUNCH_RPM / RPM_PER_RADPS
    helps = boosts or fills or car.electric
    return Foot(launch, float(up), up_mps, helps, fills, float(boost_lag_s), _NATURAL_SHARE)


def _check(
    car: Architecture, boosts: bool, added_kg: float, boost_lag_s: float, handling: Handling,
    engine_model: str,
) -> None:  # fmt: skip
    if boosts and "e_boost" not in car.functions:
        raise DataError(f"{car.name}: e_boost is none of this car's functions; leave --boost out")
    if not -200 <= added_kg <= 5000 or not 0 <= boost_lag_s <= 10:
        raise DataError(
            f"added mass {added_kg:g} kg, boost lag {boost_lag_s:g} s; allowed: -200 to 5000 kg, 0 to 10 s"
        )
    check_engine_model(car, engine_model)
    if engine_model == "mean_value" and boost_lag_s > 0:
        raise DataError(
            f"boost lag {boost_lag_s:g} s beside engine model mean_value, whose turbocharger has a lag of its own; "
            "leave one of them out"
        )
    handling.check()


def _pulled(
    floored: _Floored, speed_mps: float, place: int, until_kmh: float, until_m: float = 0.0
) -> Array:
    """The record of a run from a speed in a gear; a mean-value engine's ends where speed and distance are."""
    driven, ways, foot = floored.driven, floored.ways, floored.foot
    start = speed_mps, place, floored.start_j
    record: Array = np.zeros((round(_LONGEST_S / STEP_S), col.COLUMNS))
    if floored.free is not None:
        until = until_kmh / KMH_PER_MPS, until_m
        return floored.free.pulled(speed_mps, floored.start_j, until, STEP_S, len(record))
    work = col.pull_work(driven)
    if floored.engine_model == "map":
        col.pull(driven, ways, foot, work, start, STEP_S, record)
        return record
    moved = col.pull_begun(driven, ways, foot, start)
    breathing = Breathing(
        floored.car, moved.state.side_radps, _torque_before(floored, speed_mps, place)
    )
    piece = round(_PIECE_S / STEP_S)
    for first in range(0, len(record), piece):
        part = record[first : first + piece]
        moved = breathing.pull(driven, ways, foot, work, moved, STEP_S, part)
        if moved.state.speed_mps >= until_kmh / KMH_PER_MPS and moved.distance_m >= until_m:
            return record[: first + piece]
    return record


def _torque_before(floored: _Floored, speed_mps: float, place: int) -> float:
    """What the engine gives at constant speed in a gear, on a level road; 0 at rest, before a launch."""
    if speed_mps == 0.0:
        return 0.0
    ways, way, body, limits = (
        floored.driven.ways, floored.ways[place], floored.driven.body, floored.driven.limits,
    )  # fmt: skip
    through = ways.wheel[way, -1] * ways.wheel_yield[way, 0, -1] / body.radius_m
    torque = float(resistance(speed_mps, 0.0, body)[0] / through)
    side = ways.wheel[way, -1] * speed_mps / body.radius_m
    gearbox = floored.car.gearbox
    if gearbox is not None and gearbox.loss is not None:
        state = np.array([place + 1]), np.array([side]), np.array([torque])
        torque = float(gearbox.loss.input_nm(*state)[0])
    if len(limits.load_nm):
        torque -= ways.side[way, 1] * float(tabulated(limits.load_nm[0], limits.engine_step, side))
    return torque


def _to_100_j(trace: Array, start_j: float) -> float | None:
    """Energy from the battery up to 100 km/h."""
    to_100 = _first(trace[:, col.SPEED], 100 / KMH_PER_MPS)
    return None if to_100 is None else start_j - _stored_j(trace, to_100)


def _window_j(car: Architecture, start_j: float) -> float:
    return start_j - float(energy_j(car.battery, car.battery.soc_min))


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


def _in_gear(floored: _Floored) -> dict[tuple[int, int, int], tuple[float, float] | None]:
    """Time and energy from the battery, from third gear on, and 40 to 80 km/h in fourth.

    Without an engine in the one gear there is. None where the engine turns too slowly or fast, or the speed is
    not reached.
    """
    driven, ways = floored.driven, floored.ways
    never = np.full_like(floored.foot.up_mps, np.inf)
    held = floored._replace(foot=floored.foot._replace(up_radps=np.inf, up_mps=never))
    lowest = 1 if floored.car.electric or floored.free is not None else 3
    cases = [(gear, *pair) for gear in range(lowest, len(ways) + 1) for pair in IN_GEAR_KMH]
    if len(ways) >= 4:
        cases.append((4, *FOURTH_KMH))
    found: dict[tuple[int, int, int], tuple[float, float] | None] = {}
    for gear, low, high in cases:
        ratio = driven.ways.wheel[ways[gear - 1], -1] / driven.body.radius_m / KMH_PER_MPS
        found[gear, low, high] = None
        turns = ratio * low >= driven.limits.idle_radps
        turns &= ratio * high <= driven.limits.engine_max_radps
        if floored.free is None and not turns:
            continue
        trace = _pulled(held, low / KMH_PER_MPS, gear - 1, high)
        time = _first(trace[:, col.SPEED], high / KMH_PER_MPS)
        if time is not None:
            found[gear, low, high] = time, floored.start_j - _stored_j(trace, time)
    return found
