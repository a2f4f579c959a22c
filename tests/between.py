"""Torques between the levels of a table, from a table of many more levels, which knows nothing of cells."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from hevopt import build_problem, load_cycle
from hevopt.bounds import virtual
from hevopt.problem import battery as battery_model


def part(cycle, begin, end):
    """Some seconds of a cycle."""
    whole = load_cycle(cycle)
    cut = {
        name: None if (values := getattr(whole, name)) is None else values[begin:end]
        for name in ("speed_mps", "grade", "gear", "clutch_open")
    }
    return replace(whole, time_s=whole.time_s[begin:end] - whole.time_s[begin], **cut)


DRIVES = {
    "B": ("nedc", 0, 60),
    "C2": ("nedc", 110, 190),
    "D": ("us06", 40, 80),
    "E": ("us06", 5, 35),
}


class Samples(NamedTuple):
    """Controls of a fine table that lie in cells of a coarse one: the cell of each, t in it, and what it takes."""

    cell: np.ndarray
    place: np.ndarray
    fuel_kg: np.ndarray
    nox_kg: np.ndarray
    power_w: np.ndarray


def torques_of(table):
    """(time, control) the one torque that is chosen, NaN where none is."""
    found, first = np.full(table.fuel_kg.shape, np.nan), 0
    for branch in table.flows.branches:
        for piece in branch.pieces:
            for torque in piece.given.values():
                steps = piece.here.shafts.step[:, None]
                found[steps, first + np.arange(torque.shape[1])] = torque
        first += len(branch.labels)
    return found


def samples_of(car, cycle, problem, levels=401):
    """Cells of a problem of a car, and everything of a finer table within them."""
    cells, fine = problem.table.cells(), build_problem(car, cycle, levels=levels).table
    coarse_nm, fine_nm = torques_of(problem.table), torques_of(fine)
    state = [hash((c.engine_on, c.machine_gear, c.engine_gear)) for c in problem.table.controls]
    of_state = [hash((c.engine_on, c.machine_gear, c.engine_gear)) for c in fine.controls]
    parts = []
    for k in np.unique(cells.step):
        here = np.flatnonzero(cells.step == k)
        low, high = (coarse_nm[k, ends[here]] for ends in (cells.low, cells.high))
        own = np.array(state)[cells.low[here]]
        inside = (np.array(of_state) == own[:, None]) & (fine_nm[k] >= low[:, None])
        inside &= fine_nm[k] <= high[:, None]
        n, column = np.nonzero(inside)
        share = (fine_nm[k, column] - low[n]) / (high[n] - low[n])
        figures = (v[k, column] for v in (fine.fuel_kg, fine.nox_kg, fine.battery_power_w))
        parts.append(Samples(here[n], share, *figures))
    return cells, Samples(*(np.concatenate(values) for values in zip(*parts, strict=True)))


def below_lines(lines, place, cell, values):
    """By how much values fall below the greater of two lines at most."""
    at = lines[:, 0, cell] * (1 - place) + lines[:, 1, cell] * place
    return np.max(at.max(axis=0) - values)


def drains_w(battery, power_w, seed=0):
    """(energy, ...) rates at which a battery drains at three stored energies of its window."""
    at = np.random.default_rng(seed).uniform(*battery.granted_window_j, 3)
    at[:2] = battery.granted_window_j
    for voltage, discharge, charge in zip(*battery_model.states(battery, at)[1:], strict=True):
        ohm = np.where(power_w < 0, charge, discharge)
        yield battery_model.chemical_power_w(battery, power_w, voltage, ohm)


def states_of(table):
    """The state of the driveline of each control; of a part of a drive there may be fewer, in another order."""
    return [(c.engine_on, c.machine_gear, c.engine_gear) for c in table.controls]


class Dense(NamedTuple):
    """By how much a control of a finer table falls at most below all that a bound counts in its step and mode, as a
    share of the greatest cost there; and how many were looked at."""

    below: float
    count: int


def _drain_j(battery, power_w, volt, discharge, charge, step_s):
    ohm = np.where(power_w < 0, charge, discharge)
    return battery_model.chemical_power_w(battery, power_w, volt, ohm) * step_s


def dense_below(problem, fine, prices_kgpj, energies_j, begin=0) -> Dense:
    """Every control of a finer table of the same car and drive within what the coarse one can use, at prices.

    fine: a table whose first step is step `begin`; prices_kgpj: (price, time); energies_j: (energy, time), of the
    whole problem's steps
    """
    choices, table = virtual.split_of(problem).choices, problem.table
    steps = slice(begin, begin + len(fine.step_s))
    coarse_nm, fine_nm = torques_of(table)[steps], torques_of(fine)
    mode_of = dict(zip(states_of(table), table.mode, strict=True))
    own, states = ([*map(list(mode_of).index, states_of(each))] for each in (table, fine))
    own, states, within = np.array(own), np.array(states), fine.reject == 0
    modes = np.array(list(mode_of.values()))[states]
    for state in range(len(mode_of)):
        usable = np.where(
            table.reject[steps][:, own == state] == 0, coarse_nm[:, own == state], np.nan
        )
        there = fine_nm[:, states == state]
        low, high = np.nanmin(usable, 1, initial=np.inf), np.nanmax(usable, 1, initial=-np.inf)
        known = (there >= low[:, None] - 1e-12) & (there <= high[:, None] + 1e-12)
        within[:, states == state] &= known | np.isnan(there)
    step, mode = choices.spread(np.arange(choices.steps)), table.mode[choices.control]
    here = (step >= steps.start) & (step < steps.stop)
    step, mode, cost_kg, power_w = (
        step[here] - begin,
        mode[here],
        choices.cost_kg[here],
        choices.power_w[here],
    )
    fine_kg = fine.fuel_kg + problem.nox_weight * fine.nox_kg
    worst, count = -np.inf, 0
    for energy in energies_j:
        at = battery_model.states(problem.battery, energy[steps])[1:]
        counted = _drain_j(problem.battery, power_w, *at[:, step], fine.step_s[step])
        of_step = (*at[:, :, None], fine.step_s[:, None])
        looked = _drain_j(problem.battery, fine.battery_power_w, *of_step)
        for price in prices_kgpj:
            least = np.full((len(fine.step_s), table.modes), np.inf)
            np.minimum.at(least, (step, mode), cost_kg + price[steps][step] * counted)
            value = fine_kg + price[steps][:, None] * looked
            below = np.where(within, least[:, modes] - value, -np.inf)
            worst = max(worst, float(below.max() / np.abs(value[within]).max()))
            count += int(within.sum())
    return Dense(worst, count)
