"""At which steps a state of the driveline drives in which way: what demand and driver make of it.

The driver's clutch, for a turning engine, at a listed gear:
    locked     the gearbox input turns at or above the launch speed: engine and input turn as one
    slipping   below it while driving: the engine holds the launch speed, the torque passes, the slip is lost
    open       braking below idle, listed `clutch_open` while braking; with the engine at rest always
A torque converter has no clutch to open: it is locked where its file says so, and slips else.
Standing, gearboxes are in neutral, so that the engine can turn what lies between.
"""

from collections.abc import Hashable, Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from hevopt.car.architecture import Architecture
from hevopt.car.driveline import Phase, State
from hevopt.car.parts import Gear
from hevopt.car.ways import Way, way
from hevopt.display.facts import Shown
from hevopt.driving.demand import Demand
from hevopt.driving.driver import gap_shares, launch_speed_radps
from hevopt.powertrain.shafts import Shafts, shafts_of
from hevopt.powertrain.turbine import slipped
from hevopt.problem.arrays import Array, Flags, Indices


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Driver(Shown):
    """What demand and driver make of the steps, whatever the strategy chooses.

    launch_radps: (time,) engine speed at which the clutch closes
    gap: (time,) share of the step without torque through the listed gearbox
    phases: engine turning or not -> the phases, and (time,) where each holds
    """

    demand: Demand
    launch_radps: Array
    gap: Array
    phases: Mapping[bool, list[tuple[Phase, Flags]]]


class Stretch(NamedTuple):
    """The steps at which a state drives in one way, and how shafts turn there."""

    way: Way
    step: Indices
    shafts: Shafts


def driver_of(car: Architecture, demand: Demand) -> Driver:
    """The driver of a car on a demand."""
    launch, gap = np.zeros(len(demand.gear)), np.zeros(len(demand.gear))
    if not car.electric and car.gearbox is not None:
        launch = launch_speed_radps(demand, car.engine, car.gearbox)
        if car.gear == "cycle" and car.gearbox.shift_gap_s > 0:
            gap = gap_shares(demand, car.vehicle, car.engine, car.gearbox)
    phases = {on: _phases(car, demand, launch, engine_on=on) for on in (True, False)}
    return Driver(demand, launch, gap, phases)


def stretches(car: Architecture, driver: Driver, state: State) -> list[Stretch]:
    """A state's ways, each with its steps; at a step without any the state is not possible."""
    possible = _possible(car, driver, state)
    merged: dict[Hashable, tuple[Way, list[Indices]]] = {}
    for phase, where in driver.phases[state.engine_on]:
        step = np.flatnonzero(where & possible)
        for opened, part in _opened(car, driver, state, phase, step):
            if len(part):
                found = way(car.driveline, state, phase._replace(opened=opened))
                if found.tied and not state.engine_on and car.driveline.engine in found.shafts:
                    continue  # an engine that the wheels turn is not at rest
                held = tuple(found.held.items())
                key = (found.uses, held, found.chosen, found.slack, found.converter)
                merged.setdefault(key, (found, []))[1].append(part)
    result = []
    for found, parts in merged.values():
        step = np.sort(np.concatenate(parts))
        shafts = shafts_of(car, driver.demand, found, step, driver.launch_radps)
        if found.converter is not None:
            shafts = slipped(found, shafts, car.engine.idle_radps)
        if any(use.gear is None for use in found.uses):
            shafts = replace(shafts, gap=driver.gap[step])
        result.append(Stretch(found, step, shafts))
    return result


def _phases(
    car: Architecture, demand: Demand, launch_radps: Array, *, engine_on: bool
) -> list[tuple[Phase, Flags]]:
    """Every phase and the steps at which it holds, (time,)."""
    standing = demand.wheel_speed_radps == 0
    driving = demand.wheel_torque_nm > 0
    apart = demand.clutch_open & ~driving
    phases = [(Phase(True), standing)]
    neutral = ~standing
    for box in car.driveline.boxes:
        if box.choice == "free":
            continue
        listed = ~standing & np.isin(demand.gear, box.gears)
        neutral = neutral & ~listed
        open_here = listed
        if engine_on and (car.driveline.driver_clutches or car.driveline.converter is not None):
            input_radps = np.array(box.ratios)[demand.gear] * demand.wheel_speed_radps
            if car.driveline.converter is not None:
                locked = listed & _locks(car, demand.gear, input_radps)
                slipping = listed & ~locked
            else:
                locked = listed & ~apart & (input_radps >= launch_radps)
                slipping = listed & driving & (input_radps < launch_radps)
            open_here = listed & ~locked & ~slipping
            phases.append((Phase(False, "closed", box.name), locked))
            phases.append((Phase(False, "slipping", box.name), slipping))
        phases.append((Phase(False, "open", box.name), open_here))
    phases.append((Phase(False), neutral))
    return phases


def _locks(car: Architecture, gear: Indices, input_radps: Array) -> Flags:
    """(time,) where a torque converter is locked."""
    part = car.driveline.converter
    assert part is not None  # asked for where there is one
    return part.data.locks(gear, input_radps, car.engine.idle_radps)


def _possible(car: Architecture, driver: Driver, state: State) -> Flags:
    """(time,) whether the gears chosen go with the gear listed, and with the engine's lowest speed in it."""
    demand, launch_radps = driver.demand, driver.launch_radps
    possible = np.ones(len(demand.gear), dtype=bool)
    moving = demand.wheel_speed_radps > 0
    for box in car.driveline.boxes:
        if box.choice == "preselected" and state.engine_on:
            of_box = moving & np.isin(demand.gear, box.gears)
            possible &= ~of_box | (demand.gear == state.gear(box.name))
    if car.gear == "free" and state.engine_on and car.gearbox is not None:
        # Above first gear the clutch does not slip, and the engine keeps its lowest speed.
        driving = demand.wheel_torque_nm > 0
        speed = car.gearbox.ratios[demand.gear] * demand.wheel_speed_radps
        if car.driveline.converter is not None:
            locked = moving & _locks(car, demand.gear, speed)
            return possible & ~(locked & (speed < car.gearbox.engine_speed_min_radps))
        locked = moving & ~(demand.clutch_open & ~driving) & (speed >= launch_radps)
        slow = locked & (speed < car.gearbox.engine_speed_min_radps)
        slips = moving & driving & (speed < launch_radps)
        possible &= (demand.gear <= 1) | ~(slow | slips)
    return possible


def _opened(
    car: Architecture, driver: Driver, state: State, phase: Phase, step: Indices
) -> list[tuple[frozenset[str], Indices]]:
    """The steps by which gears their own couplings open, being turned too fast."""
    limited = [
        part
        for part in car.driveline.parts
        if isinstance(part, Gear) and np.isfinite(part.speed_max_radps)
    ]
    if not limited or not len(step):
        return [(frozenset(), step)]
    whole = way(car.driveline, state, phase)
    closed = shafts_of(car, driver.demand, whole, step, driver.launch_radps)
    rest = np.zeros(len(step))
    fast = np.array(
        [closed.speed_radps.get(part.first, rest) > part.speed_max_radps for part in limited]
    )
    codes = (1 << np.arange(len(limited))) @ fast
    return [
        (
            frozenset(part.name for n, part in enumerate(limited) if code >> n & 1),
            step[codes == code],
        )
        for code in sorted(set(codes.tolist()))
    ]
