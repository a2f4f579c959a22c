"""Compiled parts of the rule-based strategies."""

from typing import NamedTuple

import numpy as np

from hevopt._compile import compiled
from hevopt.problem._battery_kernels import BatteryArrays, chemical_power_at
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


class RuleDrive(NamedTuple):
    """A drive under a rule: entries (time,) that were taken, and energy and mode (time + 1,) before each step."""

    entry: Indices
    energy_j: Array
    mode: Indices


@compiled()
def load_point_choices(
    choices: Choices, nox: Array, fired: Flags, charge_w: Array, nox_cap_kgps: float
) -> Indices:
    """(level, time) entry of least cost among fired ones that charge at least charge_w[level] within the cap.

    Where none does: the entry within the cap that charges most; where none is within it, that of least NOx.
    -1 where the step has no fired entry at all.
    """
    first, cost, power, step_s = choices.first, choices.cost_kg, choices.power_w, choices.step_s
    steps, levels = len(step_s), len(charge_w)
    chosen = np.full((levels, steps), -1, dtype=np.int64)
    for k in range(steps):
        most, least_nox = -1, -1
        best = np.full(levels, np.inf)
        for i in range(first[k, 0], first[k, -1]):
            if not fired[i]:
                continue
            if least_nox < 0 or (nox[i], cost[i]) < (nox[least_nox], cost[least_nox]):
                least_nox = i
            if nox[i] > nox_cap_kgps * step_s[k]:
                continue
            if most < 0 or (power[i], cost[i]) < (power[most], cost[most]):
                most = i
            for level in range(levels):
                if power[i] > -charge_w[level]:
                    break
                if cost[i] < best[level]:
                    best[level] = cost[i]
                    chosen[level, k] = i
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
def _drive(
    rule: Rule,
    engine: Indices,
    begin: int,
    choices: Choices,
    battery: BatteryArrays,
    driven: RuleDrive,
) -> float:
    """Drive on from a step with the engine's entries, (time,); the stored energy at the end."""
    power, step_s = choices.power_w, choices.step_s
    case, _, switch_j, _ = choices.switching
    modes, (entry, energy, mode) = rule.modes, driven
    for k in range(begin, len(step_s)):
        chosen = entry_at(rule, engine, k, energy[k], mode[k], choices)
        between = energy[k] - switch_j[case[k], mode[k], modes[chosen]]
        entry[k], mode[k + 1] = chosen, modes[chosen]
        energy[k + 1] = between - step_s[k] * chemical_power_at(power[chosen], between, battery)
    end_j: float = energy[-1]
    return end_j


@compiled()
def _at_rest(steps: int, start: State) -> RuleDrive:
    driven = RuleDrive(
        np.empty(steps, dtype=np.int64), np.empty(steps + 1), np.empty(steps + 1, dtype=np.int64)
    )
    driven.energy_j[0], driven.mode[0] = start.energy_j, start.mode
    return driven


@compiled()
def neutral_drive(
    rule: Rule,
    engine: Indices,
    choices: Choices,
    start: State,
    end_j: float,
    battery: BatteryArrays,
) -> tuple[RuleDrive, Indices, tuple[int, int]]:
    """The drive whose charging power ends with end_j or just more, the engine's entries in it, (time,), and of
    which level they are before which step; from there on of the one below.

    engine: (level, time) entries by rising charging power. The lowest level that reaches the charge is kept up to
    the first step that will do, the one below it from there on; where none reaches it, the highest is kept.
    Both are found by halving, as more charging leaves more charge.
    """
    steps, top = len(choices.step_s), len(engine) - 1
    driven = _at_rest(steps, start)
    if _drive(rule, engine[0], 0, choices, battery, driven) - end_j >= 0.0:
        return driven, engine[0], (0, steps)
    if _drive(rule, engine[top], 0, choices, battery, driven) - end_j < 0.0:
        return driven, engine[top], (top, steps)
    below, level = 0, top
    while level - below > 1:
        middle = (below + level) // 2
        if _drive(rule, engine[middle], 0, choices, battery, driven) - end_j >= 0.0:
            level = middle
        else:
            below = middle
    _drive(rule, engine[level], 0, choices, battery, driven)
    tried, short, until = _at_rest(steps, start), 0, steps
    while until - short > 1:
        # Up to the step the drive is known.
        middle = (short + until) // 2
        tried.energy_j[middle], tried.mode[middle] = driven.energy_j[middle], driven.mode[middle]
        if _drive(rule, engine[level - 1], middle, choices, battery, tried) - end_j >= 0.0:
            until = middle
        else:
            short = middle
    _drive(rule, engine[level - 1], until, choices, battery, driven)
    taken = np.concatenate((engine[level, :until], engine[level - 1, until:]))
    return driven, taken, (level, until)
