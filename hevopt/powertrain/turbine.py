"""A torque converter that slips: how fast the engine turns, and what its shaft and the gearbox's are left with.

What the wheels ask for asks a torque of the turbine, by the balance of its shafts with nothing chosen on them, and
the converter's curves tell at which speed of the impeller it gives that. The engine is never slower than idling:
where that gives more than is asked for, the car creeps and friction brakes hold against it. Where the wheels drive,
nothing passes and the engine idles. At standstill with a gear engaged the turbine rests, and the engine idles
against it. The engine's speed is held over a step; what it gains from one to the next is a jump of kinetic energy.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache

import numpy as np

from hevopt.car.balance import speeds_of
from hevopt.car.driveline import BRAKE, ENGINE
from hevopt.car.parts import WHEEL, TorqueConverter
from hevopt.car.ways import Way
from hevopt.powertrain.operation import Setting, setting
from hevopt.powertrain.shafts import Shafts, Slip, value_of
from hevopt.powertrain.torques import Torques
from hevopt.problem.arrays import Array

_TURBINE = "turbine"
# Speeds of the impeller that are tried where a step asks for more than there is, and how often ever closer.
_TRIED, _PASSES = 101, 3


def slipped(way: Way, shafts: Shafts, idle_radps: float) -> Shafts:
    """The shafts of a way whose converter slips, as fast as what the wheels ask for makes the engine turn."""
    part = _part(way)
    idle = np.full(len(shafts.step), idle_radps)
    if part.second not in way.shafts:
        return _turned(way, shafts, idle)
    none = {BRAKE: np.zeros((1, 1))} | {name: np.zeros((1, 1)) for name in way.chosen}
    asked = Torques(_with_turbine(way), shafts).solve(none, [_TURBINE])[_TURBINE][:, 0]
    turbine = shafts.speed_radps[part.second]
    impeller = part.data.impeller_radps(np.nan_to_num(asked), turbine)
    turned = _turned(way, shafts, np.maximum(impeller, idle))
    found = turned.slip
    assert found is not None
    given = np.where(impeller > idle, asked, found.turbine_nm)
    return _acting(part, turned, found.impeller_nm, given)


def turbine_most_nm(here: Setting, machine_nm: Callable[[Setting, str], Array]) -> Array:
    """(state,) largest wheel torque of all speeds of the impeller that are tried, ever closer around the best.

    machine_nm: (state,) torque of a machine by its name at the states of a setting
    """
    way, part, engine = here.way, _part(here.way), here.car.engine
    states = len(here.shafts.step)
    low = np.full(states, engine.idle_radps)
    high = np.full(states, engine.speed_max_radps)
    turbine, each = np.zeros(states), np.repeat(np.arange(states), _TRIED)
    for _ in range(_PASSES if states else 0):
        speeds = low[:, None] + (high - low)[:, None] * np.linspace(0.0, 1.0, _TRIED)
        tried = _turned(way, here.shafts.picked(each), speeds.ravel())
        assert tried.slip is not None
        there = setting(here.car, way, tried)
        given = {name: machine_nm(there, name)[:, None] for name in way.chosen}
        needed = there.torques.solve(given, [ENGINE])[ENGINE][:, 0]
        fits = needed <= there.engine_nm(engine.covered_nm)
        found = np.where(fits, tried.slip.turbine_nm, 0.0).reshape(states, _TRIED)
        best, rows = np.argmax(found, axis=1), np.arange(states)
        turbine = np.maximum(turbine, found[rows, best])
        # The next look is at what lies between the best speed and its neighbours.
        low, high = (
            speeds[rows, np.maximum(best - 1, 0)],
            speeds[rows, np.minimum(best + 1, _TRIED - 1)],
        )
    if not states:
        return turbine
    known = {_TURBINE: turbine[:, None]} | {name: np.zeros((1, 1)) for name in way.chosen}
    bare = _acting(part, here.shafts, np.zeros(states), np.zeros(states))
    short = Torques(_with_turbine(way), bare).solve(known, [BRAKE])[BRAKE][:, 0]
    delivered: Array = here.shafts.wheel_nm - short
    return delivered


def _part(way: Way) -> TorqueConverter:
    assert way.converter is not None  # asked for where one slips
    return way.converter


@lru_cache(maxsize=4096)
def _with_turbine(way: Way) -> Way:
    """The way with the turbine's torque as an actuator's."""
    return replace(way, active={**way.active, _TURBINE: _part(way).second})


def _turned(way: Way, shafts: Shafts, impeller_radps: Array) -> Shafts:
    """The shafts at a speed of the impeller, with what the converter takes and gives there."""
    part, gear = _part(way), shafts.gear
    inputs = {WHEEL: shafts.speed_radps[WHEEL], part.first: impeller_radps}
    speeds = {s: value_of(terms, inputs, gear) for s, terms in speeds_of(way).items()}
    turbine = speeds.get(part.second, np.zeros(len(gear)))
    taken, given = part.data.torques_nm(impeller_radps, turbine)
    return _acting(part, replace(shafts, speed_radps=speeds), taken, given)


def _acting(part: TorqueConverter, shafts: Shafts, taken_nm: Array, given_nm: Array) -> Shafts:
    """The shafts with what the converter takes and gives, in place of what it did."""
    none, speeds = np.zeros(len(shafts.step)), shafts.speed_radps
    before = Slip(none, none, none) if shafts.slip is None else shafts.slip
    acting = dict(shafts.acting_nm)
    for shaft, more in (
        (part.first, taken_nm - before.impeller_nm),
        (part.second, before.turbine_nm - given_nm),
    ):
        if shaft in speeds:
            acting[shaft] = acting.get(shaft, none) + more
    heat_w = taken_nm * speeds[part.first] - given_nm * speeds.get(part.second, none)
    return replace(shafts, acting_nm=acting, slip=Slip(taken_nm, given_nm, heat_w))
