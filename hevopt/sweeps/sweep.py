"""A whole sweep as one call: from a study's file to its store, going on where an earlier one was."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from hevopt.display.facts import Shown
from hevopt.errors import DataError
from hevopt.sweeps.store.frames import read_sweep
from hevopt.sweeps.store.reading import open_to_read

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, slots=True, repr=False)
class Swept(Shown):
    """A store after a sweep. counts: of its plan's cases "ok", "infeasible", "failed", "pruned" and "missing"; its
    "designs"; "other" results that it keeps, of other inputs, strategies or code.
    """

    store: Path
    counts: Mapping[str, int]

    def _facts(self) -> dict[str, object]:
        return {"store": self.store, **self.counts}

    def to_frame(self) -> "pd.DataFrame":
        """The cases as a table of pandas, see `read_sweep`."""
        return read_sweep(self.store)


def sweep(
    study: str | Path,
    store: str | Path | None = None,
    *,
    workers: int | None = None,
    backend: str = "loky",
    scheduler: str | None = None,
    timeout_s: float | None = None,
    memory_mb: float | None = None,
    prune: bool = False,
    retry_failed: bool = False,
    progress: Callable[[str, int, int], None] | None = None,
    notice: Callable[[str], None] | None = None,
) -> Swept:
    """Solve every design of a study on all cores or a cluster; what the store has already is not run again.

    study: its TOML file; store: file of the results, by default beside the study with the suffix .sqlite
    workers: how many, by default as many as there are cores
    backend: "loky", processes of this machine, or "dask" or "ray"; scheduler: address of a cluster that runs
    timeout_s: after which a case is a failed one; memory_mb: address space of a worker's process
    prune: solve no design whose certified bound proves it worse; retry_failed: run failed cases once more
    progress: called with what is done, how many cases are run and how many there were to run
    notice: called with what went wrong on the way, such as a lost worker
    Raises DataError for a study that is wrong, with every fault, a wrong option or a file that is no store; what a
    case does wrong is its own outcome. Interrupted, it keeps what is solved: the same call goes on from there.
    """
    check_system()
    from hevopt.sweeps.into_store import check_sweep, into_store
    from hevopt.sweeps.run import Advance, Execution, Onlookers

    study, tell = Path(study), progress or (lambda text, done, total: None)
    place = study.with_suffix(".sqlite") if store is None else Path(store)
    execution = Execution(backend, workers, scheduler, timeout_s, memory_mb)
    check_sweep(execution, study, place)

    last = (-1, 0)

    def run(found: Advance) -> None:
        nonlocal last
        if (found.done, found.total) != last:
            last = found.done, found.total
            tell(f"{found.failed} failed, {found.pruned} pruned", *last)

    watch = Onlookers(run, notice or (lambda text: None))
    call = f"hevopt.sweep({str(study)!r}, {str(place)!r})"
    into_store(study, place, execution, call, prune=prune, retry_failed=retry_failed, watch=watch)
    with open_to_read(place) as reader:
        return Swept(place, reader.counts())


def check_system() -> None:
    """DataError where the system lacks what keeps stores and workers safe."""
    try:
        import fcntl  # noqa: F401
        import resource  # noqa: F401
    except ImportError:
        raise DataError(
            "sweeps run on Linux, not on this system; stores from there can be looked at, exported and reported "
            "here"
        ) from None
