"""Work shared out between this process and one forked from it, where that is sound and pays."""

import mmap
import os
import pickle
import signal
import threading
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from multiprocessing.connection import Connection
from typing import TYPE_CHECKING, Any, TypeVar, cast

from hevopt.errors import HevoptError

if TYPE_CHECKING:
    from multiprocessing.context import ForkProcess

_Result = TypeVar("_Result")
# How often the process that was forked looks whether the first is still there.
_LOOK_S = 0.2


class SharedCount:
    """How much is done, by both processes; each counts in a place of its own, which the other reads.

    of_first: whether the process it is used in is the first one, not the one forked from it
    """

    def __init__(self) -> None:
        self._counts = memoryview(mmap.mmap(-1, 16)).cast("q")
        self.of_first = True

    def add(self, count: int) -> None:
        self._counts[int(self.of_first)] += count

    def total(self) -> int:
        return sum(self._counts)

    def in_other_process(self) -> None:
        """Count in the other's place from now on."""
        self.of_first = False


def two_processors() -> bool:
    """Whether a process can be forked here without harm, and has a processor of its own to run on."""
    if not hasattr(os, "fork") or threading.active_count() > 1:
        return False
    return len(os.sched_getaffinity(0)) > 1 if hasattr(os, "sched_getaffinity") else False


def nothing() -> None:
    """Nothing is to be done while this process waits."""


def halves(
    work: Callable[[int], _Result],
    order: Sequence[int],
    tally: SharedCount,
    meanwhile: Callable[[], None] = nothing,
) -> list[_Result]:
    """work(0) to work(count - 1), at most 256; a process forked from this one takes every call that is next when it
    is free.

    order: of the calls, those that take longest first, so that neither process waits long for the other
    meanwhile: what this process does before it waits
    Results come back by number, whoever made them, and so does an error: the first that is raised on purpose. What
    the other process does not bring back, as where it was killed, is done here.
    """
    count = len(order)
    tickets, issued = os.pipe()
    os.write(issued, bytes(order))
    os.close(issued)
    other, here = _forked(_other, work, tickets, tally)
    try:
        found = _taken(work, tickets)
        meanwhile()
        for beside in _heard(here):
            found |= beside
        for n in range(count):
            if n not in found:
                found[n] = _tried(work, n)
    finally:
        other.terminate()
        other.join()
        os.close(tickets)
        here.close()
    results: list[_Result] = []
    for n in range(count):
        result = found[n]
        if isinstance(result, HevoptError):
            raise result
        results.append(result)
    return results


def ahead(work: Callable[[], _Result]) -> Callable[[], _Result]:
    """What gives work()'s result, or raises its error, once that is needed.

    Until then a process forked from this one does it, where there is a processor for that, and this one something
    else; what that process does not bring back is done here.
    """
    if not two_processors():
        return work
    other, here = _forked(_send, work)

    def result() -> _Result:
        found = _heard(here)
        here.close()
        other.join()
        if not found:
            return work()
        if isinstance(found[0], HevoptError):
            raise found[0]
        return cast(_Result, found[0])

    return result


def _forked(target: Callable[..., None], *given: Any) -> "tuple[ForkProcess, Connection]":
    """A process forked from this one, told what is given, where to tell what it finds, and who is the first; and
    where that is heard."""
    from multiprocessing import get_context

    context = get_context("fork")
    here, there = context.Pipe(duplex=False)
    other = context.Process(target=target, args=(*given, there, os.getpid()), daemon=True)
    other.start()
    there.close()
    return other, here


def _tell(there: Connection, found: Any) -> None:
    # Arrays that nobody may write stay so by this protocol alone: loops are compiled for one kind of them.
    there.send_bytes(pickle.dumps(found, protocol=5))


def _heard(here: Connection) -> list[Any]:
    """What the other process found; empty where it ended before it told."""
    with suppress(EOFError, OSError, pickle.UnpicklingError):
        return [pickle.loads(here.recv_bytes())]
    return []


def _send(work: Callable[[], Any], there: Connection, first: int) -> None:
    _depend_on(first)
    # Any other error than those on purpose is met by the first process, which does the work itself then.
    with suppress(Exception):
        try:
            found = work()
        except HevoptError as error:
            found = error
        _tell(there, found)


def _other(
    work: Callable[[int], Any], tickets: int, tally: SharedCount, there: Connection, first: int
) -> None:
    _depend_on(first)
    tally.in_other_process()
    _tell(there, _taken(work, tickets))


def _depend_on(first: int) -> None:
    # The first process is interrupted, and ends this one; where it is killed, nobody does.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    threading.Thread(target=_end_with, args=(first,), daemon=True).start()


def _end_with(first: int) -> None:
    """End this process once the first one is gone: nobody would read what it sends, nor close what it holds."""
    while os.getppid() == first:
        time.sleep(_LOOK_S)
    os._exit(1)


def _taken(work: Callable[[int], Any], tickets: int) -> dict[int, Any]:
    """What this process does of the work, by number: what comes next, until nothing is left."""
    found = {}
    while ticket := os.read(tickets, 1):
        found[ticket[0]] = _tried(work, ticket[0])
    return found


def _tried(work: Callable[[int], Any], n: int) -> Any:
    try:
        return work(n)
    except HevoptError as error:
        return error
