"""How long a sweep will take, from a few of its cases."""

from dataclasses import dataclass, replace
from time import monotonic

from hevopt.sweeps.plan.jobs import Job
from hevopt.sweeps.run import Execution, Onlookers, Schedule, Stopped
from hevopt.sweeps.workers.backends import workers

_SAMPLES, _SAMPLE_WEIGHTS = 4, 3


@dataclass(frozen=True, slots=True)
class Sample:
    """Cases run for an estimate.

    cases: how many; seconds: they took; startup_s: what went by besides, until the worker was up and had compiled
    total_s: what all cases take on one worker, less that
    """

    cases: int
    seconds: float
    startup_s: float
    total_s: float


def timed_sample(
    plan: Schedule, missing: set[str], execution: Execution, watch: Onlookers
) -> Sample | None:
    """A few jobs from all over the plan, run one after the other on one worker; None where none is missing.

    The first one loads and compiles, and counts for the estimate only where it is alone. Of a job with many NOx
    weights the first few are run.
    """
    jobs = list(plan.picked(missing))
    if not jobs:
        return None
    last = len(jobs) - 1
    places = dict.fromkeys(round(n * last / _SAMPLES) for n in range(_SAMPLES + 1))
    chosen = [_with_few_weights(jobs[place]) for place in places]
    spent: dict[str, float] = {}
    began_s = ended_s = monotonic()
    with workers(execution.terms(), count=1, notice=watch.notice) as run:
        for outcomes in run(chosen):
            spent |= {outcome.key: outcome.seconds for outcome in outcomes}
            ended_s = monotonic()
            if watch.stop():
                raise Stopped
    warm = [case for job in chosen[1:] or chosen for case in job.cases]
    mean_s = sum(spent[case.key] for case in warm) / len(warm)
    startup_s = max(0.0, ended_s - began_s - mean_s * len(spent))
    return Sample(len(spent), sum(spent.values()), startup_s, mean_s * len(missing))


def _with_few_weights(job: Job) -> Job:
    weights = list(dict.fromkeys(case.nox_weight for case in job.cases))[:_SAMPLE_WEIGHTS]
    return replace(job, cases=tuple(case for case in job.cases if case.nox_weight in weights))
