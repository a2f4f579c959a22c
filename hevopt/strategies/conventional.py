"""The rule-based fuel strategy of the study.

Above a state of charge the car is driven electrically up to a power and a speed; it recovers what braking gives;
otherwise the engine runs and shifts its load point, up or down, to keep the charge neutral; it rests at standstill.
The three thresholds stand in the car's file (`[rules]`); those that do not are calibrated together: of the whole
family, the member of least charge-corrected cost. A grid over all three is screened; from its best member on, each
threshold in turn goes through all its values, the others kept, until none gives less.
"""

from collections.abc import Sequence
from itertools import product

import numpy as np

from hevopt.problem.arrays import Array, Indices, rising
from hevopt.problem.problem import Plan, Problem
from hevopt.strategies._rules import (
    Calibrated,
    ElectricLimits,
    Rules,
    as_tried,
    calibrated,
    corrected_kg,
    eligible,
    engine_entries,
    figures_of,
    rules_of,
    told,
)
from hevopt.strategies._rules_driven import DrivenRule

# Values of each threshold; of the window's width above its lower end, those of the state of charge.
_POWERS, _SPEEDS = 24, 12
_SOC_SHARES = np.linspace(0.05, 0.5, 10)
_ROUNDS = 8
# Screened is every second value of each threshold: with every fourth, members passed over burnt up to 8 % less,
# with every third up to 1 %, with these up to 0.1 % (9 cars and cycles, against the whole family).
_COARSE = 2


def start(
    problem: Problem,
    *,
    thresholds_w: Sequence[float] | None = None,
    thresholds_mps: Sequence[float] | None = None,
    thresholds_soc: Sequence[float] | None = None,
) -> Calibrated:
    """The family's member that suits the problem best; see `solve`."""
    rules = rules_of(problem)
    engine = engine_entries(rules)
    asked = thresholds_soc, thresholds_w, thresholds_mps
    axes = [
        np.asarray(usual if own is None else own, dtype=np.float64)
        for own, usual in zip(asked, _axes(rules), strict=True)
    ]
    coarse = [rising(axis[::_COARSE], axis[-1:]) for axis in axes]
    near = [ElectricLimits(*limits) for limits in product(*coarse)]
    quick, exact = _Judged(rules, engine, quick=True), _Judged(rules, engine, quick=False)
    centre = near[int(np.argmin(_ranked(rules, quick.figures(near))))]
    centre, _ = _improved(quick, axes, centre)
    centre, results = _improved(exact, axes, centre)
    family = as_tried(_sections(axes, centre), engine, results)
    own = told(centre).items()
    return calibrated(
        rules, family, lambda member: (member["corrected_kg"], not own <= member.items())
    )


def start_on(problem: Problem, points: Problem, interval_s: float) -> DrivenRule:
    """The member that suits the problem best, on operating points: any of them, however often."""
    return DrivenRule(start(problem), points, interval_s)


def solve(
    problem: Problem,
    *,
    thresholds_w: Sequence[float] | None = None,
    thresholds_mps: Sequence[float] | None = None,
    thresholds_soc: Sequence[float] | None = None,
) -> Plan:
    """The family's best member; notes["calibration"] holds the curve over each threshold, the others kept.

    thresholds_*: values to choose from in place of the usual ones, evenly up to the highest power and speed driven
    electrically, and from near the lower end of the window to its middle
    """
    return start(
        problem,
        thresholds_w=thresholds_w,
        thresholds_mps=thresholds_mps,
        thresholds_soc=thresholds_soc,
    ).plan


def _axes(rules: Rules) -> list[Array]:
    """Values of each threshold, rising: those of the file where it gives them."""
    steps, given, battery = rules.steps, rules.problem.thresholds.electric, rules.problem.battery
    width = battery.soc_max - battery.soc_min
    top_w, top_mps = (
        float(np.max(of[rules.electric], initial=0.0)) for of in (steps.power_w, steps.speed_mps)
    )
    usual = [
        battery.soc_min + _SOC_SHARES * width,
        np.linspace(0.0, top_w, _POWERS),
        np.linspace(0.0, top_mps, _SPEEDS + 1)[1:],
    ]
    return [
        axis if own is None else np.array([own]) for axis, own in zip(usual, given, strict=True)
    ]


class _Judged:
    """Figures of members, worked out once for all that drive electrically at the same steps, above one charge."""

    def __init__(self, rules: Rules, engine: Indices, *, quick: bool) -> None:
        self.rules, self._engine, self._quick = rules, engine, quick
        self._driven: dict[tuple[float, float], bytes] = {}
        self._found: dict[tuple[float, bytes], Array] = {}

    def figures(self, limits: Sequence[ElectricLimits]) -> Array:
        """(member, 4); see `figures_of`."""
        alike = [(own.soc, self._steps(own.power_w, own.speed_mps)) for own in limits]
        new = {key: own for key, own in zip(alike, limits, strict=True) if key not in self._found}
        if new:
            found = figures_of(self.rules, list(new.values()), self._engine, quick=self._quick)
            self._found |= zip(new, found, strict=True)
        return np.array([self._found[key] for key in alike])

    def _steps(self, power_w: float, speed_mps: float) -> bytes:
        """The steps of driving within a power and a speed, as a key."""
        if (power_w, speed_mps) not in self._driven:
            steps = self.rules.steps
            within = (steps.power_w <= power_w) & (steps.speed_mps <= speed_mps)
            self._driven[power_w, speed_mps] = np.packbits(self.rules.electric & within).tobytes()
        return self._driven[power_w, speed_mps]


def _improved(
    judged: _Judged, axes: Sequence[Array], centre: ElectricLimits
) -> tuple[ElectricLimits, Array]:
    """A member that none on the lines through it is better than, found from another on, and the figures there."""
    for improved in range(_ROUNDS + 1):
        limits = _sections(axes, centre)
        results = judged.figures(limits)
        ranks = _ranked(judged.rules, results)
        best = int(np.argmin(ranks))
        if improved == _ROUNDS or ranks[best] >= ranks[limits.index(centre)]:
            break
        centre = limits[best]
    return centre, results


def _ranked(rules: Rules, results: Array) -> Array:
    """(member,) corrected cost; beyond all others where the end charge is off, and where it is not inside."""
    corrected, inside = corrected_kg(rules, results), results[:, 3] > 0
    beyond = 1.0 + np.ptp(corrected)
    ranks: Array = corrected + beyond * ~eligible(rules, results) + beyond * ~inside
    return ranks


def _sections(axes: Sequence[Array], centre: ElectricLimits) -> list[ElectricLimits]:
    """The members on lines through one, a line along each axis; on the first line it stands itself."""
    power = [centre._replace(power_w=float(value)) for value in rising(axes[1], [centre.power_w])]
    speed = [centre._replace(speed_mps=float(value)) for value in axes[2]]
    soc = [centre._replace(soc=float(value)) for value in axes[0]]
    return [*power, *(limits for limits in (*speed, *soc) if limits != centre)]
