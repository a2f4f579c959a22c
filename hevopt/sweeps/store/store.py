"""The store of a sweep: one SQLite file, written by one process alone.

    meta     name, value           the study's text, digests, versions and inputs (file -> SHA-256) as JSON, the
                                   command, when it was made and last run
    designs  number, parameters    of the study as last run: key path -> value, as JSON
    plan     design, cycle, strategy, nox_weight, key     which case answers for which design
    cases    key, ending, row, failure, seconds           every result ever stored, by the digest of its inputs
    pruned   design, bound, incumbent, objective          designs discarded, and by what

Results are added in transactions half a second or 200 rows apart, and reach the disk with each (WAL, FULL: twice a
second it costs nothing): what a killed run or a lost machine had not committed is run again, and there is never
half a row. A result is never deleted, and never replaced unless it was a failure.
"""

import json
import os
import sqlite3
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import asdict, astuple
from datetime import UTC, datetime
from pathlib import Path
from time import monotonic
from typing import Any

from hevopt.errors import DataError, HevoptError
from hevopt.files.shown import encodable, printable
from hevopt.files.writing import check_writable
from hevopt.sweeps.plan.jobs import Planned, Result
from hevopt.sweeps.plan.prune import Pruned
from hevopt.sweeps.store.limits import check_side_files, schema_faults
from hevopt.sweeps.store.stored import damaged, loaded

SCHEMA = 2
# "hevs": tells a store from other programs' SQLite files.
APPLICATION = 0x68657673
# Entry of meta: what a sizing says of its designs, a line each.
PROVEN = "proven"
_COMMIT_S, _COMMIT_ROWS = 0.5, 200
_TABLES = """
CREATE TABLE meta (name TEXT PRIMARY KEY, value TEXT) WITHOUT ROWID;
CREATE TABLE designs (number INTEGER PRIMARY KEY, parameters TEXT NOT NULL);
CREATE TABLE plan (design INTEGER NOT NULL, cycle TEXT NOT NULL, strategy TEXT NOT NULL, nox_weight REAL NOT NULL,
                   key TEXT NOT NULL, PRIMARY KEY (design, cycle, strategy)) WITHOUT ROWID;
CREATE INDEX plan_key ON plan (key);
CREATE TABLE cases (key TEXT PRIMARY KEY, ending TEXT NOT NULL, row TEXT, failure TEXT, seconds REAL NOT NULL);
CREATE TABLE pruned (design INTEGER PRIMARY KEY, bound REAL NOT NULL, incumbent INTEGER NOT NULL,
                     objective REAL NOT NULL);
"""
_ADD = """
INSERT INTO cases VALUES (?, ?, ?, ?, ?) ON CONFLICT (key) DO UPDATE
SET ending = excluded.ending, row = excluded.row, failure = excluded.failure, seconds = excluded.seconds
WHERE cases.ending = 'failed'
"""


class StoreGone(HevoptError):
    """A store no longer lies at its path: what would be added to it nobody would find."""

    exit_status = 4

    def __init__(self, path: Path) -> None:
        super().__init__(
            f"{path}: the store was deleted, moved or replaced while the sweep ran, which has stopped; a moved one "
            "has all results up to then: put it back, and run the same command again"
        )


class Store:
    """An open store; `open_store` makes one."""

    def __init__(self, path: Path, connection: sqlite3.Connection) -> None:
        self.path, self._connection = path, connection
        self._target, self._file, self._gone = path.resolve(), path.stat(), False
        self._waiting: list[tuple[Any, ...]] = []
        self._since_s = 0.0

    def begin(
        self,
        meta: Mapping[str, str],
        designs: Iterable[tuple[int, Mapping[str, Any]]],
        plan: Iterable[Planned],
    ) -> None:
        """Make a study the store's: what was planned and pruned before goes, results stay."""
        now = datetime.now(UTC).isoformat(timespec="seconds")
        with self._transaction() as run:
            for table in ("designs", "plan", "pruned"):
                run.execute(f"DELETE FROM {table}")
            run.execute("DELETE FROM meta WHERE name = ?", (PROVEN,))
            run.execute("INSERT OR IGNORE INTO meta VALUES ('created', ?)", (now,))
            run.executemany(
                "INSERT OR REPLACE INTO meta VALUES (?, ?)",
                [*((name, encodable(value)) for name, value in meta.items()), ("begun", now)],
            )
            values = ((number, json.dumps(parameters)) for number, parameters in designs)
            run.executemany("INSERT INTO designs VALUES (?, ?)", values)
            run.executemany(
                "INSERT INTO plan VALUES (?, ?, ?, ?, ?)",
                (case._replace(cycle=encodable(case.cycle)) for case in plan),
            )

    def note(self, name: str, value: str) -> None:
        """Keep an entry of meta."""
        with self._transaction() as run:
            run.execute("INSERT OR REPLACE INTO meta VALUES (?, ?)", (name, encodable(value)))

    def check_place(self) -> None:
        """StoreGone where the file at the store's path is no longer the one that was opened."""
        try:
            there = os.path.samestat(self._file, self.path.stat())
        except OSError:
            there = False
        if not there:
            self._gone = True
            # SQLite would leave what is not yet in the file beside its old name, where nobody looks for it.
            with suppress(HevoptError), told(self.path):
                self.commit()
                self._connection.execute("PRAGMA wal_checkpoint(TRUNCATE)")
            raise StoreGone(self.path)

    def add(self, outcomes: Iterable[Result]) -> None:
        """Take outcomes, and commit them and earlier ones when it is time; called with none, only that."""
        for o in outcomes:
            if not self._waiting:
                self._since_s = monotonic()
            row = None if o.row is None else json.dumps(o.row, allow_nan=False)
            failure = o.failure and json.dumps(
                {name: encodable(text) for name, text in asdict(o.failure).items()}
            )
            self._waiting.append((o.key, str(o.ending), row, failure, o.seconds))
        due = len(self._waiting) >= _COMMIT_ROWS or monotonic() - self._since_s >= _COMMIT_S
        if self._waiting and due:
            self.commit()

    def commit(self) -> None:
        """Write what was taken. Where that fails it is kept, and the store stays as it was."""
        if self._waiting:
            with self._transaction() as run:
                run.executemany(_ADD, self._waiting)
            self._waiting.clear()

    def prune(self, pruned: Iterable[Pruned]) -> None:
        """Add designs discarded."""
        with self._transaction() as run:
            run.executemany(
                "INSERT OR REPLACE INTO pruned VALUES (?, ?, ?, ?)", map(astuple, pruned)
            )

    def endings(self) -> dict[str, str]:
        """Key -> ending of the planned cases that have a result."""
        query = "SELECT key, ending FROM cases WHERE key IN (SELECT key FROM plan)"
        with told(self.path):
            return dict(self._connection.execute(query))

    def others(self) -> int:
        """How many results belong to no planned case."""
        query = "SELECT count(*) FROM cases WHERE key NOT IN (SELECT key FROM plan)"
        with told(self.path):
            return int(self._connection.execute(query).fetchone()[0])

    def rows(self, keys: Iterable[str]) -> Iterator[tuple[str, dict[str, Any] | None]]:
        """Key and row of each of some cases; None where there is none."""
        self.commit()
        query = "SELECT row FROM cases WHERE key = ? AND row IS NOT NULL"
        with told(self.path):
            for key in keys:
                found = self._connection.execute(query, (key,)).fetchone()
                yield key, loaded(self.path, found[0]) if found else None

    def close(self) -> None:
        """Write what was taken, and leave one file."""
        try:
            self.commit()
        finally:
            with suppress(sqlite3.Error):
                self._connection.close()
            if self._gone and not self._target.exists():
                for ending in ("-wal", "-shm"):
                    self._target.with_name(self._target.name + ending).unlink(missing_ok=True)

    @contextmanager
    def _transaction(self) -> Iterator[sqlite3.Connection]:
        """All of it or nothing."""
        with told(self.path):
            self._connection.execute("BEGIN IMMEDIATE")
            try:
                yield self._connection
                self._connection.execute("COMMIT")
            except BaseException:
                # Where the disk is full, SQLite may have rolled back already.
                with suppress(sqlite3.Error):
                    self._connection.execute("ROLLBACK")
                raise


@contextmanager
def open_store(path: Path) -> Iterator[Store]:
    """A store to write to, made where there is none; `locked` first. DataError where that cannot be."""
    target = check_writable(path)
    check_side_files(target)
    with told(path):
        connection = sqlite3.connect(target, timeout=60.0, isolation_level=None)
    try:
        with told(path):
            new = not connection.execute("SELECT count(*) FROM sqlite_master").fetchone()[0]
        if not new:
            check_kind(path, connection)
        with told(path):
            connection.execute("PRAGMA journal_mode = WAL")
            connection.execute("PRAGMA synchronous = FULL")
            if new:
                marks = f"PRAGMA application_id = {APPLICATION}; PRAGMA user_version = {SCHEMA};"
                connection.executescript(f"BEGIN; {_TABLES} {marks} COMMIT;")
        store = Store(path, connection)
        try:
            yield store
        finally:
            store.close()
    finally:
        connection.close()


def check_kind(path: Path, connection: sqlite3.Connection) -> None:
    """DataError where a database is not a store, one of a later hevopt, or has other tables."""
    with told(path):
        application = connection.execute("PRAGMA application_id").fetchone()[0]
        version = connection.execute("PRAGMA user_version").fetchone()[0]
    if application != APPLICATION:
        raise DataError(f"{path}: an SQLite file, but not the store of a sweep; name another")
    if version != SCHEMA:
        raise DataError(
            f"{path}: written in format {version}, this hevopt knows {SCHEMA}; "
            f"use a {'newer' if version > SCHEMA else 'former'} version, or name another store"
        )
    with told(path):
        faults = schema_faults(connection, _TABLES)
    if faults:
        raise damaged(path, faults[0])


@contextmanager
def told(path: Path) -> Iterator[None]:
    """SQLite's errors as DataError, with what to do."""
    try:
        yield
    except sqlite3.Error as error:
        raise DataError(f"{path}: {_advice(error)}") from None


def _advice(error: sqlite3.Error) -> str:
    # What a damaged file holds, SQLite quotes as it is.
    name, said = getattr(error, "sqlite_errorname", ""), printable(str(error))
    if name.startswith("SQLITE_NOTADB"):
        return "not a store of a sweep, nor an SQLite file; name another"
    if name.startswith("SQLITE_INTERRUPT"):
        return "damaged (reading it takes more work than its size can need); keep a copy, and name another"
    if name.startswith("SQLITE_CORRUPT"):
        return f"damaged ({said}); keep a copy, and recover it with the tools of SQLite"
    if name.startswith("SQLITE_FULL") or name.startswith("SQLITE_IOERR"):
        return (
            f"cannot be written ({said}); results stored before are safe: make room on the disk, and run "
            "the same command again"
        )
    if name.startswith(("SQLITE_READONLY", "SQLITE_CANTOPEN", "SQLITE_PERM")):
        return f"cannot be opened or written ({said}); name a store that can, with --store"
    if name.startswith(("SQLITE_BUSY", "SQLITE_LOCKED")):
        return f"another program holds it ({said}); close that, and run the same command again"
    return f"SQLite: {said}"
