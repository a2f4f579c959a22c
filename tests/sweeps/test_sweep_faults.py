"""Whatever ends a sweep or a part of it: no result lost, none doubled, the end as if nothing had been.

The loops of twenty are marked long: `pytest -m long tests/sweeps`.
"""

import json
import os
import resource
import signal
import sqlite3
import subprocess
import threading
import time
from contextlib import closing, contextmanager
from functools import partial
from random import Random

import pytest
from sweep_runs import (
    check_sound,
    gone,
    kill,
    run,
    session,
    start,
    stored,
    sweep_here,
    table,
    wait_for_results,
    write_study,
)

from hevopt.errors import DataError
from hevopt.sweeps.store.reading import open_to_read

ROUNDS = [pytest.param(1, id="once"), pytest.param(20, id="20 times", marks=pytest.mark.long)]
BACKENDS = [
    pytest.param("loky", 20, id="loky 20 times", marks=pytest.mark.long),
    pytest.param("dask", 20, id="dask 20 times", marks=pytest.mark.long),
    pytest.param("ray", 20, id="ray 20 times", marks=pytest.mark.long),
]


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    return write_study(tmp_path_factory.mktemp("study"), 8, 5)


@pytest.fixture(scope="module")
def small_study(tmp_path_factory):
    return write_study(tmp_path_factory.mktemp("small"), 10, 10)


@pytest.fixture(scope="module")
def whole(study):
    """The table of an uninterrupted sweep, and how long that took."""
    began = time.monotonic()
    run(study, "--jobs", "2")
    return table(study.with_suffix(".sqlite")), time.monotonic() - began


@pytest.mark.parametrize("rounds", ROUNDS)
def test_the_parent_is_killed_at_a_random_moment(study, whole, tmp_path, rounds):
    expected, took_s = whole
    random, interrupted = Random(rounds), 0
    for n in range(rounds):
        store = tmp_path / f"{n}.sqlite"
        process = start(study, "--jobs", "2", "--store", str(store))
        if n % 2:  # often while it starts or plans
            time.sleep(random.uniform(0.1, 1.0) * took_s)
        else:
            wait_for_results(process, store, 1)
            time.sleep(random.uniform(0.0, 0.1) * took_s)
        kill(process.pid)
        assert gone(process), session(process)
        process.communicate(timeout=60)
        check_sound(store)
        had = stored(store)
        interrupted += 0 < had < len(expected) - 1
        out, _ = run(study, "--jobs", "2", "--store", str(store))
        assert f"{len(expected) - 1 - had} cases run in" in out
        check_sound(store)
        assert table(store) == expected
    assert interrupted >= rounds / 3


@pytest.mark.parametrize("backend", ["loky", pytest.param("dask", marks=pytest.mark.long)])
def test_workers_whose_parent_is_killed_before_their_first_task_end_too(study, tmp_path, backend):
    process = start(
        study, "--jobs", "2", "--store", str(tmp_path / "s.sqlite"), "--backend", backend
    )
    deadline = time.monotonic() + 60
    while not workers_of(process):
        assert time.monotonic() < deadline
        time.sleep(0.005)
    kill(process.pid)
    assert gone(process), session(process)
    process.communicate(timeout=60)


def workers_of(process):
    """Workers of a started sweep and their processes; not its services, such as a scheduler."""
    marks = (
        "loky.backend.popen",
        "hevopt.sweeps.workers.child",
        "spawn_main",
        "ray::_called",
        "ray::IDLE",
    )
    return [
        pid for pid, command in session(process).items()
        if pid != process.pid and any(mark in command for mark in marks)
    ]  # fmt: skip


@pytest.mark.parametrize(("backend", "rounds"), BACKENDS)
def test_workers_are_killed_at_random_moments(study, whole, tmp_path, backend, rounds):
    random, killed, sweeps = Random(7), 0, 0
    while killed < rounds:
        store = tmp_path / f"{sweeps}.sqlite"
        sweeps += 1
        process = start(study, "--jobs", "2", "--store", str(store), "--backend", backend)
        reading = threading.Thread(target=process.wait)
        reading.start()
        wait_for_results(process, store, 1)
        while process.poll() is None and killed < rounds:
            victims = workers_of(process)
            if victims:
                kill(random.choice(victims))
                killed += 1
            time.sleep(random.uniform(0.2, 2.0))
        out, err = process.communicate(timeout=120)
        reading.join()
        check_sound(store)
        assert process.returncode in (0, 4), err
        if process.returncode == 4:
            # A case was under way both times that its process was killed, or too many workers in a row.
            assert "twice" in out or "goes on from there" in err
            run(study, "--jobs", "2", "--store", str(store), "--retry-failed")
        assert table(store) == whole[0]
        assert gone(process), session(process)


@contextmanager
def small_disk(folder):
    """A disk of 500 kB in a folder, where this user may mount one."""
    mount = ["mount", "-t", "tmpfs", "-o", "size=500k", "tmpfs", str(folder)]
    if subprocess.run(mount, capture_output=True).returncode:
        pytest.skip("no right to mount a small disk; the limit of a file's size is tried instead")
    try:
        yield lambda: subprocess.run(["mount", "-o", "remount,size=50m", str(folder)], check=True)
    finally:
        subprocess.run(["umount", str(folder)], check=True)


@contextmanager
def small_files(folder):
    """Files of this process may not grow beyond 500 kB."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (500_000, before[1]))
    try:
        yield lambda: resource.setrlimit(resource.RLIMIT_FSIZE, before)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


@pytest.mark.parametrize("limit", [pytest.param(small_disk, marks=pytest.mark.long), small_files])
def test_a_full_disk_stops_the_sweep_and_loses_nothing_stored(small_study, tmp_path, limit):
    folder = tmp_path / "disk"
    folder.mkdir()
    with limit(folder) as make_room:
        store = folder / "s.sqlite"
        # There is room for the plan and a part of the results.
        with pytest.raises(DataError, match=r"cannot be written .*make room.*same command"):
            sweep_here(small_study, store, "bulky", workers=1)
        check_sound(store)
        had = stored(store)
        assert 0 < had < 200
        make_room()
        assert sweep_here(small_study, store, "bulky", workers=1).done == 200 - had
        check_sound(store)
        with open_to_read(store) as reader:
            counts = reader.counts()
        with closing(sqlite3.connect(store)) as connection:
            rows = [json.loads(row) for (row,) in connection.execute("SELECT row FROM cases")]
    assert counts["ok"] == 200 and counts["other"] == 0
    assert len(rows) == 200 and all(len(row["more"]) == 6000 for row in rows)


def test_a_full_disk_ends_the_command_with_status_2_and_no_process_left(study, tmp_path):
    def limited():
        resource.setrlimit(resource.RLIMIT_FSIZE, (150_000, 150_000))

    store = tmp_path / "s.sqlite"
    process = start(study, "--jobs", "1", "--store", str(store), preexec_fn=limited)
    _, err = process.communicate(timeout=60)
    assert process.returncode == 2 and "make room on the disk" in err and "Traceback" not in err
    assert gone(process)
    check_sound(store)


def test_a_read_only_folder_is_refused_before_anything_runs(study, tmp_path, monkeypatch):
    monkeypatch.setattr(os, "access", lambda path, mode: mode != os.W_OK)
    with pytest.raises(DataError, match="cannot be written"):
        sweep_here(study, tmp_path / "s.sqlite")
    assert not stored(tmp_path / "s.sqlite")


@pytest.mark.long
def test_ctrl_c_pressed_again_and_again_loses_nothing(study, whole, tmp_path):
    store = tmp_path / "s.sqlite"
    # Whatever started the tests: a shell has what it runs in the background ignore Ctrl-C.
    heard = partial(signal.signal, signal.SIGINT, signal.default_int_handler)
    process = start(study, "--jobs", "2", "--store", str(store), preexec_fn=heard)
    wait_for_results(process, store, 1)
    for _ in range(3):
        os.killpg(process.pid, signal.SIGINT)  # to all of them, as a terminal does
        time.sleep(0.05)
    out, err = process.communicate(timeout=30)
    assert process.returncode == 4 and "Traceback" not in err
    assert "the same command goes on from there" in out
    assert gone(process)
    check_sound(store)
    run(study, "--jobs", "2", "--store", str(store))
    assert table(store) == whole[0]
