"""The step of the public learning benchmark DRL-Base-EMS as a control table, on UDDS.

Its agent sets the mechanical power of the machine in one of 2000 even steps; the engine gives the rest of what the
wheels ask, at most a sixth of its power more than a second before. Braking and standing leave nothing to choose.
That ramp is a discrete state here: a band of engine power. `ramp="inner"` allows a jump between bands where it is
allowed from and to any power of them, so that each plan drives in its own step; `"outer"` where it is allowed from
and to some, so that a bound holds for the exact ramp.

Its step knows the charge in three places: charge near a limit of the window, an engine that charges below a band
kept for pulling away, and a lock at a charge of 0.6 that takes the agent's action away. The table is that of
charges within SOC_BAND, where only the lock is left, and without the lock; with it: highlander_agent.py.
"""

from dataclasses import replace
from functools import lru_cache
from typing import Literal, NamedTuple

import numpy as np

from hevopt.driving.cycle import load_cycle
from hevopt.problem.arrays import Array, Flags, Indices
from hevopt.problem.battery import Battery
from hevopt.problem.problem import Problem
from hevopt.problem.table import ControlTable, Signals
from hevopt.reproduction.scores import highlander_data as data

CYCLE = "udds"
# Bands of engine power in what it may gain in a second, the step's length.
BANDS = 4
RAMP_KW = data.ENGINE_MOST_KW / data.ENGINE_RAMP_S
# Charge kept for pulling away from rest, and that free for braking from the cycle's most speed, 25.4 m/s.
SOC_BAND = (0.481, 0.70)
_MPS_PER_MPH = 0.44704
_VOLTS = 300.0
_ROOT = float(np.sqrt(data.ROUND_TRIP))


class HighlanderAsked(NamedTuple):
    """(time,) speed at a second's end, m/s, power before the gearbox, kW, whether it stands or creeps, and whether
    the agent chooses: where power is asked, but not creeping once the engine has been on for half a minute"""

    speed_mps: Array
    power_kw: Array
    creeping: Flags
    chosen: Flags


@lru_cache
def asked() -> HighlanderAsked:
    """What its car asks of the drive in every second of the cycle."""
    # Its speeds are the schedule's tenths of a mile per hour, by its own factor.
    speed = np.round(load_cycle(CYCLE).speed_mps / _MPS_PER_MPH, 1) / data.MPH_PER_MPS
    before, after = speed[:-1], speed[1:]
    mean = (before + after) / 2
    drag = 0.5 * data.AIR_KGPM3 * data.DRAG_AREA_M2 * mean**3
    inertia = data.MASS_KG + data.WHEELS * data.WHEEL_INERTIA_KGM2 / data.WHEEL_RADIUS_M**2
    rolling = data.GRAVITY_MPS2 * data.ROLLING * data.MASS_KG * mean
    wheel_kw = (drag + inertia * (after**2 - before**2) / 2 + rolling) / 1e3
    faded = 1 + data.REGEN_A * np.exp(-data.REGEN_B * (mean * data.MPH_PER_MPS + 1))
    regained_kw = np.minimum(
        charging_most_kw() * data.TRANSMISSION_EFFICIENCY, data.REGEN_MOST / faded * -wheel_kw
    )
    out_kw = np.where(wheel_kw > 0, wheel_kw, -np.maximum(regained_kw, 0.0))
    efficiency = data.TRANSMISSION_EFFICIENCY
    power_kw = np.where(out_kw > 0, out_kw / efficiency, out_kw * efficiency)
    creeping = after * data.MPH_PER_MPS - 1e-5 <= data.ELECTRIC_BELOW_MPH
    return HighlanderAsked(after, power_kw, creeping, (power_kw > 0) & ~_electric(creeping))


def _electric(creeping: Flags) -> Flags:
    """(time,) where the machine gives all by itself: creeping, unless the engine came on less than 29 s before."""
    electric, on_s = np.zeros_like(creeping), 0.0
    for k, slow in enumerate(creeping):
        electric[k] = slow and not 0 < on_s < data.ENGINE_LEAST_ON_S - 1
        on_s = 0.0 if electric[k] else on_s + 1
    return electric


def charging_most_kw() -> float:
    """Most mechanical power of the machine as a generator, as its step takes it from the battery's."""
    held = _held(data.MACHINE_OUT_KW, data.BATTERY_MOST_KW)
    return float(data.BATTERY_MOST_KW / data.MACHINE_EFFICIENCY[held])


def actions(count: int = data.ACTIONS) -> Indices:
    """So many of the agent's actions, evenly, first and last among them."""
    return np.unique(np.round(np.linspace(0, data.ACTIONS - 1, count)).astype(np.int64))


def machine_kw(action: Indices, asked_kw: Array | float) -> Array:
    """What an action sets the machine to, not more than the drive asks."""
    most = charging_most_kw()
    wanted = action / (data.ACTIONS - 1) * 2 * most - most
    return np.minimum(asked_kw, wanted)


def electric_kw(mechanical_kw: Array) -> Array:
    """Electric power of the machine at a mechanical one; its efficiency is that of the hundredth below."""
    drive = data.MACHINE_EFFICIENCY[_held(data.MACHINE_OUT_KW, np.maximum(mechanical_kw, 0.0))]
    regain = data.MACHINE_EFFICIENCY[_held(data.MACHINE_IN_KW, np.maximum(-mechanical_kw, 0.0))]
    found: Array = np.where(mechanical_kw > 0, mechanical_kw / drive, mechanical_kw * regain)
    return found


def drained_kw(mechanical_kw: Array) -> Array:
    """Rate at which stored energy falls: machine and auxiliaries, and the battery's efficiency."""
    electric = electric_kw(mechanical_kw) + data.AUXILIARIES_KW
    return np.where(electric < 0, electric * _ROOT, electric / _ROOT)


def fuel_kw(engine_kw: Array) -> Array:
    """Power of the fuel burnt at an engine power; none at rest."""
    share = engine_kw / data.ENGINE_MOST_KW
    burnt: Array = engine_kw / np.interp(share, data.ENGINE_SHARE, data.ENGINE_EFFICIENCY)
    return burnt


def fuel_kg(energy_kwh: Array) -> Array:
    """Mass of fuel of an energy, by its gallon."""
    return energy_kwh * (data.KG_PER_GALLON / data.KWH_PER_GALLON)


def braking_kw(soc: Array | float) -> Array:
    """(time,) or, with charges (charge, 1), (charge, time) power of the machine where the drive asks nothing.

    All that is regained; rolling faster than a walk, at least what feeds the auxiliaries, if not by the brakes then
    by the engine, unless charge is above that kept free for braking by more than they take.
    """
    car = asked()
    free = 0.5 * data.MASS_KG * car.speed_mps**2 / 3.6e6 * data.MACHINE_PEAK * data.REGEN_MOST
    kept = np.maximum(data.SOC_MOST - free / data.BATTERY_KWH, data.SOC_LEAST)
    above_kw = np.clip((soc - kept) * data.BATTERY_KWH * 3600, 0.0, data.BATTERY_MOST_KW)
    feed_kw = np.minimum(above_kw - data.AUXILIARIES_KW, 0.0)
    feed_kw = feed_kw / data.MACHINE_EFFICIENCY[_held(data.MACHINE_IN_KW, -feed_kw)]
    regained = np.minimum(car.power_kw, 0.0)
    found: Array = np.where(car.creeping, regained, np.minimum(regained, feed_kw))
    return found


def problem(
    count: int,
    ramp: Literal["inner", "outer"] = "inner",
    soc_end: float = data.SOC_START,
) -> Problem:
    """UDDS with so many of the 2000 actions; end charge at least soc_end."""
    car, rows = asked(), _rows(count)
    bands = 1 + max(int(band[-1]) for band, _ in rows)
    slots = max(int(np.bincount(band).max()) for band, _ in rows)
    machine = np.full((len(rows), bands * slots), np.nan)
    for k, (band, mechanical) in enumerate(rows):
        first = np.searchsorted(band, band)
        machine[k, band * slots + np.arange(len(band)) - first] = mechanical
    engine = np.maximum(car.power_kw[:, None] - machine, 0.0)
    step = BANDS - 1 if ramp == "inner" else BANDS + 1
    jump = np.arange(bands) - np.arange(bands)[:, None]
    table = ControlTable.from_arrays(
        fuel_kg(fuel_kw(engine) / 3600),
        drained_kw(np.nan_to_num(machine)) * 1e3,
        np.isfinite(machine),
        mode=np.repeat(np.arange(bands), slots),
        switch_fuel_kg=np.zeros((bands, bands)),
        switch_allowed=jump <= step,
    )
    return Problem(_seen(table), _battery(), data.SOC_START, soc_end)


def _rows(count: int) -> list[tuple[Indices, Array]]:
    """For each second, by band of engine power: the bands, and the machine's powers, each once."""
    car, action = asked(), actions(count)
    alone = np.where(car.power_kw > 0, car.power_kw, braking_kw(data.SOC_START))
    rows = []
    for asked_kw, chosen, only in zip(car.power_kw, car.chosen, alone, strict=True):
        mechanical = np.unique(machine_kw(action, asked_kw))[::-1] if chosen else only[None]
        engine = np.maximum(asked_kw - mechanical, 0.0)
        rows.append(((engine / RAMP_KW * BANDS).astype(np.int64), mechanical))
    return rows


def _seen(table: ControlTable) -> ControlTable:
    """The table with what a rule looks at; the first control is that of the machine alone."""
    car = asked()
    none = np.zeros(len(car.speed_mps))
    signals = Signals(car.speed_mps, car.power_kw * 1e3, none.astype(np.int64), none != 0)
    controls = (table.controls[0]._replace(engine_on=False), *table.controls[1:])
    return replace(table, signals=signals, controls=controls)


def _battery() -> Battery:
    """Its energy without losses, which the table's power carries, as they are of one efficiency each way."""
    nothing = np.zeros(2)
    capacity = data.BATTERY_KWH * 3.6e6 / _VOLTS
    voltage = np.full(2, _VOLTS)
    return Battery(np.array([0.0, 1.0]), voltage, nothing, nothing, capacity, 1.0, *SOC_BAND)


def _held(knots: Array, power_kw: Array | float) -> Indices:
    """Index of the hundredth at or below a power, from the first on."""
    below: Indices = np.searchsorted(knots, np.minimum(power_kw, knots[-1] - 0.01), "right") - 1
    return np.maximum(below, 1)
