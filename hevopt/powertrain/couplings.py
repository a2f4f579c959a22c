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
from dataclasses import replace

import numpy as np

from hevopt.car.architecture import Architecture
from hevopt.driving.demand import Demand
from hevopt.powertrain.joint import Flags, Joint, _Clutch, _clutch, _joint


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
        connected = connected & (speed <= arch.machines[0].speed_max_radps)
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
