"""The cases of a store as a table in a file: CSV, or Parquet where pyarrow is installed."""

import csv
import io
from collections.abc import Iterator, Mapping
from itertools import groupby, islice
from operator import attrgetter
from pathlib import Path
from types import NoneType
from typing import Any, get_args, get_type_hints

from hevopt.errors import DataError
from hevopt.files.shown import printable
from hevopt.files.writing import check_writable, csv_cells, write_whole
from hevopt.studies.rows import Row
from hevopt.sweeps.plan.jobs import BOUND, FIGURES, NOX_WEIGHT
from hevopt.sweeps.plan.prune import Pruned
from hevopt.sweeps.store.reading import OUTCOMES, Reader

_LEADING = ("design", "cycle", "strategy", "outcome")
_PRUNED = ("design_bound_l_per_100km", "incumbent", "incumbent_objective_l_per_100km")
_LAST = ("error", "case_s")
# Of a row: the strategy is told before, and a sweep has no reference for changes.
_LEFT_OUT = ("strategy", "delta_fuel_percent", "delta_nox_percent")
# Lines that a part of a Parquet file has, so that memory holds few of them.
_GROUP = 10_000


def check_export(path: Path) -> None:
    """DataError, before anything runs, where a table could not be written to this file."""
    if path.suffix not in (".csv", ".parquet"):
        raise DataError(f"--export {path}: a file ending in .csv or .parquet is needed")
    check_writable(path)
    if path.suffix == ".parquet":
        try:
            import pyarrow  # noqa: F401
        except ImportError:
            raise DataError(
                '--export to Parquet needs pyarrow; run: pip install "hevopt[parquet]", or export to a '
                ".csv file"
            ) from None


def export(reader: Reader, path: Path) -> int:
    """Write a line per case, by design, cycle and strategy, parameters and figures as columns; how many lines.

    The text is the same whatever ran the sweep, apart from the column case_s: seconds of the whole case,
    the control table and the dynamic program going to the first one that needed them. Cases of pruned designs have
    their bound, that of the design (mean over the cycles), and the incumbent that condemned it.
    """
    check_export(path)
    write_whole(path, csv_of(reader) if path.suffix == ".csv" else _parquet_of(reader))
    counts = reader.counts()
    return sum(counts[outcome] for outcome in OUTCOMES)


def csv_of(reader: Reader) -> bytes:
    """The table that `export` writes to a .csv file."""
    out = io.BytesIO()
    text = io.TextIOWrapper(out, encoding="utf-8", newline="")
    writer = csv.writer(text, lineterminator="\n")
    names = list(_kinds(reader))
    writer.writerow(csv_cells(map(printable, names)))
    for line in _lines(reader):
        values = [line.get(name) for name in names]
        writer.writerow(csv_cells(values))
    text.flush()
    return out.getvalue()


def _parquet_of(reader: Reader) -> bytes:
    import pyarrow as pa
    import pyarrow.parquet as pq

    types = {int: pa.int64(), float: pa.float64(), bool: pa.bool_()}
    kinds = _kinds(reader)
    schema = pa.schema([(name, types.get(kind, pa.string())) for name, kind in kinds.items()])
    out = io.BytesIO()
    lines = _lines(reader)
    with pq.ParquetWriter(out, schema) as writer:
        while group := list(islice(lines, _GROUP)):
            columns = {
                name: [None if line.get(name) is None else kind(line[name]) for line in group]
                for name, kind in kinds.items()
            }
            writer.write_table(pa.table(columns, schema))
    return out.getvalue()


def _kinds(reader: Reader) -> dict[str, type]:
    """Column name -> what its values are: floats where whole numbers stand among others, text beside any text.

    A parameter keeps its key path as name; NOx weight stands among the parameters.
    """
    found: dict[str, set[type]] = {name: set() for name in _LEADING}
    for line in _lines(reader):
        for name, value in line.items():
            found.setdefault(name, set()).add(type(value))
    pruned = [name for name in _PRUNED if name in found]
    last = [*pruned, *_LAST]
    ordered = [name for name in found if name not in last] + last
    known = _known_kinds()
    kinds = {name: _kind_of(found.get(name, set()) - {type(None)}) for name in ordered}
    return {name: known.get(name, kind) for name, kind in kinds.items()}


def _known_kinds() -> dict[str, type]:
    """Column name -> what its values are, whether or not the store has one: all columns but the parameters."""
    figures = dict.fromkeys((*FIGURES, *_PRUNED), float) | {"incumbent": int, "case_s": float}
    kinds = {
        name: next(kind for kind in (get_args(hint) or (hint,)) if kind is not NoneType)
        for name, hint in get_type_hints(Row).items()
    }
    # What is more than a number, such as a status, a store has as text.
    kinds = {name: kind if kind in (int, float, bool) else str for name, kind in kinds.items()}
    return kinds | figures | {"design": int, NOX_WEIGHT: float, "error": str}


def _kind_of(kinds: set[type]) -> type:
    if kinds == {int, float}:
        return float
    return kinds.pop() if len(kinds) == 1 else str


def _lines(reader: Reader) -> Iterator[dict[str, Any]]:
    condemned = {pruned.design: pruned for pruned in reader.pruned()}
    for (design, _), found in groupby(reader.records(), attrgetter("design", "cycle")):
        records = list(found)
        bound = next((r.row for r in records if r.strategy == BOUND and r.row is not None), {})
        for record in records:
            line = {name: getattr(record, name) for name in _LEADING}
            line |= record.parameters
            line[NOX_WEIGHT] = record.nox_weight
            pruned = record.outcome == "pruned"
            row = _unsolved(bound, condemned[design]) if pruned else record.row or {}
            line |= {k: v for k, v in row.items() if k not in _LEFT_OUT}
            yield line | {"error": record.error, "case_s": record.seconds}


def _unsolved(bound: Mapping[str, Any], pruned: Pruned) -> dict[str, Any]:
    """What is known of a case of a pruned design; bound: the row of its bound."""
    known = {name: bound.get(name) for name in ("architecture", "bound_l_per_100km")}
    why = zip(_PRUNED, (pruned.bound, pruned.incumbent, pruned.objective), strict=True)
    return {**dict.fromkeys(bound), **known, **dict(why)}
