"""Compiled parts of virtual.py, which has the mathematics: points of cells, and their place among the choices."""

from typing import NamedTuple

import numpy as np

from hevopt._compile import compiled
from hevopt.problem.arrays import Array, Flags, Indices

# Least share of U² that s² may be where a tangent is taken.
_LEAST_ROOT = 1e-6


class Worst(NamedTuple):
    """Least voltage and greatest resistances of the window, and the coulombic efficiency."""

    voltage: float
    discharge_ohm: float
    charge_ohm: float
    efficiency: float


@compiled()
def nodes(cost: Array, power: Array, worst: Worst, epsilon: float) -> tuple[Array, Array, Flags]:
    """(4, cell) costs and powers of a cell's points, its ends first and last, and which of them there are."""
    count = cost.shape[2]
    nodes_kg, nodes_w = np.empty((4, count)), np.empty((4, count))
    there = np.ones((4, count), dtype=np.bool_)
    place, at_w = np.empty(4), np.empty(4)
    place[0], place[3] = 0.0, 1.0
    for c in range(count):
        one, other = _kink(cost, c), _kink(power, c)
        one = other if np.isnan(one) else one
        other = one if np.isnan(other) else other
        one = 0.5 if np.isnan(one) else one
        other = 0.5 if np.isnan(other) else other
        place[1], place[2] = min(one, other), max(one, other)
        most_kg = most_w = 0.0
        for line in range(2):
            for end in range(2):
                most_kg = max(most_kg, abs(cost[line, end, c]))
                most_w = max(most_w, abs(power[line, end, c]))
        for n in range(4):
            nodes_kg[n, c] = _greater(cost, c, place[n])
            at_w[n] = nodes_w[n, c] = _greater(power, c, place[n])
        middle = (at_w[1] + at_w[2]) / 2
        hopeless = False
        for n in (1, 2):
            own = _lowered(at_w[0] if n == 1 else at_w[3], at_w[n], worst, epsilon)
            between = _lowered(middle, at_w[n], worst, epsilon)
            hopeless |= np.isnan(own) or np.isnan(between)
            nodes_kg[n, c] -= 4.0 * epsilon * most_kg
            nodes_w[n, c] = min(own, between) - 4.0 * epsilon * most_w
        if hopeless:
            there[2, c] = False
            nodes_kg[1, c] = min(
                min(nodes_kg[0, c], nodes_kg[1, c]), min(nodes_kg[2, c], nodes_kg[3, c])
            )
            nodes_w[1, c] = min(min(at_w[0], at_w[1]), min(at_w[2], at_w[3]))
    return nodes_kg, nodes_w, there


@compiled()
def _greater(lines: Array, c: int, place: float) -> float:
    """The greater of two lines at a place of their cell."""
    first: float = lines[0, 0, c] * (1.0 - place) + lines[0, 1, c] * place
    second: float = lines[1, 0, c] * (1.0 - place) + lines[1, 1, c] * place
    return max(first, second)


@compiled()
def _kink(lines: Array, c: int) -> float:
    """Where the lines of a cell cross, NaN where they do not."""
    before = lines[1, 0, c] - lines[0, 0, c]
    after = lines[1, 1, c] - lines[0, 1, c]
    if (before < 0) == (after < 0):
        return np.nan
    share: float = before / (before - after)
    return min(max(share, 0.0), 1.0)


@compiled()
def _lowered(touch: float, power: float, worst: Worst, epsilon: float) -> float:
    """A power that drains no more than the tangent at `touch` says of `power`; NaN without use."""
    voltage, discharge, charge, efficiency = worst
    charging = touch < 0 or (touch == 0 and power < 0)
    ohm = charge if charging else discharge
    squared = voltage**2 - 4.0 * ohm * touch
    if not squared > _LEAST_ROOT * voltage**2:
        return np.nan
    grown = 1.0 + 16.0 * epsilon * voltage**2 / squared
    moved = power - grown * ohm * (power - touch) ** 2 / squared
    if charging and moved > 0:
        drained = efficiency * moved
        peak = discharge * drained > voltage**2 / 2
        return 0.0 if peak else drained - discharge * (drained / voltage) ** 2
    if not charging and moved < 0:
        stored = moved / efficiency
        return stored - charge * (stored / voltage) ** 2
    return moved


@compiled()
def among(first: Indices, block: Indices) -> tuple[Indices, Indices]:
    """Entries by step and mode, those that blocks begin at `first`, (time, mode + 1), and after them in each the
    further ones, whose blocks are given, numbered on; and where blocks begin now."""
    steps, modes = first.shape[0], first.shape[1] - 1
    count = np.zeros(steps * modes + 1, dtype=np.int64)
    for b in block:
        count[b + 1] += 1
    start = np.cumsum(count)
    entry = np.empty(first[-1, -1] + len(block), dtype=np.int64)
    begin = np.empty_like(first)
    for k in range(steps):
        for m in range(modes):
            begin[k, m] = first[k, m] + start[k * modes + m]
            for i in range(first[k, m], first[k, m + 1]):
                entry[begin[k, m] + i - first[k, m]] = i
        begin[k, modes] = first[k, modes] + start[(k + 1) * modes]
    for n in range(len(block)):
        k, m = divmod(block[n], modes)
        place = first[k, m + 1] + start[block[n]]
        entry[place] = first[-1, -1] + n
        start[block[n]] += 1
    return entry, begin
