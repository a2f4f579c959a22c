"""Ways to spoil what hevopt itself wrote: tables, cells and figures of a store, values of a saved comparison."""

import gzip
import json
import random
import sqlite3
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from hevopt.sweeps.store.store import SCHEMA

_COLUMNS = {
    "meta": ("name", "value"), "designs": ("number", "parameters"),
    "plan": ("design", "cycle", "strategy", "nox_weight", "key"),
    "cases": ("key", "ending", "row", "failure", "seconds"),
    "pruned": ("design", "bound", "incumbent", "objective"),
}  # fmt: skip
_ENDLESS = "WITH RECURSIVE endless(x) AS (SELECT 1 UNION ALL SELECT x + 1 FROM endless)"
_SCRIPTS = (
    "DROP TABLE {table}",
    "DROP TABLE {table}; CREATE VIEW {table} AS " + _ENDLESS + " SELECT {nothing} FROM endless",
    "ALTER TABLE {table} RENAME TO old; CREATE VIEW {table} AS SELECT * FROM old",
    "ALTER TABLE {table} RENAME COLUMN {column} TO other",
    "DROP TABLE {table}; CREATE TABLE {table} ({columns}, computed AS (abs(1)))",
    "DROP TABLE {table}; CREATE VIRTUAL TABLE {table} USING fts5({columns})",
    "CREATE TRIGGER more AFTER INSERT ON {table} BEGIN SELECT 1; END",
    "CREATE INDEX more ON {table} ({column} COLLATE NOCASE)",
    "INSERT OR IGNORE INTO {table} " + _ENDLESS + " SELECT {x} FROM endless LIMIT 200000",
    "DELETE FROM {table} WHERE abs(random()) % 3 = 0",
    "PRAGMA writable_schema = ON; UPDATE sqlite_master SET rootpage = {page} WHERE name = '{table}'",
    "PRAGMA writable_schema = ON; UPDATE sqlite_master SET sql = 'no' WHERE name = '{table}'",
    "PRAGMA application_id = 1", "PRAGMA user_version = {page}",
    "PRAGMA encoding = 'UTF-16'; PRAGMA page_size = 512; VACUUM",
)  # fmt: skip
_CELLS = (
    None, -1, 0, 1, 2**31, 2**62, -(2**63), 0.5, 1e308, -1e308, 5e-324, float("inf"), "", "x", "nan", "1e5", "\0",
    "\x1b[31m", "=1+1", "ok", "failed", "pruned", "missing", "bound", "[]", "{}", "null", '{"a": 1}', '{"a": NaN}',
    "[" * 100_000, "9" * 4000, '"\\ud800"', "a" * 100_000, b"\xff\xfe", b"",
)  # fmt: skip
_VALUES = (
    None, True, False, -1, 0, 1, 7, 1000, 0.5, 1e99, -1e99, 1e308, 5e-324, 1e-300, -0.0, 2**52, 2**70, 10**4000, "",
    "x", "ok", "bound", "shortfall", "shortfall at 99999999999999999999 steps", "\ud800", "\0\x1b[2J", "=1+1",
    "a" * 100_000, "</script>", [], {}, [[]], [None], {"a": 1}, float("nan"), float("inf"),
)  # fmt: skip


def store_spoilt(contents: bytes, rng: random.Random) -> bytes:
    """A store with other tables, cells, or figures in its JSON texts, one to three of them."""
    with tempfile.TemporaryDirectory(prefix="hevopt-fuzz-") as name:
        path = Path(name) / "s.sqlite"
        path.write_bytes(contents)
        connection = sqlite3.connect(path, isolation_level=None)
        connection.execute("PRAGMA synchronous = OFF")
        for spoil in rng.choices((_tables, _cell, _text), (1, 2, 4), k=rng.choice((1, 1, 2, 3))):
            try:
                spoil(connection, rng)
            except (sqlite3.Error, UnicodeEncodeError):
                pass  # what was spoilt before leaves nothing to spoil here
        connection.close()
        return path.read_bytes()


def _tables(connection: sqlite3.Connection, rng: random.Random) -> None:
    table = rng.choice(list(_COLUMNS))
    columns = _COLUMNS[table]
    script = rng.choice(_SCRIPTS).format(
        table=table, column=rng.choice(columns), columns=", ".join(columns),
        page=rng.choice((SCHEMA + 1, 0, 3, 9999)),
        nothing=", ".join(f"NULL AS {name}" for name in columns), x=", ".join("x" for _ in columns),
    )  # fmt: skip
    connection.executescript(script)


def _cell(connection: sqlite3.Connection, rng: random.Random) -> None:
    table = rng.choice(list(_COLUMNS))
    column, value = rng.choice(_COLUMNS[table]), rng.choice(_CELLS)
    cast = "CAST(? AS TEXT)" if isinstance(value, bytes) and rng.random() < 0.5 else "?"
    some = rng.choice(("", " WHERE abs(random()) % 3 = 0"))
    connection.execute(f"UPDATE OR IGNORE {table} SET {column} = {cast}{some}", (value,))


def _text(connection: sqlite3.Connection, rng: random.Random) -> None:
    """The same figure of one JSON text or of all in a column."""
    table, column, key = rng.choice(
        (("cases", "row", "key"), ("cases", "row", "key"), ("designs", "parameters", "number"),
         ("meta", "value", "name"))
    )  # fmt: skip
    query = f"SELECT {key}, {column} FROM {table} WHERE {column} LIKE '{{%' ORDER BY {key}"
    found = connection.execute(query).fetchall()
    state = rng.getstate()
    for at, text in found if rng.random() < 0.3 else found[:1]:
        rng.setstate(state)
        contents = json.loads(text)
        _change(contents, rng)
        connection.execute(
            f"UPDATE {table} SET {column} = ? WHERE {key} = ?", (json.dumps(contents), at)
        )


def saved_spoilt(contents: bytes, rng: random.Random) -> bytes:
    """A saved comparison, packed or not, with one to three of its values changed."""
    packed = contents.startswith(b"\x1f\x8b")
    results = json.loads(gzip.decompress(contents) if packed else contents)
    for _ in range(rng.choice((1, 1, 1, 2, 3))):
        _change(results, rng)
    text = json.dumps(results).encode()
    return gzip.compress(text, compresslevel=1, mtime=0) if packed else text


def bomb(contents: bytes, rng: random.Random) -> bytes:
    """Some hundred kilobytes that unpack to more than half a gigabyte, or to many small values."""
    unit, count = rng.choice(
        ((b" ", 550), (b"0,", 250), (b"[],", 150), (b'"",', 150), (b'{"a":', 20))
    )
    return gzip.compress(unit * (count * 1_000_000 // len(unit)), compresslevel=1, mtime=0)


def _change(contents: Any, rng: random.Random) -> None:
    """Change one value somewhere: all keys are as likely, however long the lists are."""
    kinds: dict[tuple[str, ...], list[tuple[Any, Any]]] = {}
    for kind, holder, key in _places(contents, ()):
        kinds.setdefault(kind, []).append((holder, key))
    if not kinds:
        return
    holder, key = rng.choice(kinds[rng.choice(list(kinds))])
    old = holder[key]
    if isinstance(old, list) and old and rng.random() < 0.7:
        holder[key] = rng.choice((old[:-1], old[::-1], [0 for _ in old], []))
    elif rng.random() < 0.1:
        del holder[key]
    else:
        alike = [v for v in _VALUES if isinstance(v, type(old))] or _VALUES
        holder[key] = rng.choice(alike if rng.random() < 0.6 else _VALUES)


def _places(value: Any, kind: tuple[str, ...]) -> Iterator[tuple[tuple[str, ...], Any, Any]]:
    """(kind, holder, key) of all values; of lists the first three entries only."""
    inner = value.items() if isinstance(value, dict) else ()
    inner = enumerate(value[:3]) if isinstance(value, list) else inner
    for key, below in list(inner):
        found = (*kind, "" if isinstance(value, list) else key)
        yield found, value, key
        yield from _places(below, found)


CRAFTED: dict[str, tuple[Callable[[bytes, random.Random], bytes], ...]] = {
    "sweep.sqlite": (store_spoilt,),
    "saved.json": (saved_spoilt,),
    "saved.json.gz": (saved_spoilt, saved_spoilt, saved_spoilt, bomb),
}
