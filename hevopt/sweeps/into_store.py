"""A sweep from the file of its study into its store."""

from collections.abc import Callable, Mapping
from pathlib import Path

from hevopt.errors import DataError
from hevopt.files.shown import shown
from hevopt.files.writing import check_outs
from hevopt.sweeps.plan.study_file import read_study
from hevopt.sweeps.run import Advance, Execution, Onlookers, Schedule, begin, plan_of, run_sweep
from hevopt.sweeps.store.lock import locked
from hevopt.sweeps.store.reading import open_to_read
from hevopt.sweeps.store.store import open_store
from hevopt.sweeps.workers.pools import check_backend

NOTHING_TO_PRUNE = (
    "prune: each design has a NOx weight of its own, none condemns another: nothing is pruned"
)
# Name of a figure of Execution -> what is allowed.
_LIMITS = {"workers": (1, 1e6), "timeout_s": (1e-3, 1e6), "memory_mb": (1, 1e8)}


def check_sweep(
    execution: Execution, study: Path, store: Path, outs: Mapping[str, Path | None] | None = None
) -> None:
    """DataError, before anything is planned, where something could not be had at the end.

    outs: option -> a further file to be written
    """
    check_backend(execution.backend, execution.scheduler)
    for name, (low, high) in _LIMITS.items():
        value = getattr(execution, name)
        if value is not None and not (isinstance(value, int | float) and low <= value <= high):
            raise DataError(f"{name} = {shown(value)}; allowed: {low:g} to {high:g}")
    check_outs({"--store": store, **(outs or {})}, [study])


def into_store(
    study: Path,
    store: Path,
    execution: Execution,
    command: str,
    *,
    prune: bool,
    retry_failed: bool,
    watch: Onlookers,
    planning: Callable[[int, int], None] = lambda done, total: None,
    outs: Mapping[str, Path | None] | None = None,
) -> Advance:
    """Run what the store lacks of a study; how it went. Raises Stopped.

    command: what repeats it; planning: called with the number of cars checked and of all; outs: as above
    """
    contents = read_study(study)
    with locked(store):
        if store.exists() and store.stat().st_size:
            with open_to_read(store):
                pass  # one message at once, not after minutes of planning, where it is no store
        plan = plan_of(contents, prune=prune, progress=planning)
        check_outs(outs or {}, plan.inputs)
        with open_store(store) as opened:
            begin(plan, opened, command)
            _notices(plan, store, opened.others(), bool(opened.endings()), prune, watch)
            with watch.held():
                return run_sweep(
                    plan, opened, execution, prune=prune, retry_failed=retry_failed, watch=watch
                )


def _notices(
    plan: Schedule, store: Path, others: int, known: bool, prune: bool, watch: Onlookers
) -> None:
    """What is to be known before the run. others: results of other plans; known: whether this one has some."""
    if prune and not plan.prunable:
        watch.notice(NOTHING_TO_PRUNE)
    if others and not known:
        watch.notice(
            f"{store} holds {others} results, none that this study asks for as it is now (inputs, "
            "strategies, hevopt or a library changed): they stay, and everything is run"
        )
