"""What a worker of any backend does: hand jobs to a process of its own, and outlive whatever they do to it.

A case that runs past its time, or ends its process, is a failed outcome, not a lost worker. The process is kept
from task to task; it is started with one thread for every numerical library, before any of them is loaded.
"""

import os
import socket
import subprocess
import sys
import tempfile
import threading
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from multiprocessing.connection import Connection
from time import monotonic, sleep
from typing import IO, NamedTuple
from weakref import finalize

from hevopt.sweeps.plan.jobs import Ending, Failure, Job, Result
from hevopt.sweeps.workers.child import (
    CASE,
    LOADING_WALL,
    OUTCOME,
    READY,
    REFUSED,
    CannotStart,
    Terms,
    late,
)

ONE_THREAD = dict.fromkeys(
    ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "BLIS_NUM_THREADS",
     "VECLIB_MAXIMUM_THREADS", "NUMEXPR_NUM_THREADS", "NUMBA_NUM_THREADS"), "1",
)  # fmt: skip
_START_S, _STARTS_MAX = 300.0, 3
# A case is first asked to stop, and its process ended where it has not after this.
_GRACE_S = 2.0
_ERROR_BYTES = 400


class Ended(NamedTuple):
    """A process that did not answer: at which case, if at one, why, and whether that was for taking too long."""

    key: str | None
    fault: str
    late: bool


def run_task(jobs: Sequence[Job], terms: Terms) -> list[Result]:
    """The outcomes of all cases of some jobs."""
    return [outcome for job in jobs for outcome in _outcomes(job, terms)]


def _outcomes(job: Job, terms: Terms) -> list[Result]:
    """Outcomes of a job. A case during which the process ends is tried once more: it may not have been at fault."""
    found: dict[str, Result] = {}
    suspects: set[str] = set()
    while left := tuple(case for case in job.cases if case.key not in found):
        began = monotonic()
        ended = _process(terms).run(replace(job, cases=left), found)
        if ended is None:
            continue
        key = ended.key or next((case.key for case in left if case.key not in found), None)
        if key is None:
            break
        if ended.late or key in suspects:
            fault = ended.fault if ended.late else f"{ended.fault}, twice"
            found[key] = Result(key, Ending.FAILED, None, Failure(fault), monotonic() - began)
        suspects.add(key)
    return list(found.values())


_kept = threading.local()


def _process(terms: Terms) -> "_Process":
    """This thread's process, a new one where there is none that runs to these terms."""
    process: _Process | None = getattr(_kept, "process", None)
    if process is not None and process.terms == terms and process.alive():
        return process
    drop_process()
    for attempt in range(_STARTS_MAX):
        try:
            _kept.process = started = _Process(terms)
            return started
        except _NotStarted as error:
            fault = f"{error}, {attempt + 1} times"
    raise CannotStart(fault)


def drop_process() -> None:
    """End this thread's process."""
    process = getattr(_kept, "process", None)
    if process is not None:
        process.end()
    _kept.process = None


class _NotStarted(Exception):
    """A process ended, or was silent, before it was ready."""


class _Process:
    """A running child.py and the pipe to it."""

    def __init__(self, terms: Terms) -> None:
        self.terms, self._warm = terms, False
        ours, theirs = socket.socketpair()
        # What it says on its way out, for the error of the case.
        self._errors = tempfile.TemporaryFile()
        environment = os.environ | ONE_THREAD
        # Dask has its workers give memory back at once, which costs a process that solves a third of its speed.
        environment.pop("MALLOC_TRIM_THRESHOLD_", None)
        environment["PYTHONPATH"] = python_path()
        with theirs:
            self._running = subprocess.Popen(
                [sys.executable, "-P", "-m", "hevopt.sweeps.workers.child", str(theirs.fileno()), str(os.getpid())],
                stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=self._errors,
                env=environment, pass_fds=[theirs.fileno()],
            )  # fmt: skip
        self._pipe = Connection(ours.detach())
        self.end = finalize(self, _end, self._running, self._pipe, self._errors)
        self._introduce()

    def _introduce(self) -> None:
        kind, text = None, ""
        with suppress(OSError, EOFError):
            self._pipe.send(self.terms)
            if self._pipe.poll(_START_S):
                kind, text = self._pipe.recv()
        if kind == READY:
            return
        said = self._said()
        self.end()
        if kind == REFUSED:
            raise CannotStart(text)
        raise _NotStarted(f"its process ended before it was ready{said}")

    def alive(self) -> bool:
        return self._running.poll() is None

    def run(self, job: Job, found: dict[str, Result]) -> Ended | None:
        """Put the outcomes of a job among those found, as they come; how the process ended where it did."""
        self._errors.seek(0)
        self._errors.truncate()
        key, deadline = None, self._deadline()
        try:
            self._pipe.send(job)
            while self._pipe.poll(None if deadline is None else max(0.0, deadline - monotonic())):
                kind, value = self._pipe.recv()
                if kind == CASE:
                    self._warm = self._warm or key is not None
                    key, deadline = value, self._deadline()
                elif kind == OUTCOME:
                    found[value.key], key, self._warm = value, None, True
                else:
                    return None
        except (EOFError, OSError):
            code = self._running.wait()
            how = f"signal {-code}" if code < 0 else f"exit status {code}"
            fault = (
                f"the process of the case ended ({how}; out of memory, or a crash){self._said()}"
            )
            self.end()
            return Ended(key, fault, late=False)
        self.end()
        return Ended(key, late(self.terms.timeout_s), late=True)

    def _deadline(self) -> float | None:
        if self.terms.timeout_s is None:
            return None
        loading_s = 0.0 if self._warm else LOADING_WALL * self.terms.loading_s
        return monotonic() + self.terms.timeout_s + loading_s + _GRACE_S

    def _said(self) -> str:
        self._errors.seek(0)
        lines = self._errors.read()[-_ERROR_BYTES:].decode(errors="replace").split("\n")
        text = " ".join(line.strip() for line in lines if line.strip())
        return f": {text}" if text else ""


def python_path() -> str:
    """Where a process started from this one finds the same modules."""
    return os.pathsep.join(path for path in sys.path if path)


def _end(running: subprocess.Popen[bytes], pipe: Connection, errors: IO[bytes]) -> None:
    running.kill()
    running.wait()
    pipe.close()
    errors.close()


def end_with(parent: int) -> None:
    """Let this worker end when the process that started it does, be that before its first task."""
    threading.Thread(target=_watch, args=(parent,), daemon=True).start()


def _watch(parent: int) -> None:
    while os.getppid() == parent:
        sleep(0.5)
    os._exit(1)
