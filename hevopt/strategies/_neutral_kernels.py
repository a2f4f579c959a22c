"""Compiled search for the charging power with which a rule keeps the charge."""

import numpy as np

from hevopt._compile import compiled
from hevopt.problem._battery_kernels import BatteryArrays, chemical_power, state_at
from hevopt.problem.arrays import Indices
from hevopt.problem.choices import Choices, State
from hevopt.strategies._rule_kernels import Rule, RuleDrive, Span, drive_on, permitted


@compiled()
def lane_of(drives: RuleDrive, lane: int) -> RuleDrive:
    """One of several drives, (lane, ...)."""
    return RuleDrive(drives.entry[lane], drives.energy_j[lane], drives.mode[lane])


@compiled()
def drive_abreast(
    rule: Rule,
    engine: Indices,
    begins: Indices,
    choices: Choices,
    battery: BatteryArrays,
    drives: RuleDrive,
) -> None:
    """Drive on as `drive_on`, (lane, ...), from (lane,) steps on, with engine's entries (lane, time).

    A step waits for the divisions of the one before: several drives wait together, hardly longer than one.
    """
    power, step_s = choices.power_w, choices.step_s
    case, _, switch_j, allowed = choices.switching
    (electric, fixed, modes, least_j, price_kgpj), efficiency = rule, battery.coulombic_efficiency
    entry, energy, mode = drives
    for k in range(begins.min(), len(step_s)):
        for lane in range(len(begins)):
            if k < begins[lane]:
                continue
            stored, before = energy[lane, k], mode[lane, k]
            chosen = fixed[k] if fixed[k] >= 0 else engine[lane, k]
            if electric[k] >= 0 and stored > least_j:
                chosen = electric[k]
            if not allowed[case[k], before, modes[chosen]]:
                chosen = permitted(chosen, k, before, modes, price_kgpj, choices)
            after = modes[chosen]
            between = stored - switch_j[case[k], before, after]
            _, voltage, discharge, charging = state_at(between, battery)
            drain_w = chemical_power(power[chosen], voltage, discharge, charging, efficiency)
            entry[lane, k], mode[lane, k + 1] = chosen, after
            energy[lane, k + 1] = between - step_s[k] * drain_w


@compiled()
def abreast_at_rest(lanes: int, steps: int, start: State) -> RuleDrive:
    """Drives before their first step."""
    drives = RuleDrive(
        np.empty((lanes, steps), dtype=np.int64),
        np.empty((lanes, steps + 1)),
        np.empty((lanes, steps + 1), dtype=np.int64),
    )
    drives.energy_j[:, 0], drives.mode[:, 0] = start.energy_j, start.mode
    return drives


@compiled()
def enough(
    rule: Rule,
    engine: Indices,
    hint: int,
    choices: Choices,
    span: Span,
    battery: BatteryArrays,
    drives: RuleDrive,
) -> tuple[int, int, int]:
    """The lowest charging power, (level,), that ends with enough charge; as many as there are where none does. With
    it the lanes of the drives that keep that level and the one below, -1 where there is no such level.

    engine: (level, time) entries by rising charging power; drives: of three lanes
    More charging leaves more charge, so that levels further and further from a hint are tried until one is enough
    and one is not, then those half-way between. The first three are driven abreast.
    """
    top, first = len(engine) - 1, np.zeros(3, dtype=np.int64)
    level = min(hint, top)
    held = np.minimum(max(min(level - 1, top - 2), 0) + np.arange(3), top)
    drive_abreast(rule, engine[held], first, choices, battery, drives)
    low, high, step, of_low, of_high = -1, len(engine), 1, -1, -1
    while high - low > 1:
        lane = -1
        for n in range(3):
            if held[n] == level:
                lane = n
        if lane < 0:
            lane = 0
            while lane == of_low or lane == of_high:
                lane += 1
            held[lane] = level
            drive_on(rule, engine[level], 0, choices, battery, lane_of(drives, lane))
        if drives.energy_j[lane, -1] >= span.end_j:
            high, of_high = level, lane
        else:
            low, of_low = level, lane
        if low < 0:
            level = max(high - step, 0)
        elif high == len(engine):
            level = min(low + step, high - 1)
        else:
            level = (low + high) // 2
        step *= 2
    return high, of_high, of_low


@compiled()
def neutral_drive(
    rule: Rule, engine: Indices, hint: int, choices: Choices, span: Span, battery: BatteryArrays
) -> tuple[RuleDrive, Indices, tuple[int, int]]:
    """The drive whose charging power ends with enough charge or just more, the engine's entries in it, (time,), and
    of which level they are before which step; from there on of the one below.

    The lowest level that reaches the charge is kept up to the first step that will do, the one below it from there
    on; where none reaches it, the highest is kept.
    """
    steps = len(choices.step_s)
    drives = abreast_at_rest(3, steps, span.start)
    level, of_level, of_below = enough(rule, engine, hint, choices, span, battery, drives)
    driven = lane_of(drives, of_level if of_level >= 0 else of_below)
    if level == 0 or level == len(engine):
        kept = min(level, len(engine) - 1)
        return driven, engine[kept], (kept, steps)
    below, lower = lane_of(drives, of_below), engine[level - 1]
    until = _change(rule, lower, below, choices, span, battery, driven)
    taken = np.concatenate((engine[level, :until], lower[until:]))
    return driven, taken, (level, until)


@compiled()
def _change(
    rule: Rule,
    engine: Indices,
    below: RuleDrive,
    choices: Choices,
    span: Span,
    battery: BatteryArrays,
    driven: RuleDrive,
) -> int:
    """The first step from which on the engine's entries, (time,), of a lower charging power leave enough charge.

    driven: a drive that keeps a level that is enough, which is changed to it there

    What that drive gains on the one of the lower level, `below`, up to a step tells about where the step is; steps
    further and further from there are tried until one is enough and one is not, then those half-way between.
    """
    steps = len(choices.step_s)
    missing_j, middle = span.end_j - below.energy_j[-1], 1
    while middle < steps - 1 and driven.energy_j[middle] - below.energy_j[middle] < missing_j:
        middle += 1
    trials, both = abreast_at_rest(2, steps, span.start), np.empty((2, steps), dtype=np.int64)
    both[:] = engine
    held = np.array([max(middle - 1, 1), middle])
    for lane in range(2):
        _meet(driven, held[lane], lane_of(trials, lane))
    drive_abreast(rule, both, held, choices, battery, trials)
    short, until, step = 0, steps, 1
    while until - short > 1:
        lane = 0 if middle == held[0] else 1
        tried = lane_of(trials, lane)
        if middle != held[lane]:
            _meet(driven, middle, tried)
            drive_on(rule, engine, middle, choices, battery, tried)
            held[lane] = middle
        if tried.energy_j[-1] >= span.end_j:
            until = middle
            driven.entry[until:] = tried.entry[until:]
            driven.energy_j[until:], driven.mode[until:] = (
                tried.energy_j[until:],
                tried.mode[until:],
            )
        else:
            short = middle
        middle = (short + until) // 2
        if short == 0:
            middle = max(until - step, middle)
        elif until == steps:
            middle = min(short + step, middle)
        step *= 2
    return until


@compiled()
def _meet(driven: RuleDrive, step: int, other: RuleDrive) -> None:
    """Another drive before a step as one is."""
    other.energy_j[step], other.mode[step] = driven.energy_j[step], driven.mode[step]
