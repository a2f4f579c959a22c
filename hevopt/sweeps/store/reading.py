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
from hevopt.files.lookup import check_regular, places_shown, without_folders
from hevopt.files.writing import temporary_folder
from hevopt.sweeps.plan.jobs import Ending, Failure
from hevopt.sweeps.plan.prune import Pruned
from hevopt.sweeps.store.limits import check_side_files, contents_faults, set_limits
from hevopt.sweeps.store.store import check_kind, told
from hevopt.sweeps.store.stored import (
    check_case,
    check_meta,
    check_pruned,
    damaged,
    known_figures,
    loaded,
)

_RECORDS = """
SELECT plan.design, designs.parameters, plan.cycle, plan.strategy, plan.nox_weight,
       CASE WHEN cases.ending IS NOT NULL THEN cases.ending WHEN pruned.design IS NOT NULL THEN 'pruned'
            ELSE 'missing' END AS ending, cases.row, cases.failure, cases.seconds
FROM plan JOIN designs ON designs.number = plan.design LEFT JOIN cases ON cases.key = plan.key
LEFT JOIN pruned ON pruned.design = plan.design
"""

_ABSOLUTE = """
SELECT cycle FROM plan WHERE cycle LIKE '/%' AND length(cycle) < 5000 UNION
SELECT value FROM designs, json_each(CASE WHEN json_valid(parameters) THEN parameters ELSE '{}' END)
WHERE type = 'text' AND value LIKE '/%' AND length(value) < 5000
"""


@dataclass(frozen=True, slots=True)
class Record:
    """A case of a design. row: as jobs.Outcome has it; seconds: it took."""

    design: int
    parameters: Mapping[str, Any]
    cycle: str
    strategy: str
    nox_weight: float
    ending: Ending
    row: Mapping[str, Any] | None
    failure: Failure | None
    seconds: float | None


def inputs_in(meta: Mapping[str, str]) -> dict[str, str]:
    """File -> SHA-256, of the files that a sweep was made from, by what its store knows of it."""
    return dict(json.loads(meta.get("inputs", "{}")))


@dataclass(frozen=True, slots=True)
class Reader:
    """A store as it was at one moment; `open_to_read` makes one.

    names: absolute path of a cycle or component -> as a report names it
    """

    path: Path
    connection: sqlite3.Connection
    names: Mapping[str, str]

    def meta(self) -> dict[str, str]:
        """What is known of the sweep: study (its text), command, created, begun ..."""
        with told(self.path):
            meta = dict(self.connection.execute("SELECT name, value FROM meta"))
        check_meta(self.path, meta)
        return meta

    def endings(self) -> dict[str, str]:
        """Key -> ending of all cases that have a result."""
        with told(self.path):
            return dict(self.connection.execute("SELECT key, ending FROM cases"))

    def counts(self) -> dict[str, int]:
        """Cases of the plan by ending; `designs`; `other`: results of other plans or other code."""
        query = f"SELECT ending, count(*) FROM ({_RECORDS}) GROUP BY ending"
        with told(self.path):
            counts = dict.fromkeys(map(str, Ending), 0) | dict(self.connection.execute(query))
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
                for name in ("parameters", "row", "failure"):
                    values[name] = loaded(self.path, values[name])
                check_case(self.path, values, keys)
                keys = values["parameters"]
                yield self._record(values)

    def _record(self, values: dict[str, Any]) -> Record:
        parameters = {
            key: self.names.get(value, value) if isinstance(value, str) else value
            for key, value in values["parameters"].items()
        }
        failure = values["failure"]
        shown = {
            "parameters": parameters,
            "cycle": self.names.get(values["cycle"], values["cycle"]),
            "row": known_figures(values["row"]),
            "ending": Ending(values["ending"]),
            "failure": failure
            and Failure(**{name: without_folders(text) for name, text in failure.items()}),
        }
        return Record(**values | shown)

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
    if not os.path.lexists(path):
        raise DataError(f"{path}: there is no such store; check the path, or run the sweep first")
    check_regular(path)
    check_side_files(path)
    with ExitStack() as stack:
        connection = _connected(path, stack)
        with told(path):
            connection.execute("BEGIN")
        check_kind(path, connection)
        with told(path):
            faults = contents_faults(connection, path)
            if faults:
                raise damaged(path, faults[0])
            names = _names_shown(connection)
        yield Reader(path, connection, names)


def _names_shown(connection: sqlite3.Connection) -> dict[str, str]:
    """Of files named by absolute paths: how a report names each, from the study's folder on."""
    found = connection.execute("SELECT value FROM meta WHERE name = 'study_file'").fetchone()
    folder = Path(found[0]).parent if found and isinstance(found[0], str) else None
    texts = [text for (text,) in connection.execute(_ABSOLUTE) if isinstance(text, str)]
    names = places_shown(map(Path, texts), folder)
    return {text: names[Path(text)] for text in texts}


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
    set_limits(connection, path)
    connection.execute("PRAGMA query_only = ON")
    connection.execute("SELECT count(*) FROM sqlite_master")
    return connection
