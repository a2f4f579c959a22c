"""Every backend: the same outcomes, each once, in workers of their own, through whatever a case does to one."""

import os
import re
import signal
import socket
import subprocess
import sys
import threading
import time
from contextlib import contextmanager
from pathlib import Path

import pytest
import sweep_workers
from sweep_runs import alive, table, write_study
from sweep_runs import run as swept

from hevopt.errors import DataError, HevoptError
from hevopt.sweeps.workers import pools, supervisor
from hevopt.sweeps.workers.backends import workers
from hevopt.sweeps.workers.child import Terms
from hevopt.sweeps.workers.pools import check_backend

WORK = Terms("sweep_workers:work")


def outcomes_of(jobs, terms=WORK, **options):
    with workers(terms, **options) as run:
        return [outcome for found in run(jobs) for outcome in found]


def by_key(outcomes):
    """The outcomes by key, none of which may have come twice."""
    outcomes = list(outcomes)
    found = {outcome.key: outcome for outcome in outcomes}
    assert len(found) == len(outcomes)
    return found


def ended(pids, within_s=30.0):
    deadline = time.monotonic() + within_s
    while any(map(alive, pids)) and time.monotonic() < deadline:
        time.sleep(0.05)
    return not any(map(alive, pids))


@pytest.mark.parametrize(
    ("backend", "count"),
    [("loky", 2), pytest.param("loky", 1, marks=pytest.mark.long), ("dask", 2), ("ray", 2)],
)
def test_a_backend_has_as_many_workers_as_asked_outside_this_process(
    backend, count, monkeypatch, tmp_path
):
    # Ray's workers do not share this process' path.
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(filter(None, sys.path)))
    jobs = sweep_workers.jobs(12, 2, {n: ["meet", str(tmp_path), count] for n in range(0, 24, 2)})
    with workers(WORK, backend=backend, count=count) as run:
        found = by_key(outcome for outcomes in run(jobs) for outcome in outcomes)
        again = by_key(outcome for outcomes in run(jobs[:2]) for outcome in outcomes)
    assert set(found) == {f"k{n}" for n in range(24)}
    for key, outcome in found.items():
        assert outcome.ending == "ok" and sweep_workers.row_of(key).items() <= outcome.row.items()
    pids = {o.row["pid"] for o in found.values() if "pid" in o.row}
    homes = {o.row["worker"] for o in found.values() if "pid" in o.row}
    assert len(pids) == len(homes) == count
    assert os.getpid() not in pids | homes
    # Ctrl-C in a terminal goes to every process; how to end is for the parent to say.
    assert all(o.row["deaf"] for o in found.values() if "pid" in o.row)
    assert {o.row["pid"] for o in again.values() if "pid" in o.row} <= pids
    assert ended(pids | homes)


def test_a_worker_computes_with_one_thread():
    (outcome,) = outcomes_of(sweep_workers.jobs(1, 1, {0: "threads"}), count=1)
    # For compiled loops; and there is none that a product of matrices has started.
    assert (outcome.row["numba"], outcome.row["here"]) == (1, 1)


def test_a_worker_searches_for_rubbish_but_not_among_what_it_has_loaded():
    (outcome,) = outcomes_of(sweep_workers.jobs(1, 1, {0: "rubbish"}), count=1)
    assert outcome.row["searched"] and outcome.row["kept"] > 1000


def test_whatever_a_case_does_is_its_own_failure_and_costs_no_other_case(tmp_path):
    marker = str(tmp_path / "died")
    does = {
        1: "raise", 4: "hang", 8: "hang in C", 10: "hang and shrug", 13: "die", 17: "unstorable", 20: "nan",
        25: "exit", 30: ["die once", marker], 35: "hang and garble",
    }  # fmt: skip
    terms = Terms("sweep_workers:work", timeout_s=1.0, loading_s=0.0)
    found = by_key(outcomes_of(sweep_workers.jobs(20, 2, does), terms, count=2))
    assert set(found) == {f"k{n}" for n in range(40)}
    errors = {int(key[1:]): str(o.failure) for key, o in found.items() if o.ending == "failed"}
    assert set(errors) == set(does) - {30}
    expected = {
        1: "not today", 13: "signal 9.*twice", 17: "cannot be stored", 20: "cannot be stored", 25: "SystemExit",
    } | dict.fromkeys((4, 8, 10, 35), "^timeout: took more than 1 s$")  # fmt: skip
    for number, words in expected.items():
        assert re.search(words, errors[number]), errors[number]
    assert os.path.exists(marker)


def test_what_a_job_has_finished_is_not_run_again_when_its_process_ends(tmp_path):
    ran = tmp_path / "ran"
    does = {n: ["note", str(ran)] for n in range(12)} | {3: "die", 4: "hang in C", 9: "die"}
    terms = Terms("sweep_workers:work", timeout_s=1.0, loading_s=0.0)
    found = by_key(outcomes_of(sweep_workers.jobs(1, 12, does), terms, count=1))
    failed = {int(key[1:]) for key, o in found.items() if o.ending == "failed"}
    assert len(found) == 12 and failed == {3, 4, 9}
    assert ran.read_text() == "ran\n" * 9


def test_a_case_that_eats_memory_is_its_own_failure():
    terms = Terms("sweep_workers:work", memory_mb=700)
    found = by_key(outcomes_of(sweep_workers.jobs(2, 2, {1: "eat"}), terms, count=1))
    assert [found[f"k{n}"].ending for n in range(4)] == ["ok", "failed", "ok", "ok"]
    assert "MemoryError" in found["k1"].failure.headline


@contextmanager
def dask_cluster():
    from distributed import LocalCluster

    with LocalCluster(
        n_workers=2, threads_per_worker=1, memory_limit=0, dashboard_address="127.0.0.1:0"
    ) as cluster:
        yield cluster.scheduler_address


@contextmanager
def ray_cluster():
    """A cluster as `ray start` makes it, which asks for a token wherever the user has one."""
    command = [str(Path(sys.executable).with_name("ray"))]
    head = ["start", "--head", "--port=6399", "--num-cpus=2", "--include-dashboard=false"]
    subprocess.run([*command, *head], check=True, capture_output=True)
    try:
        yield "127.0.0.1:6399"
    finally:
        subprocess.run([*command, "stop"], check=True, capture_output=True)


@pytest.mark.long
@pytest.mark.parametrize(("backend", "cluster"), [("dask", dask_cluster), ("ray", ray_cluster)])
def test_a_cluster_that_runs_already_gives_the_same_results_and_goes_on_running(
    tmp_path, backend, cluster
):
    study = write_study(tmp_path, 3, 2)
    swept(study, "--jobs", "1")
    expected = table(tmp_path / "study.sqlite")
    with cluster() as address:
        for name in ("one", "two"):
            store = tmp_path / f"{name}.sqlite"
            words = ("--backend", backend, "--scheduler", address, "--store", str(store))
            swept(study, *words)
            assert table(store) == expected


@pytest.mark.parametrize(("work", "words"), [("raises", "all of it"), ("forgets", "no outcome")])
def test_work_that_breaks_its_promise_gives_failures(work, words):
    found = by_key(outcomes_of(sweep_workers.jobs(1), Terms(f"sweep_workers:{work}"), count=1))
    assert words in found["k0"].failure.headline
    assert found["k1"].ending == ("failed" if work == "raises" else "ok")


@pytest.mark.parametrize(
    ("terms", "words"),
    [
        (Terms("sweep_workers:absent"), "absent"),
        (Terms("sweep_workers:work", memory_mb=20), "allow more"),
        (Terms("sweep_workers:work", code="other"), "not those that this process started with"),
    ],
)
def test_workers_that_cannot_start_are_an_error_and_not_failed_cases(terms, words):
    with pytest.raises(
        HevoptError, match=f"a worker cannot start: .*{words}.*so far are stored"
    ) as found:
        outcomes_of(sweep_workers.jobs(4), terms, count=1)
    assert found.value.exit_status == 4 and str(found.value).count("a worker cannot start") == 1


def test_a_worker_whose_process_ends_before_it_is_ready_says_why_and_that_results_are_kept(
    monkeypatch,
):
    monkeypatch.setattr(supervisor.sys, "executable", "/bin/false")
    with pytest.raises(HevoptError, match=r"cannot start.* 3 times.*so far are stored") as found:
        supervisor.run_task(sweep_workers.jobs(1), WORK)
    assert found.value.exit_status == 4


def test_where_no_pool_can_be_opened_results_are_kept_too(monkeypatch):
    def fails(*_):
        raise OSError(11, "Resource temporarily unavailable")

    monkeypatch.setitem(pools.OPENED, "loky", fails)
    with pytest.raises(
        HevoptError, match=r"no worker can be started: .*unavailable; all res"
    ) as found:
        outcomes_of(sweep_workers.jobs(1))
    assert found.value.exit_status == 4


@pytest.fixture
def silent_port():
    """An address that takes connections and never answers."""
    with socket.create_server(("127.0.0.1", 0), backlog=50) as server:
        yield server.getsockname()[1]


@pytest.mark.parametrize(
    ("backend", "address"), [("dask", "tcp://127.0.0.1:{}"), ("ray", "127.0.0.1:{}")]
)
def test_a_scheduler_that_says_nothing_is_told_after_the_time_limit(
    silent_port, monkeypatch, backend, address
):
    monkeypatch.setattr(pools, "_CONNECT_S", 0.5)
    where = address.format(silent_port)
    with pytest.raises(
        DataError, match=rf"no {backend.title()} cluster at '{where}' .none within 0.5 s"
    ):
        outcomes_of(sweep_workers.jobs(1), backend=backend, scheduler=where)


def test_the_caller_is_heard_and_goes_while_a_scheduler_says_nothing(silent_port):
    began = time.monotonic()
    with workers(WORK, backend="dask", scheduler=f"tcp://127.0.0.1:{silent_port}") as run:
        assert next(run(sweep_workers.jobs(1))) == []
    assert time.monotonic() - began < pools._CONNECT_S


@pytest.mark.parametrize("backend", ["loky", pytest.param("dask", marks=pytest.mark.long)])
def test_killed_workers_lose_nothing_and_double_nothing(backend):
    """Both what holds a worker up and what it holds: the jobs under way are run again."""
    notices = []
    jobs = sweep_workers.jobs(40, 1, dict.fromkeys(range(40), "pids"))
    outcomes, killed = [], set()
    with workers(WORK, backend=backend, count=2, notice=notices.append) as run:
        for found in run(jobs):
            outcomes += found
            for outcome in found:
                victim = outcome.row["worker" if len(killed) % 2 else "pid"]
                if len(outcomes) > 10 * (len(killed) + 1) and len(killed) < 2 and alive(victim):
                    os.kill(victim, signal.SIGKILL)
                    killed.add(victim)
    assert len(killed) == 2
    found = by_key(outcomes)
    assert set(found) == {f"k{n}" for n in range(40)}
    assert {o.ending for o in outcomes} == {"ok"}
    assert bool(notices) == (backend == "loky") and all("run again" in text for text in notices)


def test_closed_early_the_workers_are_gone_and_what_came_is_kept(tmp_path):
    waits = ["await", str(tmp_path / "never")]  # for 100 s
    jobs = sweep_workers.jobs(40, 1, {n: "pids" if n < 12 else waits for n in range(40)})
    began, threads, outcomes = time.monotonic(), set(threading.enumerate()), []
    with workers(WORK, count=2) as run:
        arrivals = run(jobs)
        for found in arrivals:
            outcomes += found
            if len(outcomes) > 5:
                break
        arrivals.close()
    assert time.monotonic() - began < 90
    assert ended({o.row[name] for o in outcomes for name in ("pid", "worker")})
    deadline = time.monotonic() + 60
    # The one that watches over what processes share stays as long as Python does.
    while len(set(threading.enumerate()) - threads) > 1:
        assert time.monotonic() < deadline
        time.sleep(0.05)


def test_the_caller_is_heard_while_nothing_comes(tmp_path):
    """Not only while the worker starts: between two outcomes as well."""
    heard, came = tmp_path / "heard", []
    jobs = sweep_workers.jobs(3, 1, {1: ["await", str(heard)]})
    with workers(WORK, count=1) as run:
        for found in run(jobs):
            came += found
            if came and not found:
                heard.touch()
    assert heard.exists() and [o.ending for o in came] == ["ok"] * 3


def test_a_caller_that_stops_when_workers_end_is_not_told_of_a_loss():
    """As where a signal ends a whole group of processes: the caller sees its own before the loss is told."""
    notices = []
    with workers(WORK, count=1, notice=notices.append) as run:
        arrivals = run(sweep_workers.jobs(50, 1, dict.fromkeys(range(50), "pids")))
        worker = next(o.row["worker"] for found in arrivals for o in found)
        os.kill(worker, signal.SIGKILL)
        while alive(worker):
            time.sleep(0.01)
        for found in arrivals:
            if not found:
                break
        arrivals.close()
    assert not notices


@pytest.mark.parametrize(
    ("backend", "scheduler", "words"),
    [("threads", None, "loky, dask, ray"), ("loky", "tcp://here:1", "this machine alone")],
)
def test_a_backend_that_cannot_be_is_a_users_mistake(backend, scheduler, words):
    with pytest.raises(DataError, match=words):
        check_backend(backend, scheduler)


@pytest.mark.parametrize(("backend", "module"), [("dask", "distributed"), ("ray", "ray")])
def test_a_missing_backend_is_told_with_the_command_that_installs_it(monkeypatch, backend, module):
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(DataError, match=rf'pip install "hevopt\[{backend}\]"'):
        check_backend(backend, None)
