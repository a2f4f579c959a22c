"""The study: run strategies on architectures over one cycle, and collect a row for each."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Unpack

from hevopt.car.architecture import Architecture
from hevopt.display.facts import Shown, html_table
from hevopt.driving.cycle import DISTANCE_MIN_M, Cycle, load_cycle
from hevopt.errors import (
    DataError,
    HevoptError,
    UnknownNoxError,
)
from hevopt.files.keywords import check_keywords
from hevopt.problem.problem import Plan, Problem, Trajectory
from hevopt.strategies import Strategy, chosen, strategy_named
from hevopt.studies.by_car import NOBODY, Observe, Progress, Solving, Watch, unobserved, unseen
from hevopt.studies.cars import cars_of
from hevopt.studies.case import Case
from hevopt.studies.drawing import draw_rows
from hevopt.studies.forward_rows import ForwardFigures, forward_figures
from hevopt.studies.frames import rows_frame
from hevopt.studies.rows import Row, against_reference
from hevopt.studies.settings import Keywords, Settings
from hevopt.studies.solved import (
    causal_among,
    check_horizon,
    strategies_for,
)

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes


@dataclass(frozen=True, slots=True, repr=False)
class Comparison(Shown):
    """All rows of a cycle, and the messages of what failed, by architecture and strategy.

    reference: the row that changes are against, None where there are none
    end_asked: car -> state of charge asked at the end, of those where it is another than the start's
    lost_proofs: architecture and kind of proof -> why it was tried and not found
    left_out: settings that have no meaning for some of the cars, and why
    causal: strategies of the rows that decide without knowing the rest of the cycle
    peeking: car and strategy -> what shows that a strategy from outside knows more of the cycle than it says
    forward: architecture and strategy -> what the row does when it is driven forward, where that was asked for
    """

    cycle: str
    rows: list[Row]
    failures: dict[str, HevoptError] = field(default_factory=dict)
    nox_weight: float = 0.0
    reference: str | None = None
    free_gear: bool = False
    end_asked: Mapping[str, float] = field(default_factory=dict)
    lost_proofs: Mapping[str, str] = field(default_factory=dict)
    left_out: Sequence[str] = ()
    causal: frozenset[str] = frozenset()
    peeking: Mapping[tuple[str, str], str] = field(default_factory=dict)
    forward: Mapping[tuple[str, str], ForwardFigures] = field(default_factory=dict)

    def _facts(self) -> dict[str, object]:
        failed = sum(not row.solved for row in self.rows)
        rows = len(self.rows)
        return {"cycle": self.cycle, "rows": rows, "failed": failed, "reference": self.reference}

    @property
    def peeking_by_row(self) -> dict[str, str]:
        """`peeking`, car and strategy as one text."""
        return {f"{car} {strategy}": why for (car, strategy), why in self.peeking.items()}

    def _repr_html_(self) -> str:
        facts = [row._facts() for row in self.rows]
        heads = list(facts[0]) if facts else []
        return html_table(f"cycle {self.cycle}", heads, [list(fact.values()) for fact in facts])

    def plot(self, axes: "Axes | None" = None) -> "Axes":
        """What every row needs beside the bound that none can undercut; with a weight on NOx, of the sum of both.

        axes: of matplotlib, by default new ones
        """
        return draw_rows(self.cycle, self.rows, self.nox_weight, axes)

    def to_frame(self) -> "pd.DataFrame":
        """The rows as a table of pandas, one line each: the cycle, then the fields of `Row`, units in the names."""
        return rows_frame(self.cycle, self.rows, self.forward)


_NO_OTHERS: Mapping[str, Strategy] = {}
# A name, names and pairs (name, function), or a function by its name.
Strategies = str | Sequence[str | tuple[str, Any]] | Mapping[str, Any]


def solve(problem: Problem, strategy: str = "dp", **settings: Any) -> Plan:
    """The plan of a strategy by name, with the settings that its `solve` names.

    Raises DataError for a name or a setting that there is not, with those that there are.
    """
    own = strategy_named(strategy).solve
    check_keywords(f"solve, {strategy}", own, settings)
    return own(problem, **settings)


def compare(
    cycle: Cycle | str | Path = "nedc",
    architectures: Architecture | str | Path | Iterable[Architecture | str | Path] | None = None,
    strategies: Strategies | None = None,
    *,
    progress: Progress | None = None,
    observe: Observe | None = None,
    forward: bool = False,
    **settings: Unpack[Keywords],
) -> Comparison:
    """Every strategy (by default the usual ones that fit) on every architecture (by default the shipped ones).

    cycle, architectures: names of shipped ones, files, or what was loaded; one, or several
    strategies: a name or a list of names, "all" for every one that fits; {name: function} for one of your own, also
    as a pair in a list: a policy, or a function from Problem to control indices or a Plan, see `register`; or
    FILE.py:FUNCTION or MODULE:FUNCTION in place of a name
    progress: called with what comes next, and how many cases of how many are done
    observe: called with every solved case, its row (no reference yet), plan and trajectory
    forward: drive every row forward as well, see `drive`
    settings: the fields of `Settings`, such as nox_weight, refine or mass_kg
    Raises DataError for a wrong name, file or setting, with those that there are. Where an engine has no NOx data,
    what asks for NOx is a failed row; UnknownNoxError if nothing else is asked.
    """
    # Here, as it takes long to load, and `compare_cars` needs none of it.
    from hevopt.studies.given import settings_from

    names, others = chosen(strategies)
    told = settings_from("compare", settings, strategies=names)
    if isinstance(architectures, Architecture | str | Path):
        architectures = [architectures]
    cars = cars_of(architectures, told)
    drive = cycle if isinstance(cycle, Cycle) else load_cycle(cycle)
    watch = Watch(progress or unseen, observe or unobserved)
    found = compare_cars(cars.cars, drive, told, others=others, watch=watch, forward=forward)
    return replace(found, left_out=cars.left_out)


def compare_cars(
    cars: Sequence[Architecture],
    cycle: Cycle,
    settings: Settings,
    *,
    others: Mapping[str, Strategy] = _NO_OTHERS,
    watch: Watch = NOBODY,
    forward: bool = False,
    may_fork: bool = False,
) -> Comparison:
    """The strategies of the settings on cars in which the settings are made already; see `compare`.

    others: strategies beside those shipped and registered; forward: drive every row forward as well
    may_fork: share the cars with a process forked from this one, on drives short enough for the memory of two; cars
    that are observed or driven forward, and strategies from outside, are solved by one process
    """
    driven: dict[tuple[str, str], ForwardFigures] = {}
    if forward:
        watch = watch._replace(observe=_driving(watch.observe, settings.horizon_s, driven))
    if cycle.distance_m < DISTANCE_MIN_M:
        raise DataError(
            f"cycle {cycle.name}: distance {cycle.distance_m:.3g} m; needed: {DISTANCE_MIN_M:g} m or more"
        )
    asked = [(car, strategies_for(car, settings.strategies, others)) for car in cars]
    named = list(dict.fromkeys(name for _, names in asked for name in names))
    check_horizon(settings.horizon_s, named, others)
    solving = Solving(asked, cycle, settings, others, watch)
    found = solving.found(may_fork)
    failures = {case: error for of_car in found for case, error in of_car.failures.items()}
    peeking = {row: why for of_car in found for row, why in of_car.peeking.items()}
    rows = [row for of_car in found for row in of_car.rows]
    _raise_unknown_nox(rows, failures)
    rows, reference = against_reference(rows)
    return Comparison(
        cycle.name,
        rows,
        failures,
        settings.nox_weight,
        reference,
        settings.free_gear,
        end_asked(cars),
        {proof: why for of_car in found for proof, why in of_car.lost.items()},
        causal=causal_among(rows, peeking, others),
        peeking=peeking,
        forward=driven,
    )


def _driving(
    observe: Observe, horizon_s: float | None, driven: dict[tuple[str, str], ForwardFigures]
) -> Observe:
    """An observer that drives every solved case forward as well."""

    def both(case: Case, row: Row, plan: Plan, trajectory: Trajectory) -> None:
        observe(case, row, plan, trajectory)
        driven[row.architecture, row.strategy] = forward_figures(case, row, trajectory, horizon_s)

    return both


def _raise_unknown_nox(rows: Sequence[Row], failures: Mapping[str, HevoptError]) -> None:
    """UnknownNoxError where nothing was asked but what needs data on NOx that there are not."""
    unknown = [error for error in failures.values() if isinstance(error, UnknownNoxError)]
    if unknown and len(unknown) == len(failures) and not any(row.solved for row in rows):
        raise unknown[0]


def end_asked(cars: Iterable[Architecture]) -> dict[str, float]:
    """Car -> state of charge asked at the end, of those where it is another than the start's."""
    return {car.name: car.soc_end for car in cars if car.soc_end != car.soc_start}


def steps_of(cycle: str | Path) -> int:
    """Number of steps of a cycle."""
    return len(load_cycle(cycle).time_s) - 1
