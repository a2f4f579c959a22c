"""Designs of a sizing, judged: requirements first, then bounds, then solved where no bound condemns them.

A design that misses a requirement is not solved; nor is one whose certified bound lies above what another design
reaches in every objective. What is solved depends on the order in which designs are asked for, not on workers.
"""

import json
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from math import fsum, isfinite

from hevopt.car.architecture import Architecture
from hevopt.car_files.load import load_architecture
from hevopt.errors import DataError
from hevopt.sizing.requirements import MISSED, Required, reached
from hevopt.sizing.study_file import SizeStudy
from hevopt.sweeps.plan.designs import Design
from hevopt.sweeps.plan.jobs import BOUND, Job, Planned, jobs_of
from hevopt.sweeps.plan.parameters import Scalar
from hevopt.sweeps.plan.prune import Pruned, follows
from hevopt.sweeps.store.store import Store

# Designs solved between two looks at what is best: few, so that bounds spare many.
_SOLVED_AT_ONCE = 4


class Fate(StrEnum):
    """What became of a design."""

    SOLVED = "solved"
    DISCARDED = "discarded by its bound"
    MISSES = "misses a requirement"
    EXCLUDED = "excluded by a constraint"
    NO_CAR = "no car"
    INFEASIBLE = "does not follow a cycle"


@dataclass(slots=True)
class Candidate:
    """A design and what became of it.

    required: what it reaches; bounds, values: of each objective, no less than and as reached; None where not known
    fuel_l_per_100km, bound_l_per_100km: by cycle
    """

    design: Design
    fate: Fate
    car: Architecture | None = None
    required: list[Required] = field(default_factory=list)
    why: str = ""
    bounds: tuple[float, ...] | None = None
    values: tuple[float, ...] | None = None
    fuel_l_per_100km: tuple[float, ...] = ()
    bound_l_per_100km: tuple[float, ...] = ()

    @property
    def excess(self) -> float:
        """By how much it misses what is asked, 0 where it meets all."""
        if self.fate in (Fate.NO_CAR, Fate.INFEASIBLE, Fate.EXCLUDED):
            return 10 * MISSED
        return fsum(max(one.excess, 0.0) for one in self.required)


def rank(one: Candidate) -> tuple[tuple[float, ...], int]:
    """By which solved designs are ordered: the first objective's least first."""
    return one.values or (), one.design.number


def least_bound(found: Iterable[Candidate]) -> float | None:
    """What none of some designs that meet what is asked can be below in the first objective: their least bound.
    None where one has none."""
    asked = [one for one in found if one.fate in (Fate.SOLVED, Fate.DISCARDED)]
    bounds = [one.bounds[0] for one in asked if one.bounds is not None]
    return min(bounds) if bounds and len(bounds) == len(asked) else None


# Runs those cases of some jobs, by their keys, that the store lacks.
Runner = Callable[[Sequence[Job], Iterable[str]], None]


class Candidates:
    """All designs asked for so far, in order; each is judged once."""

    def __init__(self, study: SizeStudy, store: Store, meta: dict[str, str], run: Runner) -> None:
        self.study, self.store, self.meta, self.run = study, store, meta, run
        self.found: list[Candidate] = []
        self._known: dict[str, Candidate] = {}
        self._planned: list[Planned] = []
        self._pruned: list[Pruned] = []

    def judged(self, wanted: Sequence[dict[str, Scalar]]) -> list[Candidate]:
        """The candidates of some values of the parameters, in their order."""
        new: list[Candidate] = []
        keys = [json.dumps(values, sort_keys=True) for values in wanted]
        for key, values in zip(keys, wanted, strict=True):
            if key not in self._known:
                self._known[key] = self._candidate(values)
                self.found.append(self._known[key])
                new.append(self._known[key])
        self._solve([one for one in new if one.fate is Fate.SOLVED])
        return [self._known[key] for key in keys]

    @property
    def solved(self) -> list[Candidate]:
        """Those that meet all requirements and were solved."""
        return [one for one in self.found if one.fate is Fate.SOLVED and one.values is not None]

    def _candidate(self, values: dict[str, Scalar]) -> Candidate:
        study = self.study.sweep
        design = Design(len(self.found), values, study.source.parent, study.derived)
        one = Candidate(design, Fate.SOLVED)
        try:
            if not all(rule.holds(values) for rule in study.constraints):
                one.fate = Fate.EXCLUDED
                return one
            one.car = load_architecture(study.architecture, design.changes)
        except DataError as error:
            one.fate, one.why = Fate.NO_CAR, " ".join(str(error).split())
            return one
        one.required = reached(one.car, self.study.require)
        if any(not required.excess <= 0 for required in one.required):
            one.fate = Fate.MISSES
        return one

    def _solve(self, new: Sequence[Candidate]) -> None:
        study = self.study.sweep
        names = [BOUND, *study.strategies]
        groups = [(one.design.changes, [(one.design.number, 0.0)]) for one in new]
        found = list(
            jobs_of(
                study.architecture, study.cycles, names, groups,
                allow_shortfall=study.allow_shortfall, brought=study.brought,
            )
        )  # fmt: skip
        jobs = [job for job, _ in found]
        plan: dict[int, list[Planned]] = {one.design.number: [] for one in new}
        for _, cases in found:
            self._planned += cases
            plan[cases[0].design] += cases
        # A store's designs have cases; what misses a requirement has none.
        planned = {case.design for case in self._planned}
        designs = (
            (one.design.number, one.design.values)
            for one in self.found
            if one.design.number in planned
        )
        self.store.begin(self.meta, designs, self._planned)
        every = [case for cases in plan.values() for case in cases]
        self.run(jobs, [case.key for case in every if case.strategy == BOUND])
        for one in new:
            self._bound(one, plan[one.design.number])
        waiting = sorted(
            (one for one in new if one.fate is Fate.SOLVED),
            key=lambda one: (one.bounds or (), one.design.number),
        )
        while waiting:
            for one in waiting:
                better = self._better(one)
                if better is not None:
                    one.fate = Fate.DISCARDED
                    self._discard(one, better)
            waiting = [one for one in waiting if one.fate is Fate.SOLVED]
            now, waiting = waiting[:_SOLVED_AT_ONCE], waiting[_SOLVED_AT_ONCE:]
            keys = [c.key for one in now for c in plan[one.design.number] if c.strategy != BOUND]
            self.run(jobs, keys)
            for one in now:
                self._result(one, plan[one.design.number])
        self.store.prune(self._pruned)

    def _bound(self, one: Candidate, cases: Sequence[Planned]) -> None:
        figures = self._figures(one, [c for c in cases if c.strategy == BOUND], "bound_l_per_100km")
        if figures is not None:
            one.bound_l_per_100km = figures
            one.bounds = self._values(one, figures)

    def _result(self, one: Candidate, cases: Sequence[Planned]) -> None:
        solved = [case for case in cases if case.strategy != BOUND]
        figures = self._figures(one, solved, "objective_l_per_100km")
        if figures is None:
            one.fate = Fate.INFEASIBLE
            return
        one.fuel_l_per_100km, one.values = figures, self._values(one, figures)
        bounds = self._figures(one, solved, "objective_bound_l_per_100km")
        if bounds is not None:
            one.bound_l_per_100km, one.bounds = bounds, self._values(one, bounds)

    def _figures(
        self, one: Candidate, cases: Sequence[Planned], name: str
    ) -> tuple[float, ...] | None:
        """A figure on each cycle; None, and the design's fate, where a cycle has none."""
        rows = dict(self.store.rows(case.key for case in cases))
        if any(rows.get(case.key) is None for case in cases) or not follows(rows.values()):
            one.fate = Fate.INFEASIBLE
            return None
        found = tuple((rows[case.key] or {}).get(name) for case in cases)
        known = tuple(figure for figure in found if figure is not None and isfinite(figure))
        return known if len(known) == len(found) else None

    def _values(self, one: Candidate, fuel: Sequence[float]) -> tuple[float, ...]:
        mean = fsum(w * f for w, f in zip(self.study.weights, fuel, strict=True))
        assert one.car is not None  # a design that is solved is a car
        return tuple(objective.value(one.car, mean) for objective in self.study.objectives)

    def _better(self, one: Candidate) -> Candidate | None:
        """A solved design that reaches, in every objective, no more than the bounds of this one."""
        if one.bounds is None:
            return None
        bounds = one.bounds
        return next(
            (
                other
                for other in self.solved
                if other is not one
                and all(b >= value for b, value in zip(bounds, other.values or (), strict=True))
                and bounds != other.values
            ),
            None,
        )

    def _discard(self, one: Candidate, better: Candidate) -> None:
        """Keep by what a design was discarded, where that is its fuel, so that nobody waits for its results."""
        if [dict(objective.weights) for objective in self.study.objectives] != [{"fuel": 1.0}]:
            return
        assert one.bounds is not None and better.values is not None  # as both were compared
        self._pruned.append(
            Pruned(one.design.number, one.bounds[0], better.design.number, better.values[0])
        )
