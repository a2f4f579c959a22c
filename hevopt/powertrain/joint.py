"""Carried out of hevopt/couplings.py."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hevopt.car.architecture import Architecture
from hevopt.display.facts import Shown
from hevopt.driving.demand import Demand
from hevopt.driving.driver import launch_speed_radps

Array = NDArray[np.float64]


Flags = NDArray[np.bool_]


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Joint(Shown):
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
