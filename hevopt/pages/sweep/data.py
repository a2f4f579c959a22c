"""What a sweep came to, design by design: taken from its cases in one pass, so that memory holds figures only."""

import csv
import io
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from math import fsum, nan
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hevopt.display.facts import Shown
from hevopt.errors import DataError
from hevopt.files.lookup import without_folders
from hevopt.files.shown import printable
from hevopt.files.writing import csv_cells
from hevopt.studies.status import OK, Status
from hevopt.sweeps.plan.jobs import BOUND, NOX_WEIGHT, Ending
from hevopt.sweeps.plan.prune import Pruned
from hevopt.sweeps.store.export import cases_csv
from hevopt.sweeps.store.reading import Record, inputs_in, open_to_read
from hevopt.sweeps.store.reasons import Reasons

Array = NDArray[np.float64]
Scalar = bool | int | float | str

FAILURES_LISTED = 100
# More cases than this are too many for a page to carry along.
CASES_MAX = 30_000
# Designs in the table that stands in for them.
DESIGNS_MAX = 100_000
# NOx of a smaller share in the objective tells too little of how it counts as fuel.
_SHARE_MIN = 1e-3
# A row's figures are rounded each on its own.
_ROUNDING = 1e-9


class Solved(NamedTuple):
    """The best strategy's case of a design on a cycle."""

    objective: float
    strategy: str
    bound: float
    fuel: float
    nox: float
    status: Status


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class DesignFigures(Shown):
    """Designs in the order of their numbers; arrays and lists are (design,), NaN where there is nothing.

    objective, fuel, nox: means over the cycles of the best strategy's, fuel charge-corrected (l/100 km, mg/km)
    bound: of the objective, mean over the cycles. Where the design was solved, for plans that leave at least the
    charge that its cases left, charge-corrected as they are; else the certified dual for the asked charge
    strategy, status: of the best cases, joined where cycles differ
    steps_short: most steps on which a case did not follow its cycle; short: whether there is one
    fuel_per_nox: fuel (l/100 km) that 1 mg/km of NOx counts at weight 1, of the lightest fuel; None if never seen
    """

    number: NDArray[np.int64]
    values: dict[str, list[Scalar]]
    weight: Array
    objective: Array
    fuel: Array
    nox: Array
    bound: Array
    strategy: list[str]
    status: list[str]
    steps_short: NDArray[np.int64]
    fuel_per_nox: float | None

    @property
    def short(self) -> NDArray[np.bool_]:
        return self.steps_short > 0

    @property
    def merit(self) -> Array:
        """What designs are ranked by: the objective; the bound where the sweep asked for nothing else."""
        return self.objective if np.isfinite(self.objective).any() else self.bound

    @property
    def gap_percent(self) -> Array:
        """How far the objective lies above the design's own bound; 0 where rounding puts it below."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(
                self.bound > 0,
                np.maximum(100 * (self.objective - self.bound) / self.bound, 0.0),
                np.nan,
            )


@dataclass(slots=True)
class Tally:
    """How the cases ended.

    counts: ending -> cases; reasons: why cases have no row, by ending; failures: the first of those without one
    lost: why proofs were tried and not found, by proof
    marks: a row's status other than ok -> cases; cycles, strategies: those planned
    contradictions: cases whose objective is below their own bound
    """

    counts: Counter[Ending] = field(default_factory=Counter)
    reasons: Reasons = field(default_factory=Reasons)
    lost: Reasons = field(default_factory=Reasons)
    failures: list[Record] = field(default_factory=list)
    marks: Counter[Status] = field(default_factory=Counter)
    cycles: dict[str, None] = field(default_factory=dict)
    strategies: dict[str, None] = field(default_factory=dict)
    contradictions: int = 0


@dataclass(frozen=True, slots=True, eq=False)
class Sweep:
    """A sweep as its store has it; meta: the store's; cases_csv: every case, or None where they are too many."""

    name: str
    meta: Mapping[str, str]
    figures: DesignFigures
    tally: Tally
    pruned: Sequence[Pruned]
    cases_csv: bytes | None

    @property
    def inputs(self) -> dict[str, str]:
        """File -> SHA-256, of the files that it was made from."""
        return inputs_in(self.meta)


def load_sweep(path: Path) -> Sweep:
    """The sweep of a store, which may be running; DataError where it cannot be read or has no designs."""
    with open_to_read(path) as reader:
        figures, tally = summary_of(reader.records())
        if not len(figures.number):
            raise DataError(f"{path}: the store has no study yet; run hevopt sweep on it first")
        unsolved = set(figures.number[np.isnan(figures.objective)].tolist())
        pruned = [found for found in reader.pruned() if found.design in unsolved]
        few = tally.counts.total() <= CASES_MAX
        cases = cases_csv(reader) if few else None
        return Sweep(
            printable(path.name), _meta_shown(reader.meta()), figures, tally, pruned, cases
        )


def _meta_shown(meta: Mapping[str, str]) -> dict[str, str]:
    """What a page may hand on of it; the files themselves are named by the page."""
    files = ("inputs", "study_file")
    return {k: text if k in files else without_folders(text) for k, text in meta.items()}


def summary_of(records: Iterable[Record]) -> tuple[DesignFigures, Tally]:
    """The figures of all designs, and how the cases ended, of the cases of a sweep in any order."""
    tally = Tally()
    designs: dict[int, tuple[Mapping[str, Scalar], float]] = {}
    best: dict[tuple[int, str], Solved] = {}
    duals: dict[tuple[int, str], float] = {}
    worths: list[float] = []
    short: Counter[int] = Counter()
    for record in records:
        _count(tally, record)
        designs.setdefault(record.design, (record.parameters, record.nox_weight))
        place, row = (record.design, record.cycle), record.row
        if row is None:
            continue
        if record.strategy == BOUND:
            duals[place] = row["objective_bound_l_per_100km"]
            continue
        found = _solved(row)
        short[record.design] = max(short[record.design], found.status.shortfall_steps)
        best[place] = min(best.get(place, found), found, key=_order)
        tally.contradictions += found.bound > found.objective * (1 + _ROUNDING)
        nox_cost = found.objective - found.fuel
        if nox_cost > _SHARE_MIN * found.objective and record.nox_weight * found.nox > 0:
            worths.append(nox_cost / (record.nox_weight * found.nox))
    numbers, cycles = sorted(designs), list(tally.cycles)
    solved = [_mean_solved([best.get((n, cycle)) for cycle in cycles]) for n in numbers]
    held = [[_bound_of(best.get((n, c)), duals.get((n, c))) for c in cycles] for n in numbers]
    figures = DesignFigures(
        number=np.array(numbers),
        values={key: [designs[n][0][key] for n in numbers] for key in _keys(designs)},
        weight=np.array([designs[n][1] for n in numbers]),
        objective=np.array([s.objective for s in solved]),
        fuel=np.array([s.fuel for s in solved]),
        nox=np.array([s.nox for s in solved]),
        bound=np.array([nan if None in of else fsum(of) / len(of) for of in held]),
        strategy=[s.strategy for s in solved],
        status=[s.status for s in solved],
        steps_short=np.array([short[n] for n in numbers], dtype=np.int64),
        fuel_per_nox=max(worths, default=None),
    )
    return figures, tally


def _keys(designs: Mapping[int, tuple[Mapping[str, Scalar], float]]) -> list[str]:
    return list(next(iter(designs.values()))[0]) if designs else []


def _count(tally: Tally, record: Record) -> None:
    tally.cycles[record.cycle] = None
    if record.strategy != BOUND:
        tally.strategies[record.strategy] = None
    tally.counts[record.ending] += 1
    if record.failure is not None:
        tally.reasons.add(record.ending, record.failure.headline, record.design)
        if len(tally.failures) < FAILURES_LISTED:
            tally.failures.append(record)
    if record.row is None:
        return
    if not (status := Status.read(record.row["status"])).ok:
        tally.marks[status] += 1
    for kind, why in (record.row.get("lost_proofs") or {}).items():
        tally.lost.add(kind, why, record.design)


def _solved(row: Mapping[str, Any]) -> Solved:
    return Solved(
        row["objective_l_per_100km"],
        row["strategy"],
        row["objective_bound_l_per_100km"],
        row["fuel_corrected_l_per_100km"],
        nan if row.get("nox_mg_per_km") is None else row["nox_mg_per_km"],
        Status.read(row["status"]),
    )


def _order(solved: Solved) -> tuple:
    return *solved[:-1], str(solved.status)


def _bound_of(best: Solved | None, dual: float | None) -> float | None:
    """What bounds a design's objective on a cycle, rounding aside: its best case's, or else the dual alone."""
    return dual if best is None else min(best.bound, best.objective)


class _Mean(NamedTuple):
    """A design over the cycles: means, and the strategies and marks of all of them as text."""

    objective: float = nan
    fuel: float = nan
    nox: float = nan
    strategy: str = ""
    status: str = ""


def _mean_solved(solved: Sequence[Solved | None]) -> _Mean:
    """A design's mean over the cycles; nothing where a cycle is not solved."""
    if None in solved:
        return _Mean()
    return _Mean(
        fsum(s.objective for s in solved) / len(solved),
        fsum(s.fuel for s in solved) / len(solved),
        fsum(s.nox for s in solved) / len(solved),
        ", ".join(dict.fromkeys(s.strategy for s in solved)),
        "; ".join(dict.fromkeys(str(s.status) for s in solved if not s.status.ok)) or str(OK),
    )


def designs_csv(figures: DesignFigures) -> bytes:
    """A line per design, only the best ones, those that follow first, where there are more than DESIGNS_MAX."""
    merit = figures.merit
    order = np.arange(len(merit))
    if len(merit) > DESIGNS_MAX:
        order = np.sort(np.lexsort((merit, figures.short))[:DESIGNS_MAX])
    columns: Mapping[str, Sequence[Any]] = {
        "design": figures.number.tolist(),
        **figures.values,
        NOX_WEIGHT: figures.weight.tolist(),
        "objective_l_per_100km": _ten_digits(figures.objective),
        "fuel_corrected_l_per_100km": _ten_digits(figures.fuel),
        "nox_mg_per_km": _ten_digits(figures.nox),
        "bound_l_per_100km": _ten_digits(figures.bound),
        "gap_percent": _ten_digits(figures.gap_percent),
        "strategy": figures.strategy,
        "status": figures.status,
    }
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(csv_cells(columns))
    lists = list(columns.values())
    writer.writerows(csv_cells(of[n] for of in lists) for n in order.tolist())
    return text.getvalue().encode()


def _ten_digits(values: NDArray[np.float64]) -> list[float | None]:
    return [None if np.isnan(value) else float(f"{value:.10g}") for value in values.tolist()]
