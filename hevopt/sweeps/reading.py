"""Reading a store: while a sweep writes to it, after one was killed, on a disk that cannot be written."""

import json
import os
import shutil
import sqlite3
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

from hevopt.errors import DataError
from hevopt.sweeps.prune import Pruned
from hevopt.sweeps.store import check_kind, told
from hevopt.sweeps.stored import OUTCOMES, check_case, check_meta, check_pruned, loaded
from hevopt.writing import temporary_folder

_RECORDS = """
SELECT plan.design, designs.parameters, plan.cycle, plan.strategy, plan.nox_weight,
       CASE WHEN cases.status IS NOT NULL THEN cases.status WHEN pruned.design IS NOT NULL THEN 'pruned'
            ELSE 'missing' END AS outcome, cases.row, cases.error, cases.seconds
FROM plan JOIN designs ON designs.number = plan.design LEFT JOIN cases ON cases.key = plan.key
LEFT JOIN pruned ON pruned.design = plan.design
"""


@dataclass(frozen=True, slots=True)
class Record:
    """A case of a design. outcome: one of OUTCOMES; row: as jobs.Outcome has it; seconds: it took."""

    design: int
    parameters: Mapping[str, Any]
    cycle: str
    strategy: str
    nox_weight: float
    outcome: str
    row: Mapping[str, Any] | None
    error: str | None
    seconds: float | None


def inputs_in(meta: Mapping[str, str]) -> dict[str, str]:
    """File -> SHA-256, of the files that a sweep was made from, by what its store knows of it."""
    return json.loads(meta.get("inputs", "{}"))


@dataclass(frozen=True, slots=True)
class Reader:
    """A store as it was at one moment; `open_to_read` makes one."""

    path: Path
    connection: sqlite3.Connection

    def meta(self) -> dict[str, str]:
        """What is known of the sweep: study (its text), command, created, begun ..."""
        with told(self.path):
            meta = dict(self.connection.execute("SELECT name, value FROM meta"))
        check_meta(self.path, meta)
        return meta

    def statuses(self) -> dict[str, str]:
        """Key -> status of all cases that have a result."""
        with told(self.path):
            return dict(self.connection.execute("SELECT key, status FROM cases"))

    def counts(self) -> dict[str, int]:
        """Cases of the plan by outcome; `designs`; `other`: results of other plans or other code."""
        query = f"SELECT outcome, count(*) FROM ({_RECORDS}) GROUP BY outcome"
        with told(self.path):
            counts = dict.fromkeys(OUTCOMES, 0) | dict(self.connection.execute(query))
            for name, query in (
                ("designs", "SELECT count(*) FROM designs"),
                ("other", "SELECT count(*) FROM cases WHERE key NOT IN (SELECT key FROM plan)"),
            ):
                counts[name] = self.connection.execute(query).fetchone()[0]
        return counts

    def records(self) -> Iterator[Record]:
        """Every case of the plan, by design, cycle and strategy."""
        query = f"{_RECORDS} ORDER BY plan.design, plan.cycle, plan.strategy"
        with told(self.path):
            names = [field.name for field in fields(Record)]
            keys = None
            for found in self.connection.execute(query):
                values = dict(zip(names, found, strict=True))
                for name in ("parameters", "row"):
                    values[name] = loaded(self.path, values[name])
                check_case(self.path, values, keys)
                keys = values["parameters"]
                yield Record(**values)

    def pruned(self) -> list[Pruned]:
        """The designs discarded unsolved, by number."""
        query = "SELECT design, bound, incumbent, objective FROM pruned ORDER BY design"
        with told(self.path):
            pruned = [Pruned(*found) for found in self.connection.execute(query)]
        for one in pruned:
            check_pruned(self.path, asdict(one))
        return pruned


@contextmanager
def open_to_read(path: Path) -> Iterator[Reader]:
    """The store at a path as it is now, whatever is written to it meanwhile."""
    try:
        found = path.is_file()
    except OSError as error:
        raise DataError(f"{path}: cannot be read ({error.strerror}); check the path") from None
    if not found:
        raise DataError(f"{path}: there is no such store; check the path, or run the sweep first")
    with ExitStack() as stack:
        connection = _connected(path, stack)
        check_kind(path, connection)
        with told(path):
            connection.execute("BEGIN")
        yield Reader(path, connection)


def _connected(path: Path, stack: ExitStack) -> sqlite3.Connection:
    """A connection that changes nothing.

    Beside a store SQLite wants files of its own, which the last to close it removes if it may write. Where there
    can be none, the store cannot change either; what was not yet merged into it is merged in a copy.
    """
    log = Path(os.path.realpath(path) + "-wal")
    writable = os.access(path, os.W_OK) and os.access(path.absolute().parent, os.W_OK)
    try:
        return _opened(path, "mode=rw" if writable else "mode=ro", stack)
    except sqlite3.OperationalError:
        if log.exists() and log.stat().st_size:
            folder = stack.enter_context(temporary_folder())
            for file, name in ((path, "store"), (log, "store-wal")):
                shutil.copy(file, folder / name)
            with told(path):
                return _opened(folder / "store", "mode=rw", stack)
    except sqlite3.Error:
        pass
    with told(path):
        return _opened(path, "immutable=1", stack)


def _opened(path: Path, how: str, stack: ExitStack) -> sqlite3.Connection:
    connection = sqlite3.connect(f"{path.absolute().as_uri()}?{how}", uri=True, timeout=60.0)
    stack.callback(connection.close)
    connection.isolation_level = None
    connection.execute("PRAGMA query_only = ON")
    connection.execute("SELECT count(*) FROM sqlite_master")
    return connection
