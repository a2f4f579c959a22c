"""Which torques are open at each step, and the levels of them that a table holds.

One torque is chosen: a machine's, what the engine's limits and its own leave open, the engine delivering the rest;
or without an engine that acts, from what meets the demand to none, friction brakes taking the rest while the car
brakes. Always among the levels of a turning engine: both ends (engine at full load and at its lowest torque), zero
torque, battery idle, engine at its best efficiency, and fuel cut without friction brakes. Of measured maps of
engine and machine every torque where they bend (knots.py) is a level as well: between these they are straight.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from hevopt.car.architecture import Architecture
from hevopt.car.driveline import ENGINE, State
from hevopt.display.facts import Shown
from hevopt.powertrain.knots import knot_count, knots_nm
from hevopt.powertrain.operation import Setting
from hevopt.problem.arrays import Array, Flags, Indices

_BRAKING_LEVELS = 6
_TORQUE_TOLERANCE_NM = 1e-6
ADDED_PLACES = np.array([-1.0, -0.5, 0.0, 0.5, 1.0])
_SPECIAL_LEVELS = ("zero torque", "battery idle", "best efficiency", "fuel cut")


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Around(Shown):
    """Where to add torques: close to those of a plan.

    torque_nm: state -> (time,) torque of the plan, NaN where it drives in another state
    share: distance of the outermost torque added, as a share of what is open at the step
    points: state -> actuator -> (time,) torque, and "speed" -> that of the engine; NaN likewise
    """

    torque_nm: Mapping[State, Array]
    share: float
    points: Mapping[State, Mapping[str, Array]] = field(default_factory=dict)

    def added_nm(self, state: State, step: Indices, low: Array, high: Array) -> Array:
        """(state, added) torques; the lowest open one again where the plan drives in another state."""
        known = self.torque_nm.get(state)
        centre = (np.full(low.shape, np.nan) if known is None else known[step])[:, None]
        added = centre + self.share * (high - low)[:, None] * ADDED_PLACES
        low, high = np.minimum(low, high)[:, None], np.maximum(low, high)[:, None]
        return np.where(np.isnan(added), low, np.clip(added, low, high))


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Levels(Shown):
    """Torques given, (state, level) by actuator; repeats: levels that are there already, (state, level)."""

    given: Mapping[str, Array]
    repeats: Flags


def labels(car: Architecture, state: State, levels: int, around: Around | None) -> tuple[str, ...]:
    """The names of a state's levels."""
    if car.driveline.follows_load:
        return ("battery idle",)
    named = tuple(f"{share:.3f}" for share in _shares(state, levels))
    special = _SPECIAL_LEVELS if state.engine_on else ()
    added = () if around is None else tuple(f"refined {place:+.2f}" for place in ADDED_PLACES)
    knots = knot_count(car, engine_on=state.engine_on)
    return (*named, *special, *added, *(f"map knot {n}" for n in range(1, knots + 1)))


def levels_of(here: Setting, state: State, levels: int, around: Around | None) -> Levels:
    """The levels of a way of a state, as many as `labels` names."""
    count = len(labels(here.car, state, levels, around))
    name = here.way.chosen[0] if here.way.chosen else here.way.slack
    if name is None or name == ENGINE:
        return _single(len(here.shafts.step), count)
    if here.car.driveline.follows_load:
        torque = here.idle_nm(name)[:, None]
        return Levels({name: torque}, np.zeros(torque.shape, dtype=bool))
    low, high, best, cut = _open_nm(here, name)
    shares = _shares(state, levels)
    torque = low[:, None] * (1 - shares) + high[:, None] * shares
    repeats = np.zeros((len(low), count), dtype=bool)
    if state.engine_on:
        idle = here.idle_nm(name)
        if not here.way.chosen:
            repeats[:, len(shares) + _SPECIAL_LEVELS.index("best efficiency")] = True
        torque = np.column_stack([torque, np.zeros_like(idle), idle, best, cut])
    if around is not None:
        added = around.added_nm(state, here.shafts.step, low, high)
        torque = np.column_stack([torque, added])
    if count > torque.shape[1]:
        knots, met = _knots(here, name, torque, count - torque.shape[1])
        repeats[:, torque.shape[1] :] = ~met
        torque = np.hstack([torque, np.where(met, knots, low[:, None])])
    repeats[high - low <= _TORQUE_TOLERANCE_NM, 1:] = True
    return Levels({name: torque}, repeats)


def _knots(here: Setting, name: str, torque: Array, count: int) -> tuple[Array, Flags]:
    """(state, count) torques where measured maps bend, and which of them lie between the levels given."""
    knots = np.full((len(torque), count), np.nan)
    found = knots_nm(here, name)
    knots[:, : found.shape[1]] = found
    least, most = np.nanmin(torque, axis=1)[:, None], np.nanmax(torque, axis=1)[:, None]
    return knots, (knots > least) & (knots < most)


def _shares(state: State, levels: int) -> Array:
    return np.linspace(0.0, 1.0, levels if state.engine_on else _BRAKING_LEVELS)


def _single(states: int, count: int) -> Levels:
    repeats = np.ones((states, count), dtype=bool)
    repeats[:, 0] = False
    return Levels({}, repeats)


def _open_nm(here: Setting, name: str) -> tuple[Array, Array, Array, Array]:
    """(state,) lowest and highest torque that the limits of engine and machine leave open, and between them that
    of the engine's best efficiency and that of its lowest torque; both the lowest where no engine acts."""
    limit, wanted = here.limit_nm(name), here.shafts.wheel_nm
    if name in here.way.chosen:
        engine = here.car.engine
        full = here.engine_nm(engine.covered_nm)
        full = np.where(np.isnan(full), np.maximum(here.least_nm, 0.0), full)
        wished = np.column_stack([full, here.least_nm, here.engine_nm(engine.best_nm)])
        pinned = here.torques.solve(here.unbraked({ENGINE: wished}), [name])[name]
        low, high, best = np.broadcast_to(pinned, wished.shape).T
        cut = high
        if here.friction_nm.any():
            given = here.least_braked({ENGINE: here.least_nm[:, None]})
            part = np.broadcast_to(here.torques.solve(given, [name])[name], (len(limit), 1))[:, 0]
            cut = np.where(part < 0, part, np.maximum(cut, 0.0))
    else:
        found = here.torques.solve(here.least_braked({}), [name])[name]
        low = high = best = np.broadcast_to(found, (len(limit), 1))[:, 0]
        cut = high
    high = np.where(wanted > 0, high, np.maximum(high, 0.0))
    low, high = np.clip(low, -limit, limit), np.clip(high, -limit, limit)
    if name in here.way.chosen:
        return low, high, best, np.clip(cut, np.minimum(low, high), np.maximum(low, high))
    return low, high, low, low
