"""The small parallel hybrid of DynaProg's example, with splits of any number, and a bound for all between them.

Controls are the gear, free in every second, and the share u of the torque asked at the crankshaft that the machine
gives, -1 to 1 in even steps. At u = 1 the engine rests, and its inertia asks for no torque. The engine's fuel is a
straight line between the torques of its map, and burns that of the map's least torque below it.

The bound: between two neighbouring splits fuel and battery power are at least the least of each there, found at the
ends, at the maps' torques in between and where the power of a generator is flat. A control of both least values is
as good as every split of the cell, so no plan of any splits costs less than the bound of a table of such controls.
"""

from collections.abc import Callable
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from hevopt.driving.cycle import load_cycle
from hevopt.problem.arrays import Array, Flags
from hevopt.problem.battery import Battery
from hevopt.problem.problem import Problem
from hevopt.problem.table import ControlTable
from hevopt.reproduction.scores import small_hybrid_data as data

CYCLE = "udds"
# Steps that are worked out at a time, for what they take of memory.
_BLOCK = 64


class _Asked(NamedTuple):
    """(time, gear) at the crankshaft: speed, torque without the engine's inertia, and that of the inertia."""

    speed_radps: Array
    torque_nm: Array
    inertia_nm: Array


class _Parts(NamedTuple):
    """(time, gear, split) fuel in kg/s, battery power in W, torques of engine and machine, and what can be used."""

    fuel_kgps: Array
    power_w: Array
    engine_nm: Array
    machine_nm: Array
    usable: Flags


def split_problem(splits: int) -> Problem:
    """UDDS with so many splits in each gear; end charge at least that of the start."""
    share = np.linspace(-1.0, 1.0, splits)

    def parts(asked: _Asked) -> _Parts:
        return _parts(asked, np.broadcast_to(share, (*asked.torque_nm.shape, splits)))

    return _problem(parts)


def relaxed_problem(splits: int) -> Problem:
    """A problem whose every bound is one of all splits: a control for each cell, least fuel with least power."""
    share = np.linspace(-1.0, 1.0, splits)

    def parts(asked: _Asked) -> _Parts:
        rest = _parts(asked, np.ones((*asked.torque_nm.shape, 1)))
        both = zip(_cells(asked, share[:-1], share[1:]), rest, strict=True)
        return _Parts(*(np.concatenate(pair, axis=2) for pair in both))

    return _problem(parts)


def _problem(parts: Callable[[_Asked], _Parts]) -> Problem:
    """The problem of some controls, without those that another beats in fuel and power."""
    asked = _asked()
    steps = len(asked.speed_radps)
    rows: list[tuple[Array, Array]] = []
    for begin in range(0, steps, _BLOCK):
        block = parts(_Asked(*(values[begin : begin + _BLOCK] for values in asked)))
        rows += map(_undominated, block.fuel_kgps, block.power_w, block.usable)
    width = max(len(fuel) for fuel, _ in rows)
    fuel, power = (np.full((steps, width), np.nan) for _ in range(2))
    for k, (fuel_kgps, power_w) in enumerate(rows):
        fuel[k, : len(fuel_kgps)], power[k, : len(power_w)] = fuel_kgps, power_w
    table = ControlTable.from_arrays(fuel, power, np.isfinite(fuel))
    pack = data.MODULES
    battery = Battery(
        np.linspace(0, 1, 11),
        data.MODULE_V * pack,
        data.DISCHARGE_OHM * pack,
        data.CHARGE_OHM * pack,
        data.CAPACITY_AS,
        data.COULOMBIC_EFFICIENCY,
        *data.SOC_WINDOW,
    )
    return Problem(table, battery, data.SOC_START, data.SOC_START)


def _undominated(fuel: Array, power: Array, usable: Flags) -> tuple[Array, Array]:
    """Fuel and power of a step's controls, by power, each of less fuel than those of less power."""
    fuel, power = fuel[usable], power[usable]
    order = np.lexsort((fuel, power))
    fuel, power = fuel[order], power[order]
    before = np.concatenate([[np.inf], np.minimum.accumulate(fuel)[:-1]])
    return fuel[fuel < before], power[fuel < before]


@lru_cache
def _asked() -> _Asked:
    """What the cycle asks for in each gear: speed at a second's start, acceleration to its end."""
    speed = load_cycle(CYCLE).speed_mps
    speed, accel = speed[:-1], np.diff(speed)
    moving = speed != 0
    drag_n = data.MASS_KG * (data.GRAVITY_MPS2 * data.ROLLING + accel)
    force_n = moving * (drag_n + data.DRAG_NPM2S2 * speed**2)
    wheel_nm = (force_n * data.WHEEL_RADIUS_M + data.AXLE_LOSS_NM * moving)[:, None]
    crank = data.GEAR_RATIOS / data.WHEEL_RADIUS_M
    efficiency = data.GEARBOX_EFFICIENCY
    through_nm = np.where(wheel_nm > 0, wheel_nm / efficiency, wheel_nm * (2 - efficiency))
    inertia_nm = data.ENGINE_INERTIA_KGM2 * crank * accel[:, None]
    return _Asked(crank * speed[:, None], through_nm / data.GEAR_RATIOS, inertia_nm)


def _parts(asked: _Asked, share: Array) -> _Parts:
    """What shares of the machine, (time, gear, split), take; the engine rests at a share of 1."""
    speed = asked.speed_radps[..., None]
    wanted = asked.torque_nm[..., None] + asked.inertia_nm[..., None] * (share != 1)
    turning = speed > 0
    engine = turning * (wanted > 0) * (1 - share) * wanted
    machine = turning * share * wanted / data.MACHINE_RATIO
    usable = ~((wanted < 0) & (machine > 0))
    known = (speed >= data.ENGINE_SPEED_RADPS[0]) & (speed <= data.ENGINE_SPEED_RADPS[-1])
    usable &= (engine <= _most(speed, data.ENGINE_SPEED_RADPS, data.ENGINE_MOST_NM)) & (
        known | (engine == 0)
    )
    shaft = data.MACHINE_RATIO * speed
    usable &= np.abs(machine) <= _most(shaft, data.MACHINE_SPEED_RADPS, data.MACHINE_MOST_NM)
    return _Parts(_fuel_kgps(speed, engine), _battery_w(shaft, machine), engine, machine, usable)


def _most(speed: Array, knots: Array, torque: Array) -> Array:
    return np.interp(speed, knots, torque)


def _fuel_kgps(speed: Array, torque: Array) -> Array:
    """Fuel, 0 at rest; the map's nearest value beyond it."""
    knots = data.ENGINE_TORQUE_NM
    work_w = data.ENGINE_SPEED_RADPS[:, None] * knots
    held = np.clip(speed, data.ENGINE_SPEED_RADPS[0], data.ENGINE_SPEED_RADPS[-1])
    inside = np.clip(torque, knots[0], knots[-1])
    fuel = _bilinear(
        data.ENGINE_SPEED_RADPS, knots, data.ENGINE_FUEL_GPKWH * work_w / 3.6e9, held, inside
    )
    return np.where(torque == 0, 0.0, fuel)


def _battery_w(speed: Array, torque: Array) -> Array:
    """Power at the terminals: the machine's, by its efficiency, and the auxiliaries, behind the inverter."""
    efficiency = _efficiency(speed, torque)
    shaft_w = speed * torque
    electric_w = np.where(torque < 0, shaft_w * efficiency, shaft_w / efficiency)
    bus_w = electric_w + data.AUXILIARIES_W
    return np.where(bus_w > 0, bus_w / data.INVERTER_EFFICIENCY, bus_w * data.INVERTER_EFFICIENCY)


def _efficiency(speed: Array, torque: Array) -> Array:
    speeds, torques = data.MACHINE_SPEED_RADPS, data.MACHINE_TORQUE_NM
    held, inside = np.clip(speed, 0.0, speeds[-1]), np.clip(torque, torques[0], torques[-1])
    return _bilinear(speeds, torques, data.MACHINE_EFFICIENCY, held, inside)


def _bilinear(rows: Array, columns: Array, values: Array, at_row: Array, at_column: Array) -> Array:
    i = np.clip(np.searchsorted(rows, at_row, "right") - 1, 0, len(rows) - 2)
    j = np.clip(np.searchsorted(columns, at_column, "right") - 1, 0, len(columns) - 2)
    s = (at_row - rows[i]) / (rows[i + 1] - rows[i])
    t = (at_column - columns[j]) / (columns[j + 1] - columns[j])
    low = values[i, j] * (1 - t) + values[i, j + 1] * t
    high = values[i + 1, j] * (1 - t) + values[i + 1, j + 1] * t
    found: Array = low * (1 - s) + high * s
    return found


def _cells(asked: _Asked, low: Array, high: Array) -> _Parts:
    """The least fuel and the least power of every cell, each between two shares below 1, the high one left out."""
    shape = (*asked.torque_nm.shape, len(low))
    # Shares just below 1 turn the engine, 1 does not: the end of the last cell is taken from below.
    ends = [np.broadcast_to(low, shape), np.broadcast_to(np.minimum(high, 1 - 1e-12), shape)]
    first, last = (_parts(asked, end) for end in ends)
    speed = asked.speed_radps[..., None]
    fuel, power = (
        np.minimum(first.fuel_kgps, last.fuel_kgps),
        np.minimum(first.power_w, last.power_w),
    )
    for knot in data.ENGINE_TORQUE_NM:
        within = _within(knot, first.engine_nm, last.engine_nm)
        at = _fuel_kgps(asked.speed_radps, np.full_like(asked.speed_radps, knot))[..., None]
        fuel = np.where(within, np.minimum(fuel, at), fuel)
    shaft = data.MACHINE_RATIO * asked.speed_radps
    for torque in _flat_torques(shaft):
        within = _within(torque[..., None], first.machine_nm, last.machine_nm)
        power = np.where(within, np.minimum(power, _battery_w(shaft, torque)[..., None]), power)
    return _Parts(fuel, power, first.engine_nm, first.machine_nm, _reached(speed, first, last))


def _within(torque: Array | float, one: Array, other: Array) -> Flags:
    inside: Flags = (np.minimum(one, other) < torque) & (torque < np.maximum(one, other))
    return inside


def _flat_torques(speed: Array) -> list[Array]:
    """(time, gear) torques at which the machine's power may be least: its map's, and where it is flat."""
    knots = data.MACHINE_TORQUE_NM
    found = [np.full_like(speed, knot) for knot in knots]
    at = [_efficiency(speed, np.full_like(speed, knot)) for knot in knots]
    for n in range(len(knots) - 1):
        slope = (at[n + 1] - at[n]) / (knots[n + 1] - knots[n])
        constant = at[n] - slope * knots[n]
        # T (constant + slope T) is flat at - constant / (2 slope); T / (constant + slope T) nowhere.
        flat = -constant / np.where(slope == 0, np.inf, 2 * slope)
        found.append(np.clip(flat, knots[n], knots[n + 1]))
    return found


def _reached(speed: Array, first: _Parts, last: _Parts) -> Flags:
    """Whether some split of a cell can be used: its torques meet both limits, no machine pushes a brake."""
    known = (speed >= data.ENGINE_SPEED_RADPS[0]) & (speed <= data.ENGINE_SPEED_RADPS[-1])
    engine_most = _most(speed, data.ENGINE_SPEED_RADPS, data.ENGINE_MOST_NM)
    shaft = data.MACHINE_RATIO * speed
    machine_most = _most(shaft, data.MACHINE_SPEED_RADPS, data.MACHINE_MOST_NM)
    least_engine = np.minimum(first.engine_nm, last.engine_nm)
    low = np.minimum(first.machine_nm, last.machine_nm)
    high = np.maximum(first.machine_nm, last.machine_nm)
    # Torques of one sign for one that is asked: below 0 the machine may brake alone, u >= 0.
    braking = (first.engine_nm == 0) & (last.engine_nm == 0)
    pushing = braking & (low > 0)
    reached: Flags = (
        (least_engine <= engine_most)
        & (known | braking)
        & (low <= machine_most)
        & (high >= -machine_most)
        & ~pushing
    )
    return reached
