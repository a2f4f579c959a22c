"""How much of a store is read: as an SQLite file it may have been damaged, or made by someone, to hold anything.

Its tables are those that a sweep makes, character by character, so that none is a view without an end or computes
what it holds. They have no more rows than the file has room for, and reading them takes no more of SQLite's
instructions than so many rows can need: links between pages can be crafted so that a small file reads as an endless
one.
"""

import sqlite3
from functools import cache
from pathlib import Path

from hevopt.errors import DataError

# Of one text or key: a study's text has at most 5 MB.
TEXT_BYTES_MAX = 20_000_000
ROWS_MAX = 20_000_000
META_MAX = 100
# The least that SQLite needs for a row.
_ROW_BYTES = 4
# A record takes some 40 instructions in each of half a dozen readings, and 100 bytes or more.
_INSTRUCTIONS, _INSTRUCTIONS_PER_BYTE, _INSTRUCTIONS_MAX = 50_000_000, 20, 10**10
_ASKED_EVERY = 100_000
_SIDE_FILES = ("-wal", "-journal", "-shm")


def check_side_files(path: Path) -> None:
    """DataError where what SQLite opens beside a store is no file, such as a pipe that never answers."""
    for suffix in _SIDE_FILES:
        beside = path.with_name(path.name + suffix)
        if beside.exists() and not beside.is_file():
            raise DataError(f"{beside}: not a regular file; remove it, it stands beside a store")


def set_limits(connection: sqlite3.Connection, path: Path) -> None:
    """Have SQLite refuse texts that are too long, and stop after more instructions than the file can need."""
    connection.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, TEXT_BYTES_MAX)
    connection.execute("PRAGMA trusted_schema = OFF")
    most = min(_INSTRUCTIONS + _INSTRUCTIONS_PER_BYTE * _bytes_of(path), _INSTRUCTIONS_MAX)
    left = most // _ASKED_EVERY

    def is_spent() -> bool:
        nonlocal left
        left -= 1
        return left < 0

    connection.set_progress_handler(is_spent, _ASKED_EVERY)


def _bytes_of(path: Path) -> int:
    files = (path, path.with_name(path.name + "-wal"))
    return sum(file.stat().st_size for file in files if file.is_file())


def schema_faults(connection: sqlite3.Connection, tables: str) -> list[str]:
    """What of a database's schema is not as `tables`, statements of CREATE TABLE and INDEX, make it."""
    there = set(connection.execute("SELECT type, name, sql FROM sqlite_master"))
    faults = [
        f"{name} is not the {kind} that a sweep makes"
        for kind, name, sql in sorted(_made_by(tables))
        if (kind, name, sql) not in there
    ]
    return faults + ["it has a trigger"] * any(kind == "trigger" for kind, *_ in there)


@cache
def _made_by(tables: str) -> frozenset[tuple[str, str, str]]:
    connection = sqlite3.connect(":memory:")
    try:
        connection.executescript(tables)
        query = "SELECT type, name, sql FROM sqlite_master WHERE sql IS NOT NULL"
        return frozenset(connection.execute(query))
    finally:
        connection.close()


def contents_faults(connection: sqlite3.Connection, path: Path) -> list[str]:
    """What of a store's tables is too much, or does not belong together."""
    room = min(_bytes_of(path) // _ROW_BYTES, ROWS_MAX)
    most = {"meta": META_MAX, "designs": room, "plan": room, "cases": room, "pruned": room}
    for table, rows in most.items():
        # Row by row: SQLite's own count of a crafted table cannot be stopped.
        query = f"SELECT count(*) FROM (SELECT 1 FROM {table} LIMIT {rows + 1})"
        if connection.execute(query).fetchone()[0] > rows:
            return [f"{table} has more than {rows} rows"]
    queries = {
        "a planned case has no design": (
            "SELECT 1 FROM plan WHERE design NOT IN (SELECT number FROM designs)"
        ),
        "a design has no planned case": (
            "SELECT 1 FROM designs WHERE number NOT IN (SELECT design FROM plan)"
        ),
        "a pruned design is none of the study's": (
            "SELECT 1 FROM pruned WHERE design NOT IN (SELECT number FROM designs)"
        ),
        "a design has two NOx weights": (
            "SELECT 1 FROM plan GROUP BY design HAVING min(nox_weight) IS NOT max(nox_weight)"
        ),
    }
    return [
        fault
        for fault, query in queries.items()
        if connection.execute(f"{query} LIMIT 1").fetchone() is not None
    ]
