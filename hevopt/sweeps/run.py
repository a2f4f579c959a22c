"""A sweep from its study to its store: plan, leave out what the store has, run the rest, store it as it comes."""

import json
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import AbstractContextManager, ExitStack, nullcontext
from dataclasses import dataclass, field, replace
from functools import cache
from time import monotonic
from typing import Any

from hevopt.driving.cycle import load_cycle
from hevopt.errors import DataError
from hevopt.files.lookup import dumped_json
from hevopt.studies.provenance import code_digest, digest, files_digests, versions
from hevopt.sweeps.plan.designs import Designs, cars_of, designs_of, groups_of
from hevopt.sweeps.plan.jobs import BOUND, Ending, Job, Planned, jobs_of
from hevopt.sweeps.plan.prune import Bounded, follows, mean_bound, mean_objective, search
from hevopt.sweeps.plan.study_file import SweepStudy
from hevopt.sweeps.store.store import Store
from hevopt.sweeps.workers.backends import Run, workers
from hevopt.sweeps.workers.child import Terms

WORK = "hevopt.sweeps.workers.work:run_job"


@dataclass(frozen=True, slots=True)
class Execution:
    """On what a sweep runs. workers: None for all there are; timeout_s, memory_mb: of a case, see `Terms`."""

    backend: str = "loky"
    workers: int | None = None
    scheduler: str | None = None
    timeout_s: float | None = None
    memory_mb: float | None = None
    work: str = WORK

    def terms(self) -> Terms:
        """What the workers are told."""
        return Terms(self.work, self.timeout_s, self.memory_mb, code=code_digest())


@dataclass(frozen=True, slots=True, eq=False)
class Schedule:
    """All cases of a study: jobs that run them, and which case answers for which design.

    inputs: file -> SHA-256, of all files that it is made from
    """

    study: SweepStudy
    designs: Designs
    jobs: list[Job]
    planned: list[Planned]
    inputs: Mapping[str, str] = field(default_factory=dict)

    @property
    def prunable(self) -> bool:
        """Whether two designs share a NOx weight, so that one can condemn the other."""
        weights = {case.design: case.nox_weight for case in self.planned}
        return len(set(weights.values())) < len(weights)

    def picked(self, keys: Iterable[str]) -> Iterator[Job]:
        """Jobs for some of the cases, each of which is run once though several jobs have it."""
        return picked(self.jobs, keys)


def picked(jobs: Iterable[Job], keys: Iterable[str]) -> Iterator[Job]:
    """Jobs for some of their cases, each of which is run once though several jobs have it."""
    wanted = set(keys)
    for job in jobs:
        cases = tuple(case for case in job.cases if case.key in wanted)
        wanted.difference_update(case.key for case in cases)
        if cases:
            yield replace(job, cases=cases)


@dataclass(slots=True)
class Advance:
    """How far a sweep is. done: cases run since `began_s` (monotonic), failed: of those; total: to run."""

    total: int
    done: int = 0
    failed: int = 0
    pruned: int = 0
    began_s: float = field(default_factory=monotonic)


@dataclass(frozen=True, slots=True, eq=False)
class Onlookers:
    """Who looks on. progress: called some times a second; notice: what went wrong; stop: whether to end now.

    held: entered for the part of a sweep that asks `stop`
    """

    progress: Callable[[Advance], None] = lambda progress: None
    notice: Callable[[str], None] = lambda text: None
    stop: Callable[[], bool] = lambda: False
    held: Callable[[], AbstractContextManager[None]] = nullcontext


class Stopped(Exception):
    """`Watch.stop` said so; everything there was is stored."""


def plan_of(
    study: SweepStudy,
    *,
    prune: bool = False,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> Schedule:
    """Every case of a study; DataError where a design is no car. prune: each design's bound is a case as well.

    progress: called with the number of cars on a cycle planned so far, and of all
    """
    strategies = list(study.strategies)
    if prune and strategies == [BOUND]:
        raise DataError(
            f"{study.source}: --prune saves solving designs, and this study asks for bounds alone"
        )
    if prune and BOUND not in strategies:
        strategies.append(BOUND)
    designs = designs_of(study)
    groups = groups_of(designs)
    found = jobs_of(
        study.architecture, study.cycles, strategies, groups,
        allow_shortfall=study.allow_shortfall, brought=study.brought,
    )  # fmt: skip
    jobs, planned = [], []
    for job, cases in found:
        jobs.append(job)
        planned += cases
        progress(len(jobs), len(groups) * len(study.cycles))
    inputs = files_digests(
        cars_of(study, designs), map(load_cycle, study.cycles), [study.source, *study.files]
    )
    return Schedule(study, designs, jobs, planned, inputs)


def begin(plan: Schedule, store: Store, command: str) -> None:
    """Make a plan the store's."""
    meta = meta_of(plan.study, plan.inputs, command)
    store.begin(meta, ((d.number, d.values) for d in plan.designs), plan.planned)


def meta_of(study: SweepStudy, inputs: Mapping[str, str], command: str) -> dict[str, str]:
    """What a store knows of a study. inputs: file -> SHA-256; command: what repeats it"""
    text = study.source.read_text(encoding="utf-8-sig")
    return {
        "study": text,
        "study_digest": digest(text),
        "code_digest": code_digest(),
        "versions": json.dumps(versions()),
        "inputs": dumped_json(dict(inputs)),
        "command": command,
        "study_file": str(study.source.absolute()),
    }


def settled(endings: Mapping[str, str], *, retry_failed: bool) -> set[str]:
    """Keys of the cases that need not be run: infeasible is a result, and failed unless it is to be tried again."""
    return {key for key, end in endings.items() if end != Ending.FAILED or not retry_failed}


def run_sweep(
    plan: Schedule,
    store: Store,
    execution: Execution,
    *,
    prune: bool = False,
    retry_failed: bool = False,
    watch: Onlookers,
) -> Advance:
    """Run what the store lacks of a plan that it has begun, and store it as it comes.

    What is stored does not depend on backend and workers, except for the seconds. Raises Stopped, or StoreGone.
    """
    done = settled(store.endings(), retry_failed=retry_failed)
    missing = {case.key for case in plan.planned} - done
    progress = Advance(len(missing))
    with ExitStack() as stack:
        team = workers(
            execution.terms(), backend=execution.backend, count=execution.workers,
            scheduler=execution.scheduler, notice=watch.notice,
        )  # fmt: skip
        # With bounds and incumbents all in the store there may be nothing to start workers for.
        team_when_needed = cache(lambda: stack.enter_context(team))
        course = CasesRun(store, team_when_needed, progress, watch, missing)
        if prune:
            _pruned(plan, course)
        else:
            course.run(plan.jobs, missing)
        store.check_place()
    return progress


@dataclass(frozen=True, slots=True, eq=False)
class CasesRun:
    """A sweep under way. workers: starts them at the first call; missing: keys of the cases still to run."""

    store: Store
    workers: Callable[[], Run]
    progress: Advance
    watch: Onlookers
    missing: set[str] = field(default_factory=set)

    def run(self, jobs: Iterable[Job], keys: Iterable[str]) -> None:
        """Run those of some jobs' cases that are missing, and store what comes."""
        wanted = list(picked(jobs, self.missing.intersection(keys)))
        if not wanted:
            return
        arrivals = self.workers()(wanted)
        try:
            for outcomes in arrivals:
                self.store.check_place()
                self.store.add(outcomes)
                self.progress.done += len(outcomes)
                self.progress.failed += sum(o.ending == Ending.FAILED for o in outcomes)
                self.missing.difference_update(o.key for o in outcomes)
                self.watch.progress(self.progress)
                if self.watch.stop():
                    raise Stopped
        finally:
            try:
                self.store.commit()
            finally:
                arrivals.close()


def _pruned(plan: Schedule, course: CasesRun) -> None:
    """Bounds first; then designs wave by wave, less those that a bound condemns."""
    store, progress = course.store, course.progress
    bounds: dict[int, list[str]] = {}
    solved: dict[int, dict[str, list[str]]] = {}
    for case in plan.planned:
        if case.strategy == BOUND:
            bounds.setdefault(case.design, []).append(case.key)
        else:
            solved.setdefault(case.design, {}).setdefault(case.cycle, []).append(case.key)
    course.run(plan.jobs, (key for keys in bounds.values() for key in keys))
    rows = store.rows(key for keys in bounds.values() for key in keys)
    figures = {key: _figure_of(row, "bound_l_per_100km") for key, row in rows}
    weights = {case.design: case.nox_weight for case in plan.planned}
    waves = search(
        Bounded(design, weights[design], mean_bound([figures[key] for key in keys]))
        for design, keys in bounds.items()
    )
    wave = next(waves, None)
    while wave is not None:
        spared = {
            pruned: course.missing.intersection(_all(solved[pruned.design]))
            for pruned in wave.pruned
        }
        # A design that an earlier run has solved is spared nothing: it stays a solved one.
        store.prune(pruned for pruned, keys in spared.items() if keys)
        gone = set().union(*spared.values())
        course.missing.difference_update(gone)
        progress.total -= len(gone)
        progress.pruned += len(gone)
        course.run(plan.jobs, (key for design in wave.designs for key in _all(solved[design])))
        objectives = {design: _objective(store, solved[design]) for design in wave.designs}
        try:
            wave = waves.send(objectives)
        except StopIteration:
            wave = None


def _figure_of(row: Mapping[str, Any] | None, name: str) -> float | None:
    return None if row is None else row.get(name)


def _all(cycles: dict[str, list[str]]) -> list[str]:
    return [key for keys in cycles.values() for key in keys]


def _objective(store: Store, cycles: dict[str, list[str]]) -> float | None:
    rows = dict(store.rows(_all(cycles)))
    if not follows(rows.values()):
        return None
    figures = {key: _figure_of(row, "objective_l_per_100km") for key, row in rows.items()}
    return mean_objective([[figures[key] for key in keys] for keys in cycles.values()])
