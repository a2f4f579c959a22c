"""Torques between the levels of a table, from a table of many more levels, which knows nothing of cells."""

from typing import NamedTuple

import numpy as np

from hevopt import build_problem
from hevopt.problem import battery as battery_model


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
