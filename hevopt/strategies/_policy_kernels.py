"""Compiled policy iteration of sdp.py on representative rows: values over class, mode and stored energy."""

from typing import NamedTuple

import numpy as np

from hevopt._compile import compiled
from hevopt.problem._battery_kernels import BatteryArrays, chemical_power, state_at
from hevopt.problem.arrays import Array, Indices
from hevopt.problem.choices import Choices
from hevopt.problem.switching import Switching
from hevopt.strategies._causal_kernels import SteadyGrid


class Policy(NamedTuple):
    """What a policy does on representative rows.

    own, target: (row, mode led to, node) the choice's own cost, and where it leads, in cells
    follow, paid, between: (row, mode come from, node) mode gone to, cost of switching, and where it leads, in cells
    """

    own: Array
    target: Array
    follow: Indices
    paid: Array
    between: Array


class Rows(NamedTuple):
    """Class of representative rows and weight within it, (row,) each."""

    row_class: Indices
    row_share: Array


@compiled()
def improve(
    choices: Choices,
    row_class: Indices,
    ahead: Array,
    grid: SteadyGrid,
    excess_kgpj: float,
    battery: BatteryArrays,
) -> Policy:
    """Greedy policy on representative rows for a value ahead (class, mode, node).

    The choice is that of least cost + value ahead. Energy outside the window costs excess_kgpj; having no choice
    costs a whole window of it.
    """
    first, power = choices.first, choices.power_w
    low, cell = grid
    rows, modes, nodes = first.shape[0], first.shape[1] - 1, ahead.shape[2]
    own = np.full((rows, modes, nodes), excess_kgpj * cell * nodes)
    target = np.zeros((rows, modes, nodes))
    least = np.empty((modes, nodes))
    policy = Policy(
        own, target, np.zeros((rows, modes, nodes), dtype=np.int64), np.empty((rows, modes, nodes)),
        np.empty((rows, modes, nodes)),
    )  # fmt: skip
    for r in range(rows):
        for j in range(nodes):
            energy = low + cell * j
            _, voltage, discharge, charging = state_at(energy, battery)
            for n in range(modes):
                least[n, j] = np.inf
                for i in range(first[r, n], first[r, n + 1]):
                    rate = chemical_power(
                        power[i], voltage, discharge, charging, battery.coulombic_efficiency
                    )
                    if np.isnan(rate):
                        continue
                    wanted = j - choices.step_s[r] * rate / cell
                    place = min(max(wanted, 0.0), nodes - 1.0)
                    paid = choices.cost_kg[i] + excess_kgpj * cell * abs(wanted - place)
                    total = paid + _between(ahead[row_class[r], n], place)
                    if total < least[n, j]:
                        least[n, j], own[r, n, j], target[r, n, j] = total, paid, place
        _switch(choices.switching, r, least, cell, excess_kgpj, policy)
    return policy


@compiled()
def _switch(
    switching: Switching, r: int, least: Array, cell: float, excess_kgpj: float, policy: Policy
) -> None:
    """Fill the modes that a policy goes to at row r, from the least (mode, node) after switching."""
    case, modes, nodes = switching.case[r], least.shape[0], least.shape[1]
    for m in range(modes):
        for j in range(nodes):
            best = np.inf
            policy.paid[r, m, j], policy.between[r, m, j] = switching.kg[case, m, 0], j
            for n in range(modes):
                if not switching.allowed[case, m, n]:
                    continue
                wanted = j - switching.energy_j[case, m, n] / cell
                place = min(max(wanted, 0.0), nodes - 1.0)
                paid = switching.kg[case, m, n] + excess_kgpj * cell * abs(wanted - place)
                total = paid + _at(least[n], place)
                if total < best:
                    best, policy.follow[r, m, j] = total, n
                    policy.paid[r, m, j], policy.between[r, m, j] = paid, place


@compiled()
def evaluate(policy: Policy, rows: Rows, stage_kg: Array, ahead: Array, value: Array) -> None:
    """Fill the value (class, mode, node) of one step of a policy, `stage_kg` (class, node) included.

    Between nodes it is linear, as `improve` takes it to be: a policy is worth what it was chosen for.
    """
    own, target, follow, paid, between = policy
    row_class, row_share = rows
    classes, modes, nodes = ahead.shape
    switched = np.empty((modes, nodes))
    for z in range(classes):
        for m in range(modes):
            value[z, m] = stage_kg[z]
    for r in range(len(row_class)):
        z, share = row_class[r], row_share[r]
        for n in range(modes):
            for j in range(nodes):
                switched[n, j] = own[r, n, j] + _between(ahead[z, n], target[r, n, j])
        for m in range(modes):
            for j in range(nodes):
                after = _at(switched[follow[r, m, j]], between[r, m, j])
                value[z, m, j] += share * (paid[r, m, j] + after)


@compiled()
def look_ahead(transition: Array, value: Array, ahead: Array) -> None:
    """Fill the mean value of the class that follows, (class, mode, node) [now]."""
    classes = len(transition)
    flat, mean = value.reshape(classes, -1), ahead.reshape(classes, -1)
    mean[:] = 0.0
    for z in range(classes):
        for y in range(classes):
            if transition[z, y] > 0.0:
                mean[z] += transition[z, y] * flat[y]


@compiled()
def sweep(
    sweeps: int, transition: Array, policy: Policy, rows: Rows, stage_kg: Array, value: Array
) -> Array:
    """Relative value (class, mode, node) after that many steps of a policy, 0 in the middle of class 0."""
    value, ahead = value.copy(), np.empty_like(value)
    for _ in range(sweeps):
        look_ahead(transition, value, ahead)
        evaluate(policy, rows, stage_kg, ahead, value)
        value -= value[0, 0, value.shape[2] // 2]
    return value


@compiled(inline="always")
def _at(values: Array, place: float) -> float:
    """At a place that is a node where switching takes no energy."""
    j = int(place)
    value: float = values[j] if j == place else _between(values, place)
    return value


@compiled(inline="always")
def _between(values: Array, place: float) -> float:
    j = min(int(place), len(values) - 2)
    value: float = values[j] + (place - j) * (values[j + 1] - values[j])
    return value
