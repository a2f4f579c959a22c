"""Jobs to outcomes on many workers, by joblib, through the loss of any worker.

Jobs travel in tasks of about a second; outcomes come as tasks end, in any order. joblib's own backends run them in
this process where there is one worker; the one for Ray gives no results as they come, and queues tasks behind a
slow one while others are idle; the one for Dask lets arguments be lost with a worker, and waits for ever for a task
that Dask has given up. So joblib gets one backend here, which sends calls to a pool and hands on its futures.
"""

import queue
import signal
import threading
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager, suppress
from functools import partial
from multiprocessing import resource_tracker
from typing import Any

from joblib import Parallel, delayed
from joblib.externals.loky.backend import resource_tracker as loky_tracker
from joblib.parallel import ParallelBackendBase

from hevopt.errors import HevoptError
from hevopt.sweeps.child import Terms
from hevopt.sweeps.jobs import Job, Outcome
from hevopt.sweeps.pools import Pool, open_pool
from hevopt.sweeps.supervisor import run_task

_TASK_S = 1.0
_TICK_S = 0.2
_CLOSE_S = 15.0
# Pools that may end one after the other without a single outcome in between.
_LOSSES_MAX = 5

Run = Callable[[Iterable[Job]], Iterator[list[Outcome]]]


@contextmanager
def workers(
    terms: Terms,
    *,
    backend: str = "loky",
    count: int | None = None,
    scheduler: str | None = None,
    notice: Callable[[str], None] = lambda text: None,
) -> Iterator[Run]:
    """A function from jobs to their outcomes, on workers that stay from call to call and are gone at the end.

    The outcomes come in lists, an empty one five times a second where there is none, so that the caller can see to
    other things; closed early, the jobs on their way are given up. Pools that break are opened anew, and what was
    on its way is run again; `notice` is told. Raises WorkersLost where they break time after time.
    """
    with _Team(partial(open_pool, backend, count, scheduler), terms, notice) as team:
        yield team.run


class WorkersLost(HevoptError):
    """Workers end faster than they work; what they had done is stored."""

    exit_status = 4

    def __init__(self, text: str) -> None:
        super().__init__(
            f"{text}; all results so far are stored: the same command goes on from there"
        )


class _Futures(ParallelBackendBase):
    """joblib's view of a pool: at least two workers, or joblib would run the calls in this process."""

    supports_retrieve_callback = True
    supports_return_generator = True

    def __init__(self, pool: Pool) -> None:
        super().__init__(nesting_level=0)
        self.pool, self._waiting = pool, {}

    def effective_n_jobs(self, n_jobs: int) -> int:
        return max(2, self.pool.workers)

    def configure(self, n_jobs: int = 1, parallel: Any = None, **_: Any) -> int:
        self.parallel = parallel
        return self.effective_n_jobs(n_jobs)

    def submit(self, func: Callable[[], Any], callback: Callable[[Future], None]) -> Future:
        try:
            future = self.pool.send(func)
        except Exception as error:
            future = Future()
            future.set_exception(error)
        self._waiting[future] = callback
        future.add_done_callback(self._done)
        return future

    def _done(self, future: Future) -> None:
        callback = self._waiting.pop(future, None)
        if callback is not None:
            callback(future)

    def retrieve_result_callback(self, out: Future) -> Any:
        return out.result()

    def abort_everything(self, ensure_ready: bool = True) -> None:
        self._waiting.clear()

    def give_up(self) -> None:
        """Let joblib see that a call has failed, so that it stops waiting for all."""
        with suppress(KeyError):
            callback = self._waiting.popitem()[1]
            failed: Future = Future()
            failed.set_exception(_GivenUp())
            callback(failed)


class _GivenUp(Exception):
    """The caller wants no more outcomes."""


class _Tasks:
    """Jobs packed into tasks of about a second, and which of them are on their way."""

    def __init__(self, jobs: Iterable[Job], workers: int) -> None:
        self._jobs, self._workers = deque(jobs), workers
        self.job_s, self.ended = 0.0, False
        self.sent: dict[int, list[Job]] = {}
        self._lock = threading.Lock()
        self._number = 0

    def __iter__(self) -> Iterator[tuple[int, list[Job]]]:
        while not self.ended:
            with self._lock:
                task = [self._jobs.popleft() for _ in range(min(self._size(), len(self._jobs)))]
                if not task:
                    return
                self._number += 1
                self.sent[self._number] = task
                number = self._number
            yield number, task

    def _size(self) -> int:
        """One job until it is known how long they take; smaller tasks again when few are left."""
        share = len(self._jobs) // (4 * self._workers)
        fitting = int(_TASK_S / self.job_s) if self.job_s else 1
        return max(1, min(fitting, share))

    def answered(self, number: int, outcomes: list[Outcome]) -> None:
        jobs = self.sent.pop(number)
        took_s = max(sum(outcome.seconds for outcome in outcomes), 1e-4) / len(jobs)
        self.job_s = took_s if not self.job_s else 0.7 * self.job_s + 0.3 * took_s

    def take_back(self) -> None:
        """Put what was on its way in front again."""
        with self._lock:
            for number in sorted(self.sent, reverse=True):
                self._jobs.extendleft(reversed(self.sent.pop(number)))


class _Team:
    """A pool, and the one thread that opens it, works with it and closes it.

    That thread keeps interrupts from everything it starts: what a terminal sends to all is for the caller to see.
    """

    def __init__(
        self, open_one: Callable[[], Pool], terms: Terms, notice: Callable[[str], None]
    ) -> None:
        self._open, self._terms, self._notice = open_one, terms, notice
        self._thread = ThreadPoolExecutor(1, "hevopt-sweep", _keep_interrupts)
        self._backend: _Futures | None = None
        self._losses = 0

    def __enter__(self) -> "_Team":
        try:
            self._renew()
        except BaseException:
            self._thread.shutdown(wait=False)
            raise
        return self

    def __exit__(self, *_: object) -> None:
        self._close()
        self._thread.shutdown(wait=False)

    def _renew(self) -> None:
        self._backend = _Futures(_waited(self._thread.submit(self._open)))

    def _close(self) -> None:
        backend, self._backend = self._backend, None
        if backend is not None:
            closing = self._thread.submit(backend.pool.close)
            with suppress(Exception):
                closing.result(_CLOSE_S)

    def run(self, jobs: Iterable[Job]) -> Iterator[list[Outcome]]:
        """Lists of outcomes, as `workers` says."""
        tasks = _Tasks(jobs, self._backend.pool.workers)
        while True:
            arrived: queue.SimpleQueue = queue.SimpleQueue()
            driving = self._thread.submit(self._drive, tasks, arrived.put)
            try:
                yield from self._arrivals(tasks, arrived)
            finally:
                self._stop(tasks, driving)
            fault = driving.exception()
            if fault is None:
                return
            # What ended the workers may ask the caller to end as well.
            yield []
            self._recover(tasks, fault)

    def _drive(self, tasks: _Tasks, deliver: Callable[[Any], None]) -> None:
        """Runs tasks through joblib until none is left or one is lost; the last thing delivered is None."""
        try:
            call = delayed(partial(_numbered, self._terms))
            parallel = Parallel(
                backend=self._backend, n_jobs=self._backend.pool.workers, batch_size=1,
                pre_dispatch=self._backend.pool.window, return_as="generator_unordered",
            )  # fmt: skip
            for answer in parallel(call(*task) for task in tasks):
                deliver(answer)
        finally:
            deliver(None)

    def _arrivals(self, tasks: _Tasks, arrived: queue.SimpleQueue) -> Iterator[list[Outcome]]:
        while True:
            try:
                answer = arrived.get(timeout=_TICK_S)
            except queue.Empty:
                yield []
                continue
            if answer is None:
                return
            number, outcomes = answer
            if isinstance(outcomes, HevoptError):
                raise outcomes
            tasks.answered(number, outcomes)
            self._losses = 0
            yield outcomes

    def _stop(self, tasks: _Tasks, driving: Future) -> None:
        """End the driving, wherever it is, and the pool where tasks are on their way in it."""
        tasks.ended = True
        self._backend.give_up()
        with suppress(Exception):
            driving.exception(_CLOSE_S)
        tasks.ended = False

    def _recover(self, tasks: _Tasks, fault: BaseException) -> None:
        text = (str(fault).splitlines() or [""])[0] or type(fault).__name__
        self._losses += 1
        if self._losses > _LOSSES_MAX:
            raise WorkersLost(
                f"workers ended {self._losses} times without an outcome in between, last: {text}"
            )
        tasks.take_back()
        self._notice(f"a worker was lost ({text}); its jobs are run again")
        self._close()
        try:
            self._renew()
        except HevoptError as error:
            raise WorkersLost(
                f"a worker was lost ({text}), and no other could be started: {error}"
            ) from None


def _numbered(
    terms: Terms, number: int, jobs: list[Job]
) -> tuple[int, list[Outcome] | HevoptError]:
    """What a worker returns; an error as a value, since each backend dresses up what is raised in its own way."""
    try:
        return number, run_task(jobs, terms)
    except HevoptError as error:
        return number, error


def _keep_interrupts() -> None:
    # Each of the two unblocks interrupts in the thread that first needs it: so they are started before.
    resource_tracker.ensure_running()
    loky_tracker.ensure_running()
    signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})


def _waited(future: Future) -> Any:
    """A future's result, with the caller's interrupts seen at once."""
    while not future.done():
        with suppress(Exception):
            future.exception(timeout=_TICK_S)
    return future.result()
