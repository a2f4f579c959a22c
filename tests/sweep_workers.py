"""Stand-ins for the work of a sweep: quick, and able to do to a worker whatever a case might."""

import contextlib
import gc
import os
import signal
import time
from zlib import crc32

from hevopt.errors import SolverError
from hevopt.sweeps.plan.jobs import Failure, Job, Result, Task


def jobs(count, cases=2, does=None):
    """Jobs of some cases with keys k0, k1 ...; does: case number -> what `act` does in it."""
    does = does or {}
    made = []
    for n in range(count):
        numbers = range(n * cases, (n + 1) * cases)
        acts = {f"k{i}": does[i] for i in numbers if i in does}
        made.append(
            Job("car", {"does": acts}, "trace", False, tuple(Task(f"k{i}", 0.0, "dp") for i in numbers))
        )  # fmt: skip
    return made


def row_of(key):
    """The row that every worker must give for a key, with a number that only full precision keeps."""
    figure = 1 / (crc32(key.encode()) % 1000 + 3)
    return {"strategy": "dp", "status": "ok", "objective_l_per_100km": figure,
            "fuel_l_per_100km": figure, "fuel_corrected_l_per_100km": figure,
            "bound_l_per_100km": figure / 2, "objective_bound_l_per_100km": figure / 2}  # fmt: skip


def work(job, guard):
    for case in job.cases:
        try:
            with guard():
                extra = act(job.changes.get("does", {}).get(case.key))
        except Exception as error:
            text = f"{type(error).__name__}: {error}"
            yield Result(case.key, "failed", None, Failure(text), 0.001)
        else:
            yield Result(case.key, "ok", row_of(case.key) | extra, None, 0.001)


def slow(job, guard):
    time.sleep(0.05)
    return work(job, guard)


def landscape(job, guard):
    """Objectives with one valley per NOx weight, and bounds one per cent below."""
    cells, power_w = job.changes["battery.cells_in_series"], job.changes["machine.power_max_w"]
    outcomes = []
    for case in job.cases:
        bottom = 70 if case.nox_weight else 50
        figure = 4 + ((cells - bottom) / 40) ** 2 + ((power_w - 2e4) / 2e4) ** 2
        row = row_of(case.key) | {
            "objective_l_per_100km": figure,
            "bound_l_per_100km": 0.99 * figure,
            "objective_bound_l_per_100km": 0.99 * figure,
        }
        if case.strategy == "bound":
            row |= {"strategy": "bound", "objective_l_per_100km": None}
        outcomes.append(Result(case.key, "ok", row, None, 0.001))
    return outcomes


def short_of_torque(job, guard):
    """As `landscape`, but the cars in the valley do not follow the cycle, and would be the best."""
    short = abs(job.changes["machine.power_max_w"] - 2e4) < 5e3
    outcomes = []
    for outcome in landscape(job, guard):
        if short and outcome.row["objective_l_per_100km"] is not None:
            outcome.row["status"] = "shortfall at 3 steps"
            outcome.row["objective_l_per_100km"] = 0.1
        outcomes.append(outcome)
    return outcomes


def typical(job, guard):
    """Rows as large as those of real cases."""
    more = {f"figure_number_{n}_l_per_100km": 1 / (n + 3) for n in range(15)}
    return [Result(c.key, "ok", row_of(c.key) | more, None, 0.001) for c in job.cases]


def bulky(job, guard):
    """Rows of six kilobytes, and time for the store to take them in several portions."""
    time.sleep(0.03)
    return [Result(c.key, "ok", row_of(c.key) | {"more": "x" * 6000}, None, 0.1) for c in job.cases]


def fails_when_asked(job, guard):
    """Every third key fails for as long as a file says so."""
    failing = os.path.exists(os.environ["SWEEP_FAILS"])
    return [
        Result(o.key, "failed", None, Failure("asked to"), 0.0)
        if failing and crc32(o.key.encode()) % 3 == 0
        else o
        for o in work(job, guard)
    ]


def raises(job, guard):
    raise RuntimeError("all of it")


def forgets(job, guard):
    return list(work(job, guard))[1:]


def act(what):
    """What one case does: nothing, tell something, or harm."""
    match what:
        case None:
            pass
        case "pids":
            time.sleep(0.1)
            blocked = signal.pthread_sigmask(signal.SIG_BLOCK, [])
            deaf = signal.SIGINT in blocked
            return {"pid": os.getpid(), "worker": os.getppid(), "deaf": deaf}
        case ["meet", folder, count]:
            # Until as many processes are there as are expected.
            open(os.path.join(folder, str(os.getpid())), "w").close()
            deadline = time.monotonic() + 60
            while len(os.listdir(folder)) < count and time.monotonic() < deadline:
                time.sleep(0.02)
            return act("pids")
        case ["note", file]:
            with open(file, "a") as f:
                f.write("ran\n")
        case ["await", file]:
            deadline = time.monotonic() + 100
            while not os.path.exists(file):
                assert time.monotonic() < deadline
                time.sleep(0.01)
        case "rubbish":
            return {"kept": gc.get_freeze_count(), "searched": gc.isenabled()}
        case "threads":
            return _threads()
        case "raise":
            raise ValueError("not today")
        case "hang":
            while True:
                time.sleep(0.01)
        case "hang and shrug":
            with contextlib.suppress(SolverError):
                act("hang")
        case "hang and garble":
            try:
                act("hang")
            except SolverError:
                raise KeyError("what a library made of it") from None
        case "hang in C":
            signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGALRM})
            while True:
                time.sleep(10)
        case "eat":
            held = []
            while True:
                held.append(bytearray(2**24))
        case "die":
            os.kill(os.getpid(), signal.SIGKILL)
        case ["die once", marker]:
            if not os.path.exists(marker):
                open(marker, "w").close()
                os.kill(os.getpid(), signal.SIGKILL)
        case "exit":
            raise SystemExit(3)
        case "unstorable":
            return {"bad": object()}
        case "nan":
            return {"bad": float("nan")}
    return {}


def _threads():
    """Threads that numerical libraries may use, and those that this process has after a product of matrices."""
    import numba
    import numpy as np

    matrix = np.ones((500, 500))
    matrix @ matrix
    return {"numba": numba.get_num_threads(), "here": len(os.listdir("/proc/self/task"))}
