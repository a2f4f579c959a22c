"""The strategies of some cars on a cycle, solved car by car."""

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import partial
from typing import NamedTuple

from hevopt.car.architecture import Architecture
from hevopt.driving.cycle import Cycle
from hevopt.errors import HevoptError, InfeasibleError, SolverError, UnknownNoxError
from hevopt.powertrain._torque_kernels import resolved
from hevopt.problem.problem import Plan, Problem, Trajectory
from hevopt.strategies import Strategy, strategy_named
from hevopt.studies.case import Case, prepare
from hevopt.studies.halves import SharedCount, halves, nothing, two_processors
from hevopt.studies.rows import Row, failed_row
from hevopt.studies.settings import Settings
from hevopt.studies.solved import run_case, why_not_causal

_FAILURES = (InfeasibleError, SolverError, UnknownNoxError)
# Two processes hold two tables: at this length about as much as the longest drives take of one.
_FORK_SAMPLES_MAX = 20_000
_FORK_CARS_MAX = 64

# Called with what comes next, and how many of how many are done.
Progress = Callable[[str, int, int], None]
# Called with every solved case, its row (no reference yet), plan and trajectory.
Observe = Callable[[Case, Row, Plan, Trajectory], None]


def unseen(text: str, done: int, total: int) -> None:
    """Nobody looks on."""


def unobserved(case: Case, row: Row, plan: Plan, trajectory: Trajectory) -> None:
    """Nobody keeps anything."""


class Watch(NamedTuple):
    """Who is told while a comparison runs.

    progress: what comes next, and how many cases of how many are done
    observe: every solved case, its row (no reference yet), plan and trajectory
    meanwhile: called where this process would only wait for another, so that what comes after is there
    """

    progress: Progress = unseen
    observe: Observe = unobserved
    meanwhile: Callable[[], None] = nothing


NOBODY = Watch()


class OfCar(NamedTuple):
    """What is found of one car; names as in `Comparison`."""

    rows: list[Row]
    failures: dict[str, HevoptError]
    lost: dict[str, str]
    peeking: dict[tuple[str, str], str]


@dataclass(frozen=True, slots=True)
class Solving:
    """Strategies by car, on a cycle; compiled: those whose loops were compiled before their turn."""

    asked: Sequence[tuple[Architecture, Sequence[str]]]
    cycle: Cycle
    settings: Settings
    others: Mapping[str, Strategy]
    watch: Watch
    tally: SharedCount = field(default_factory=SharedCount)
    compiled: list[str] = field(default_factory=list)

    def found(self, may_fork: bool) -> list[OfCar]:
        """Every car's; may_fork: by two processes where memory lasts for two, nobody observes, and no strategy from
        outside is asked, which may remember from one car to the next."""
        cars = range(len(self.asked))
        short = len(self.cycle.time_s) <= _FORK_SAMPLES_MAX and 1 < len(cars) <= _FORK_CARS_MAX
        alone = self.others or self.watch.observe is not unobserved
        if may_fork and short and not alone and two_processors():
            order = sorted(cars, key=self._work, reverse=True)
            return halves(self._of_car, order, self.tally, self.watch.meanwhile)
        return [self._of_car(n) for n in cars]

    def _work(self, n: int) -> tuple[bool, int]:
        """What grows with the work on a car: whether its gear is free, and its states times strategies."""
        car, wanted = self.asked[n]
        return car.gear == "free", len(wanted) * sum(1 for _ in car.driveline.states())

    def _of_car(self, n: int) -> OfCar:
        car, wanted = self.asked[n]
        found = OfCar([], {}, {}, {})
        self._told(f"{car.name}: table and certificate")
        try:
            case = prepare(car, self.cycle, self.settings, begun=partial(self._compile, wanted))
        except _FAILURES as error:
            self.tally.add(len(wanted))
            rows = [failed_row(car, name, error) for name in wanted]
            return found._replace(rows=rows, failures={car.name: error})
        for name in wanted:
            self._told(f"{car.name}: {name}")
            found.rows.append(self._row(case, name, found))
            self.tally.add(1)
        return found._replace(lost=lost_proofs(case))

    def _compile(self, wanted: Sequence[str], problem: Problem) -> None:
        """Where the process that was forked meets loops that nobody has compiled yet: those of strategies, as the
        first begins with dynamic programming and certificate. Each then finds on the disk what the other compiled.
        """
        loaded = getattr(resolved, "stats", None)
        if self.tally.of_first or self.compiled or loaded is None:
            return
        if not loaded.cache_misses or loaded.cache_path is None:
            return
        self.compiled.extend(wanted)
        for strategy in (strategy_named(name) for name in wanted if name != "dp"):
            with suppress(HevoptError):
                if strategy.usual:
                    strategy.solve(problem)

    def _told(self, what: str) -> None:
        if not self.tally.of_first:
            return  # two would write over one another
        total = sum(len(names) for _, names in self.asked)
        self.watch.progress(what, self.tally.total(), total)

    def _row(self, case: Case, strategy: str, found: OfCar) -> Row:
        """The row of a strategy, observed; where it fails, one that says so, and the error among the failures.

        What shows that it knows more of the cycle than it says is put to what peeks.
        """
        try:
            solved = run_case(case, strategy, self.settings.horizon_s, self.others)
            shown = why_not_causal(case, strategy, solved[1], self.others)
        except _FAILURES as error:
            found.failures[f"{case.car.name} {strategy}"] = error
            return failed_row(case.car, strategy, error)
        if shown is not None:
            found.peeking[case.car.name, strategy] = shown
        self.watch.observe(case, *solved)
        return solved[0]


def lost_proofs(case: Case) -> dict[str, str]:
    """Architecture and kind of proof -> why a proof was tried on a case and not found."""
    failures = case.certificate.failures.items()
    return {f"{case.car.name}, {kind}": message for kind, message in failures}
