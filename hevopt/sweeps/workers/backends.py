"""Jobs to outcomes on many workers, through the loss of any worker.

Jobs travel in tasks of about a second; outcomes come as tasks end, in any order. Whatever the backend, here it is a
pool that takes calls and gives futures; a thread of its own opens and closes it, since each may take long, or for
ever, while the caller is to be heard.
"""

import queue
import signal
import threading
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, wait
from contextlib import contextmanager, suppress
from functools import partial
from multiprocessing import resource_tracker
from typing import Any, cast

from loky.backend import resource_tracker as loky_tracker

from hevopt.errors import HevoptError
from hevopt.files.shown import first_line
from hevopt.sweeps.plan.jobs import Job, Result
from hevopt.sweeps.workers.child import KEPT, Terms
from hevopt.sweeps.workers.pools import Pool, open_pool
from hevopt.sweeps.workers.supervisor import run_task

_TASK_S = 1.0
_TICK_S = 0.2
_CLOSE_S = 15.0
# Pools that may end one after the other without a single outcome in between.
_LOSSES_MAX = 5

Run = Callable[[Iterable[Job]], Generator[list[Result], None, None]]


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

    The outcomes come in lists, an empty one five times a second where there is none, while workers start too, so
    that the caller can see to other things; closed early, the jobs on their way are given up. Pools that break are
    opened anew, and what was on its way is run again; `notice` is told. Raises WorkersLost where they break time
    after time, DataError where a scheduler does not answer.
    """
    team = _Team(partial(open_pool, backend, count, scheduler), terms, notice, scheduler is None)
    try:
        yield team.run
    finally:
        team.end()


class WorkersLost(HevoptError):
    """Workers end faster than they work, or do not start; what they had done is stored."""

    exit_status = 4

    def __init__(self, text: str) -> None:
        super().__init__(f"{text}; {KEPT}")


class _Tasks:
    """Jobs packed into tasks of about a second, and which of them are on their way."""

    def __init__(self, jobs: Iterable[Job]) -> None:
        self._jobs = deque(jobs)
        self._job_s, self._number = 0.0, 0
        self._sent: dict[int, list[Job]] = {}

    def take(self, workers: int) -> tuple[int, list[Job]] | None:
        """The next task and its number, to be sent to one of some workers; None where no job is left."""
        task = [self._jobs.popleft() for _ in range(min(self._size(workers), len(self._jobs)))]
        if not task:
            return None
        self._number += 1
        self._sent[self._number] = task
        return self._number, task

    def _size(self, workers: int) -> int:
        """One job until it is known how long they take; smaller tasks again when few are left."""
        share = len(self._jobs) // (4 * workers)
        fitting = int(_TASK_S / self._job_s) if self._job_s else 1
        return max(1, min(fitting, share))

    def answered(self, number: int, outcomes: list[Result]) -> None:
        jobs = self._sent.pop(number)
        took_s = max(sum(outcome.seconds for outcome in outcomes), 1e-4) / len(jobs)
        self._job_s = took_s if not self._job_s else 0.7 * self._job_s + 0.3 * took_s

    def take_back(self) -> None:
        """Put what was on its way in front again."""
        for number in sorted(self._sent, reverse=True):
            self._jobs.extendleft(reversed(self._sent.pop(number)))


class _Server:
    """A thread that makes calls one after the other, and keeps interrupts from everything that they start.

    What a terminal sends to all is for the caller to see. Where a call never ends, the program ends all the same.
    """

    def __init__(self) -> None:
        self._calls: queue.SimpleQueue[Any] = queue.SimpleQueue()
        threading.Thread(target=self._serve, name="hevopt-sweep", daemon=True).start()

    def call(self, function: Callable[..., Any], *arguments: Any) -> Future[Any]:
        """What a function will have returned."""
        done: Future[Any] = Future()
        self._calls.put((done, partial(function, *arguments)))
        return done

    def end(self) -> None:
        self._calls.put(None)

    def _serve(self) -> None:
        # Each of the two unblocks interrupts in the thread that first needs it: so they are started before.
        resource_tracker.ensure_running()
        loky_tracker.ensure_running()
        signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        while (asked := self._calls.get()) is not None:
            done, call = asked
            try:
                done.set_result(call())
            except BaseException as error:
                done.set_exception(error)


class _Team:
    """A pool, opened when it is first needed and anew when it breaks. own: whether its workers end with it."""

    def __init__(
        self, open_one: Callable[[], Pool], terms: Terms, notice: Callable[[str], None], own: bool
    ) -> None:
        self._open, self._terms, self._notice, self._own = open_one, terms, notice, own
        self._server = _Server()
        self._opened: Future[Any] | None = None
        self._losses, self._loss = 0, ""

    def run(self, jobs: Iterable[Job]) -> Generator[list[Result], None, None]:
        """Lists of outcomes, as `workers` says."""
        tasks = _Tasks(jobs)
        while (fault := (yield from self._attempt(tasks))) is not None:
            self._close()
            # What ended the workers may ask the caller to end as well.
            yield []
            self._lost(fault)
            tasks.take_back()

    def _attempt(self, tasks: _Tasks) -> Generator[list[Result], None, BaseException | None]:
        """Runs tasks until none is left, or one is lost: then why."""
        pool = yield from self._pool()
        sent: dict[Future[Any], int] = {}
        fault = None
        try:
            while fault is None:
                while len(sent) < pool.window and (task := tasks.take(pool.workers)):
                    sent[self._send(pool, *task)] = task[0]
                if not sent:
                    break
                outcomes: list[Result] = []
                for future in wait(sent, _TICK_S, FIRST_COMPLETED).done:
                    number = sent.pop(future)
                    if lost := _fault_of(future):
                        fault = lost
                    else:
                        outcomes += self._answer(tasks, number, future.result())
                yield outcomes
        finally:
            if sent:
                self._close()
        return fault

    def _pool(self) -> Generator[list[Result], None, Pool]:
        if self._opened is None:
            self._opened = self._server.call(self._open)
        opened = self._opened
        while not wait([opened], _TICK_S).done:
            yield []
        if fault := _fault_of(opened):
            self._opened = None
            if isinstance(fault, HevoptError) and not self._losses:
                raise fault
            none = "and no other could" if self._losses else "no worker can"
            raise WorkersLost(f"{self._loss}{none} be started: {first_line(fault)}")
        _hear_signals()
        pool: Pool = opened.result()
        return pool

    def _send(self, pool: Pool, number: int, jobs: list[Job]) -> Future[Any]:
        sent = self._server.call(pool.send, partial(_answer_of, self._terms, jobs))
        fault = _fault_of(sent)
        return sent if fault else cast("Future[Any]", sent.result())

    def _answer(
        self, tasks: _Tasks, number: int, answer: list[Result] | HevoptError
    ) -> list[Result]:
        if isinstance(answer, HevoptError):
            raise answer
        tasks.answered(number, answer)
        self._losses, self._loss = 0, ""
        return answer

    def _lost(self, fault: BaseException) -> None:
        text = first_line(fault)
        self._losses += 1
        if self._losses > _LOSSES_MAX:
            raise WorkersLost(
                f"workers ended {self._losses} times without an outcome in between, last: {text}"
            )
        self._loss = f"a worker was lost ({text}), "
        self._notice(f"a worker was lost ({text}); its jobs are run again")

    def _close(self) -> None:
        opened, self._opened = self._opened, None
        # A scheduler that is still silent has nothing that would have to be closed.
        if opened is not None and (self._own or opened.done()):
            closing = self._server.call(lambda: opened.result().close())
            with suppress(Exception):
                closing.exception(_CLOSE_S)

    def end(self) -> None:
        self._close()
        self._server.end()


def _hear_signals() -> None:
    """Take signals back: at one that asks a sweep to end, Ray's handler tells of a crash, and aborts in the end."""
    if threading.current_thread() is threading.main_thread():
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            if callable(handler := signal.getsignal(number)):
                signal.signal(number, handler)


def _answer_of(terms: Terms, jobs: list[Job]) -> list[Result] | HevoptError:
    """What a worker returns; an error as a value, since each backend dresses up what is raised in its own way."""
    try:
        return run_task(jobs, terms)
    except HevoptError as error:
        return error


def _fault_of(future: Future[Any]) -> BaseException | None:
    """What a call raised, waited for."""
    try:
        return future.exception()
    except CancelledError as error:
        return error
