"""A car's limits over speed, tabulated from its components for the loop."""

from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from hevopt.car.architecture import Architecture
from hevopt.car.converter import Converter
from hevopt.car.machine import Machine
from hevopt.forward._beside_kernels import Beside
from hevopt.forward._limits_kernels import Limits, Motors
from hevopt.problem.arrays import Array
from hevopt.problem.battery import Battery, power_limits_w

_ENGINE_STEP_RADPS = 0.25
_MACHINE_POINTS = 1201
_TORQUES = 201
# Loads at which the torque of an alternator is tabulated where the cycle lists the load.
_LOADS = 33
# Beyond its highest speed by this share an engine is not tabulated, and neither is a machine.
_BEYOND = 1.2
# Share of its highest speed up to which a machine beside a free engine speed keeps what torque it has there [E].
_A_LITTLE = 1.02
# Steps of a table of the braking that a machine may take: speed, and braking force over weight.
_BRAKING_MPS, _BRAKING_RATE = 0.25, 0.01
# Speeds at a time for which torques that battery and machine allow are searched: what memory close by holds.
_ROWS = 32
# Machines of which the tables are kept, for cars that differ in something else.
_KEPT = 8
# Machines without a limit of their own are tabulated up to these.
_FASTEST_RADPS, _STRONGEST_NM = 2e4, 1e4


def limits_of(
    car: Architecture, loads_w: tuple[float, float] | None = None, first: int = 0
) -> Limits:
    """The limits of a car and one of its machines; loads_w: least and greatest electric load, None for its own."""
    own_w = car.vehicle.auxiliary_power_w
    least_w, most_w = loads_w or (own_w, own_w)
    engine, machine = car.engine, car.machines[first]
    speed = np.arange(0.0, _BEYOND * engine.speed_max_radps, _ENGINE_STEP_RADPS)
    # Idle speed lies between two of these speeds, of which a map may not know the lower one.
    near = (speed < engine.idle_radps) & (speed > engine.idle_radps - _ENGINE_STEP_RADPS)
    least = np.nan_to_num(engine.drag_nm(np.where(near, engine.idle_radps, speed)))
    full = engine.covered_nm(speed)
    full = np.where(np.isnan(full) | (speed > engine.speed_max_radps), np.maximum(least, 0.0), full)
    if car.driveline.free_engine_speed or car.driveline.converter is not None:
        # Kept at idle speed by a machine, or loaded there by a converter, it gives what it has there, below it too.
        at_idle = float(engine.covered_nm(np.array([engine.idle_radps]))[0])
        full = np.where(speed < engine.idle_radps, at_idle, full)
    load, rows = np.zeros((0, len(speed))), _LOADS if most_w > least_w else 1
    if car.driveline.follows_load:
        turning = np.maximum(speed, 0.3 * engine.idle_radps)
        given = (
            machine.generating_nm(w, turning) for w in np.linspace(least_w, most_w, rows).tolist()
        )
        load = np.nan_to_num(np.array(list(given)))
    machine_speed, most, loss = _tabulated(machine)
    low, high = _allowed(machine, car.battery, car.converter, (least_w, most_w))
    return Limits(
        _ENGINE_STEP_RADPS, full, least, load, float(least_w), float(most_w - least_w) / max(rows - 1, 1),
        float(machine_speed[1]), low, high, loss, most, engine.idle_radps, engine.speed_max_radps, own_w,
        max(each.spin_efficiency for each in car.machines), _braking_share(car), _BRAKING_MPS, _BRAKING_RATE,
        *_converting(car),
        bool(car.functions & {"e_boost", "nox_cut", "power_management"}),
        "regenerative_braking" in car.functions,
    )  # fmt: skip


def beside_of(
    car: Architecture, others: Sequence[int], loads_w: tuple[float, float] | None
) -> Beside:
    """The limits of some machines of a car, each as if the battery were its alone."""
    own_w = car.vehicle.auxiliary_power_w
    count, points = len(others), _MACHINE_POINTS
    found = Beside(
        np.zeros(count), np.zeros((count, points)), np.zeros((count, points)), np.zeros((count, points, _TORQUES)),
        np.zeros(count), *map(float, power_limits_w(car.battery)),
    )  # fmt: skip
    for n, machine in enumerate(car.machines[other] for other in others):
        speed, found.most_nm[n], found.loss_w[n] = _tabulated(machine)
        found.step_radps[n] = speed[1]
        allowed = _allowed(machine, car.battery, car.converter, loads_w or (own_w, own_w))
        found.low_nm[n], found.high_nm[n] = allowed
    return found


def motors_of(car: Architecture) -> Motors:
    """The limits of every machine of a car, and of its battery."""
    tables = [_tabulated(machine) for machine in car.machines]
    speeds, most, losses = (list(parts) for parts in zip(*tables, strict=True))
    # One that a step takes a little beyond its highest speed still brakes itself and the engine.
    limits = [
        np.where(speed <= _A_LITTLE * top, machine.limit_nm(np.minimum(speed, top)), 0.0)
        for machine, speed in zip(car.machines, speeds, strict=True)
        for top in (machine.speed_max_radps,)
    ]
    least_w, most_w = power_limits_w(car.battery)
    top = np.array([machine.speed_max_radps for machine in car.machines])
    return Motors(
        np.array([speed[1] for speed in speeds]), np.minimum(np.array(limits), _STRONGEST_NM), np.array(losses),
        np.array(most), top, float(least_w), float(most_w),
    )  # fmt: skip


@lru_cache(maxsize=_KEPT)
def _tabulated(machine: Machine) -> tuple[Array, float, Array]:
    """Speeds, highest torque, and (speed, torque) loss of a machine up to that torque of either sign."""
    top = min(machine.speed_max_radps, _FASTEST_RADPS)
    speed = np.linspace(0.0, _BEYOND * top, _MACHINE_POINTS)
    known = np.where(speed <= machine.speed_max_radps, machine.limit_nm(speed), 0.0)
    most = min(float(known.max()), _STRONGEST_NM)
    torque = np.linspace(-most, most, _TORQUES)
    return speed, most, np.nan_to_num(machine.loss_w(torque[None, :], speed[:, None]))


def _converting(car: Architecture) -> tuple[Array, Array]:
    """Powers at the bus and shares that pass a converter; empty without one."""
    if car.converter is None:
        return np.zeros(0), np.zeros(0)
    points = car.converter.power_w, car.converter.efficiency
    power_w, share = (np.ascontiguousarray(values, dtype=np.float64) for values in points)
    return power_w, share


def _braking_share(car: Architecture) -> Array:
    """(speed, rate) share of the braking that may pass the machine's axle."""
    braking = car.vehicle.braking
    if braking is None or "regenerative_braking" not in car.functions:
        return np.zeros((0, 0))
    speed = _BRAKING_MPS * np.arange(241, dtype=np.float64)
    rate = _BRAKING_RATE * np.arange(121, dtype=np.float64)
    return np.ascontiguousarray(braking.share(speed[:, None], rate[None, :]), dtype=np.float64)


@lru_cache(maxsize=_KEPT)
def _allowed(
    machine: Machine, battery: Battery, converter: Converter | None, loads_w: tuple[float, float]
) -> tuple[Array, Array]:
    """(speed,) lowest and highest torque that machine and battery allow at any of the loads."""
    speed, _, _ = _tabulated(machine)
    limit = np.minimum(machine.limit_nm(speed), _STRONGEST_NM)
    limit = np.where(speed <= machine.speed_max_radps, limit, 0.0)
    share = np.linspace(-1.0, 1.0, 2 * _TORQUES + 1)
    least, greatest = power_limits_w(battery)
    low, high = np.zeros(len(speed)), np.zeros(len(speed))
    for first in range(0, len(speed), _ROWS):
        rows = slice(first, first + _ROWS)
        torque = limit[rows, None] * share
        drawn = np.nan_to_num(machine.loss_w(torque, speed[rows, None]), nan=np.inf)
        drawn += torque * speed[rows, None]
        gentle, power = (drawn + load_w for load_w in loads_w)
        if converter is not None:
            gentle, power = converter.terminal_w(gentle), converter.terminal_w(power)
        inside = (gentle >= least) & (power <= greatest) | (share == 0)
        high[rows] = np.max(np.where(inside, torque, 0.0), axis=1)
        # Beyond the torque of least electric power more braking charges less.
        best = np.argmin(np.where(inside, power, np.inf), axis=1)
        low[rows] = np.minimum(torque[np.arange(len(torque)), best], 0.0)
    return low, high
