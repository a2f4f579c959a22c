"""A car's limits over speed, tabulated from its components for the loop."""

import numpy as np

from hevopt.car.architecture import Architecture
from hevopt.car.machine import Machine
from hevopt.forward._limits_kernels import Limits
from hevopt.problem.arrays import Array
from hevopt.problem.battery import power_limits_w

_ENGINE_STEP_RADPS = 0.25
_MACHINE_POINTS = 1201
_TORQUES = 201
# Beyond its highest speed by this share an engine is not tabulated, and neither is a machine.
_BEYOND = 1.2
# Steps of a table of the braking that a machine may take: speed, and braking force over weight.
_BRAKING_MPS, _BRAKING_RATE = 0.25, 0.01
# Machines without a limit of their own are tabulated up to these.
_FASTEST_RADPS, _STRONGEST_NM = 2e4, 1e4


def limits_of(car: Architecture) -> Limits:
    """The limits of a car with one machine."""
    engine, machine = car.engine, car.machines[0]
    speed = np.arange(0.0, _BEYOND * engine.speed_max_radps, _ENGINE_STEP_RADPS)
    least = np.nan_to_num(engine.drag_nm(speed))
    full = engine.covered_nm(speed)
    full = np.where(np.isnan(full) | (speed > engine.speed_max_radps), np.maximum(least, 0.0), full)
    load = np.zeros(0)
    if car.driveline.follows_load:
        turning = np.maximum(speed, 0.3 * engine.idle_radps)
        load = np.nan_to_num(machine.generating_nm(car.vehicle.auxiliary_power_w, turning))
    top = min(machine.speed_max_radps, _FASTEST_RADPS)
    machine_speed = np.linspace(0.0, _BEYOND * top, _MACHINE_POINTS)
    most = float(min(machine.torque_max_nm, _STRONGEST_NM))
    torque = np.linspace(-most, most, _TORQUES)
    loss = np.nan_to_num(machine.loss_w(torque[None, :], machine_speed[:, None]))
    low, high = _allowed(car, machine, machine_speed)
    return Limits(
        _ENGINE_STEP_RADPS, full, least, load, float(machine_speed[1]), low, high, loss, most,
        engine.idle_radps, engine.speed_max_radps, car.vehicle.auxiliary_power_w,
        machine.spin_efficiency, _braking_share(car), _BRAKING_MPS, _BRAKING_RATE,
        bool(car.functions & {"e_boost", "nox_cut", "power_management"}),
        "regenerative_braking" in car.functions,
    )  # fmt: skip


def _braking_share(car: Architecture) -> Array:
    """(speed, rate) share of the braking that may pass the machine's axle."""
    braking = car.vehicle.braking
    if braking is None or "regenerative_braking" not in car.functions:
        return np.zeros((0, 0))
    speed = _BRAKING_MPS * np.arange(241, dtype=np.float64)
    rate = _BRAKING_RATE * np.arange(121, dtype=np.float64)
    return np.ascontiguousarray(braking.share(speed[:, None], rate[None, :]), dtype=np.float64)


def _allowed(car: Architecture, machine: Machine, speed: Array) -> tuple[Array, Array]:
    """(speed,) lowest and highest torque that machine and battery allow."""
    limit = np.minimum(machine.limit_nm(speed), _STRONGEST_NM)
    limit = np.where(speed <= machine.speed_max_radps, limit, 0.0)
    share = np.linspace(-1.0, 1.0, 2 * _TORQUES + 1)
    torque = limit[:, None] * share
    loss = np.nan_to_num(machine.loss_w(torque, speed[:, None]), nan=np.inf)
    power = torque * speed[:, None] + loss + car.vehicle.auxiliary_power_w
    least, greatest = power_limits_w(car.battery)
    inside = (power >= least) & (power <= greatest) | (share == 0)
    high = np.max(np.where(inside, torque, 0.0), axis=1)
    # Beyond the torque of least electric power more braking charges less.
    best = np.argmin(np.where(inside, power, np.inf), axis=1)
    return np.minimum(torque[np.arange(len(speed)), best], 0.0), high
