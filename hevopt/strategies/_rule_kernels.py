"""Compiled parts of the rule-based strategies."""

from typing import NamedTuple

import numpy as np

from hevopt._compile import compiled
from hevopt.problem._battery_kernels import BatteryArrays, chemical_power, state_at
from hevopt.problem.arrays import Array, Flags, Indices
from hevopt.problem.choices import Choices, State


class Rule(NamedTuple):
    """Entries that a rule takes but for those of the engine, whose charging power is searched.

    electric: (time,) while more than least_j is stored, -1 where never
    fixed: (time,) else, -1 where the engine drives; modes: (entry,) that all entries lead to
    price_kgpj: what a joule of the battery is worth where the table forbids what the rule would take
    """

    electric: Indices
    fixed: Indices
    modes: Indices
    least_j: float
    price_kgpj: float


class Span(NamedTuple):
    """Where a drive starts, what must be left at its end, and between which stored energies it may stay."""

    start: State
    end_j: float
    least_j: float
    greatest_j: float


class RuleDrive(NamedTuple):
    """A drive under a rule: entries (time,) that were taken, and energy and mode (time + 1,) before each step."""

    entry: Indices
    energy_j: Array
    mode: Indices


@compiled()
def load_point_choices(
    choices: Choices, nox: Array, fired: Flags, charge_w: Array, nox_cap_kgps: float
) -> Indices:
    """(level, time) entry of least cost among fired ones that charge at least charge_w[level], rising, in the cap.

    Where none does: the entry within the cap that charges most; where none is within it, that of least NOx.
    -1 where the step has no fired entry at all.
    """
    first, cost, power, step_s = choices.first, choices.cost_kg, choices.power_w, choices.step_s
    steps, levels = len(step_s), len(charge_w)
    chosen = np.full((levels, steps), -1, dtype=np.int64)
    best = np.empty(levels)
    for k in range(steps):
        most, least_nox = -1, -1
        best[:] = np.inf
        for i in range(first[k, 0], first[k, -1]):
            if not fired[i]:
                continue
            if least_nox < 0 or (nox[i], cost[i]) < (nox[least_nox], cost[least_nox]):
                least_nox = i
            if nox[i] > nox_cap_kgps * step_s[k]:
                continue
            if most < 0 or (power[i], cost[i]) < (power[most], cost[most]):
                most = i
            # The highest level that it charges enough for; of those below, it stands for each as well.
            level = np.searchsorted(charge_w, -power[i], "right") - 1
            if level >= 0 and cost[i] < best[level]:
                best[level], chosen[level, k] = cost[i], i
        for level in range(levels - 2, -1, -1):
            above = chosen[level + 1, k]
            if above >= 0 and (best[level + 1], above) < (best[level], chosen[level, k]):
                best[level], chosen[level, k] = best[level + 1], above
        for level in range(levels):
            if chosen[level, k] < 0:
                chosen[level, k] = most if most >= 0 else least_nox
    return chosen


@compiled()
def permitted(
    entry: int, k: int, before: int, modes: Indices, price_kgpj: float, choices: Choices
) -> int:
    """An entry, or where the table forbids its mode after another: its like in a mode that is not, or the entry
    of least cost and worth of charge in one. The entry itself where all are forbidden.
    """
    first, cost, power = choices.first, choices.cost_kg, choices.power_w
    case, allowed = choices.switching.case[k], choices.switching.allowed
    if allowed[case, before, modes[entry]]:
        return entry
    best, least = entry, np.inf
    for i in range(first[k, 0], first[k, -1]):
        if allowed[case, before, modes[i]]:
            if cost[i] == cost[entry] and power[i] == power[entry]:
                return i
            total = cost[i] + price_kgpj * power[i] * choices.step_s[k]
            if total < least:
                best, least = i, total
    return best


@compiled()
def entry_at(
    rule: Rule, engine: Indices, k: int, energy_j: float, mode: int, choices: Choices
) -> int:
    """What a rule takes at a step: the electric entry while more than least_j is stored; engine: (time,)."""
    entry = rule.fixed[k] if rule.fixed[k] >= 0 else engine[k]
    if rule.electric[k] >= 0 and energy_j > rule.least_j:
        entry = rule.electric[k]
    return permitted(entry, k, mode, rule.modes, rule.price_kgpj, choices)


@compiled()
def drive_on(
    rule: Rule,
    engine: Indices,
    begin: int,
    choices: Choices,
    battery: BatteryArrays,
    driven: RuleDrive,
) -> float:
    """Drive on from a step with the engine's entries, (time,); the stored energy at the end.

    Each step takes what `entry_at` says, written out, as calls with all the arrays take longer than the step.
    """
    power, step_s = choices.power_w, choices.step_s
    case, _, switch_j, allowed = choices.switching
    (electric, fixed, modes, least_j, price_kgpj), efficiency = rule, battery.coulombic_efficiency
    entry, energy, mode = driven
    stored, before = energy[begin], mode[begin]
    for k in range(begin, len(step_s)):
        chosen = fixed[k] if fixed[k] >= 0 else engine[k]
        if electric[k] >= 0 and stored > least_j:
            chosen = electric[k]
        if not allowed[case[k], before, modes[chosen]]:
            chosen = permitted(chosen, k, before, modes, price_kgpj, choices)
        after = modes[chosen]
        between = stored - switch_j[case[k], before, after]
        _, voltage, discharge, charging = state_at(between, battery)
        drain_w = chemical_power(power[chosen], voltage, discharge, charging, efficiency)
        stored, before = between - step_s[k] * drain_w, after
        entry[k], mode[k + 1], energy[k + 1] = chosen, after, stored
    end_j: float = energy[-1]
    return end_j


@compiled()
def at_rest(steps: int, start: State) -> RuleDrive:
    """A drive before its first step."""
    driven = RuleDrive(
        np.empty(steps, dtype=np.int64), np.empty(steps + 1), np.empty(steps + 1, dtype=np.int64)
    )
    driven.energy_j[0], driven.mode[0] = start.energy_j, start.mode
    return driven
