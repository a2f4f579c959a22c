"""Compiled drives of several members of a rule family side by side, of which only what they come to is kept.

A step waits for the roots and divisions of the one before, of its own drive: those of others fill the time.
"""

from typing import NamedTuple

import numpy as np

from hevopt._compile import compiled
from hevopt.problem._battery_kernels import BatteryArrays, chemical_power, state_at
from hevopt.problem.arrays import Array, Indices
from hevopt.problem.choices import Choices
from hevopt.strategies._rule_kernels import Rule, Span, permitted


class Lanes(NamedTuple):
    """Drives side by side, the first of which are in use.

    electric, fixed: (lane, time) entries as in Rule; taken: (lane, time) fixed ones, else the engine's
    least_j: (lane,) as in Rule; stored_j, mode: (lane,) where they are
    totals: (lane, 4) cost, NOx, stored energy beyond what must be left, and 1 where the window is kept and no
    switch forbidden
    """

    electric: Indices
    fixed: Indices
    taken: Indices
    least_j: Array
    stored_j: Array
    mode: Indices
    totals: Array


class Search(NamedTuple):
    """The search of each lane's member for the lowest charging power that leaves enough.

    member, level: (lane,) whose it is, and the level that is tried next
    low, high: (lane,) the highest level that is known to leave too little, the lowest to leave enough; -1 and as
    many as there are where none is known; low_j, high_j: (lane,) what they leave beyond what must be left
    """

    member: Indices
    level: Indices
    low: Indices
    high: Indices
    low_j: Array
    high_j: Array


@compiled()
def empty_lanes(lanes: int, steps: int) -> tuple[Lanes, Search]:
    """Lanes that are not in use."""
    entries, whole, figures = (
        np.empty((3, lanes, steps), np.int64),
        np.empty((5, lanes), np.int64),
        np.empty((4, lanes)),
    )
    drives = Lanes(
        entries[0], entries[1], entries[2], figures[0], figures[1], whole[0], np.empty((lanes, 4))
    )
    return drives, Search(whole[1], whole[2], whole[3], whole[4], figures[2], figures[3])


@compiled()
def take_up(
    lane: int, member: int, rule: Rule, level: int, levels: int, lanes: Lanes, search: Search
) -> None:
    """Begin the search of a member in a lane, with a level."""
    lanes.electric[lane], lanes.fixed[lane], lanes.least_j[lane] = (
        rule.electric,
        rule.fixed,
        rule.least_j,
    )
    search.member[lane], search.level[lane] = member, level
    search.low[lane], search.high[lane] = -1, levels


@compiled()
def drive_lanes(
    active: int,
    modes: Indices,
    nox_kg: Array,
    price_kgpj: float,
    choices: Choices,
    span: Span,
    battery: BatteryArrays,
    lanes: Lanes,
) -> None:
    """Drive the lanes in use from start to end, with what each takes; see `drive_on` and `result_of`."""
    power, cost, step_s = choices.power_w, choices.cost_kg, choices.step_s
    case, switch_kg, switch_j, allowed = choices.switching
    electric, _, taken, least_j, stored, mode, totals = lanes
    for n in range(active):
        stored[n], mode[n] = span.start.energy_j, span.start.mode
        totals[n, 0], totals[n, 1], totals[n, 3] = 0.0, 0.0, 1.0
    for k in range(len(step_s)):
        of = case[k]
        for n in range(active):
            before, chosen = mode[n], taken[n, k]
            if electric[n, k] >= 0 and stored[n] > least_j[n]:
                chosen = electric[n, k]
            if not allowed[of, before, modes[chosen]]:
                chosen = permitted(chosen, k, before, modes, price_kgpj, choices)
            after = modes[chosen]
            between = stored[n] - switch_j[of, before, after]
            _, voltage, discharge, charging = state_at(between, battery)
            drain_w = chemical_power(
                power[chosen], voltage, discharge, charging, battery.coulombic_efficiency
            )
            end = between - step_s[k] * drain_w
            totals[n, 0] += cost[chosen] + switch_kg[of, before, after]
            totals[n, 1] += nox_kg[chosen]
            kept = min(end, between) >= span.least_j and max(end, between) <= span.greatest_j
            if not (kept and allowed[of, before, after]):
                totals[n, 3] = 0.0
            stored[n], mode[n] = end, after
    for n in range(active):
        totals[n, 2] = stored[n] - span.end_j


@compiled()
def fill(active: int, engine: Indices, lanes: Lanes, search: Search) -> None:
    """What the lanes in use take but for electric driving, of the level that each tries next."""
    for n in range(active):
        fixed, level, taken = lanes.fixed[n], engine[search.level[n]], lanes.taken[n]
        for k in range(len(fixed)):
            taken[k] = fixed[k] if fixed[k] >= 0 else level[k]


@compiled()
def narrowed(
    active: int, levels: int, slope_j: float, lanes: Lanes, search: Search, found: Array
) -> tuple[int, float]:
    """How many lanes go on, first of all, after a drive of each, and about what a level more leaves, 0 where that
    is not known yet.

    found: (member, 4) results, of the lowest level that leaves enough; of the highest where none does
    """
    member, level, low, high, low_j, high_j = search
    kept = 0
    for n in range(active):
        beyond_j = lanes.totals[n, 2]
        if beyond_j >= 0.0:
            high[n], high_j[n] = level[n], beyond_j
        else:
            low[n], low_j[n] = level[n], beyond_j
        if beyond_j >= 0.0 or high[n] == levels:
            found[member[n]] = lanes.totals[n]
        if low[n] >= 0 and high[n] < levels:
            slope_j = (high_j[n] - low_j[n]) / (high[n] - low[n])
        if high[n] - low[n] > 1:
            level[n] = _next(low[n], high[n], low_j[n], high_j[n], levels, slope_j)
            if kept < n:
                lanes.electric[kept], lanes.fixed[kept] = lanes.electric[n], lanes.fixed[n]
                lanes.least_j[kept] = lanes.least_j[n]
                member[kept], level[kept], low[kept], high[kept] = (
                    member[n],
                    level[n],
                    low[n],
                    high[n],
                )
                low_j[kept], high_j[kept] = low_j[n], high_j[n]
            kept += 1
    return kept, slope_j


@compiled()
def _next(low: int, high: int, low_j: float, high_j: float, levels: int, slope_j: float) -> int:
    """The level to try next, where what is left would be just enough if it rose evenly; half-way where that cannot
    be told, as beyond what the battery can give.
    """
    if low >= 0 and high < levels:
        share = low_j / (low_j - high_j)
    else:
        share = (-low_j if low >= 0 else high_j) / (slope_j * (high - low))
    if not 0.0 < share < 1.0:
        share = 0.5
    far = max(int(np.ceil(share * (high - low))), 1)
    return min(low + far, high - 1) if low >= 0 else max(high - far, 0)
