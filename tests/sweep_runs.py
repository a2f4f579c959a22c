"""A small study, sweeps of it in processes of their own, and what must hold of a store whatever befell it."""

import csv
import io
import os
import signal
import sqlite3
import subprocess
import sys
import time
from pathlib import Path

from hevopt.sweeps.plan.study_file import read_study
from hevopt.sweeps.run import Execution, Onlookers, begin, plan_of, run_sweep
from hevopt.sweeps.store.export import cases_csv
from hevopt.sweeps.store.lock import locked
from hevopt.sweeps.store.reading import open_to_read
from hevopt.sweeps.store.store import open_store

SPEEDS_MPS = [
    0, 0, 1.5, 3, 4.5, 6, 7.5, 9, 10, 11, 12, 12.5, 13, 13, 13, 13, 13, 12, 11, 10, 9, 8, 7, 6, 5, 4, 3, 2, 1, 0, 0,
]  # fmt: skip


def write_study(folder, cells=13, powers=10, strategies=("ecms",), more=""):
    """A study of 2 x cells x powers designs on a cycle of half a minute; its path."""
    lines = "\n".join(f"{t},{speed}" for t, speed in enumerate(SPEEDS_MPS))
    (folder / "short.csv").write_text(f"time_s,speed_mps\n{lines}\n")
    study = folder / "study.toml"
    study.write_text(
        f"""architecture = "C2"
cycles = ["short.csv"]
strategies = {list(strategies)}
{more}
[parameters]
battery.cells_in_series = {{ from = 32, to = 96, count = {cells} }}
machine.power_max_w = {{ from = 8e3, to = 3e4, count = {powers} }}
nox_weight = [0, 10]
"""
    )
    return study


def sweep_here(study, store, work="work", *, prune=False, retry_failed=False, watch=None, **how):
    """A sweep by stand-ins, run from this process; its progress."""
    with locked(store), open_store(store) as opened:
        plan = plan_of(read_study(study), prune=prune)
        begin(plan, opened, "test")
        execution = Execution(work=work if ":" in work else f"sweep_workers:{work}", **how)
        options = {"prune": prune, "retry_failed": retry_failed, "watch": watch or Onlookers()}
        return run_sweep(plan, opened, execution, **options)


def start(study, *options, **how):
    """`hevopt sweep` in a session of its own, so that all it starts can be found."""
    command = [
        sys.executable,
        "-c",
        "from hevopt.cli import main; main()",
        "sweep",
        str(study),
        *options,
    ]
    return subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True, **how
    )  # fmt: skip


def run(study, *options, status=0, **how):
    """What `hevopt sweep` says on stdout and stderr."""
    process = start(study, *options, **how)
    out, err = process.communicate(timeout=300)
    assert process.returncode == status, f"{process.returncode}\n{out}\n{err}"
    return out, err


def session(process):
    """Pids and commands of all processes that a started sweep has left, itself included."""
    found = {}
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            fields = fields_of(folder)
            command = (folder / "cmdline").read_text().replace("\0", " ")
        except OSError:
            continue
        if int(fields[3]) == process.pid and fields[0] != "Z":
            found[int(folder.name)] = command
    return found


def fields_of(folder):
    """What the system tells of a process from its state on."""
    return (folder / "stat").read_text().rpartition(")")[2].split()


def alive(pid):
    """Whether a process runs; one that has ended and is still listed does not."""
    try:
        return fields_of(Path(f"/proc/{pid}"))[0] != "Z"
    except OSError:
        return False


def gone(process, within_s=30.0):
    """Whether all processes of a sweep end by themselves."""
    deadline = time.monotonic() + within_s
    while session(process):
        if time.monotonic() > deadline:
            return False
        time.sleep(0.1)
    return True


def stored(store):
    """How many results a store has; 0 where there is none yet."""
    if not store.exists():
        return 0
    connection = sqlite3.connect(f"{store.as_uri()}?mode=rw", uri=True)
    try:
        return connection.execute("SELECT count(*) FROM cases").fetchone()[0]
    except sqlite3.OperationalError:
        return 0
    finally:
        connection.close()


def wait_for_results(process, store, count):
    deadline = time.monotonic() + 300
    while stored(store) < count:
        assert process.poll() is None, process.communicate()
        assert time.monotonic() < deadline
        time.sleep(0.02)


def kill(pid):
    try:
        os.kill(pid, signal.SIGKILL)
    except ProcessLookupError:
        pass


def check_sound(store):
    """Neither damaged nor doubled, whatever happened."""
    if stored(store):
        connection = sqlite3.connect(store)
        try:
            assert connection.execute("PRAGMA integrity_check").fetchone() == ("ok",)
            keys = connection.execute("SELECT count(*), count(DISTINCT key) FROM cases").fetchone()
            assert keys[0] == keys[1]
            halves = "SELECT count(*) FROM cases WHERE ending = 'ok' AND json_valid(row) IS NOT 1"
            assert connection.execute(halves).fetchone() == (0,)
        finally:
            connection.close()


def table(store):
    """The cases of a store as lines of its table, without the seconds."""
    with open_to_read(store) as reader:
        lines = list(csv.reader(io.StringIO(cases_csv(reader).decode())))
    assert lines[0][-1] == "case_s"
    return [line[:-1] for line in lines]
