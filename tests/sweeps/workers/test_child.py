"""The time limit of a case, and what the first case of a process has on top of it."""

import signal
import time

import pytest
from sweep_workers import jobs

from hevopt.sweeps.plan.jobs import Ending, Result
from hevopt.sweeps.workers.child import OUTCOME, Terms, _Runner


def sleeps(key):
    """Long by the clock, without processor time: what a case sees whose processor others have."""
    time.sleep(0.5)


def computes(key):
    began = time.process_time()
    while time.process_time() < began + 5.0:
        pass


def endings(does, *, loading_s, cases=2):
    """How the cases of one job end in this process."""
    sent = []

    class Pipe:
        send = staticmethod(sent.append)

    def work(job, guard):
        for case in job.cases:
            with guard():
                does(case.key)
            yield Result(case.key, Ending.OK, {}, None, 0.0)

    before = signal.getsignal(signal.SIGALRM)
    try:
        (job,) = jobs(1, cases)
        _Runner(Pipe, Terms("-", timeout_s=0.02, loading_s=loading_s), work).solve(job)
    finally:
        signal.signal(signal.SIGALRM, before)
    return [value.ending for kind, value in sent if kind == OUTCOME]


@pytest.mark.parametrize(
    ("does", "loading_s", "first"),
    [
        (sleeps, 0.1, Ending.OK),  # what is granted is processor time, of which it had next to none
        (sleeps, 0.01, Ending.FAILED),  # but no more than ten times as long by the clock
        (computes, 0.1, Ending.FAILED),
    ],
)
def test_the_first_case_has_its_time_to_load_in_processor_time(does, loading_s, first):
    found = endings(does, loading_s=loading_s)
    assert found == [first, Ending.FAILED]
