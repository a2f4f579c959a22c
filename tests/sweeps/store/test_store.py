"""The store: what goes in comes out to the last bit, once, and nothing that happens to it loses a row."""

import os
import sqlite3
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest
from small_stores import DESIGNS, PLAN, ok, row
from sweep_runs import check_sound

from hevopt.errors import DataError, HevoptError
from hevopt.pages.sweep.alerts import alerts
from hevopt.pages.sweep.data import load_sweep
from hevopt.pages.sweep.verdict import groups_of
from hevopt.sweeps.plan.jobs import Failure, Result
from hevopt.sweeps.plan.prune import Pruned
from hevopt.sweeps.store import store as store_module
from hevopt.sweeps.store.lock import locked
from hevopt.sweeps.store.reading import open_to_read
from hevopt.sweeps.store.store import open_store


def filled(path, outcomes):
    with open_store(path) as store:
        store.begin({"study": "text"}, DESIGNS, PLAN)
        store.add(outcomes)
    return path


def records(path):
    with open_to_read(path) as reader:
        return list(reader.records())


def test_what_is_stored_is_read_to_the_last_bit_in_the_order_of_designs(tmp_path):
    failed = Result("1dp", "failed", None, Failure("no; 'quoted'\n"), 2.0)
    infeasible = Result("1ecms", "infeasible", None, Failure("never"), 1.0)
    path = filled(tmp_path / "s.sqlite", [failed, ok("0ecms", 0.1 + 0.2), infeasible])
    found = records(path)
    assert [(r.design, r.strategy, r.ending) for r in found] == [
        (0, "dp", "missing"), (0, "ecms", "ok"), (1, "dp", "failed"), (1, "ecms", "infeasible"),
    ]  # fmt: skip
    assert found[1].row == row(0.1 + 0.2, "ecms")
    assert str(found[2].failure) == "no; 'quoted'\n" and found[2].seconds == 2.0
    assert found[0].parameters == {"a": 0.1, "nox_weight": 0}
    assert list(tmp_path.iterdir()) == [path]


def test_a_failure_is_read_as_it_was_made_and_a_lost_proof_is_in_every_view(tmp_path, hevopt):
    path = tmp_path / "s.sqlite"
    why = Failure.of(DataError("cycle cannot be followed:\n  t = 3 s\nchoose another"))
    lost = {"lost_proofs": {"LP prices": "HiGHS stopped with status 4"}}
    fine = ok("0dp")
    solved = Result(fine.key, fine.ending, fine.row | lost, None, 0.5)
    filled(path, [solved, Result("1dp", "failed", None, why, 1.0)])
    found = {(r.design, r.strategy): r for r in records(path)}
    assert found[1, "dp"].failure == why
    assert (why.headline, why.details) == (
        "cycle cannot be followed", "  t = 3 s\nchoose another",
    )  # fmt: skip
    assert found[0, "dp"].row["lost_proofs"] == lost["lost_proofs"]
    said = hevopt("sweep", "--status", "s.sqlite").out
    assert "failed once in design 1: cycle cannot be followed\n" in said
    assert "LP prices not found once in design 0: HiGHS stopped with status 4" in said
    assert hevopt("sweep", "--store", "s.sqlite", "--export", "cases.csv").status == 0
    written = (tmp_path / "cases.csv").read_text()
    assert "LP prices: HiGHS stopped with status 4" in written
    assert '"cycle cannot be followed:\n  t = 3 s\nchoose another"' in written
    (checks,) = [a for a in page_alerts(path) if a.name == "Certificates"]
    assert checks.found and any("HiGHS stopped" in line for line in checks.lines)


def page_alerts(path):
    sweep = load_sweep(path)
    return alerts(sweep, groups_of(sweep.figures))


def test_a_result_is_never_replaced_and_a_failure_is(tmp_path):
    path = filled(
        tmp_path / "s.sqlite", [ok("0dp", 1.0), Result("1dp", "failed", None, Failure("e"), 0.0)]
    )
    filled(
        path, [ok("0dp", 2.0), ok("1dp", 3.0), Result("0dp", "failed", None, Failure("late"), 0.0)]
    )
    found = {r.design: r for r in records(path) if r.strategy == "dp"}
    assert found[0].row["fuel_l_per_100km"] == 1.0 and found[1].row["fuel_l_per_100km"] == 3.0
    check_sound(path)


def test_a_result_is_on_disk_after_half_a_second_or_two_hundred_rows(tmp_path, monkeypatch):
    path, now = filled(tmp_path / "s.sqlite", []), [100.0]
    monkeypatch.setattr(store_module, "monotonic", lambda: now[0])

    def on_disk():
        with open_to_read(path) as reader:
            return len(reader.endings())

    with open_store(path) as store:
        store.add([ok("a")])
        store.add([])
        assert on_disk() == 0
        now[0] += 0.5
        store.add([])
        assert on_disk() == 1
        store.add([ok(f"b{n}") for n in range(199)])
        assert on_disk() == 1
        store.add([ok("c")])
        assert on_disk() == 201


def test_what_sqlite_quotes_of_a_damaged_file_is_printable(tmp_path):
    with pytest.raises(DataError) as found, store_module.told(tmp_path / "s.sqlite"):
        raise sqlite3.OperationalError('unrecognized token: "\x01\x1b[31m"')
    assert str(found.value).endswith('SQLite: unrecognized token: "??[31m"')


def test_another_plan_keeps_the_results_of_the_former(tmp_path):
    path = filled(tmp_path / "s.sqlite", [ok("0dp"), ok("1dp")])
    with open_store(path) as store:
        store.prune([Pruned(1, 2.0, 0, 1.5)])
        store.begin({"study": "other"}, DESIGNS[:1], PLAN[-1:])
        assert store.endings() == {"0dp": "ok"} and store.others() == 1
    with open_to_read(path) as reader:
        assert reader.counts() == {
            "ok": 1, "infeasible": 0, "failed": 0, "pruned": 0, "missing": 0, "designs": 1, "other": 1,
        }  # fmt: skip
        assert reader.meta()["study"] == "other" and reader.pruned() == []


def test_a_pruned_design_is_told_with_what_condemned_it_and_a_solved_case_is_not_hidden(tmp_path):
    path = filled(tmp_path / "s.sqlite", [ok("1dp")])
    with open_store(path) as store:
        store.prune([Pruned(1, 2.0, 0, 1.5)])
    assert [r.ending for r in records(path)] == ["missing", "missing", "ok", "pruned"]
    with open_to_read(path) as reader:
        assert reader.pruned() == [Pruned(1, 2.0, 0, 1.5)]


def test_a_store_is_read_while_it_is_written_and_a_reading_sees_one_moment(tmp_path):
    path = filled(tmp_path / "s.sqlite", [ok("0dp")])
    with open_store(path) as store, open_to_read(path) as reader:
        assert reader.counts()["ok"] == 1
        store.add([ok("1dp")])
        store.commit()
        assert reader.counts()["ok"] == 1
        with open_to_read(path) as later:
            assert later.counts()["ok"] == 2


@pytest.mark.parametrize("use", [open_store, open_to_read])
def test_what_is_no_store_is_refused_clearly_and_left_alone(tmp_path, use):
    text, foreign, newer = (tmp_path / f"{name}.sqlite" for name in ("text", "foreign", "newer"))
    text.write_text("no database at all, but long enough to be looked at as one" * 20)
    connection = sqlite3.connect(foreign)
    connection.execute("CREATE TABLE mine (a)")
    connection.close()
    filled(newer, [])
    connection = sqlite3.connect(newer)
    connection.execute("PRAGMA user_version = 9")
    connection.close()
    before = {path: path.read_bytes() for path in (text, foreign, newer)}
    for path, words in ((text, "nor an SQLite file"), (foreign, "not the store"), (newer, "newer")):
        with pytest.raises(DataError, match=words), use(path):
            pass
    assert {path: path.read_bytes() for path in before} == before
    with pytest.raises(DataError), use(tmp_path):
        pass


def test_reading_a_store_that_is_not_there_makes_none(tmp_path):
    with pytest.raises(DataError, match="no such store"), open_to_read(tmp_path / "s.sqlite"):
        pass
    assert not list(tmp_path.iterdir())


READ = """
import os, sys
from pathlib import Path
from hevopt.sweeps.store.reading import open_to_read
from hevopt.sweeps.store.store import open_store
from hevopt.sweeps.store.lock import locked
from hevopt.errors import DataError
if os.getuid() == 0:  # to whom nothing is read-only
    os.setresgid(65534, 65534, 65534)
    os.setresuid(65534, 65534, 65534)
with open_to_read(Path(sys.argv[1])) as reader:
    print(reader.counts()["ok"])
for use in (locked, open_store):
    try:
        with use(Path(sys.argv[1])):
            print("written")
    except DataError as error:
        print(error)
"""


@pytest.mark.parametrize("pending", [False, True])
def test_a_read_only_store_is_read_in_full_and_refused_for_a_sweep(pending):
    """In a read-only folder; `pending`: its writer was killed, and a row is in its log alone."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        path = filled(folder / "s.sqlite", [ok("0dp")])
        if pending:
            with open_store(path) as store:
                store.add([ok("1dp")])
                store.commit()
                kept = {p: p.read_bytes() for p in folder.iterdir() if not p.name.endswith("-shm")}
            for file, contents in kept.items():
                file.write_bytes(contents)
        for file in folder.iterdir():
            file.chmod(0o444)
        folder.chmod(0o555)
        done = subprocess.run(
            [sys.executable, "-c", READ, str(path)], capture_output=True, text=True
        )
        folder.chmod(0o755)
    lines = done.stdout.splitlines()
    assert lines[0] == ("2" if pending else "1"), done.stderr
    assert "cannot lock" in lines[1] and "--store" in lines[1]
    assert "Read-only file" in lines[2]


HOLD = """
import sys, time
from pathlib import Path
from hevopt.sweeps.store.lock import locked
with locked(Path(sys.argv[1])):
    print("held", flush=True)
    time.sleep(60)
"""


def test_a_second_sweep_is_refused_by_name_and_a_killed_one_leaves_no_lock(tmp_path):
    path = tmp_path / "s.sqlite"
    holder = subprocess.Popen(
        [sys.executable, "-c", HOLD, str(path)], stdout=subprocess.PIPE, text=True
    )
    with holder:
        assert holder.stdout.readline() == "held\n"
        with (
            pytest.raises(DataError, match=f"another sweep.*process {holder.pid} on "),
            locked(path),
        ):
            pass
        holder.kill()
    with locked(path), pytest.raises(DataError, match=str(os.getpid())), locked(path):
        pass
    assert not list(tmp_path.iterdir())


def test_a_store_is_locked_by_whatever_link_it_is_named(tmp_path):
    path, link = filled(tmp_path / "s.sqlite", []), tmp_path / "deep" / "link.sqlite"
    link.parent.mkdir()
    link.symlink_to(path)
    for first, second in ((path, link), (link, path)):
        with (
            locked(first),
            pytest.raises(DataError, match=f"another sweep.*process {os.getpid()} on "),
            locked(second),
        ):
            pass
    assert sorted(p.name for p in tmp_path.rglob("*.lock")) == []
    (tmp_path / "hard.sqlite").hardlink_to(path)
    with pytest.raises(DataError, match="hard links"), locked(path):
        pass


def move(path):
    path.rename(path.with_name("moved.sqlite"))


def move_the_folder(path):
    path.parent.rename(path.parent.with_name("moved"))


def replace(path):
    filled(path.with_name("other.sqlite"), [])
    move(path)
    path.with_name("other.sqlite").rename(path)


@pytest.mark.parametrize("gone", [Path.unlink, move, move_the_folder, replace])
def test_a_store_that_goes_while_it_is_open_is_told_and_takes_its_results_along(tmp_path, gone):
    path = tmp_path / "home" / "s.sqlite"
    path.parent.mkdir()
    with pytest.raises(HevoptError, match="deleted, moved or replaced") as found:
        with open_store(path) as store:
            store.begin({"study": "text"}, DESIGNS, PLAN)
            store.check_place()
            store.add([ok("0ecms")])
            gone(path)
            store.check_place()
    assert found.value.exit_status == 4
    moved = [p for p in tmp_path.rglob("*.sqlite") if "moved" in str(p)]
    assert len(moved) == (gone is not Path.unlink)
    assert not list(path.parent.glob("*-wal")) or gone is replace
    for file in moved:
        with open_to_read(file) as reader:
            assert reader.counts()["ok"] == 1


@pytest.mark.parametrize(
    "damage",
    [
        "UPDATE cases SET row = substr(row, 1, 40)",
        "UPDATE cases SET row = replace(row, 'status', 'statuz')",
        "UPDATE cases SET row = replace(row, '\"ok\"', '7')",
        "UPDATE cases SET seconds = 'x'",
        "UPDATE designs SET parameters = '[1]'",
        "UPDATE designs SET parameters = '{\"b\": 1}' WHERE number = 1",
        "INSERT INTO pruned VALUES (1, 'x', 0, 1.0)",
        "INSERT INTO meta VALUES ('versions', '{')",
    ],
)
def test_a_damaged_store_is_one_message(tmp_path, damage):
    path = filled(tmp_path / "s.sqlite", [ok("0dp")])
    connection = sqlite3.connect(path)
    connection.execute(damage)
    connection.commit()
    connection.close()
    with open_to_read(path) as reader, pytest.raises(DataError, match=r"s\.sqlite: damaged"):
        list(reader.records()), reader.pruned(), reader.meta()
