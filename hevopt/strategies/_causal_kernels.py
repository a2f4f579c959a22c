"""Compiled loops of the causal strategies: one pass over the steps, each seen once and none ahead.

Choices are those of choices.py. A value function is linear between the nodes of a grid of stored energy.
"""

from typing import NamedTuple

import numpy as np

from hevopt._compile import compiled
from hevopt.problem._battery_kernels import chemical_power, state_at

# Halvings of the bracket in which a factor over past steps is searched.
_HALVINGS = 14


class Feedback(NamedTuple):
    """Parameters of the adaptive factor; a_ecms.py says what they mean and where they come from."""

    base_kgpj: float
    proportional: float
    integral_s: float
    integral_max: float
    start_share: float
    recovered_jpv2: float
    recovered_weight_v2: float
    edge: float
    window_s: float
    window_reach: float


@compiled()
def decide(k, first, cost, power, step_s, switch_kg, allowed, mode, energy, value, low, cell, bat):
    """Entry, mode and stored energy after the choice of least cost + switching + value ahead.

    value: (mode, node) at stored energies low + cell x node, the window's ends being its first and last node.
    Only choices that stay within the window count; where none does, the one that leaves it least is taken.
    """
    modes, nodes = value.shape
    high = low + cell * (nodes - 1)
    _, voltage, discharge, charging = state_at(energy, bat)
    best, entry, next_mode, next_energy = np.inf, -1, mode, energy
    least_out, way_out, out_mode, out_energy = np.inf, -1, mode, energy
    for n in range(modes):
        if not allowed[mode, n]:
            continue
        for i in range(first[k, n], first[k, n + 1]):
            rate = chemical_power(power[i], voltage, discharge, charging, bat.coulombic_efficiency)
            after = energy - step_s[k] * rate
            outside = max(low - after, after - high)
            if not outside <= 0.0:  # nor where the voltage cannot deliver the power, NaN
                if outside < least_out:
                    least_out, way_out, out_mode, out_energy = outside, i, n, after
                continue
            place = (after - low) / cell
            j = min(int(place), nodes - 2)
            ahead = value[n, j] + (place - j) * (value[n, j + 1] - value[n, j])
            total = cost[i] + switch_kg[mode, n] + ahead
            if total < best:
                best, entry, next_mode, next_energy = total, i, n, after
    if entry < 0:
        return way_out, out_mode, out_energy
    return entry, next_mode, next_energy


@compiled()
def neutral_factor(first, cost, drain, start, end, wanted_j, low, high):
    """The factor between low and high at which steps start <= k < end, each of least cost + factor x drain,
    would have drained `wanted_j` in all; the nearer end where none does."""
    for _ in range(_HALVINGS):
        factor = 0.5 * (low + high)
        drained = 0.0
        for k in range(start, end):
            best, of_best = np.inf, 0.0
            for i in range(first[k, 0], first[k, -1]):
                total = cost[i] + factor * drain[i]
                if total < best:
                    best, of_best = total, drain[i]
            drained += of_best
        if drained > wanted_j:
            low = factor
        else:
            high = factor
    return 0.5 * (low + high)


@compiled()
def _factor(p, base, shortage, integral, energy, low, high):
    """Equivalence factor for a shortage of charge, and steeper or gone near the window's ends."""
    edge_j = p.edge * (high - low)
    factor = base * (1.0 + p.proportional * shortage + integral)
    factor *= 1.0 + 3.0 * max(1.0 - (energy - low) / edge_j, 0.0)
    return max(factor * min(max((high - energy) / edge_j, 0.0), 1.0), 0.0)


@compiled()
def adaptive(first, cost, power, drain, step_s, switch_kg, allowed, speed, braking, mode, energy,
             target, low, high, p, bat):  # fmt: skip
    """Entries (time,), factors (time,) and the learnt energy recovered per square of speed.

    drain: (entry,) fall of stored energy at the start's state of charge, read for past steps only
    """
    steps, modes = first.shape[0], first.shape[1] - 1
    path, factors = np.empty(steps, dtype=np.int64), np.empty(steps)
    value = np.zeros((modes, 2))
    start_kg = p.start_share * switch_kg
    recovered, slowed = p.recovered_jpv2 * p.recovered_weight_v2, p.recovered_weight_v2
    base, integral, since, oldest, span_s = p.base_kgpj, 0.0, 0.0, 0, 0.0
    for k in range(steps):
        if k > 0:
            slowed += max(speed[k - 1] ** 2 - speed[k] ** 2, 0.0)
            since += step_s[k - 1]
            span_s += step_s[k - 1]
        while oldest < k and span_s > p.window_s:
            span_s -= step_s[oldest]
            oldest += 1
        if span_s > 0.9 * p.window_s and since > 0.25 * p.window_s:
            owed = recovered / slowed * (speed[k] ** 2 - speed[oldest] ** 2)
            base = neutral_factor(
                first, cost, drain, oldest, k, owed,
                p.base_kgpj * (1.0 - p.window_reach), p.base_kgpj * (1.0 + p.window_reach),
            )  # fmt: skip
            since = 0.0
        reference = target - recovered / slowed * speed[k] ** 2
        shortage = (reference - energy) / (0.5 * (high - low))
        integral += shortage * step_s[k] / p.integral_s
        integral = min(max(integral, -p.integral_max), p.integral_max)
        factors[k] = _factor(p, base, shortage, integral, energy, low, high)
        value[:, 1] = -factors[k] * (high - low)
        path[k], mode, after = decide(
            k, first, cost, power, step_s, start_kg, allowed, mode, energy, value, low, high - low,
            bat,
        )  # fmt: skip
        if braking[k]:
            recovered += max(after - energy, 0.0)
        energy = after
    return path, factors, recovered / slowed


@compiled()
def improve(first, cost, power, step_s, switch_kg, allowed, row_class, ahead, low, cell, excess_kgpj,
            bat):  # fmt: skip
    """Greedy policy on representative rows for a value ahead (class, mode, node).

    Per (row, mode led to, node): least cost + value ahead, the choice's own cost and its target in cells; per
    (row, mode come from, node): the mode gone to. Energy outside the window costs excess_kgpj; having no choice
    costs a whole window of it.
    """
    rows, modes, nodes = first.shape[0], first.shape[1] - 1, ahead.shape[2]
    own = np.full((rows, modes, nodes), excess_kgpj * cell * nodes)
    target = np.zeros((rows, modes, nodes))
    follow = np.zeros((rows, modes, nodes), dtype=np.int64)
    least = np.empty(modes)
    for r in range(rows):
        for j in range(nodes):
            energy = low + cell * j
            _, voltage, discharge, charging = state_at(energy, bat)
            for n in range(modes):
                least[n] = np.inf
                for i in range(first[r, n], first[r, n + 1]):
                    rate = chemical_power(
                        power[i], voltage, discharge, charging, bat.coulombic_efficiency
                    )
                    if np.isnan(rate):
                        continue
                    wanted = j - step_s[r] * rate / cell
                    place = min(max(wanted, 0.0), nodes - 1.0)
                    paid = cost[i] + excess_kgpj * cell * abs(wanted - place)
                    total = paid + _between(ahead[row_class[r], n], place)
                    if total < least[n]:
                        least[n], own[r, n, j], target[r, n, j] = total, paid, place
            for m in range(modes):
                best = np.inf
                for n in range(modes):
                    if allowed[m, n] and switch_kg[m, n] + least[n] < best:
                        best, follow[r, m, j] = switch_kg[m, n] + least[n], n
    return own, target, follow


@compiled()
def evaluate(own, target, follow, switch_kg, row_class, row_share, stage_kg, ahead, value):
    """Fill the value (class, mode, node) of one step of a policy, `stage_kg` (class, node) included."""
    classes, modes, nodes = ahead.shape
    for z in range(classes):
        for m in range(modes):
            value[z, m] = stage_kg[z]
    for r in range(len(row_class)):
        z, share = row_class[r], row_share[r]
        for m in range(modes):
            for j in range(nodes):
                n = follow[r, m, j]
                later = _between(ahead[z, n], target[r, n, j])
                value[z, m, j] += share * (switch_kg[m, n] + own[r, n, j] + later)


@compiled()
def look_ahead(transition, value, ahead):
    """Fill the mean value of the class that follows, (class, mode, node) [now]."""
    classes = len(transition)
    flat, mean = value.reshape(classes, -1), ahead.reshape(classes, -1)
    mean[:] = 0.0
    for z in range(classes):
        for y in range(classes):
            if transition[z, y] > 0.0:
                mean[z] += transition[z, y] * flat[y]


@compiled()
def sweep(sweeps, transition, own, target, follow, switch_kg, row_class, row_share, stage_kg,
          value):  # fmt: skip
    """Relative value (class, mode, node) after that many steps of a policy, 0 in the middle of class 0."""
    value, ahead = value.copy(), np.empty_like(value)
    for _ in range(sweeps):
        look_ahead(transition, value, ahead)
        evaluate(own, target, follow, switch_kg, row_class, row_share, stage_kg, ahead, value)
        value -= value[0, 0, value.shape[2] // 2]
    return value


@compiled(inline="always")
def _between(values, place):
    j = min(int(place), len(values) - 2)
    return values[j] + (place - j) * (values[j + 1] - values[j])


@compiled()
def follow_map(first, cost, power, step_s, switch_kg, allowed, row_class, ahead, mode, energy, low,
               cell, bat):  # fmt: skip
    """Entries (time,) that follow a value ahead (class, mode, node), given the class of each step."""
    path = np.empty(len(step_s), dtype=np.int64)
    for k in range(len(step_s)):
        path[k], mode, energy = decide(
            k, first, cost, power, step_s, switch_kg, allowed, mode, energy, ahead[row_class[k]],
            low, cell, bat,
        )  # fmt: skip
    return path
