"""`hevopt sweep` as it is called: what it prints, writes and returns, and what it says to a user's mistakes."""

import csv
import os
import pty
import re
import signal
import socket
import sqlite3
import subprocess
import sys
import time

import pyarrow.parquet as pq
import pytest
from command_line import call
from sweep_runs import (
    gone,
    run,
    session,
    start,
    stored,
    sweep_here,
    table,
    wait_for_results,
    write_study,
)

from hevopt.commands import sweep_view
from hevopt.sweeps.run import Advance, Stopped
from hevopt.sweeps.store.lock import locked


@pytest.fixture(scope="module")
def swept(tmp_path_factory):
    """A finished sweep: its study, its store, what it said, its table."""
    folder = tmp_path_factory.mktemp("swept")
    study, out = write_study(folder, 3, 2), folder / "cases.csv"
    said = run(study, "--jobs", "1", "--export", str(out))[0]
    return study, folder / "study.sqlite", said, out


def called(monkeypatch, capsys, *words):
    return call(monkeypatch, capsys, "sweep", *words)


def test_a_sweep_says_what_came_of_it_and_where_it_is(swept):
    study, store, said, out = swept
    assert "12 cases run in" in said and "0 of them failed" in said
    assert "12 cases of 12 designs: 12 ok" in said and "best designs of each NOx weight" in said
    assert f"--store {store} --export" in said and f"hevopt report {store}" in said
    assert sorted(p.name for p in study.parent.iterdir()) == [
        "cases.csv", "short.csv", "study.sqlite", "study.toml",
    ]  # fmt: skip
    lines = list(csv.DictReader(out.read_text().splitlines()))
    assert [int(line["design"]) for line in lines] == list(range(12))
    assert {line["battery.cells_in_series"] for line in lines} == {"32", "64", "96"}
    for line in lines:
        assert line["outcome"] == "ok" and line["strategy"] == "ecms" and line["error"] == ""
        bound, objective = (
            float(line[name]) for name in ("objective_bound_l_per_100km", "objective_l_per_100km")
        )
        assert 0 < bound <= objective * (1 + 1e-12)
        gap = 100 * (objective / bound - 1)
        assert float(line["gap_percent"]) == pytest.approx(gap, rel=0.1, abs=1e-4)


def test_run_again_it_has_nothing_to_do_and_prints_the_same_best_designs(
    swept, monkeypatch, capsys
):
    study, _, said, _ = swept
    status, out, _ = called(monkeypatch, capsys, study)
    assert status == 0 and "0 cases run" in out
    assert out[out.index("best") : out.index("12 cases of")] in said


def test_status_and_export_need_the_store_alone(swept, monkeypatch, capsys, tmp_path):
    study, store, _, _ = swept
    status, out, err = called(monkeypatch, capsys, "--status", store)
    assert (status, err) == (0, "") and "12 cases of 12 designs: 12 ok" in out and str(study) in out
    exported = tmp_path / "again.csv"
    assert called(monkeypatch, capsys, "--store", store, "--export", exported)[0] == 0
    assert [line[:-1] for line in csv.reader(exported.read_text().splitlines())] == table(store)


def test_parquet_has_the_columns_and_numbers_of_csv(swept, monkeypatch, capsys, tmp_path):
    out = tmp_path / "cases.parquet"
    assert called(monkeypatch, capsys, "--store", swept[1], "--export", out)[0] == 0
    read = pq.read_table(out)
    lines = table(swept[1])
    assert read.column_names[:-1] == lines[0]
    column = lines[0].index("objective_l_per_100km")
    assert read["objective_l_per_100km"].to_pylist() == [float(line[column]) for line in lines[1:]]
    assert read["battery.cells_in_series"].to_pylist()[0] == 32


def test_what_a_sweep_was_made_from_is_not_overwritten(tmp_path, monkeypatch, capsys):
    study, store = write_study(tmp_path, 2, 2), tmp_path / "s.sqlite"
    sweep_here(study, store, "raises", workers=1)
    before = {p: p.read_bytes() for p in tmp_path.iterdir()}
    cycle = tmp_path / "short.csv"
    said = f"{cycle} is the file that {cycle} is read from"
    for words in (
        ("sweep", study, "--store", store, "--export", cycle),
        ("sweep", "--store", store, "--export", cycle),
        ("report", store, "--out", cycle),
        ("report", store, "--out", study),
    ):
        status, out, err = call(monkeypatch, capsys, *words)
        assert (status, out) == (2, "") and said.replace(str(cycle), str(words[-1])) in err
    assert {p: p.read_bytes() for p in tmp_path.iterdir()} == before


def test_the_columns_of_parquet_have_the_same_types_whatever_is_in_the_store(
    swept, monkeypatch, capsys, tmp_path
):
    study = write_study(tmp_path, 3, 2, ("bound",))
    sweep_here(study, tmp_path / "bounds.sqlite", "hevopt.sweeps.workers.work:run_job", workers=1)
    schemas = []
    for store in (swept[1], tmp_path / "bounds.sqlite"):
        out = tmp_path / "cases.parquet"
        assert called(monkeypatch, capsys, "--store", store, "--export", out)[0] == 0
        schemas.append(pq.read_schema(out))
    assert schemas[0] == schemas[1]
    assert str(schemas[0].field("soc_end").type) == "double"


def test_a_dry_run_that_is_stopped_says_so(tmp_path, monkeypatch, capsys):
    study = write_study(tmp_path, 3, 2)

    def stopped(*_, **__):
        raise Stopped

    monkeypatch.setattr("hevopt.sweeps.estimate.timed_sample", stopped)
    status, out, err = called(monkeypatch, capsys, study, "--dry-run")
    assert status == 4 and "stopped" in out and err == ""


def test_a_dry_run_tells_what_would_run_and_stores_nothing(tmp_path, monkeypatch, capsys):
    constraint = 'constraints = ["battery.cells_in_series * 300 <= machine.power_max_w"]'
    study = write_study(tmp_path, 3, 2, ("ecms", "dp"), constraint)
    status, out, err = called(monkeypatch, capsys, study, "--dry-run", "--jobs", "2")
    assert status == 0, err
    # 8 kW is too little for all of 32, 64, 96 cells; 30 kW is enough for each.
    assert out.startswith(
        "6 designs, 6 more excluded by constraints; 12 cases, 0 of them in the store"
    )
    assert out.count("  design ") == 5 and "machine.power_max_w = 30000" in out
    assert "timed sample: 12 cases" in out and "on one worker" in out and "on 2, " in out
    assert "to start and compile" in out
    assert not (tmp_path / "study.sqlite").exists()


def test_infeasible_designs_are_results_and_failed_ones_are_not(tmp_path, monkeypatch, capsys):
    study = write_study(tmp_path, 2, 2)
    # The first case of a process, which loads and compiles, has a minute of processor time more.
    out, _ = run(study, "--jobs", "1", "--timeout", "0.001", status=4)
    ok, failed = map(int, re.search(r"8 cases of 8 designs: (\d) ok, (\d) failed", out).groups())
    assert ok >= 1 and ok + failed == 8 and "--retry-failed" in out
    assert f"failed {failed} times, first in design" in out
    assert "timeout: took more than 0.001 s" in out
    sweep_here(study, tmp_path / "all.sqlite", "raises", workers=1)
    status, out, _ = called(monkeypatch, capsys, study, "--store", tmp_path / "all.sqlite")
    assert status == 3 and "8 failed" in out and "all of it" in out
    # A cycle that no such car can follow.
    (tmp_path / "short.csv").write_text(
        "time_s,speed_mps\n0,0\n1,18\n2,36\n3,54\n4,36\n5,18\n6,0\n"
    )
    status, out, err = called(monkeypatch, capsys, study, "--jobs", "1")
    assert status == 3 and "8 cases of 8 designs: 8 infeasible; 8 more results are kept" in out
    assert "infeasible 8 times, first in design 0: architecture C2 cannot follow" in out
    assert "none that this study asks for as it is now" in err


def test_what_pruning_did_or_cannot_do_is_told(tmp_path, monkeypatch, capsys):
    study = write_study(tmp_path, 3, 2)
    sweep_here(study, tmp_path / "s.sqlite", "landscape", workers=1, prune=True)
    _, out, _ = called(monkeypatch, capsys, "--status", tmp_path / "s.sqlite")
    assert "pruned: its bound, " in out and "above the objective of design" in out
    head = study.read_text().split("battery")[0]
    weights = "nox_weight = { from = 0, to = 1, count = 23 }\n"
    study.write_text(head + weights)
    sweep_here(study, tmp_path / "w.sqlite", "work", workers=1)
    _, out, _ = called(monkeypatch, capsys, "--status", tmp_path / "w.sqlite")
    lines = [line for line in out.splitlines() if line.strip()[:1].isdigit()]
    assert "and 3 more NOx weights" in out and len(lines) == 21  # the first counts the cases
    range_of = "battery.cells_in_series = { from = 32, to = 33, count = 10 }\n"
    study.write_text(head + range_of)
    _, out, _ = called(monkeypatch, capsys, study, "--dry-run", "--jobs", "1")
    assert "battery.cells_in_series: 10 values asked for, 2 once rounded" in out


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ([], "name a study"),
        (["--status", "done.sqlite", "--jobs", "2", "--no-resume"], "leave out --jobs, --resume"),
        (["--store", "done.sqlite", "--export", "a.csv", "--prune"], "leave out --prune"),
        (["study.toml", "--dry-run", "--export", "a.csv"], "leave out --export"),
        (["study.toml", "--export", "short.csv"], "--export short.csv is the file that"),
        (["absent.toml"], "absent.toml"),
        (["study.toml", "--status", "s.sqlite"], "stands alone"),
        (["--status", "absent.sqlite"], "no such store"),
        (["--status", "study.toml"], "nor an SQLite file"),
        (["study.toml", "--backend", "slurm"], "loky, dask, ray"),
        (["study.toml", "--scheduler", "tcp://a:1"], "this machine alone"),
        (["study.toml", "--export", "a.xlsx"], ".csv or .parquet"),
        (["study.toml", "--export", "absent/a.csv"], "No such folder"),
        (
            ["study.toml", "--store", "study.toml"],
            "--store study.toml is the file that study.toml is read from",
        ),
        (["study.toml", "--store", "short.csv"], "nor an SQLite file"),
        (["study.toml", "--store", "done.sqlite", "--no-resume"], "asks for a new store"),
        (["--store", "done.sqlite", "--export", "done.sqlite"], "--export done.sqlite is the file"),
    ],
)
def test_a_users_mistake_is_one_message_and_status_2(
    words, message, swept, tmp_path, monkeypatch, capsys
):
    write_study(tmp_path, 2, 2)
    (tmp_path / "done.sqlite").write_bytes(swept[1].read_bytes())
    before = {p: p.read_bytes() for p in tmp_path.iterdir()}
    monkeypatch.chdir(tmp_path)
    status, out, err = called(monkeypatch, capsys, *words)
    assert (status, out) == (2, "")
    assert err.startswith("hevopt: error: ") and message in err and "Traceback" not in err
    assert {p: p.read_bytes() for p in tmp_path.iterdir()} == before


def test_a_second_sweep_on_a_store_is_refused(swept, monkeypatch, capsys):
    with locked(swept[1]):
        status, _, err = called(monkeypatch, capsys, swept[0])
    assert status == 2 and f"process {os.getpid()} on" in err


def test_a_cluster_that_does_not_answer_is_told(swept, monkeypatch, capsys, tmp_path):
    monkeypatch.setattr("hevopt.sweeps.workers.pools._CONNECT_S", 0.5)
    words = [
        "--backend",
        "dask",
        "--scheduler",
        "tcp://127.0.0.1:9",
        "--store",
        tmp_path / "s.sqlite",
    ]
    status, _, err = called(monkeypatch, capsys, swept[0], *words)
    assert status == 2 and "no Dask cluster at 'tcp://127.0.0.1:9'" in err


@pytest.mark.parametrize("backend", ["loky", pytest.param("ray", marks=pytest.mark.long)])
def test_asked_to_end_by_a_cluster_it_stores_all_it_has_and_leaves_no_process(tmp_path, backend):
    study, store = write_study(tmp_path, 12, 20), tmp_path / "study.sqlite"
    process = start(study, "--jobs", "2", "--backend", backend)
    wait_for_results(process, store, 1)
    process.send_signal(signal.SIGTERM)
    out, err = process.communicate(timeout=120)
    assert process.returncode == 4, err
    assert "the same command goes on from there" in out and "Traceback" not in err
    assert "SIGTERM" not in err
    assert gone(process)
    assert 0 < stored(store) < 480
    assert sorted(p.name for p in tmp_path.iterdir()) == ["short.csv", "study.sqlite", "study.toml"]


def test_a_sweep_under_nohup_goes_on_when_its_terminal_closes(tmp_path):
    def nohup():
        signal.signal(signal.SIGHUP, signal.SIG_IGN)

    study, store = write_study(tmp_path, 3, 2), tmp_path / "study.sqlite"
    process = start(study, "--jobs", "1", preexec_fn=nohup)
    wait_for_results(process, store, 1)
    process.send_signal(signal.SIGHUP)
    out, err = process.communicate(timeout=300)
    assert process.returncode == 0, err
    assert "12 cases of 12 designs: 12 ok" in out


def test_a_store_that_is_deleted_stops_the_sweep_with_one_message(tmp_path):
    study, store = write_study(tmp_path, 12, 20), tmp_path / "study.sqlite"
    process = start(study, "--jobs", "1")
    wait_for_results(process, store, 1)
    store.unlink()
    out, err = process.communicate(timeout=120)
    assert process.returncode == 4 and out == ""
    assert (
        "study.sqlite: the store was deleted, moved or replaced" in err and "Traceback" not in err
    )
    assert gone(process)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["short.csv", "study.toml"]


def test_the_first_signal_ends_a_sweep_whose_scheduler_says_nothing(tmp_path):
    study = write_study(tmp_path, 2, 2)
    with socket.create_server(("127.0.0.1", 0), backlog=50) as server:
        address = f"tcp://127.0.0.1:{server.getsockname()[1]}"
        process = start(study, "--backend", "dask", "--scheduler", address)
        deadline = time.monotonic() + 120
        while not any(
            "hevopt.sweeps.workers.probe" in command for command in session(process).values()
        ):
            assert time.monotonic() < deadline and process.poll() is None
            time.sleep(0.05)
        process.send_signal(signal.SIGTERM)
        out, err = process.communicate(timeout=120)
    assert process.returncode == 4 and err == "", err
    assert "the same command goes on from there" in out
    assert gone(process)


def test_a_sweep_with_missing_cases_is_never_a_success(tmp_path, monkeypatch, capsys):
    study, store = write_study(tmp_path, 2, 2), tmp_path / "study.sqlite"
    sweep_here(study, store, "work", workers=1)

    def begin_and_forget(*_, **__):
        with sqlite3.connect(store) as connection:
            connection.execute("DELETE FROM cases WHERE key = (SELECT min(key) FROM cases)")
        return Advance(8)

    monkeypatch.setattr("hevopt.sweeps.into_store.run_sweep", begin_and_forget)
    status, out, _ = called(monkeypatch, capsys, study)
    assert status == 4 and "1 cases have no result; the same command runs them" in out


def test_names_that_are_no_utf8_are_swept_stored_and_reported(tmp_path, monkeypatch, capsys):
    folder = tmp_path / os.fsdecode(b"d\xe9")
    folder.mkdir()
    study = write_study(folder, 2, 2).rename(folder / os.fsdecode(b"c\xe9.toml"))
    sweep_here(study, study.with_suffix(".sqlite"), "work", workers=1)
    monkeypatch.setattr("hevopt.sweeps.into_store.run_sweep", lambda *_, **__: Advance(0))
    status, out, err = called(monkeypatch, capsys, study, "--export", folder / "cases.csv")
    assert (status, err) == (0, "") and "8 cases of 8 designs: 8 ok" in out
    store, page = study.with_suffix(".sqlite"), folder / "page.html"
    assert called(monkeypatch, capsys, "--status", store)[0] == 0
    assert call(monkeypatch, capsys, "report", store, "--out", page)[::2] == (0, "")
    assert r"c\udce9.toml" in page.read_text()


NEITHER = """
import sys
sys.modules |= {"resource": None, "fcntl": None}
from hevopt.cli import main
study, store, page = sys.argv[1:]
for words in (["report", store, "--out", page], ["sweep", "--status", store], ["sweep", study]):
    sys.argv = ["hevopt", *words]
    try:
        main()
    except SystemExit as stop:
        print("status", stop.code or 0)
"""


def test_a_store_is_reported_where_sweeps_cannot_run(swept, tmp_path):
    command = [sys.executable, "-c", NEITHER, *swept[:2], tmp_path / "page.html"]
    done = subprocess.run(command, capture_output=True, text=True)
    statuses = [line for line in done.stdout.splitlines() if line.startswith("status ")]
    assert statuses == ["status 0", "status 0", "status 2"], done.stderr
    assert "sweeps run on Linux" in done.stderr


def test_progress_is_a_line_every_ten_seconds_where_there_is_no_terminal(capsys, monkeypatch):
    now = [100.0]
    monkeypatch.setattr(sweep_view, "monotonic", lambda: now[0])
    with sweep_view.SweepProgress() as shown:
        progress = Advance(total=100, began_s=100.0)
        for second in range(25):
            now[0] = 100.0 + second
            progress.done, progress.failed = 2 * second, 1
            shown(progress)
    assert capsys.readouterr().err.splitlines() == [
        "hevopt: 20 of 100 cases, 2/s, 40 s left, 1 failed",
        "hevopt: 40 of 100 cases, 2/s, 30 s left, 1 failed",
    ]


def test_on_a_terminal_it_is_a_bar_with_the_same_figures():
    master, slave = pty.openpty()
    code = (
        "import time\nfrom hevopt.commands.sweep_view import SweepProgress\n"
        "from hevopt.sweeps.run import Advance\n"
        "with SweepProgress() as shown:\n"
        "    p = Advance(total=10, began_s=time.monotonic() - 2)\n"
        "    p.done, p.failed = 4, 1\n    shown(p)\n    shown.say('a worker was lost')\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], stderr=slave, env=os.environ | {"TERM": "xterm"}
    )
    os.close(slave)
    time.sleep(0.1)
    text = os.read(master, 100_000).decode()
    os.close(master)
    assert done.returncode == 0
    assert "4/10" in text and "left, 1 failed" in text and "hevopt: a worker was lost" in text


@pytest.mark.parametrize(
    ("seconds", "text"),
    [(0.5, "0.5 s"), (42.3, "42 s"), (200, "3 min 20 s"), (18120, "5 h 2 min"), (3e5, "3 d 11 h")],
)
def test_durations_are_written_as_one_reads_them(seconds, text):
    assert sweep_view.duration(seconds) == text
