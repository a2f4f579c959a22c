"""What a sweep runs: cases, each with a key made of everything that can change its result, packed into jobs.

A job is one car on one cycle: its control table is built once for all strategies and NOx weights.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

from hevopt.architecture import load_architecture
from hevopt.cycle import load_cycle
from hevopt.provenance import cycle_contents, digest, physics_digest, versions

NOX_WEIGHT = "nox_weight"
# Not a strategy but the certified bound alone.
BOUND = "bound"


class Case(NamedTuple):
    """A strategy under a NOx weight (kg fuel per kg NOx), and the key of its result."""

    key: str
    nox_weight: float
    strategy: str


@dataclass(frozen=True, slots=True)
class Job:
    """A car, as an architecture with changed keys, on a cycle, and the cases to solve on it."""

    architecture: str
    changes: Mapping[str, Any]
    cycle: str
    allow_shortfall: bool
    cases: tuple[Case, ...]


@dataclass(frozen=True, slots=True)
class Outcome:
    """What came of a case. status: "ok", "infeasible" (proven or found impossible) or "failed", with the error.

    row: the fields of study.Row but solve_s, and `objective_l_per_100km`: charge-corrected fuel + weighted NOx
    seconds: time it took, the table and the dynamic program going to the first case that needed them
    """

    key: str
    status: str
    row: Mapping[str, Any] | None
    error: str | None
    seconds: float


class Planned(NamedTuple):
    """A case of a design: where in the study a result belongs."""

    design: int
    cycle: str
    strategy: str
    nox_weight: float
    key: str


def jobs_of(
    architecture: str,
    cycles: Sequence[str],
    strategies: Sequence[str],
    groups: Iterable[tuple[Mapping[str, Any], Sequence[tuple[int, float]]]],
    *,
    allow_shortfall: bool = False,
) -> Iterator[tuple[Job, list[Planned]]]:
    """A job per car and cycle, with the designs that its cases belong to.

    groups: changes of the car -> (design, NOx weight) of the designs that share it. Designs of one weight share
    cases. Raises DataError where a changed key is not allowed, before the job is handed out.
    """
    common = {"code": physics_digest(), "versions": versions(), "allow_shortfall": allow_shortfall}
    traces = {cycle: digest(cycle_contents(load_cycle(cycle))) for cycle in cycles}
    for changes, members in groups:
        car = digest(load_architecture(architecture, changes).contents)
        for cycle in cycles:
            inputs = digest({**common, "car": car, "cycle": traces[cycle]})
            cases: dict[tuple[float, str], Case] = {}
            planned = []
            for design, given in members:
                weight = float(given)
                for strategy in strategies:
                    key = digest([inputs, weight, strategy])
                    cases[weight, strategy] = Case(key, weight, strategy)
                    planned.append(Planned(design, cycle, strategy, weight, key))
            job = Job(architecture, changes, cycle, allow_shortfall, tuple(cases.values()))
            yield job, planned
