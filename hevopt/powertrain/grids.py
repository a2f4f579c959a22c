"""Choices that a single list of torques does not cover: a free engine speed, or more than one torque.

The free coordinates are gridded within what the limits of the other actuators leave open at each step: engine speed
by what keeps the machines below their highest speeds, the last torque by what keeps those that close the balance
within theirs. Always among the points: engine speeds of least fuel for the demand and a little more, engine at its
best efficiency and its fuel cut, zero torque of each actuator, both limits, and the battery idle.

While the car brakes, what acts on the wheels may give way to the friction brakes, in shares of what it could do.
"""

from collections.abc import Iterator, Mapping
from typing import NamedTuple

import numpy as np

from hevopt.car.architecture import Architecture
from hevopt.car.balance import speeds_of
from hevopt.car.driveline import BRAKE, ENGINE, State
from hevopt.car.parts import WHEEL
from hevopt.car.ways import Way
from hevopt.driving.demand import Demand
from hevopt.powertrain.evaluated import Evaluated, battery_idle, evaluated
from hevopt.powertrain.levels import ADDED_PLACES, Around
from hevopt.powertrain.operation import Setting, completed, flowing, setting
from hevopt.powertrain.phases import Driver, Stretch
from hevopt.powertrain.shafts import shafts_of, value_of
from hevopt.problem.arrays import Array, Flags, Indices
from hevopt.problem.battery import within_limits

# Of the levels of a single torque, the share that each of two coordinates gets.
_SPEED_SHARE, _OUTER_SHARE = 0.3, 0.22
_LEAST_COUNT = 3
# Powers, as multiples of the demand, whose engine speed of least fuel is among the points.
_DEMAND_SHARES = np.array([1.0, 1.1, 1.25, 1.5])
# Of what closes the balance, where a step asks for more than there is.
_SLACK_SHARES = np.linspace(1.0, 0.0, 11)
_BRAKING_SHARES = np.array([1.0, 0.5, 0.0])


class Gridded(NamedTuple):
    """Points of a way: torques given, (state, level) by actuator, what they do, and which of them are none."""

    here: Setting
    given: Mapping[str, Array]
    done: Evaluated
    repeats: Flags


def is_gridded(way: Way, *, follows_load: bool) -> bool:
    """Whether a way has a choice that levels of one torque, with the engine closing the balance, do not cover."""
    if "free" in way.held.values() or len(way.chosen) > 1:
        return True
    if follows_load or not way.chosen:
        return False
    closes = way.closing[way.chosen[0]]
    return ENGINE not in closes or way.slack not in (ENGINE, None)


def gridded(
    car: Architecture, driver: Driver, stretch: Stretch, state: State, levels: int
) -> Iterator[Gridded]:
    """All points of a way at its steps."""
    way, shafts, counts = stretch.way, stretch.shafts, _counts(stretch.way, levels)
    if "free" in way.held.values():
        low, high = _speed_limits(car, driver.demand, stretch)
        best = np.clip(_best_speeds(car, driver.demand, stretch), low[:, None], high[:, None])
        speeds = np.column_stack([_even(low, high, counts[0]), best])
        step = np.repeat(stretch.step, speeds.shape[1])
        shafts = shafts_of(car, driver.demand, way, step, driver.launch_radps, speeds.ravel())
    here, outer = setting(car, way, shafts), dict[str, Array]()
    for name in way.chosen[:-1]:
        low, high = _own_limits(here, name)
        grid = np.column_stack([_even(low, high, counts[0]), np.zeros_like(low)])
        here, outer = _repeated(here, outer, name, grid)
    yield from _inner(here, state, outer, counts[1], driver.demand.step_s)


def _counts(way: Way, levels: int) -> tuple[int, int]:
    """Levels of the outer and of the inner coordinate."""
    if "free" in way.held.values():
        count = max(_LEAST_COUNT, round(_SPEED_SHARE * levels))
        return count, count
    return max(_LEAST_COUNT, round(_OUTER_SHARE * levels)), levels


def refined(
    car: Architecture, driver: Driver, stretch: Stretch, state: State, levels: int, around: Around
) -> Iterator[Gridded]:
    """Points of a way close to those of a plan, at the steps where it drives in it."""
    way, counts, centre = stretch.way, _counts(stretch.way, levels), around.points.get(state, {})
    free = "free" in way.held.values()
    names = [*way.chosen, *(["speed"] if free else [])]
    if not way.chosen or not set(names) <= set(centre):
        return
    known = ~np.isnan([centre[name][stretch.step] for name in names]).any(axis=0)
    shafts = stretch.shafts.picked(np.flatnonzero(known))
    if not known.any():
        return
    far = [around.share * (levels - 1) / (count - 1) for count in counts]
    if free:
        low, high = (limit[known] for limit in _speed_limits(car, driver.demand, stretch))
        speeds = _close(centre["speed"][shafts.step], far[0], low, high)
        step = np.repeat(shafts.step, speeds.shape[1])
        shafts = shafts_of(car, driver.demand, way, step, driver.launch_radps, speeds.ravel())
    here, outer = setting(car, way, shafts), dict[str, Array]()
    for name in way.chosen[:-1]:
        grid = _close(centre[name][here.shafts.step], far[0], *_own_limits(here, name))
        here, outer = _repeated(here, outer, name, grid)
    name = way.chosen[-1]
    low, high, _ = _span(here, outer, name)
    grid = np.sort(_close(centre[name][here.shafts.step], far[1], low, high), axis=1)
    given = {**outer, name: grid}
    done = evaluated(here, state, given, driver.demand.step_s)
    yield Gridded(here, given, done, np.diff(grid, axis=1, prepend=-np.inf) <= 0)


def _close(centre: Array, far: float, low: Array, high: Array) -> Array:
    """(state, added) values around a centre, the outermost as far as a share of what is open, within it."""
    added = centre[:, None] + far * (high - low)[:, None] * ADDED_PLACES
    clipped = np.clip(added, low[:, None], high[:, None])
    return np.where(ADDED_PLACES == 0, centre[:, None], clipped)


def _repeated(
    here: Setting, outer: Mapping[str, Array], name: str, grid: Array
) -> tuple[Setting, dict[str, Array]]:
    """Every state once for each torque of a (state, torque) grid of one more actuator."""
    times = np.repeat(np.arange(len(grid)), grid.shape[1])
    more = setting(here.car, here.way, here.shafts.picked(times))
    given = {other: torque[times] for other, torque in outer.items()}
    return more, {**given, name: grid.reshape(-1, 1)}


def _speed_limits(car: Architecture, demand: Demand, stretch: Stretch) -> tuple[Array, Array]:
    """(step,) engine speeds, rad/s, between which no machine turns faster than it may."""
    step, ratios, gear = stretch.step, speeds_of(stretch.way), stretch.shafts.gear
    engine, shaft = car.engine, stretch.way.active[ENGINE]
    low = np.full(len(step), engine.idle_radps)
    high = np.full(len(step), engine.speed_max_radps)
    wheels, one = demand.wheel_speed_radps[step], np.ones(len(step))
    for (_, at), machine in zip(car.driveline.machines, car.machines, strict=True):
        own = value_of(ratios[at], {shaft: one}, gear) if at in ratios else np.zeros(1)
        if np.any(own == 0) or not np.isfinite(machine.speed_max_radps):
            continue
        rest = value_of(ratios[at], {WHEEL: wheels}, gear)
        ends = np.sort([(machine.speed_max_radps * sign - rest) / own for sign in (-1, 1)], axis=0)
        low, high = np.maximum(low, ends[0]), np.minimum(high, ends[1])
    return low, np.maximum(low, high)


def _best_speeds(car: Architecture, demand: Demand, stretch: Stretch) -> Array:
    """(step, power) engine speeds of least fuel for the demand and a little more."""
    wheels_w = np.maximum(demand.wheel_power_w[stretch.step], 0.0)
    power_w = (wheels_w + stretch.shafts.load_w)[:, None] * _DEMAND_SHARES
    return car.engine.best_radps(power_w)


def _even(low: Array, high: Array, count: int) -> Array:
    return low[:, None] + (high - low)[:, None] * np.linspace(0.0, 1.0, count)


def _inner(
    here: Setting, state: State, outer: Mapping[str, Array], count: int, step_s: Array
) -> Iterator[Gridded]:
    """The points of the last coordinate, all others being given."""
    way = here.way
    if not way.chosen:
        done = evaluated(here, state, outer, step_s)
        yield Gridded(here, outer, done, np.zeros((1, 1), dtype=bool))
        return
    name = way.chosen[-1]
    low, high, special = _span(here, outer, name)
    grid = np.sort(np.nan_to_num(np.column_stack([_even(low, high, count), *special])), axis=1)
    given = {**outer, name: grid}
    done = evaluated(here, state, given, step_s)
    yield Gridded(here, given, done, np.diff(grid, axis=1, prepend=-np.inf) <= 0)
    idle, crosses = battery_idle(here, given, name, np.broadcast_to(done.battery_w, grid.shape))
    given = {**outer, name: idle}
    yield Gridded(here, given, evaluated(here, state, given, step_s), ~crosses)
    if way.slack not in (ENGINE, None) and (here.shafts.wheel_nm <= 0).any():
        few = np.nan_to_num(np.column_stack([_even(low, high, _LEAST_COUNT), *special]))
        part, given = _braked(here, {**outer, name: few})
        done = evaluated(part, state, given, step_s)
        yield Gridded(part, given, done, np.zeros((1, 1), dtype=bool))


def _braked(here: Setting, given: Mapping[str, Array]) -> tuple[Setting, dict[str, Array]]:
    """Where the car brakes: the machine that closes the balance at shares of what it could do."""
    slack = here.way.slack
    assert slack is not None  # asked for where a machine is
    braking = np.flatnonzero(here.shafts.wheel_nm <= 0)
    part = setting(here.car, here.way, here.shafts.picked(braking))
    given = {name: torque[braking] for name, torque in given.items()}
    most = completed(part, given)[slack]
    most = np.nan_to_num(np.clip(most, -part.limit_nm(slack)[:, None], 0.0))
    shares = np.repeat(_BRAKING_SHARES, most.shape[1])
    tiled = {
        name: np.tile(torque, len(_BRAKING_SHARES)) if torque.shape[1] > 1 else torque
        for name, torque in given.items()
    }
    tiled[slack] = np.tile(most, len(_BRAKING_SHARES)) * shares
    return part, tiled


def _span(here: Setting, outer: Mapping[str, Array], name: str) -> tuple[Array, Array, list[Array]]:
    """(state,) lowest and highest torque that limits leave open, and torques of their own."""
    own = _own_limits(here, name)
    low, high = own
    special = _special(here, name)
    for closer in here.way.closing[name]:

        def pinned(torque: Array, closer: str = closer) -> Array:
            given = here.unbraked({**outer, closer: torque[:, None]})
            found = here.torques.solve(given, [name])[name]
            return np.broadcast_to(found, (len(torque), 1))[:, 0]

        one, other = (pinned(limit) for limit in _own_limits(here, closer))
        low = np.fmax(low, np.fmin(one, other))
        most = np.fmin(high, np.fmax(one, other))
        if closer == ENGINE and closer == here.way.slack:
            # Braking, friction brakes take what the engine at its lowest torque leaves.
            most = np.where(here.shafts.wheel_nm > 0, most, np.maximum(most, 0.0))
        high = np.fmin(high, most)
        special += [pinned(torque) for torque in _special(here, closer)]
    clipped = [np.clip(np.nan_to_num(torque), *own) for torque in special]
    if name == ENGINE:
        clipped.append(here.least_nm)
    return np.clip(low, *own), np.clip(high, *own), clipped


def _own_limits(here: Setting, name: str) -> tuple[Array, Array]:
    """(state,) lowest torque of a fuelled engine, or of a machine, and the highest."""
    if name != ENGINE:
        limit = here.limit_nm(name)
        return -limit, limit
    engine = here.car.engine
    most = here.engine_nm(engine.covered_nm)
    least = np.full(most.shape, engine.law.lowest_nm)
    return least, np.fmax(most, least)


def _special(here: Setting, name: str) -> list[Array]:
    """Torques of an actuator that are always among the points."""
    if name != ENGINE:
        return [np.zeros(len(here.shafts.step))]
    return [here.engine_nm(here.car.engine.best_nm), here.least_nm]


def most_nm(points: Gridded, stuck: Flags) -> tuple[Indices, Array]:
    """Steps among those stuck, and the largest wheel torque at each with these points' speeds and torques.

    What closes the balance is driven as far as it, everything else and the battery go. stuck: (time,)
    """
    here, way = points.here, points.here.way
    state = np.flatnonzero(stuck[here.shafts.step])
    none = here.shafts.step[state], np.zeros(len(state))
    if way.slack is None or not len(state):
        return none
    part = setting(here.car, way, here.shafts.picked(state))
    full, most = _own_limits(part, way.slack)[1][:, None], none[1]
    for share in _SLACK_SHARES:
        given = {name: points.given[name][state] for name in way.chosen} | {way.slack: share * full}
        torques = completed(part, given)
        flows = flowing(part, torques)
        battery_w = here.car.terminal_w(flows.machines_w + part.shafts.load_w[:, None])
        within = within_limits(here.car.battery, battery_w)
        again = points.repeats if len(points.repeats) == 1 else points.repeats[state]
        within = within & ~flows.off_engine_map & ~flows.off_machine_map & ~again
        for name in set(way.active) - set(given):
            low, high = (limit[:, None] for limit in _own_limits(part, name))
            within = within & (torques[name] >= low - 1e-6) & (torques[name] <= high + 1e-6)
        gained = np.where(within, part.shafts.wheel_nm[:, None] - torques[BRAKE], 0.0)
        most = np.maximum(most, np.max(np.nan_to_num(gained), axis=1))
    return none[0], most
