"""What an agent of DRL-Base-EMS comes to that has learnt all that its reward and its step let it.

Its reward of a second is minus the energy of the fuel, that of the second before, and of the charge taken, a kWh of
charge counted like one of fuel; over a drive that begins and ends at rest, minus the sum of both. At or below a
charge of 0.6 its step ignores the action and sets the machine to the power of the auxiliaries. Near the best such
agent is a backward recursion over charge, without the engine's ramp and with values straight between charges, which
the jump at the lock is not; it then drives in its step, with the ramp, each second by the action of the most reward
and the most to come.
"""

from typing import NamedTuple

import numpy as np

from hevopt.problem.arrays import Array, Indices
from hevopt.reproduction.scores import highlander as car
from hevopt.reproduction.scores import highlander_data as data

# Charges of the recursion: every 0.0001, 0.6 among them, over the band in which the step is that of the table.
_SOCS = np.arange(4810, 7001) / 10_000
# Of a kWh of charge: less is no use at the end (`keeps`), and beyond the band there is no way.
_MISSING, _BEYOND = 10.0, 1e3


class AgentGoal(NamedTuple):
    """What an agent is after. locked: its step ignores it at and below a charge of 0.6; keeps: it wants the least
    fuel with as much charge at the end as at the start, instead of its reward
    """

    locked: bool
    keeps: bool


class AgentDrive(NamedTuple):
    """machine_kw, engine_kw: (time,) mechanical powers; soc: (time + 1,); fuel_kwh, reward: of the whole drive;
    action: (time,) what was taken, -1 where there was none to take"""

    machine_kw: Array
    engine_kw: Array
    soc: Array
    action: Indices
    fuel_kwh: float
    reward: float


def driven(goal: AgentGoal, count: int) -> AgentDrive:
    """UDDS by the agent of a goal, with so many of the 2000 actions."""
    asked, actions = car.asked(), car.actions(count)
    to_go = _to_go_kwh(goal, actions)
    steps = len(asked.power_kw)
    machine, engine = np.zeros(steps), np.zeros(steps)
    soc, taken = np.full(steps + 1, data.SOC_START), np.full(steps, -1)
    before_kw = 0.0
    alone = _alone_kw()
    for k, asked_kw in enumerate(asked.power_kw):
        machine[k] = alone[k]
        if asked.chosen[k] and goal.locked and soc[k] <= data.LOCK_SOC:
            machine[k] = data.AUXILIARIES_KW
        elif asked.chosen[k]:
            least_kw = asked_kw - before_kw - car.RAMP_KW
            options = np.maximum(car.machine_kw(actions, asked_kw), least_kw)
            fuel, drained = _energies_kwh(options, asked_kw)
            chosen = int(np.argmin(fuel + _at(to_go[k + 1], soc[k] - drained / data.BATTERY_KWH)))
            machine[k], taken[k] = options[chosen], actions[chosen]
        engine[k] = before_kw = max(0.0, asked_kw - machine[k])
        soc[k + 1] = soc[k] - car.drained_kw(machine[k]) / 3600 / data.BATTERY_KWH
    fuel_kwh = float(car.fuel_kw(engine).sum() / 3600)
    reward = -(fuel_kwh + (soc[0] - soc[-1]) * data.BATTERY_KWH) / 0.01
    return AgentDrive(machine, engine, soc, taken, fuel_kwh, reward)


def _to_go_kwh(goal: AgentGoal, actions: Indices) -> Array:
    """(time + 1, charge) least fuel to go, less what the charge at the end is worth to the agent."""
    asked, alone = car.asked(), _alone_kw()
    steps = len(asked.power_kw)
    to_go = np.zeros((steps + 1, len(_SOCS)))
    missing = np.maximum(data.SOC_START - _SOCS, 0.0)
    to_go[-1] = data.BATTERY_KWH * (_MISSING * missing if goal.keeps else -_SOCS)
    locked = goal.locked & (_SOCS <= data.LOCK_SOC)
    for k in range(steps - 1, -1, -1):
        asked_kw = asked.power_kw[k]
        if not asked.chosen[k]:
            to_go[k] = _led(to_go[k + 1], np.array([alone[k]]), asked_kw)
            continue
        free = _led(to_go[k + 1], np.unique(car.machine_kw(actions, asked_kw)), asked_kw)
        held = _led(to_go[k + 1], np.array([data.AUXILIARIES_KW]), asked_kw)
        to_go[k] = np.where(locked, held, free)
    return to_go


def _led(after: Array, machine_kw: Array, asked_kw: float) -> Array:
    """(charge,) the least of fuel and what is to go after it, over the machine's powers."""
    fuel, drained = _energies_kwh(machine_kw, asked_kw)
    led: Array = np.min(fuel + _at(after, _SOCS[:, None] - drained / data.BATTERY_KWH), axis=1)
    return led


def _at(values: Array, soc: Array) -> Array:
    """Values between charges; beyond the band much more, and the more the further."""
    beyond = np.maximum(_SOCS[0] - soc, 0.0) + np.maximum(soc - _SOCS[-1], 0.0)
    found: Array = np.interp(soc, _SOCS, values) + _BEYOND * beyond
    return found


def _energies_kwh(machine_kw: Array, asked_kw: float) -> tuple[Array, Array]:
    """Fuel and stored energy that a second takes."""
    fuel = car.fuel_kw(np.maximum(asked_kw - machine_kw, 0.0))
    return fuel / 3600, car.drained_kw(machine_kw) / 3600


def _alone_kw() -> Array:
    """(time,) the machine's power where there is nothing to choose."""
    asked = car.asked().power_kw
    return np.where(asked > 0, asked, car.braking_kw(data.SOC_START))
