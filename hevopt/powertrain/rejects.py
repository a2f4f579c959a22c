"""Why a control cannot be used: limits of the parts, and functions the architecture does not have."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from hevopt.car.balance import directions, joints_of
from hevopt.car.driveline import BRAKE, ENGINE, State
from hevopt.car.parts import WHEEL
from hevopt.powertrain.operation import Setting
from hevopt.powertrain.torques import mapped_of
from hevopt.problem.arrays import Array, Flags
from hevopt.problem.reject import Reject

Bits = NDArray[np.uint16]

_TORQUE_TOLERANCE_NM = 1e-6
_POWER_TOLERANCE_W = 1e-6
_BOOST_SLACK_NM = 1e-3


def limit_rejects(here: Setting, torques: Mapping[str, Array]) -> Bits:
    """Limits of engine, machines and shafts, whatever the architecture may do; torques: (state, level)."""
    tolerance = _TORQUE_TOLERANCE_NM
    found = _engine_rejects(here, torques) if ENGINE in torques else np.zeros((1, 1), np.uint16)
    for name, machine in here.machines.items():
        speed = np.abs(here.speed_radps(name))[:, None]
        found = (
            found
            | bits(
                Reject.MACHINE_LIMIT,
                np.abs(torques[name])
                > machine.limit_nm(speed) * here.active(name)[:, None] + tolerance,
            )
            | bits(Reject.MACHINE_SPEED, speed > machine.speed_max_radps)
        )
    wanted, brake = here.shafts.wheel_nm[:, None], torques[BRAKE]
    # A torque converter may creep: the driver holds against it by the brakes.
    creeps = here.way.converter is not None
    unmet = np.where((wanted > 0) & (not creeps), np.abs(brake), brake) > 10 * tolerance
    if not _standing(here).all():
        found = found | bits(Reject.NO_PATH, ~_standing(here)[:, None] & unmet)
    for joint in joints_of(here.way):
        if joint.pushes:
            found = found | bits(Reject.NO_PATH, torques[joint.name] < -tolerance)
        if joint.lost is not None:
            off = here.torques.off_map(joint, torques[joint.name])
            found = found | bits(Reject.GEARBOX_MAP, off)
    for clutch in here.way.freed:
        if set(clutch.freed()) <= set(here.way.shafts):
            speeds = [c * here.shafts.speed_radps[s] for s, c in clutch.freed().items()]
            found = found | bits(Reject.NO_PATH, np.sum(speeds, axis=0)[:, None] < -tolerance)
    for torque in torques.values() if _may_fail(here) else ():
        unsolved = np.isnan(torque)
        if unsolved.any():
            found = found | bits(Reject.NO_PATH, unsolved)
    return found


def braking_rejects(here: Setting, torques: Mapping[str, Array], battery_power_w: Array) -> Bits:
    """Where machines brake the wheels more than their axle may; with a turning engine they may supply the load."""
    if not here.friction_nm.any():
        return np.zeros((1, 1), dtype=np.uint16)
    taken = battery_power_w
    if ENGINE not in torques:
        powers = (torques[name] * here.speed_radps(name)[:, None] for name in here.machines)
        taken = sum(powers, np.zeros((1, 1)))
    short = -torques[BRAKE] < here.friction_nm[:, None] - 10 * _TORQUE_TOLERANCE_NM
    return bits(Reject.BRAKING, short & (taken < -_POWER_TOLERANCE_W))


def _engine_rejects(here: Setting, torques: Mapping[str, Array]) -> Bits:
    engine, speed, tolerance = here.car.engine, here.engine_radps[:, None], _TORQUE_TOLERANCE_NM
    torque, least = torques[ENGINE], here.least_nm[:, None]
    slow = here.way.tied & (speed < engine.idle_radps * (1 - 1e-12))
    return (
        bits(
            Reject.ENGINE_TORQUE, torque > here.engine_nm(engine.full_load_nm)[:, None] + tolerance
        )
        | bits(Reject.ENGINE_TORQUE, torque < least - tolerance)
        | bits(Reject.ENGINE_SPEED, slow | (speed > engine.speed_max_radps * (1 + 1e-12)))
    )


def function_rejects(
    here: Setting, state: State, torques: Mapping[str, Array], battery_power_w: Array
) -> Bits:
    """Table 1: what the architecture's functions leave of the physically possible.

    start_stop            engine at rest while the car stands
    power_management      engine at rest, or dragged, while a machine drives; assistance
    nox_cut               assistance by a machine while the engine drives
    e_boost               assistance only beyond the engine's full load, or where a measured map ends below it
    regenerative_braking  charging while the car is braked
    Charging by the engine while it runs needs no function: any alternator does that.
    """
    has = here.car.functions.__contains__
    wanted, standing = here.shafts.wheel_nm[:, None], _standing(here)[:, None]
    banned = np.zeros((1, 1), dtype=bool)
    if not state.engine_on:
        if not here.car.electric:
            banned = (standing & (not has("start_stop"))) | (
                ~standing & (not has("power_management"))
            )
    elif not has("power_management"):
        motoring = np.zeros((1, 1), dtype=bool)
        for name in here.machines:
            motoring = motoring | (torques[name] > _TORQUE_TOLERANCE_NM)
        banned = motoring & (torques[ENGINE] <= 0)
        if not has("nox_cut"):
            full = here.engine_nm(here.car.engine.covered_nm)[:, None]
            banned = banned | motoring & ~(
                has("e_boost") & (torques[ENGINE] > full - _BOOST_SLACK_NM)
            )
    if not has("regenerative_braking"):
        banned = banned | (wanted < 0) & (battery_power_w < -_POWER_TOLERANCE_W)
    return bits(Reject.FUNCTION, banned)


def bits(reason: Reject, where: Flags) -> Bits:
    """The reason's bit where it holds."""
    return where.astype(np.uint16) * np.uint16(reason)


def _may_fail(here: Setting) -> bool:
    """Whether a balance may have no solution: where directions of power have to agree, or losses to settle."""
    return len(directions(here.way)) > 1 or bool(mapped_of(here.way))


def _standing(here: Setting) -> Flags:
    standing: Flags = here.shafts.speed_radps[WHEEL] == 0
    return standing
