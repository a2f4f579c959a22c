"""The modes of a car: what costs fuel or stored energy to change, and what each change takes."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from hevopt.car.architecture import Architecture
from hevopt.car.driveline import State
from hevopt.powertrain.branches import Driven
from hevopt.powertrain.kinetic import Jumps
from hevopt.problem.arrays import Array, Indices


class Modes(NamedTuple):
    """mode: (branch,); switch_*: (mode, mode) where they are alike at every step, else (time, mode, mode)."""

    mode: Indices
    switch_fuel_kg: Array
    switch_energy_j: Array


def modes_of(car: Architecture, branches: Sequence[Driven], *, apart: bool = False) -> Modes:
    """The modes of the branches. States are one mode where engine, gears that cost something to change and shafts'
    kinetic energy are the same; apart: no step follows another, each switches at its own mean speeds."""
    keys = [(branch.state.engine_on, *_costly_gears(car, branch.state)) for branch in branches]
    firsts: list[int] = []
    mode = []
    for n, branch in enumerate(branches):
        alike = (
            m for m, first in enumerate(firsts)
            if keys[first] == keys[n] and branches[first].kinetic.same_as(branch.kinetic)
        )  # fmt: skip
        found = next(alike, len(firsts))
        if found == len(firsts):
            firsts.append(n)
        mode.append(found)
    fuel_kg, energy_j = _switching(car, [branches[first] for first in firsts], apart=apart)
    return Modes(np.array(mode), _short(fuel_kg), _short(energy_j))


def _costly_gears(car: Architecture, state: State) -> tuple[object, object]:
    """The gears chosen whose change counts fuel, and the listed one chosen where it does."""
    costly = {box.name for box in car.driveline.boxes if box.shift_fuel_kg > 0}
    listed_kg = 0.0 if car.gearbox is None else car.gearbox.shift_fuel_kg or 0.0
    gears = tuple(pair for pair in state.gears if pair[0] in costly)
    return gears, state.listed if listed_kg else 0


def _switching(car: Architecture, modes: Sequence[Driven], *, apart: bool) -> tuple[Array, Array]:
    """Fuel and stored energy of going from one mode to another, (time, mode, mode) each."""
    jumps, first = Jumps(car), modes[0].kinetic
    shape = first.engine_j.shape[-1], len(modes), len(modes)
    fuel_kg, energy_j = np.empty(shape), np.empty(shape)
    for i, before in enumerate(modes):
        for j, after in enumerate(modes):
            runs = before.state.engine_on and after.state.engine_on
            if apart:
                taken = jumps.within(before.kinetic, after.kinetic, runs=runs)
            else:
                taken = jumps.taken(before.kinetic, after.kinetic, first, runs=runs)
            fuel_kg[:, i, j] = taken.fuel_kg + _fuel_kg(car, before.state, after.state)
            energy_j[:, i, j] = taken.energy_j
    return fuel_kg, energy_j


def _fuel_kg(car: Architecture, before: State, after: State) -> float:
    """What a start, and a change of gears, counts beside the shafts' energy."""
    costs = {box.name: box.shift_fuel_kg for box in car.driveline.boxes}
    fuel_kg = sum(costs[name] for name, gear in after.gears if (name, gear) not in before.gears)
    if after.engine_on and not before.engine_on:
        fuel_kg += car.engine.start_fuel_kg
    if car.gearbox is not None and before.listed != after.listed and before.listed and after.listed:
        fuel_kg += car.gearbox.shift_fuel_kg or 0.0
    return fuel_kg


def _short(matrices: Array) -> Array:
    return matrices[0] if (matrices == matrices[0]).all() else matrices
