"""Equivalent consumption minimisation: fuel plus a constant price on the battery's chemical power.

Each step takes the control of least  cost + s x (fall of stored energy); switching costs are exact, the mode
path being the shortest under that price (Viterbi), and the fall is that of the true battery at the present state
of charge. s, the equivalence factor in kg/J, is found so that the charge is neutral.

The end charge jumps as s moves, because a nearly straight fuel map makes many steps change at one price. Where
no s is neutral two neighbouring factors share the cycle, changing once on the way, in either order; and a plan
that would end short is also tried with the charge made good as late as possible. The cheapest plan tried that
ends with at least the asked charge is taken.

Where the charge window binds, s jumps: one factor a stretch is found (bounds/segments.py), and their mixed path
followed.
"""

import numpy as np

from hevopt.bounds.bounded import drain_at_j
from hevopt.bounds.prices import one_price_dual, typical_price_kgpj
from hevopt.bounds.segments import binds, segments
from hevopt.problem.problem import Plan, Problem
from hevopt.strategies._priced_drives import PricedDrive, PricedDrives

_FACTOR_TOLERANCE = 1e-7
# Factors tried first, as shares of a guess; where the charge keeps on the same side, each is raised to a power.
_BESIDE, _FURTHER = (0.995, 1.005), 4
# Times the guess beyond which no factor is tried.
_DEAREST = 1e6
# Trials between two factors; how often a trial may leave the charge on the side of the one before until only the
# halves are tried.
_TRIALS_MAX, _MISSED_MAX = 100, 4
# A factor below this share of the guess decides among free controls alone, as the least factor above 0 does.
_NEGLIGIBLE = 1e-9
# Passes over the segments; pulls to their path, as shares of the factor.
_PASSES = 2
_PULLS = (1e-3, 1e-2, 0.05, 0.15)


def solve(problem: Problem) -> Plan:
    """The cheapest plan of one factor, or a pair of neighbouring factors, that keeps the charge."""
    drives = PricedDrives(problem)
    guess = one_price_dual(problem)[-1].price_kgpj
    guess = guess or typical_price_kgpj(drives.choices, drives.drain_j)
    cheap, dear = _neutral_factors(drives, guess)
    drives.under(cheap.factor, to_the_end=True)
    drives.under(guess, to_the_end=True)
    if cheap.factor < dear.factor:
        _change_once(drives, dear, cheap)
        _change_once(drives, cheap, dear)
    if binds(problem, drives.choices, drives.drain_j, cheap.factor, dear.factor):
        _follow_segments(drives, guess)
    first, last = drives.best_prices
    notes = {"price_kgpj": first, "price_at_end_kgpj": last}
    return Plan(drives.best_control, notes)


def _follow_segments(drives: PricedDrives, guess: float) -> None:
    """Try factors that jump where the window binds, drawn to the charge that they stand for; twice, the second time
    with falls of stored energy as they are along it."""
    problem, choices = drives.problem, drives.choices
    drain_j = drives.drain_j
    for _ in range(_PASSES):
        found = segments(problem, choices, drain_j, guess)
        for pull in _PULLS:
            drives.follow(
                found.price_kgpj, found.energy_j, pull * max(guess, found.price_kgpj.max())
            )
        drain_j = drain_at_j(problem, choices, found.energy_j[:-1])


def _change_once(drives: PricedDrives, before: PricedDrive, after: PricedDrive) -> None:
    """Try factors that change once, at neighbouring steps of which one leaves less charge and one enough.

    The change matters only at steps at which the plans of the two factors differ. What one stores up to a step, and
    the other from it on, tells about where it is; steps further and further from there, up to half-way, are tried
    until they are found.
    """
    steps, apart = np.arange(drives.choices.steps), np.flatnonzero(before.path != after.path)

    def changed(until: int, *, to_the_end: bool = False) -> PricedDrive:
        factors = np.where(steps < until, before.factor, after.factor)
        return drives.under(factors, to_the_end=to_the_end)

    left_j = after.surplus_j + (before.energy_j - after.energy_j)[np.append(apart, len(steps))]
    rising, there = before.factor > after.factor, np.flatnonzero(left_j >= 0.0)
    less, enough = (0, len(apart)) if rising else (len(apart), 0)
    middle, stride = int(there[0] if rising else there[-1]), 1
    while abs(enough - less) > 1:
        middle = min(max(middle, min(less, enough) + 1), max(less, enough) - 1)
        if changed(apart[middle - 1] + 1).surplus_j >= 0:
            enough = middle
        else:
            less = middle
        halfway = (less + enough) // 2
        away = min(stride, abs(halfway - middle))
        middle += away if halfway > middle else -away
        stride *= 2
    changed(apart[less] if rising else apart[less - 1] + 1, to_the_end=True)


def _neutral_factors(drives: PricedDrives, guess: float) -> tuple[PricedDrive, PricedDrive]:
    """Neighbouring factors of which the cheaper leaves too little charge and the dearer enough.

    Where no factor tried leaves enough, both are the dearest.
    """
    below, above = _BESIDE
    cheap, dear = drives.under(below * guess), None
    if cheap.surplus_j >= 0:
        free = drives.under(0.0)
        if free.surplus_j >= 0:
            return free, free
    while cheap.surplus_j >= 0:
        if cheap.factor <= _NEGLIGIBLE * guess:
            return free, cheap
        below **= _FURTHER
        dear, cheap = cheap, drives.under(below * guess)
    dear = dear or drives.under(above * guess)
    while dear.surplus_j < 0:
        above **= _FURTHER
        if above > _DEAREST:
            return dear, dear
        cheap, dear = dear, drives.under(above * guess)
    return _neighbours(drives, cheap, dear)


def _neighbours(
    drives: PricedDrives, cheap: PricedDrive, dear: PricedDrive
) -> tuple[PricedDrive, PricedDrive]:
    """Two factors between two, as close together as can be, of which one leaves too little charge and one enough.

    Tried is where the plan seems to change from one to the other; where that was off, further on, towards the plan
    that is missing yet; and where it is off again and again, half-way between.
    """
    even, missed, toward = cheap.factor, 0, 0.0
    for _ in range(_TRIALS_MAX):
        least = _FACTOR_TOLERANCE * dear.factor
        if dear.factor - cheap.factor <= least:
            break
        factor = cheap.factor
        if missed < _MISSED_MAX:
            last, even = even, _even_factor(drives, cheap, dear)
            factor = even + toward * max(0.4 * least, 2.0 * missed * abs(even - last))
        if not cheap.factor < factor < dear.factor:
            factor = (cheap.factor + dear.factor) / 2
        tried = drives.under(factor)
        before, toward = toward, -1.0 if tried.surplus_j >= 0 else 1.0
        cheap, dear = (cheap, tried) if toward < 0 else (tried, dear)
        missed += before == toward
    return cheap, dear


def _even_factor(drives: PricedDrives, cheap: PricedDrive, dear: PricedDrive) -> float:
    """About the factor between two at which the plan changes from too little charge to enough.

    Where their plans part, the dearer factor takes what drains less; at some factor between both ways on are worth
    the same. From the cheaper plan on, such partings are passed by rising factor until the charge is enough.
    """
    both, price = (cheap, dear), np.array([cheap.factor, dear.factor])
    switches = [drives.switches(drive) for drive in both]
    k = np.flatnonzero((cheap.path != dear.path) & (switches[0].before == switches[1].before))
    worth_kg = []
    for drive, switch in zip(both, switches, strict=True):
        entry, taken_j = drive.path[k], switch.energy_j[k]
        fall_j = taken_j + drives.falls_j(entry, k, cheap.energy_j[k] - taken_j)
        ahead_kg = np.stack([of.to_go_kg[k + 1, switch.mode[k]] for of in both])
        step_kg = drives.choices.cost_kg[entry] + switch.kg[k]
        worth_kg.append(step_kg + price[:, None] * fall_j + ahead_kg)
    below, above = worth_kg[1] - worth_kg[0]
    share = np.divide(below, below - above, out=np.full(len(k), 0.5), where=below > above)
    factor = cheap.factor + np.clip(share, 0.0, 1.0) * (dear.factor - cheap.factor)
    gained_j = np.diff((dear.energy_j - cheap.energy_j)[np.append(k, -1)])
    order = np.argsort(factor, kind="stable")
    enough = cheap.surplus_j + np.cumsum(gained_j[order]) >= 0.0
    return float(factor[order[np.argmax(enough)]]) if enough.any() else dear.factor
