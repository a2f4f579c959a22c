"""Branches of a table: all controls of one state of the driveline, evaluated at every step."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from hevopt.car.architecture import Architecture
from hevopt.car.driveline import BRAKE, ENGINE, State
from hevopt.display.facts import Shown
from hevopt.driving.demand import Demand
from hevopt.powertrain.evaluated import evaluated
from hevopt.powertrain.grids import Gridded, gridded, is_gridded, most_nm, refined
from hevopt.powertrain.kinetic import Kinetic, kinetic_of
from hevopt.powertrain.levels import Around, labels, levels_of
from hevopt.powertrain.operation import Setting, setting
from hevopt.powertrain.packing import packed
from hevopt.powertrain.phases import Driver, Stretch, driver_of, stretches
from hevopt.powertrain.rejects import Bits, bits
from hevopt.powertrain.turbine import turbine_most_nm
from hevopt.problem.arrays import Array, Flags, Indices
from hevopt.problem.battery import within_limits
from hevopt.problem.reject import Reject


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Piece(Shown):
    """The states at which a branch drives in one way, and the torques given there, (state, level) by actuator.

    slot: (state,) the only level of each state; None where every state has all levels
    """

    here: Setting
    given: Mapping[str, Array]
    slot: Indices | None = None


class Driven(NamedTuple):
    """A state, the names of its levels, and the pieces that make up its steps."""

    state: State
    labels: tuple[str, ...]
    pieces: tuple[Piece, ...]
    kinetic: Kinetic


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Branch(Shown):
    """All controls of one state; arrays (time, level).

    points: of a state whose levels are chosen among more points, all of them
    """

    driven: Driven
    fuel_kg: Array
    nox_kg: Array
    battery_power_w: Array
    reject: Bits
    points: tuple[Gridded, ...] = ()


def branches(car: Architecture, demand: Demand, levels: int, around: Around | None) -> list[Branch]:
    """The branches of a car: engine turning first, with a free gear gear by gear."""
    may_stop = bool(car.functions & {"start_stop", "power_management"}) or car.electric
    found = []
    for state, driver in _states(car, demand):
        if state.engine_on or may_stop:
            found.append(_branch(car, driver, state, levels, around))
    return found


def _states(car: Architecture, demand: Demand) -> list[tuple[State, Driver]]:
    """The states of a car, each with the driver in the gear that it drives in."""
    line = car.driveline
    if car.gear == "cycle" or car.gearbox is None:
        driver = driver_of(car, demand)
        return [(state, driver) for state in line.states()]
    found: list[tuple[State, Driver]] = []
    for gear in range(1, len(car.gearbox.ratios)):
        in_gear = driver_of(car, demand.with_gear(np.full_like(demand.gear, gear)))
        found += [(state, in_gear) for state in line.states(gear) if state.engine_on]
        needed = _needs_gear(car, in_gear)
        if gear == 1 or needed:
            states = line.states(gear if needed else 0)
            found += [(state, in_gear) for state in states if not state.engine_on]
    return found


def _needs_gear(car: Architecture, driver: Driver) -> bool:
    """Whether something turns with the gearbox's input while the engine rests."""
    states = [state for state in car.driveline.states(1) if not state.engine_on]
    ways = [stretch.way for state in states for stretch in stretches(car, driver, state)]
    return any(use.gear is None for found in ways for use in found.uses)


def _branch(
    car: Architecture, driver: Driver, state: State, levels: int, around: Around | None
) -> Branch:
    found, follows = stretches(car, driver, state), car.driveline.follows_load
    if any(is_gridded(stretch.way, follows_load=follows) for stretch in found):
        return _packed_branch(car, driver, state, found, levels, around)
    named = labels(car, state, levels, around)
    demand = driver.demand
    shape = len(demand.time_s), len(named)
    fuel, nox, power = (np.zeros(shape) for _ in range(3))
    reject = np.full(shape, int(Reject.NO_PATH), dtype=np.uint16)
    pieces = []
    for stretch in found:
        here = setting(car, stretch.way, stretch.shafts)
        chosen, step = levels_of(here, state, levels, around), stretch.step
        done = evaluated(here, state, chosen.given, demand.step_s)
        fuel[step], nox[step], power[step] = done.fuel_kg, done.nox_kg, done.battery_w
        reject[step] = done.reject | bits(Reject.DUPLICATE, chosen.repeats)
        pieces.append(Piece(here, chosen.given))
    reject |= bits(Reject.BATTERY_LIMIT, ~within_limits(car.battery, power))
    kinetic = kinetic_of(car, found, demand.step_s)
    return Branch(Driven(state, named, tuple(pieces), kinetic), fuel, nox, power, reject)


def _packed_branch(
    car: Architecture,
    driver: Driver,
    state: State,
    found: list[Stretch],
    levels: int,
    around: Around | None,
) -> Branch:
    """The controls of a state that has more points than a table needs: those that no other beats."""
    points: list[Gridded] = []
    step_s = driver.demand.step_s
    for stretch in found:
        if is_gridded(stretch.way, follows_load=car.driveline.follows_load):
            points += gridded(car, driver, stretch, state, levels)
            points += () if around is None else refined(car, driver, stretch, state, levels, around)
            continue
        here = setting(car, stretch.way, stretch.shafts)
        chosen = levels_of(here, state, levels, around)
        done = evaluated(here, state, chosen.given, step_s)
        points.append(Gridded(here, chosen.given, done, chosen.repeats))
    left = packed(points, len(step_s), car.battery)
    pieces = tuple(Piece(*kept) for kept in left.kept)
    named = tuple(f"point {n}" for n in range(left.reject.shape[1]))
    driven = Driven(state, named, pieces, kinetic_of(car, found, step_s))
    return Branch(driven, *left[:4], tuple(points))


def deliverable_nm(car: Architecture, branch: Branch, stuck: Flags) -> Array:
    """(time,) largest wheel torque of a branch: machines at their limit, engine at full load or its map's end.

    stuck: (time,) the steps where it is asked for
    """
    result = np.zeros(len(stuck))
    for points in branch.points:
        np.maximum.at(result, *most_nm(points, stuck))
    for piece in () if branch.points else branch.driven.pieces:
        here = piece.here
        if here.way.converter is not None and here.way.converter.second in here.way.shafts:
            state = np.flatnonzero(stuck[here.shafts.step])
            part = setting(car, here.way, here.shafts.picked(state))
            follows = car.driveline.follows_load
            result[part.shafts.step] = turbine_most_nm(
                part, Setting.idle_nm if follows else _most_nm
            )
        elif here.way.slack is not None:
            names = {*here.way.chosen, here.way.slack}
            given = {name: _most_nm(here, name)[:, None] for name in names}
            if car.driveline.follows_load:
                given |= piece.given
            short = here.torques.solve(given, [BRAKE])[BRAKE][:, 0]
            result[here.shafts.step] = here.shafts.wheel_nm - short
    return result


def _most_nm(here: Setting, name: str) -> Array:
    """(state,) highest torque of an actuator; of an engine that cannot be used, that of its own inertia."""
    if name != ENGINE:
        motoring = here.car.functions & {"e_boost", "nox_cut", "power_management"}
        return here.limit_nm(name) if motoring else np.zeros(len(here.shafts.step))
    engine, speed = here.car.engine, here.engine_radps
    most = here.engine_nm(engine.covered_nm)
    shaft = here.way.active[ENGINE]
    unused = engine.inertia_kgm2 * here.shafts.accel_radps2[shaft]
    return np.where(np.isnan(most) | (speed > engine.speed_max_radps), unused, most)
