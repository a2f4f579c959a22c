"""What a worker does with a job: build the control table once, solve every case on it, never raise."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, nullcontext
from functools import lru_cache
from math import isfinite
from pathlib import Path
from time import perf_counter
from typing import Any

from hevopt.bounds.certificate import certify
from hevopt.car.architecture import Architecture
from hevopt.car_files.load import load_architecture
from hevopt.driving.cycle import Cycle, load_cycle
from hevopt.errors import DataError, InfeasibleError, SolverError
from hevopt.files.lookup import find
from hevopt.powertrain.powertrain import build_problem
from hevopt.problem.problem import Problem
from hevopt.strategies import Strategy, brought
from hevopt.strategies.brought import located
from hevopt.studies.case import Case as SolvedCase
from hevopt.studies.case import dp_case, litres
from hevopt.studies.nox import require_nox
from hevopt.studies.rows import Row, shortfall_steps
from hevopt.studies.solved import run_case
from hevopt.studies.status import Status
from hevopt.sweeps.plan.brought import source_digest
from hevopt.sweeps.plan.jobs import (
    BOUND,
    FIGURES,
    Ending,
    Failure,
    Job,
    Result,
    Task,
    inputs_digest,
)

# Proofs that cost more than a design's solution are tried only above this gap, four times that of a comparison.
_TARGET_GAP = 2e-3


def run_job(
    job: Job, guard: Callable[[], AbstractContextManager[Any]] = nullcontext
) -> Iterator[Result]:
    """An outcome for every case of a job, as it is there; any exception of a case is its outcome.

    guard: entered around every case, such as a time limit that raises
    """
    bench = _Bench(job)
    for case in job.cases:
        began = perf_counter()
        ending, row, failure = Ending.OK, None, None
        try:
            with guard():
                row = bench.row(case)
        except InfeasibleError as error:
            ending, failure = Ending.INFEASIBLE, Failure.of(error)
        except Exception as error:
            ending, failure = Ending.FAILED, Failure.of(error)
        yield Result(case.key, ending, row, failure, perf_counter() - began)


class _Bench:
    """A job's problem and its solutions by dynamic programming, each made when it is first asked for."""

    def __init__(self, job: Job) -> None:
        self.job = job
        self._built: tuple[Architecture, Cycle, Problem] | None = None
        self._solved: dict[float, SolvedCase] = {}
        self._brought: dict[str, Strategy] = {}

    def row(self, case: Task) -> dict[str, Any]:
        """A case's row as an outcome holds it."""
        if self._built is None:
            car, cycle = (
                load_architecture(self.job.architecture, self.job.changes),
                _cycle(self.job.cycle),
            )
            if self.job.inputs not in (None, inputs_digest(car, cycle)):
                raise DataError(
                    "the files of this case changed after the sweep began; run the same command again"
                )
            problem = build_problem(car, cycle, allow_shortfall=self.job.allow_shortfall)
            self._built = car, cycle, problem
        car, cycle, problem = self._built
        weight = case.nox_weight
        if weight > 0:
            require_nox(car, f"nox_weight {weight:g}")
        if case.strategy == BOUND:
            return _bound_row(car, cycle, problem.with_nox_weight(weight))
        if weight not in self._solved:
            self._solved[weight] = dp_case(car, cycle, problem.with_nox_weight(weight), _TARGET_GAP)
        return _strategy_row(self._solved[weight], case.strategy, self._others(case.strategy))

    def _others(self, name: str) -> Mapping[str, Strategy]:
        """The strategies from outside that a case needs; DataError where one is not what was planned."""
        if name in self.job.brought and name not in self._brought:
            own = self.job.brought[name]
            place = located(own.reference)
            if source_digest(place.file) != own.source:
                raise DataError(
                    f"{place.file}, the strategy {name}, changed after the sweep began; run the same command again"
                )
            self._brought[name] = brought(name, place, learns=own.learns)
        return self._brought


def _bound_row(car: Architecture, cycle: Cycle, problem: Problem) -> dict[str, Any]:
    """The certified dual alone: what no plan that ends with the asked charge can undercut."""
    certificate = certify(problem)
    bound_kg, proof = certificate.bound_kg(problem.end_min_j)
    row = Row(
        car.name,
        BOUND,
        Status(shortfall_steps=shortfall_steps(problem)),
        bound_l_per_100km=litres(car, cycle, bound_kg),
        certificate=certificate.claim(proof),
    )
    return _stored(row, None, row.bound_l_per_100km)


def _strategy_row(
    solved: SolvedCase, strategy: str, others: Mapping[str, Strategy]
) -> dict[str, Any]:
    row, _, trajectory = run_case(solved, strategy, others=others)
    surplus_j = trajectory.end_j - solved.problem.end_min_j
    worth_kg = solved.certificate.price_kgpj * surplus_j
    bound_kg, _ = solved.certificate.bound_of(trajectory)
    objective, bound = (
        litres(solved.car, solved.cycle, mass_kg - worth_kg)
        for mass_kg in (trajectory.cost_kg, bound_kg)
    )
    stored, lost = _stored(row, objective, bound), solved.certificate.failures
    return (
        stored | {"lost_proofs": {str(kind): why for kind, why in lost.items()}} if lost else stored
    )


def _stored(row: Row, objective: float | None, bound: float | None) -> dict[str, Any]:
    values = row.as_dict() | dict(zip(FIGURES, (objective, bound), strict=True))
    del values["solve_s"]
    if any(isinstance(value, float) and not isfinite(value) for value in values.values()):
        raise SolverError("a figure is not finite; the design is too far from a car")
    return values


def _cycle(name: str) -> Cycle:
    """A cycle, read once per process as long as its file stays what it is."""
    state = find("cycles", name, ".csv").stat()
    return _read_cycle(name, Path.cwd(), state.st_mtime_ns, state.st_size)


@lru_cache(maxsize=16)
def _read_cycle(name: str, folder: Path, changed_ns: int, size: int) -> Cycle:
    return load_cycle(name)
