"""What a sweep runs: cases, each with a key made of everything that can change its result, packed into jobs.

A job is one car on one cycle: its control table is built once for all strategies and NOx weights.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from functools import lru_cache
from typing import Any, NamedTuple

from hevopt.car.architecture import Architecture
from hevopt.car_files.load import load_architecture
from hevopt.driving.cycle import Cycle, load_cycle, shipped_cycles
from hevopt.errors import HevoptError
from hevopt.studies.nox import require_nox
from hevopt.studies.provenance import cycle_contents, digest, physics_digest, versions

NOX_WEIGHT = "nox_weight"
# Not a strategy but the certified bound alone.
BOUND = "bound"
# What a stored row has beside the fields of rows.Row; see `Outcome`.
FIGURES = ("objective_l_per_100km", "objective_bound_l_per_100km")


class Task(NamedTuple):
    """A strategy under a NOx weight (kg fuel per kg NOx), and the key of its result."""

    key: str
    nox_weight: float
    strategy: str


class Brought(NamedTuple):
    """What a worker needs of a strategy from outside.

    reference: see `strategies.brought.located`; source: SHA-256 of the file it stands in; learns: see `Strategy`
    """

    reference: str
    source: str
    learns: bool = False


@dataclass(frozen=True, slots=True)
class Job:
    """A car, as an architecture with changed keys, on a cycle, and the cases to solve on it.

    inputs: digest of what the files held when the keys were made; None for whatever they hold
    brought: name -> strategies from outside, of which its process knows nothing but this
    """

    architecture: str
    changes: Mapping[str, Any]
    cycle: str
    allow_shortfall: bool
    cases: tuple[Task, ...]
    inputs: str | None = None
    brought: Mapping[str, Brought] = field(default_factory=dict)


class Ending(StrEnum):
    """How a planned case stands: with a row, without one for a reason of its own, or not solved."""

    OK = "ok"
    INFEASIBLE = "infeasible"  # proven or found impossible
    FAILED = "failed"
    PRUNED = "pruned"
    MISSING = "missing"


SOLVED = (Ending.OK, Ending.INFEASIBLE, Ending.FAILED)


@dataclass(frozen=True, slots=True)
class Failure:
    """Why a case has no row. headline: in one line; details: what it lists, line by line, or ''."""

    headline: str
    details: str = ""

    @classmethod
    def of(cls, error: BaseException) -> "Failure":
        """What an exception says; one that hevopt does not raise on purpose is named."""
        said = str(error) if isinstance(error, HevoptError) else f"{type(error).__name__}: {error}"
        first, *others = said.splitlines() or ["no reason given"]
        return cls(first.rstrip(":"), "\n".join(others))

    def __str__(self) -> str:
        return f"{self.headline}:\n{self.details}" if self.details else self.headline


@dataclass(frozen=True, slots=True)
class Result:
    """What came of a case. ending: one of SOLVED; failure: of one that has no row.

    row: the fields of rows.Row but solve_s; `objective_l_per_100km`: charge-corrected fuel + weighted NOx;
    `objective_bound_l_per_100km`: what no plan with at least that row's end charge can undercut;
    `lost_proofs`: where there are any, proof -> why it was tried and not found
    seconds: time it took, the table and the dynamic program going to the first case that needed them
    """

    key: str
    ending: Ending
    row: Mapping[str, Any] | None
    failure: Failure | None
    seconds: float


class Planned(NamedTuple):
    """A case of a design: where in the study a result belongs."""

    design: int
    cycle: str
    strategy: str
    nox_weight: float
    key: str


def inputs_digest(car: Architecture, cycle: Cycle) -> str:
    """SHA-256 of everything in the files of a car and a cycle that a result depends on."""
    contents = {key: value for key, value in car.contents.items() if key != "description"}
    return digest([contents, _cycle_digest(cycle)])


@lru_cache(maxsize=64)
def _cycle_digest(cycle: Cycle) -> str:
    return digest(cycle_contents(cycle))


_NONE_BROUGHT: Mapping[str, Brought] = {}


def jobs_of(
    architecture: str,
    cycles: Sequence[str],
    strategies: Sequence[str],
    groups: Iterable[tuple[Mapping[str, Any], Sequence[tuple[int, float]]]],
    *,
    allow_shortfall: bool = False,
    brought: Mapping[str, Brought] = _NONE_BROUGHT,
) -> Iterator[tuple[Job, list[Planned]]]:
    """A job per car and cycle, with the designs that its cases belong to.

    groups: changes of the car -> (design, NOx weight) of the designs that share it. Designs of one weight share
    cases. Before a job is handed out: DataError where a changed key is not allowed, UnknownNoxError for a weight on
    NOx where the engine has no data on it.
    """
    # Workers import this module too, and leave what solves to their processes.
    from hevopt.strategies import STRATEGIES, Strategy

    common = {"code": physics_digest(), "versions": versions(), "allow_shortfall": allow_shortfall}
    traces = {cycle: load_cycle(cycle) for cycle in cycles}
    known: dict[str, Strategy | Brought] = {**STRATEGIES, **brought}
    learning = {name for name in strategies if name in known and known[name].learns}
    teachers = [cycle_contents(cycle) for cycle in shipped_cycles()] if learning else None
    made_with = {name: [digest(teachers)] for name in learning}
    for name in brought.keys() & set(strategies):
        function = brought[name].reference.rpartition(":")[2]
        made_with[name] = [*made_with.get(name, ()), function, brought[name].source]
    own = {name: brought[name] for name in strategies if name in brought}
    for changes, members in groups:
        car = load_architecture(architecture, changes)
        heaviest = max(weight for _, weight in members)
        if heaviest > 0:
            require_nox(car, f"{NOX_WEIGHT} {heaviest:g}")
        for cycle in cycles:
            inputs = inputs_digest(car, traces[cycle])
            made_of = digest({**common, "inputs": inputs})
            cases: dict[tuple[float, str], Task] = {}
            planned = []
            for design, given in members:
                weight = float(given)
                for strategy in strategies:
                    key = digest([made_of, weight, strategy, *made_with.get(strategy, ())])
                    cases[weight, strategy] = Task(key, weight, strategy)
                    planned.append(Planned(design, cycle, strategy, weight, key))
            solved = tuple(cases.values())
            job = Job(architecture, changes, cycle, allow_shortfall, solved, inputs, own)
            yield job, planned
