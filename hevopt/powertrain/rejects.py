"""Why a control cannot be used: limits of the parts, and functions the architecture does not have."""

import numpy as np
from numpy.typing import NDArray

from hevopt.car.architecture import Architecture
from hevopt.driving.demand import Demand
from hevopt.powertrain.balance import Balance
from hevopt.powertrain.joint import Joint
from hevopt.problem.table import Reject

Array = NDArray[np.float64]
Bits = NDArray[np.uint16]

_TORQUE_TOLERANCE_NM = 1e-6
_POWER_TOLERANCE_W = 1e-6
_BOOST_SLACK_NM = 1e-3


def limit_rejects(
    architecture: Architecture, demand: Demand, joint: Joint, torques: Balance
) -> Bits:
    """Limits of engine, machine and shafts, whatever the architecture may do."""
    tolerance = _TORQUE_TOLERANCE_NM
    engine, machine = architecture.engine, architecture.machines[0]
    engine_speed, speed = joint.engine_speed_radps[:, None], joint.machine_speed_radps[:, None]
    full = engine.full_load_nm(engine_speed) if joint.engine_on else 0.0
    limit = machine.limit_nm(speed)
    torque = np.abs(torques.machine)
    wanted = demand.wheel_torque_nm[:, None]
    unmet = np.where(wanted > 0, np.abs(torques.brake), -torques.brake) > 10 * tolerance
    return (
        bits(Reject.ENGINE_TORQUE, torques.engine > full + tolerance)
        | bits(Reject.ENGINE_TORQUE, torques.engine < torques.least_engine - tolerance)
        | bits(Reject.ENGINE_SPEED, engine_speed > engine.speed_max_radps * (1 + 1e-12))
        | bits(Reject.MACHINE_LIMIT, torque > limit + tolerance)
        | bits(Reject.MACHINE_SPEED, joint.connected[:, None] & (speed > machine.speed_max_radps))
        | bits(Reject.NO_PATH, ~joint.connected[:, None] & (torque > tolerance))
        | bits(Reject.NO_PATH, joint.slipping[:, None] & (torques.clutch < -tolerance))
        | bits(Reject.NO_PATH, ~joint.possible[:, None] | unmet)
    )


def function_rejects(
    architecture: Architecture,
    demand: Demand,
    joint: Joint,
    torques: Balance,
    battery_power_w: Array,
) -> Bits:
    """Table 1: what the architecture's functions leave of the physically possible.

    start_stop            engine at rest while the car stands
    power_management      engine at rest, or dragged, while the machine drives; assistance
    nox_cut               assistance by the machine while the engine drives
    e_boost               assistance only beyond the engine's full load, or where a measured map ends below it
    regenerative_braking  charging while the car is braked
    Charging by the engine while it runs needs no function: any alternator does that.
    """
    has = architecture.functions.__contains__
    wanted = demand.wheel_torque_nm[:, None]
    standing = demand.wheel_speed_radps[:, None] == 0
    banned = np.zeros(torques.machine.shape, dtype=bool)
    if not joint.engine_on:
        banned |= standing & (not has("start_stop"))
        banned |= ~standing & (not has("power_management"))
    elif not has("power_management"):
        motoring = torques.machine > _TORQUE_TOLERANCE_NM
        banned |= motoring & (torques.engine <= 0)
        if not has("nox_cut"):
            speed = joint.engine_speed_radps[:, None]
            full = architecture.engine.covered_nm(speed)
            banned |= motoring & ~(has("e_boost") & (torques.engine > full - _BOOST_SLACK_NM))
    if not has("regenerative_braking"):
        banned |= (wanted < 0) & (battery_power_w < -_POWER_TOLERANCE_W)
    return bits(Reject.FUNCTION, banned)


def bits(reason: Reject, where: NDArray[np.bool_]) -> Bits:
    return np.where(where, np.uint16(reason), np.uint16(0))
