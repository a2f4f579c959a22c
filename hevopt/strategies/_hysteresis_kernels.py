"""Compiled rules that start the engine above a power and stop it below another."""

from typing import NamedTuple

import numpy as np

from hevopt._compile import compiled
from hevopt.problem._battery_kernels import BatteryArrays, chemical_power, state_at
from hevopt.problem.arrays import Array, Indices
from hevopt.problem.choices import Choices
from hevopt.strategies._family_kernels import result_of
from hevopt.strategies._rule_kernels import RuleDrive, Span, at_rest, permitted

_HALVINGS = 12


class HysteresisRule(NamedTuple):
    """Entries of a rule that starts and stops the engine by the power that it is asked for.

    asked_w: (time,) power asked for, whatever is stored
    off: (time,) entry without fuel; where there is none, -1, the engine runs whatever is asked
    engine: (level, time) entries of the engine by charging power, those of charge_w, (level,) rising
    modes: (entry,) that all entries lead to
    price_kgpj: what a joule of the battery is worth where the table forbids what the rule would take
    """

    asked_w: Array
    off: Indices
    engine: Indices
    charge_w: Array
    modes: Indices
    price_kgpj: float


@compiled()
def entry_asked(
    rule: HysteresisRule,
    limits: Array,
    k: int,
    energy_j: float,
    mode: int,
    on: bool,
    choices: Choices,
) -> tuple[int, bool]:
    """What a rule takes at a step, and whether it holds the engine on; on: whether it did before.

    limits: W per joule missing below a stored energy, that energy; power that starts the engine, and stops it
    """
    charge_w = limits[0] * (limits[1] - energy_j)
    asked_w = rule.asked_w[k] + charge_w
    if asked_w > limits[2]:
        on = True
    elif asked_w < limits[3]:
        on = False
    entry = rule.off[k]
    if on or entry < 0:
        level = min(np.searchsorted(rule.charge_w, charge_w), len(rule.charge_w) - 1)
        entry = rule.engine[level, k]
    return permitted(entry, k, mode, rule.modes, rule.price_kgpj, choices), on


@compiled()
def drive(
    rule: HysteresisRule,
    limits: Array,
    choices: Choices,
    battery: BatteryArrays,
    driven: RuleDrive,
) -> float:
    """Drive from the start, the engine at rest; the stored energy at the end."""
    case, switch_j = choices.switching.case, choices.switching.energy_j
    stored, before, on = driven.energy_j[0], driven.mode[0], False
    for k in range(len(choices.step_s)):
        entry, on = entry_asked(rule, limits, k, stored, before, on, choices)
        after = rule.modes[entry]
        between = stored - switch_j[case[k], before, after]
        _, voltage, discharge, charging = state_at(between, battery)
        drain_w = chemical_power(
            choices.power_w[entry], voltage, discharge, charging, battery.coulombic_efficiency
        )
        stored, before = between - choices.step_s[k] * drain_w, after
        driven.entry[k], driven.mode[k + 1], driven.energy_j[k + 1] = entry, after, stored
    return float(stored)


@compiled()
def settle(
    rule: HysteresisRule,
    limits: Array,
    choices: Choices,
    span: Span,
    battery: BatteryArrays,
    driven: RuleDrive,
) -> None:
    """Put the lowest reference energy of the window that ends with enough charge into limits, found by halving; the
    window's upper end where none does."""
    low, high = span.least_j, span.greatest_j
    limits[1] = low
    if drive(rule, limits, choices, battery, driven) >= span.end_j:
        return
    for _ in range(_HALVINGS):
        limits[1] = 0.5 * (low + high)
        if drive(rule, limits, choices, battery, driven) >= span.end_j:
            high = limits[1]
        else:
            low = limits[1]
    limits[1] = high


@compiled()
def hysteresis_results(
    rule: HysteresisRule,
    limits: Array,
    nox_kg: Array,
    choices: Choices,
    span: Span,
    battery: BatteryArrays,
) -> Array:
    """(member, 4) results of members, (member, 4) limits; where a reference is NaN it is settled, and put there."""
    found = np.empty((len(limits), 4))
    driven = at_rest(len(choices.step_s), span.start)
    for n in range(len(limits)):
        if np.isnan(limits[n, 1]):
            settle(rule, limits[n], choices, span, battery, driven)
        drive(rule, limits[n], choices, battery, driven)
        found[n] = result_of(driven, nox_kg, choices, span)
    return found
