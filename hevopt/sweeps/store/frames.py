"""The cases of a store as tables of pandas: a line per case, parameters and figures as columns."""

from collections.abc import Iterator, Mapping
from itertools import groupby, islice
from operator import attrgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hevopt.files.frames import TYPES
from hevopt.studies.frames import kinds_of_rows
from hevopt.sweeps.plan.jobs import BOUND, FIGURES, NOX_WEIGHT, Ending
from hevopt.sweeps.plan.prune import Pruned
from hevopt.sweeps.store.reading import Reader, open_to_read

if TYPE_CHECKING:
    import pandas as pd

_LEADING = ("design", "cycle", "strategy", "outcome")
_PRUNED = ("design_bound_l_per_100km", "incumbent", "incumbent_objective_l_per_100km")
_LOST, _LAST = "lost_proofs", ("error", "case_s")
# Of a row: the strategy is told before, and a sweep has no reference for changes.
_LEFT_OUT = ("strategy", "delta_fuel_percent", "delta_nox_percent")
# Lines of one of the tables that a store is read in, so that memory holds few of them as Python's objects.
_GROUP = 10_000


def read_sweep(path: str | Path) -> "pd.DataFrame":
    """The cases of a sweep's store, by design, cycle and strategy, also of one that still runs.

    outcome: "ok", "infeasible", "failed", "pruned" or "missing". Every parameter is a column under its key path;
    figures have their units in their names, and are missing where a case has none. Cases of pruned designs have
    their bound, that of the design (mean over the cycles), and the incumbent that condemned it. lost_proofs: where
    there are any, proofs that were tried and not found. case_s: seconds of the whole case, the control table and
    the dynamic program going to the first one that needed them.
    Raises DataError where the file is no store, or damaged.
    """
    import pandas as pd

    with open_to_read(Path(path)) as reader:
        return pd.concat(frames_of(reader), ignore_index=True)


def frames_of(reader: Reader) -> "Iterator[pd.DataFrame]":
    """The table of `read_sweep` in parts of the same columns and types, one or more."""
    import pandas as pd

    kinds, lines = _kinds(reader), _lines(reader)
    group = list(islice(lines, _GROUP))
    while True:
        columns = {
            name: [None if line.get(name) is None else kind(line[name]) for line in group]
            for name, kind in kinds.items()
        }
        yield pd.DataFrame(
            {name: pd.Series(columns[name], dtype=TYPES[kind]) for name, kind in kinds.items()}
        )
        group = list(islice(lines, _GROUP))
        if not group:
            return


def _kinds(reader: Reader) -> dict[str, type]:
    """Column name -> what its values are: floats where whole numbers stand among others, text beside any text.

    A parameter keeps its key path as name; NOx weight stands among the parameters.
    """
    found: dict[str, set[type]] = {name: set() for name in _LEADING}
    for line in _lines(reader):
        for name, value in line.items():
            found.setdefault(name, set()).add(type(value))
    last = [*(name for name in (*_PRUNED, _LOST) if name in found), *_LAST]
    ordered = [name for name in found if name not in last] + last
    known = _known_kinds()
    kinds = {name: _kind_of(found.get(name, set()) - {type(None)}) for name in ordered}
    return {name: known.get(name, kind) for name, kind in kinds.items()}


def _known_kinds() -> dict[str, type]:
    """Column name -> what its values are, whether or not the store has one: all columns but the parameters."""
    figures = dict.fromkeys((*FIGURES, *_PRUNED), float) | {"incumbent": int, "case_s": float}
    return kinds_of_rows() | figures | {"design": int, NOX_WEIGHT: float, "error": str}


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
            leading = design, record.cycle, record.strategy, str(record.ending)
            line = {**dict(zip(_LEADING, leading, strict=True)), **record.parameters}
            line[NOX_WEIGHT] = record.nox_weight
            pruned = record.ending == Ending.PRUNED
            row = _unsolved(bound, condemned[design]) if pruned else record.row or {}
            line |= {k: v for k, v in row.items() if k not in _LEFT_OUT}
            if lost := row.get(_LOST):
                line[_LOST] = "; ".join(f"{kind}: {why}" for kind, why in lost.items())
            failure = record.failure and str(record.failure)
            yield line | {"error": failure, "case_s": record.seconds}


def _unsolved(bound: Mapping[str, Any], pruned: Pruned) -> dict[str, Any]:
    """What is known of a case of a pruned design; bound: the row of its bound."""
    known = {name: bound.get(name) for name in ("architecture", "bound_l_per_100km")}
    why = zip(_PRUNED, (pruned.bound, pruned.incumbent, pruned.objective), strict=True)
    return {**dict.fromkeys(bound), **known, **dict(why)}
