"""Stores that were damaged, or made by someone to hold anything: one message each, within limits."""

import os
import sqlite3
from pathlib import Path

import pytest
from small_stores import DESIGNS, PLAN, ok, row

from hevopt.errors import DataError
from hevopt.pages.sweep.data import load_sweep
from hevopt.pages.sweep.page import sweep_page
from hevopt.sweeps.plan.jobs import Failure, Planned, Result
from hevopt.sweeps.plan.prune import Pruned
from hevopt.sweeps.store import limits
from hevopt.sweeps.store.export import cases_csv
from hevopt.sweeps.store.reading import open_to_read
from hevopt.sweeps.store.store import open_store

COLUMNS = {
    "meta": "name, value", "designs": "number, parameters", "plan": "design, cycle, strategy, nox_weight, key",
    "cases": "key, ending, row, failure, seconds", "pruned": "design, bound, incumbent, objective",
}  # fmt: skip
ENDLESS = "WITH RECURSIVE endless(x) AS (SELECT 1 UNION ALL SELECT x + 1 FROM endless)"


@pytest.fixture
def store(tmp_path):
    """A good one: a case that is done, one that failed, one that is missing and one that was pruned."""
    path = tmp_path / "s.sqlite"
    with open_store(path) as opened:
        opened.begin({"study": "text", "inputs": "{}", "versions": "{}"}, DESIGNS, PLAN)
        opened.add([ok("0dp"), Result("0ecms", "failed", None, Failure("no"), 1.0)])
        opened.prune([Pruned(1, 2.0, 0, 1.5)])
    return path


def spoil(path, script):
    connection = sqlite3.connect(path, isolation_level=None)
    connection.executescript(script)
    connection.close()


def read_all(path):
    """All that commands read of a store."""
    with open_to_read(path) as reader:
        reader.counts(), reader.meta(), reader.pruned(), cases_csv(reader)
    return sweep_page(load_sweep(path))


def test_a_good_store_is_read(store):
    assert read_all(store).startswith("<!doctype html>")


@pytest.mark.parametrize("table", COLUMNS)
@pytest.mark.parametrize(
    "how",
    [
        "DROP TABLE {0}",
        "DROP TABLE {0}; CREATE VIEW {0} AS " + ENDLESS + " SELECT {2} FROM endless",
        "ALTER TABLE {0} RENAME TO old; CREATE VIEW {0} AS SELECT * FROM old",
        "ALTER TABLE {0} RENAME TO old; CREATE TABLE {0} AS SELECT * FROM old",
        "DROP TABLE {0}; CREATE TABLE {0} ({1}, computed AS (abs(1)))",
        "ALTER TABLE {0} ADD COLUMN more",
        "PRAGMA writable_schema = ON; UPDATE sqlite_master SET sql = replace(sql, 'TEXT', 'TEXT COLLATE none'), "
        "rootpage = rootpage WHERE name = '{0}'; PRAGMA writable_schema = RESET",
        "CREATE TRIGGER more AFTER INSERT ON {0} BEGIN SELECT 1; END",
    ],
)
def test_other_tables_than_a_sweep_makes_are_damage(store, table, how):
    columns = COLUMNS[table]
    nothing = ", ".join(f"NULL AS {name}" for name in columns.split(", "))
    script = how.format(table, columns, nothing)
    if "COLLATE" in how and table == "pruned":
        script = script.replace("'TEXT'", "'REAL'")
    spoil(store, script)
    for use in (open_to_read, open_store):
        with pytest.raises(DataError, match=r"s\.sqlite: "), use(store):
            pass


@pytest.mark.parametrize(
    ("script", "says"),
    [
        ("DELETE FROM designs WHERE number = 1", "a planned case has no design"),
        ("DELETE FROM plan WHERE design = 1", "a design has no planned case"),
        ("UPDATE pruned SET design = 7", "a pruned design is none of the study's"),
        ("UPDATE plan SET nox_weight = 2 WHERE key = '0dp'", "two NOx weights"),
        ("UPDATE plan SET nox_weight = -1", "nox_weight"),
        ("UPDATE plan SET nox_weight = 9e999", "nox_weight"),
        ("UPDATE cases SET ending = 'pruned' WHERE key = '0dp'", "cannot be stored as pruned"),
        ("UPDATE cases SET ending = 'missing' WHERE key = '0dp'", "cannot be stored as missing"),
        ("UPDATE cases SET ending = 'failed' WHERE key = '0dp'", "row"),
        ("UPDATE cases SET failure = NULL", "failure"),
        ("UPDATE cases SET row = replace(row, '0.3333333333333333', 'null')", "row"),
        ("UPDATE cases SET row = replace(row, '0.333', '1e200') WHERE row IS NOT NULL", "row"),
        ("UPDATE cases SET row = replace(row, '\"status\"', '\"soc_end\": \"x\", \"status\"')", "row.soc_end"),
        ("UPDATE cases SET row = replace(row, '\"status\"', '\"certificate\": \"\\ud800\", \"status\"')", "JSON"),
        ("UPDATE designs SET parameters = '{\"a\": 1' || printf('%.*c', 4000, '0') || '}'", "parameters.a"),
        ("UPDATE designs SET parameters = '{\"a\": NaN}'", "parameters.a"),
        ("UPDATE designs SET parameters = printf('%.*c', 100000, '[')", "JSON"),
        ("UPDATE cases SET failure = CAST(x'ff' AS TEXT) WHERE failure IS NOT NULL", "decode"),
        ("UPDATE meta SET value = 'null' WHERE name = 'versions'", "versions"),
        ("UPDATE meta SET value = '{\"a\": 1}' WHERE name = 'inputs'", "inputs"),
        ("UPDATE meta SET value = x'00' WHERE name = 'study'", "study"),
    ],
)  # fmt: skip
def test_what_no_sweep_stores_is_damage(store, script, says):
    spoil(store, script)
    with pytest.raises(DataError, match=rf"s\.sqlite: .*{says}"):
        read_all(store)


def test_more_rows_than_the_limit_and_longer_texts_are_refused(store, monkeypatch):
    monkeypatch.setattr(limits, "ROWS_MAX", 3)
    with pytest.raises(DataError, match="plan has more than 3 rows"):
        read_all(store)
    monkeypatch.undo()
    monkeypatch.setattr(limits, "TEXT_BYTES_MAX", 100)
    with pytest.raises(DataError, match="too big"):
        read_all(store)


def test_reading_ends_when_it_takes_more_work_than_the_file_can_need(store, monkeypatch):
    monkeypatch.setattr(limits, "_INSTRUCTIONS_MAX", 0)
    monkeypatch.setattr(limits, "_ASKED_EVERY", 1)
    with pytest.raises(DataError, match="more work than its size can need"):
        read_all(store)


def test_a_pruned_design_above_one_that_burns_nothing_has_a_page(store):
    spoil(store, "UPDATE pruned SET objective = 0")
    assert "pruned" in read_all(store)


def test_figures_of_other_versions_are_passed_over(store):
    spoil(store, 'UPDATE cases SET row = replace(row, \'"status"\', \'"former": [1], "status"\')')
    with open_to_read(store) as reader:
        assert next(reader.records()).row == row(1 / 3)


@pytest.mark.parametrize("suffix", ["", "-wal", "-journal"])
def test_a_pipe_in_place_of_a_file_is_one_message(store, suffix):
    path = Path(f"{store}{suffix}")
    path.unlink(missing_ok=True)
    os.mkfifo(path)
    with pytest.raises(DataError, match="not a regular file"), open_to_read(store):
        pass


@pytest.mark.parametrize("place", ["/dev/zero", "/dev", "/proc/self/mem"])
def test_what_is_no_file_that_ends_is_one_message(hevopt, place):
    for words in (("report", place, "--out", "p.html"), ("sweep", "--status", place)):
        seen = hevopt(*words)
        assert seen.status == 2 and seen.err.startswith(f"hevopt: error: {place}: ")
        assert seen.err.count("\n") == 1


def test_files_are_named_without_folders_that_are_the_users(tmp_path):
    folder = tmp_path / "mine"
    designs = [(0, {"engine": f"{tmp_path}/a/e.toml"}), (1, {"engine": f"{tmp_path}/b/e.toml"})]
    plan = [Planned(n, f"{folder}/short.csv", "dp", 0.0, f"{n}dp") for n in (0, 1)]
    path = tmp_path / "s.sqlite"
    meta = {
        "study": f'cycles = ["{folder}/short.csv"]', "study_file": f"{folder}/study.toml",
        "command": f"hevopt sweep {folder}/study.toml", "inputs": f'{{"{folder}/short.csv": "0f"}}',
    }  # fmt: skip
    with open_store(path) as opened:
        opened.begin(meta, designs, plan)
        opened.add(
            [ok("0dp"), Result("1dp", "failed", None, Failure(f"{folder}/short.csv: no"), 1.0)]
        )
    page = read_all(path)
    with open_to_read(path) as reader:
        table = cases_csv(reader).decode()
    assert str(tmp_path) not in page + table
    assert "hevopt sweep study.toml" in page and "short.csv: no" in page
    assert ",a/e.toml," in table and ",b/e.toml," in table and "0,short.csv,dp" in table
