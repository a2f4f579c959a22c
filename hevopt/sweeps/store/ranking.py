"""The best designs of a store, by objective, or by bound where bounds are all there is."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby
from math import inf
from operator import attrgetter
from typing import Any

from hevopt.sweeps.plan.prune import follows, mean_bound, mean_objective
from hevopt.sweeps.store.reading import Reader, Record


@dataclass(frozen=True, slots=True)
class Ranked:
    """A design's figures, means over the cycles; objective: None where bounds are all there is.

    bound: of the best plans' objective, charge-corrected as they are, or else for the charge asked at the end
    follows: False where a step of a cycle is driven with less than it asks
    """

    design: int
    parameters: Mapping[str, Any]
    nox_weight: float
    objective: float | None
    bound: float | None
    follows: bool


def best_designs(reader: Reader, count: int) -> dict[float, list[Ranked]]:
    """NOx weight -> its best designs, the best first, those that do not follow a cycle after all others.

    Designs of different weights have no common objective. Unsolved ones are ranked where no other is solved.
    """
    best: dict[float, list[Ranked]] = {}
    for ranked in _ranked(reader):
        if ranked.objective is not None or ranked.bound is not None:
            listed = best.setdefault(ranked.nox_weight, [])
            listed.append(ranked)
            listed.sort(key=_order)
            del listed[count:]
    return {weight: _solved_first(listed) for weight, listed in sorted(best.items())}


def _solved_first(ranked: list[Ranked]) -> list[Ranked]:
    return [design for design in ranked if design.objective is not None] or ranked


def _order(ranked: Ranked) -> tuple[bool, bool, float, int]:
    figure = ranked.bound if ranked.objective is None else ranked.objective
    found = inf if figure is None else figure
    return not ranked.follows, ranked.objective is None, found, ranked.design


def _ranked(reader: Reader) -> Iterator[Ranked]:
    for design, found in groupby(reader.records(), attrgetter("design")):
        records = list(found)
        cycles = [list(of) for _, of in groupby(records, attrgetter("cycle"))]
        yield Ranked(
            design,
            records[0].parameters,
            records[0].nox_weight,
            mean_objective([[_figure(r, "objective_l_per_100km") for r in of] for of in cycles]),
            mean_bound([_bound_of_best(of) for of in cycles]),
            follows(record.row for record in records),
        )


def _bound_of_best(records: Sequence[Record]) -> float | None:
    objectives = [_figure(record, "objective_l_per_100km") for record in records]
    solved = [(figure, n) for n, figure in enumerate(objectives) if figure is not None]
    chosen = records[min(solved)[1]] if solved else records[0]
    return _figure(chosen, "objective_bound_l_per_100km")


def _figure(record: Record, name: str) -> float | None:
    return None if record.row is None else record.row.get(name)
