"""The process that solves: alone with a job, so that whatever the job does, only this process is lost.

It speaks with the worker that started it over one pipe: `Terms` come in and READY goes out, then jobs come in and
(CASE, key) goes out before each case, (OUTCOME, outcome) as it is there, (DONE, None) after the last.
"""

import ctypes
import gc
import json
import os
import signal
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from multiprocessing.connection import Connection
from pathlib import Path
from pkgutil import resolve_name
from time import monotonic, perf_counter, process_time
from typing import Any

from hevopt.errors import SolverError
from hevopt.studies.provenance import code_digest
from hevopt.sweeps.plan.jobs import SOLVED, Ending, Failure, Job, Result

READY, REFUSED, CASE, OUTCOME, DONE = "ready", "refused", "case", "outcome", "done"
# For whatever ends a sweep before its end.
KEPT = "all results so far are stored: the same command goes on from there"
Work = Callable[..., Iterable[Result]]
LOADING_WALL = 10.0
# The kernel's prctl(2): a signal for this process when the one that started it ends.
_PR_SET_PDEATHSIG = 1
# A worker that has gone leaves nothing behind for longer than this.
_IDLE_S = 60.0


@dataclass(frozen=True, slots=True)
class Terms:
    """What a job is run with: by which function, within which limits, by which code.

    work: "module:name" of a function from job and guard to outcomes, as they are there, the guard being entered
    around every case; a name, so that a worker need not load what only its process uses
    timeout_s: of a case; memory_mb: address space of the process that solves, itself included
    loading_s: of processor time, granted on top of timeout_s to the first case of a process, which loads and
    compiles; on a machine with other work it may take LOADING_WALL times as long by the clock
    code: digest that the code beside the worker must have, or None for any
    """

    work: str
    timeout_s: float | None = None
    memory_mb: float | None = None
    loading_s: float = 60.0
    code: str | None = None


class CannotStart(SolverError):
    """No worker can start, be it for its terms or its code; what was solved before is stored."""

    exit_status = 4

    def __str__(self) -> str:
        # Made here: an error that travels from a worker is made anew from what it was made of.
        return f"a worker cannot start: {super().__str__()}; {KEPT}"


def main() -> None:
    """Serve the worker at the other end of the pipe until it goes, or is silent for a minute."""
    descriptor, parent = int(sys.argv[1]), int(sys.argv[2])
    _end_with(parent)
    # Objects that nobody holds are searched for among those of cases, not among what is loaded, which stays.
    gc.disable()
    with Connection(descriptor) as pipe, suppress(EOFError, OSError):
        try:
            terms = pipe.recv()
            work = resolve_name(terms.work)
            _accept(terms)
        except Exception as error:
            pipe.send((REFUSED, str(error) or type(error).__name__))
            return
        gc.freeze()
        gc.enable()
        pipe.send((READY, None))
        bench = _Runner(pipe, terms, work)
        while pipe.poll(_IDLE_S):
            bench.solve(pipe.recv())
            pipe.send((DONE, None))


def _end_with(parent: int) -> None:
    """End when the worker ends, even inside compiled code; be the first to go where memory runs out."""
    with suppress(OSError, AttributeError):
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != parent:
        raise SystemExit
    with suppress(OSError):
        Path("/proc/self/oom_score_adj").write_text("800")


def _accept(terms: Terms) -> None:
    if terms.code is not None and terms.code != code_digest():
        raise SolverError(
            "its hevopt, Python or libraries are not those that this process started with; install the same "
            "everywhere, change nothing while a sweep runs, and run the same command again"
        )
    if terms.memory_mb is not None:
        import resource

        limit, hard = int(terms.memory_mb * 2**20), resource.getrlimit(resource.RLIMIT_AS)[1]
        limit = limit if hard == resource.RLIM_INFINITY else min(limit, hard)
        resource.setrlimit(resource.RLIMIT_AS, (limit, hard))
        needed_mb = _address_space() / 2**20
        if needed_mb > terms.memory_mb:
            raise SolverError(
                f"--memory-mb {terms.memory_mb:g}: a worker takes {needed_mb:.0f} MB of address space "
                "before its first case; allow more"
            )


def _address_space() -> int:
    with suppress(OSError):
        pages = int(Path("/proc/self/statm").read_text().split()[0])
        return pages * os.sysconf("SC_PAGE_SIZE")
    return 0


class _Runner:
    """Runs jobs, tells which case is next, and stops one that takes too long."""

    def __init__(self, pipe: Connection, terms: Terms, work: Work) -> None:
        self._pipe, self._terms, self._work = pipe, terms, work
        self._loading_s = terms.loading_s
        # The case under a time limit, until which readings of the clocks it may go on, the cases to come, and
        # those that were late.
        self._timed: str | None = None
        self._until_s = self._processor_until_s = 0.0
        self._next: Iterator[str] = iter(())
        self._late = set[str]()
        signal.signal(signal.SIGALRM, self._stop)

    def solve(self, job: Job) -> None:
        """Send exactly one outcome for every case, each fit to be stored, as soon as it is there."""
        left, began = {case.key: case for case in job.cases}, perf_counter()
        self._next = iter(tuple(left))
        self._late.clear()
        failure = Failure("the worker gave no outcome for this case")
        try:
            for outcome in self._work(job, self._guard):
                if left.pop(outcome.key, None) is not None:
                    self._send(outcome)
        except BaseException as error:
            failure = Failure.of(error)
        for key in left:
            self._send(Result(key, Ending.FAILED, None, failure, perf_counter() - began))

    def _send(self, outcome: Result) -> None:
        # Whatever the case made of the exception that was to stop it.
        if outcome.key in self._late:
            failure = Failure(late(self._terms.timeout_s))
            outcome = replace(outcome, ending=Ending.FAILED, row=None, failure=failure)
        self._pipe.send((OUTCOME, _storable(outcome)))

    @contextmanager
    def _guard(self) -> Iterator[None]:
        key = next(self._next)
        loading_s, self._loading_s = self._loading_s, 0.0
        self._pipe.send((CASE, key))
        try:
            if (limit_s := self._terms.timeout_s) is not None:
                self._timed = key
                self._until_s = monotonic() + limit_s + LOADING_WALL * loading_s
                self._processor_until_s = process_time() + loading_s + limit_s
                signal.setitimer(signal.ITIMER_REAL, limit_s + loading_s)
            yield
        finally:
            self._timed = None
            signal.setitimer(signal.ITIMER_REAL, 0)

    def _stop(self, *_: Any) -> None:
        left_s = min(self._until_s - monotonic(), self._processor_until_s - process_time())
        # Where others take the processor, a first case has not yet had what it needs to load.
        if self._timed is not None and left_s > 0:
            signal.setitimer(signal.ITIMER_REAL, left_s)
            return
        key, self._timed = self._timed, None
        # An alarm that is heard only after its case stops nothing.
        if key is not None:
            self._late.add(key)
            raise SolverError(late(self._terms.timeout_s))


def late(timeout_s: float | None) -> str:
    """The error of a case that took too long."""
    return f"timeout: took more than {timeout_s:g} s"


def _storable(outcome: Result) -> Result:
    try:
        if outcome.ending not in SOLVED:
            raise ValueError(f"a case cannot end as {outcome.ending!r}")
        json.dumps(outcome.row, allow_nan=False)
        return outcome
    except (TypeError, ValueError, RecursionError) as error:
        failure = Failure(f"the row cannot be stored: {error}")
        return Result(outcome.key, Ending.FAILED, None, failure, outcome.seconds)


if __name__ == "__main__":
    main()
