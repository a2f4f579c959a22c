"""A whole sizing: from its file to the best design, every result in a store from which it goes on."""

from collections.abc import Callable, Iterable, Sequence
from contextlib import ExitStack
from dataclasses import replace
from functools import cache
from pathlib import Path

from hevopt.car_files.load import load_architecture
from hevopt.driving.cycle import load_cycle
from hevopt.errors import DataError, InfeasibleError
from hevopt.files.shown import printable, shown
from hevopt.sizing.around import around
from hevopt.sizing.candidates import Candidate, Candidates
from hevopt.sizing.found import Sizing
from hevopt.sizing.proof.modes import NotProvable
from hevopt.sizing.proof.prove import RangeProof, prove
from hevopt.sizing.proof.space import DRIVE, SIZES
from hevopt.sizing.search import check_search, is_lattice, search
from hevopt.sizing.statements import statements
from hevopt.sizing.study_file import SizeStudy, read_size_study
from hevopt.studies.provenance import files_digests
from hevopt.sweeps.into_store import check_sweep
from hevopt.sweeps.plan.jobs import Job
from hevopt.sweeps.plan.parameters import Range
from hevopt.sweeps.run import Advance, CasesRun, Execution, Onlookers, meta_of
from hevopt.sweeps.store.lock import locked
from hevopt.sweeps.store.store import PROVEN, Store, open_store
from hevopt.sweeps.workers.backends import workers


def size(
    study: str | Path,
    store: str | Path | None = None,
    *,
    workers: int | None = None,
    progress: Callable[[Advance], None] | None = None,
    notice: Callable[[str], None] | None = None,
) -> Sizing:
    """The best design of a study's file; what the store has already is not run again.

    store: file of the results, by default beside the study with the suffix .sqlite; workers: all cores by default
    Raises DataError for a study that is wrong, InfeasibleError where no design meets what is asked.
    """
    study = Path(study)
    place = study.with_suffix(".sqlite") if store is None else Path(store)
    watch = Onlookers(progress or (lambda found: None), notice or (lambda text: None))
    call = f"hevopt.size({str(study)!r}, {str(place)!r})"
    return sized(study, place, Execution(workers=workers), call, watch)


def sized(study: Path, place: Path, execution: Execution, command: str, watch: Onlookers) -> Sizing:
    """The same for the command line. command: what repeats it. Raises Stopped, too."""
    check_sweep(execution, study, place)
    read = read_size_study(study)
    check_search(read)
    _warn_of_weightless(read, watch)
    advance = Advance(read.trials)
    with locked(place), open_store(place) as opened, ExitStack() as stack, watch.held():
        team = workers(
            execution.terms(), backend=execution.backend, count=execution.workers,
            scheduler=execution.scheduler, notice=watch.notice,
        )  # fmt: skip
        when_needed = cache(lambda: stack.enter_context(team))
        course = CasesRun(
            opened,
            when_needed,
            Advance(0),
            Onlookers(lambda _: watch.progress(advance), stop=watch.stop),
        )
        meta = meta_of(read.sweep, _inputs(read), command)
        candidates = Candidates(read, opened, meta, _runner(opened, course))

        def done(count: int) -> None:
            advance.done, advance.total = count, max(count, advance.total)
            watch.progress(advance)

        search(read, candidates, done)
        found = proven_of(read, place, candidates, done)
        opened.note(PROVEN, "\n".join(statements(found)))
    return found


def proven_of(
    study: SizeStudy, place: Path, candidates: Candidates, done: Callable[[int], None]
) -> Sizing:
    """What was found with what is proven of it: over ranges, else by the lattice around the best design."""
    found = Sizing(study, place, is_lattice(study), tuple(candidates.found))
    if found.best is None:
        raise InfeasibleError(_none_message(found))
    try:
        return replace(found, proofs=_proofs(found, found.best))
    except DataError as error:
        found = replace(found, unproven=str(error))
    if found.lattice:
        return found
    lattice = around(study, candidates)
    done(len(candidates.found))
    return replace(found, found=tuple(candidates.found), around=lattice)


def _proofs(found: Sizing, best: Candidate) -> tuple[RangeProof, ...]:
    """What no car of the ranges burns less than, on each cycle; NotProvable where that is not known.

    Parameters that are no sizes are held at their values in the best design.
    """
    sweep, objective = found.study.sweep, found.study.objectives[0]
    if len(objective.weights) > 1 or not {"fuel", "co2"} & set(objective.weights):
        raise NotProvable("no proof over ranges: it is of fuel or CO2 alone")
    if sweep.derived or sweep.allow_shortfall:
        raise NotProvable("no proof over ranges with [derived] keys, nor with allow_shortfall")
    ranges = {
        key: (float(values.low), float(values.high))
        for key, values in sweep.parameters.items()
        if (key in SIZES or key == DRIVE) and isinstance(values, Range)
    }
    if not ranges:
        raise NotProvable(
            "no proof over ranges: no size of engine, machine or battery has a range, nor the final drive"
        )
    fixed = {key: value for key, value in best.design.changes.items() if key not in ranges}
    texts = [constraint.text for constraint in sweep.constraints]
    return tuple(
        prove(sweep.architecture, ranges, load_cycle(cycle), fixed=fixed, constraints=texts)
        for cycle in sweep.cycles
    )


def _runner(store: Store, course: CasesRun) -> Callable[[Sequence[Job], Iterable[str]], None]:
    def run(jobs: Sequence[Job], keys: Iterable[str]) -> None:
        missing = set(keys) - set(store.endings())
        course.missing.update(missing)
        course.run(jobs, missing)

    return run


def _inputs(study: SizeStudy) -> dict[str, str]:
    """File -> SHA-256, of all that any design is made from."""
    sweep = study.sweep
    texts = [
        {key: value}
        for key, values in sweep.parameters.items()
        if isinstance(values, tuple) and isinstance(values[0], str)
        for value in values
    ]
    cars = [load_architecture(sweep.architecture, changes) for changes in [{}, *texts]]
    return dict(files_digests(cars, map(load_cycle, sweep.cycles), [sweep.source, *sweep.files]))


def _warn_of_weightless(study: SizeStudy, watch: Onlookers) -> None:
    """Bigger is free where a part that is sized has no mass of its own."""
    car = load_architecture(study.sweep.architecture)
    changed = {key.partition(".")[0] for key in (*study.sweep.parameters, *study.sweep.derived)}
    for key in sorted(changed & set(car.weighed)):
        if car.weighed[key].mass_kg is None:
            unit = car.weighed[key].unit.lower()
            watch.notice(
                f"{key} weighs nothing more where it is larger: its file has no mass_kgp{unit}, give it one"
            )


def _none_message(found: Sizing) -> str:
    counts = ", ".join(f"{count} {fate}" for fate, count in found.counts.items() if count)
    text = f"{found.study.sweep.source}: no design meets what is asked ({counts})"
    near = [one for one in found.found if one.required]
    if near:
        one = min(near, key=lambda one: (one.excess, one.design.number))
        values = ", ".join(f"{printable(k)} = {shown(v)}" for k, v in one.design.values.items())
        missed = max(one.required, key=lambda required: required.excess)
        reached = "not reached" if missed.reached is None else f"{missed.reached:.4g}"
        text += (
            f"; the nearest is {values}, with {missed.name} {reached} in place of {missed.limit:g}"
        )
    why = next((one.why for one in found.found if one.why), "")
    return f"{text}; loosen a requirement or widen a range" + (f" ({why})" if why else "")
