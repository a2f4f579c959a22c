"""Compiled search over the members of a rule family."""

from typing import NamedTuple

import numpy as np

from hevopt._compile import compiled
from hevopt.problem._battery_kernels import BatteryArrays
from hevopt.problem.arrays import Array, Flags, Indices
from hevopt.problem.choices import Choices
from hevopt.strategies._abreast_kernels import drive_lanes, empty_lanes, fill, narrowed, take_up
from hevopt.strategies._neutral_kernels import neutral_drive
from hevopt.strategies._rule_kernels import Rule, RuleDrive, Span

# Drives side by side: with more of them the processor has no more to do at once.
_LANES = 8


class FamilySteps(NamedTuple):
    """What every member of a rule family sees of the steps.

    off, electric, recover: (time,) entries, -1 where there is none; standing, engaging, braking: (time,) class,
    engaging being standing with a gear engaged; power_w, speed_mps: (time,) at the wheels
    modes, nox_kg: (entry,); price_kgpj: as in Rule
    """

    off: Indices
    electric: Indices
    recover: Indices
    standing: Flags
    engaging: Flags
    braking: Flags
    power_w: Array
    speed_mps: Array
    modes: Indices
    nox_kg: Array
    price_kgpj: float


@compiled()
def rule_of(steps: FamilySteps, limits: Array) -> Rule:
    """The member that drives electrically above limits[0] J of charge, up to a power, W, and a speed, m/s.

    A gear that is engaged at standstill for a launch by the engine keeps it turning.
    """
    count = len(steps.power_w)
    electric, fixed = np.full(count, -1, dtype=np.int64), np.full(count, -1, dtype=np.int64)
    launch_electric = False
    for k in range(count - 1, -1, -1):
        if steps.standing[k]:
            if steps.off[k] >= 0 and (launch_electric or not steps.engaging[k]):
                fixed[k] = steps.off[k]
            continue
        if steps.braking[k]:
            fixed[k] = steps.recover[k]
        elif steps.power_w[k] <= limits[1] and steps.speed_mps[k] <= limits[2]:
            electric[k] = steps.electric[k]
        launch_electric = electric[k] >= 0
    return Rule(electric, fixed, steps.modes, limits[0], steps.price_kgpj)


@compiled()
def result_of(
    driven: RuleDrive, nox_kg: Array, choices: Choices, span: Span
) -> tuple[float, float, float, float]:
    """Cost, NOx, stored energy beyond what must be left, and 1 where the window is kept and no switch forbidden."""
    case, switch_kg, switch_j, allowed = choices.switching
    cost, nox, inside = 0.0, 0.0, 1.0
    energy, mode = driven.energy_j, driven.mode
    for k in range(len(choices.step_s)):
        entry, to = driven.entry[k], mode[k + 1]
        cost += choices.cost_kg[entry] + switch_kg[case[k], mode[k], to]
        nox += nox_kg[entry]
        between = energy[k] - switch_j[case[k], mode[k], to]
        least, most = min(energy[k + 1], between), max(energy[k + 1], between)
        if not (
            least >= span.least_j and most <= span.greatest_j and allowed[case[k], mode[k], to]
        ):
            inside = 0.0
    return cost, nox, energy[-1] - span.end_j, inside


@compiled()
def judged(
    steps: FamilySteps,
    limits: Array,
    engine: Indices,
    choices: Choices,
    span: Span,
    battery: BatteryArrays,
) -> Array:
    """(member, 4) results of the neutral members with some limits, (member, 3); see `rule_of` and `result_of`."""
    found, hint = np.empty((len(limits), 4)), len(engine) // 2
    for n in range(len(limits)):
        rule = rule_of(steps, limits[n])
        driven, _, (hint, _) = neutral_drive(rule, engine, hint, choices, span, battery)
        found[n] = result_of(driven, steps.nox_kg, choices, span)
    return found


@compiled()
def screened(
    steps: FamilySteps,
    limits: Array,
    engine: Indices,
    choices: Choices,
    span: Span,
    battery: BatteryArrays,
) -> Array:
    """(member, 4) as `judged`, of drives that keep the lowest charging power that is enough to their end."""
    found, levels = np.empty((len(limits), 4)), len(engine)
    lanes, search = empty_lanes(min(_LANES, len(limits)), len(choices.step_s))
    active, begun, slope_j, level = 0, 0, 0.0, levels // 2
    while active > 0 or begun < len(limits):
        while active < len(lanes.least_j) and begun < len(limits):
            rule = rule_of(steps, limits[begun])
            take_up(active, begun, rule, level, levels, lanes, search)
            active, begun = active + 1, begun + 1
        fill(active, engine, lanes, search)
        drive_lanes(
            active, steps.modes, steps.nox_kg, steps.price_kgpj, choices, span, battery, lanes
        )
        # What is tried last lies close to what the next member needs.
        level = search.level[0]
        active, slope_j = narrowed(active, levels, slope_j, lanes, search, found)
    return found
