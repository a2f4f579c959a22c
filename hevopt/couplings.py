"""How engine, machine and wheels are joined: one function per coupling kind.

A joint is one discrete way to drive: engine turning or at rest, machine in one gear. Its arrays say, per step,
at which speeds the shafts turn and how the machine's torque reaches the wheels; powertrain.py then balances
the torques, the same way for every kind.

Engine clutch, for a turning engine:
    locked     gearbox input at or above the launch speed: engine and input turn as one
    slipping   below it while driving: the engine holds the launch speed, the torque passes, the slip is lost
    open       standstill, neutral, braking below idle, listed `clutch_open` while braking
Machine path:
    upstream   on the engine's side of the clutch: joins the engine's torque before the clutch
    shared     on the gearbox input, behind the clutch
    own        neither: reaches the wheels through its own ratio
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from hevopt.architecture import Architecture
from hevopt.demand import Demand
from hevopt.driver import launch_speed_radps

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]


@dataclass(frozen=True, slots=True, eq=False)
class Joint:
    """One discrete way to drive; all arrays (time,).

    machine_gear: 0 where the machine has no choice; engine_gear: 0 where the cycle gives the gear
    locked, slipping: engine clutch; both False: the engine's torque does not reach the gearbox
    upstream, shared: machine path; both False: own path with `machine_ratio`, `machine_efficiency`
    possible: False where this joint cannot exist (the machine's gear is not the engine's, ...)
    connected: False where the machine is disconnected and stands still
    """

    engine_on: bool
    machine_gear: int
    engine_gear: int
    gear_ratio: Array
    gear_efficiency: Array
    engine_speed_radps: Array
    engine_accel_radps2: Array
    locked: Flags
    slipping: Flags
    slip_radps: Array
    upstream: Flags
    shared: Flags
    machine_speed_radps: Array
    machine_accel_radps2: Array
    machine_ratio: Array
    machine_efficiency: Array
    connected: Flags
    possible: Flags


@dataclass(frozen=True, slots=True, eq=False)
class _Clutch:
    """Kinematics shared by all joints of one engine state."""

    on: bool
    ratio: Array
    efficiency: Array
    input_speed: Array
    input_accel: Array
    engine_speed: Array
    engine_accel: Array
    locked: Flags
    slipping: Flags
    standing: Flags


def joints(architecture: Architecture, demand: Demand) -> Iterator[Joint]:
    """Every joint of the architecture: engine turning first, then at rest; with a free gear, gear by gear."""
    if architecture.gear == "cycle":
        yield from _joints_in_gear(architecture, demand)
        return
    through_gearbox = architecture.coupling.kind == "gearbox_input"
    for gear in range(1, len(architecture.gearbox.ratios)):
        in_gear = demand.with_gear(np.full_like(demand.gear, gear))
        for joint in _joints_in_gear(architecture, in_gear):
            if joint.engine_on or through_gearbox:
                possible = joint.possible & _may_drive(architecture, joint, gear)
                yield replace(joint, engine_gear=gear, possible=possible)
            elif gear == 1:
                yield joint


def _joints_in_gear(architecture: Architecture, demand: Demand) -> Iterator[Joint]:
    coupling = COUPLINGS[architecture.coupling.kind]
    for engine_on in (True, False):
        yield from coupling(architecture, demand, _clutch(architecture, demand, engine_on))


def _may_drive(architecture: Architecture, joint: Joint, gear: int) -> Flags:
    """Above first gear the clutch does not slip, and the engine keeps its lowest speed."""
    if gear == 1:
        return np.ones_like(joint.possible)
    slow = joint.engine_speed_radps < architecture.gearbox.engine_speed_min_radps
    return ~joint.slipping & ~(joint.locked & slow)


def _clutch(architecture: Architecture, demand: Demand, engine_on: bool) -> _Clutch:
    ratio = architecture.gearbox.ratios[demand.gear]
    input_speed = np.where(demand.gear > 0, ratio * demand.wheel_speed_radps, 0.0)
    input_accel = np.where(demand.gear > 0, ratio * demand.wheel_accel_radps2, 0.0)
    launch = launch_speed_radps(demand, architecture.engine, architecture.gearbox)
    standing = demand.wheel_speed_radps == 0
    driving = demand.wheel_torque_nm > 0
    in_gear = engine_on & (demand.gear > 0) & ~standing
    apart = demand.clutch_open & ~driving
    locked = in_gear & ~apart & (input_speed >= launch)
    slipping = in_gear & driving & (input_speed < launch)
    # Open clutch: the engine idles. Slipping: it holds the launch speed.
    free_speed = np.where(slipping, launch, architecture.engine.idle_radps)
    engine_speed = np.where(locked, input_speed, free_speed) if engine_on else np.zeros_like(ratio)
    return _Clutch(
        engine_on, ratio, architecture.gearbox.efficiency[demand.gear], input_speed, input_accel,
        engine_speed, np.where(locked, input_accel, 0.0), locked, slipping, standing,
    )  # fmt: skip


def _joint(
    clutch: _Clutch,
    *,
    upstream: Flags,
    shared: Flags,
    machine_speed: Array,
    machine_accel: Array,
    machine_gear: int = 0,
    machine_ratio: Array | float = 1.0,
    machine_efficiency: Array | float = 1.0,
    connected: Flags | bool = True,
    possible: Flags | bool = True,
) -> Joint:
    shape = clutch.ratio.shape
    return Joint(
        clutch.on, machine_gear, 0, clutch.ratio, clutch.efficiency,
        clutch.engine_speed, clutch.engine_accel, clutch.locked, clutch.slipping,
        np.where(clutch.slipping, clutch.engine_speed - clutch.input_speed, 0.0),
        np.broadcast_to(upstream, shape), np.broadcast_to(shared, shape),
        machine_speed, machine_accel,
        np.broadcast_to(machine_ratio, shape), np.broadcast_to(machine_efficiency, shape),
        np.broadcast_to(connected, shape), np.broadcast_to(possible, shape),
    )  # fmt: skip


def crankshaft(_: Architecture, demand: Demand, clutch: _Clutch) -> Iterator[Joint]:
    """A, B, C1: the machine turns with the engine. With the engine at rest nothing drives the wheels."""
    yield _joint(
        clutch,
        upstream=np.True_,
        shared=np.False_,
        machine_speed=clutch.engine_speed,
        machine_accel=clutch.engine_accel,
        connected=clutch.on,
        possible=clutch.on | (demand.wheel_torque_nm <= 0),
    )


def gearbox_input(arch: Architecture, demand: Demand, clutch: _Clutch) -> Iterator[Joint]:
    """C2: the machine turns with the gearbox input; at standstill, in neutral, the engine can drive it.

    Without the second clutch engine and machine cannot part: the crankshaft coupling.
    """
    if not arch.coupling.second_clutch:
        yield from crankshaft(arch, demand, clutch)
        return
    idling = clutch.standing & clutch.on
    yield _joint(
        clutch,
        upstream=idling,
        shared=~idling,
        machine_speed=np.where(idling, clutch.engine_speed, clutch.input_speed),
        machine_accel=np.where(idling, 0.0, clutch.input_accel),
        connected=idling | (clutch.input_speed > 0),
    )


def gearbox_output(arch: Architecture, demand: Demand, clutch: _Clutch) -> Iterator[Joint]:
    """D: the machine turns with the wheels, through its own ratio and the final drive."""
    ratio = arch.coupling.machine_ratio * arch.gearbox.ratios[0]
    speed = ratio * demand.wheel_speed_radps
    connected = speed > 0
    if arch.coupling.disconnects_above_speed_max:
        connected = connected & (speed <= arch.machine.speed_max_radps)
    yield _joint(
        clutch,
        upstream=np.False_,
        shared=np.False_,
        machine_speed=np.where(connected, speed, 0.0),
        machine_accel=np.where(connected, ratio * demand.wheel_accel_radps2, 0.0),
        machine_ratio=ratio,
        machine_efficiency=arch.coupling.machine_efficiency,
        connected=connected,
    )


def even_shaft(arch: Architecture, demand: Demand, clutch: _Clutch) -> Iterator[Joint]:
    """E: the machine in each even gear; with the engine in an even gear both share that gear.

    At standstill the even shaft is in neutral and the engine can drive the machine.
    """
    idling = clutch.standing & clutch.on
    even = (demand.gear % 2 == 0) & (demand.gear > 0)
    for gear in range(2, len(arch.gearbox.ratios), 2):
        ratio = arch.gearbox.ratios[gear]
        shared = even & (demand.gear == gear) & ~idling if clutch.on else np.False_
        speed = ratio * demand.wheel_speed_radps
        yield _joint(
            clutch,
            upstream=idling,
            shared=shared,
            machine_speed=np.where(idling, clutch.engine_speed, speed),
            machine_accel=np.where(idling, 0.0, ratio * demand.wheel_accel_radps2),
            machine_gear=gear,
            machine_ratio=ratio,
            machine_efficiency=arch.gearbox.efficiency[gear],
            connected=idling | (speed > 0),
            possible=~even | (demand.gear == gear) | clutch.standing if clutch.on else np.True_,
        )


COUPLINGS: dict[str, Callable[[Architecture, Demand, _Clutch], Iterator[Joint]]] = {
    "none": crankshaft,
    "belt": crankshaft,
    "crankshaft": crankshaft,
    "gearbox_input": gearbox_input,
    "gearbox_output": gearbox_output,
    "even_shaft": even_shaft,
}
