"""Results as tidy tables in files, CSV, Parquet or JSON by the suffix: rows of a comparison, steps of a drive.

Units stand in the column names; how cells are written is told in files/frames.py. JSON and Parquet carry inputs,
versions and settings along.
"""

import json
from collections.abc import Mapping, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from hevopt.errors import DataError
from hevopt.files.frames import csv_of, parquet_of, records_of
from hevopt.files.shown import printable
from hevopt.files.writing import check_writable, write_whole
from hevopt.problem.problem import Trajectory
from hevopt.studies.case import Case
from hevopt.studies.comparison import Comparison
from hevopt.studies.frames import told_forward
from hevopt.studies.rows import Row

if TYPE_CHECKING:
    import pandas as pd

SUFFIXES = (".csv", ".parquet", ".json")


def check_table_file(path: Path) -> None:
    """DataError, before anything is solved, for a suffix or a place that a table cannot be written to."""
    check_writable(path)
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        found = f"suffix {suffix!r} is unknown" if suffix else "a suffix is needed"
        raise DataError(f"{printable(str(path))}: {found}; allowed: {', '.join(SUFFIXES)}")
    if suffix == ".parquet" and find_spec("pyarrow") is None:
        raise DataError(
            f"{printable(str(path))}: writing Parquet needs pyarrow; pip install 'hevopt[parquet]', or "
            "choose .csv or .json"
        )


def result(comparison: Comparison, about: Mapping[str, Any]) -> dict[str, Any]:
    """{"cycle", "rows", "causal"} and what the rows come from; None where a figure does not exist.

    "lost_proofs" is there where a proof was tried and not found, "peeking" where a strategy knows more than it
    says, see `Comparison`.
    """
    rows = [row.as_dict() for row in comparison.rows]
    if comparison.forward:
        for row in rows:
            row |= told_forward(comparison.forward, row["architecture"], row["strategy"])
    lost = {"lost_proofs": dict(comparison.lost_proofs)} if comparison.lost_proofs else {}
    peeking = {"peeking": comparison.peeking_by_row} if comparison.peeking else {}
    marks = {"causal": sorted(comparison.causal), **peeking}
    return {"cycle": comparison.cycle, "rows": rows, **marks, **lost, **about}


def result_json(comparison: Comparison, about: Mapping[str, Any]) -> str:
    """`result` as JSON text."""
    return json.dumps(result(comparison, about), indent=1, allow_nan=False)


def write_rows(path: Path, comparison: Comparison, about: Mapping[str, Any]) -> None:
    """The rows of a comparison, one line each, the cycle in front."""
    if path.suffix.lower() == ".json":
        write_whole(path, result_json(comparison, about).encode())
    else:
        write_frame(path, comparison.to_frame(), about)


def write_steps(
    path: Path, comparison: Comparison, steps: "pd.DataFrame", about: Mapping[str, Any]
) -> None:
    """The steps of one or more drives, one line each, the cycle in front; in JSON as "steps" beside the rows."""
    if path.suffix.lower() == ".json":
        whole = {**result(comparison, about), "steps": records_of(steps)}
        write_whole(path, json.dumps(whole, allow_nan=False).encode())
    else:
        whole = steps.assign(cycle=comparison.cycle)
        write_frame(path, whole[["cycle", *steps.columns]], about)


def step_frame(case: Case, trajectory: Trajectory) -> "pd.DataFrame":
    """One line per step: what the cycle asks, then what the car does, every power and loss.

    The columns of `Trajectory.to_frame`, yes and no as 1 and 0, with the cycle's own at both ends of the step;
    nox_kg is missing where the engine has no data on it.
    """
    import pandas as pd

    cycle, driven = case.cycle, trajectory.to_frame()
    step_s, speed = np.diff(cycle.time_s), cycle.speed_mps
    asked = {
        "time_s": driven["time_s"],
        "step_s": driven["step_s"],
        "speed_start_mps": speed[:-1],
        "speed_end_mps": speed[1:],
        "acceleration_mps2": np.diff(speed) / step_s,
        "grade": cycle.grade[:-1],
        "distance_end_m": np.cumsum(step_s * (speed[1:] + speed[:-1]) / 2),
    }
    flags = driven.select_dtypes(bool).astype(int)
    driven = driven.assign(**flags).drop(columns=list(set(asked) & set(driven)))
    if not case.car.engine.nox_known:
        driven["nox_kg"] = np.nan
    return pd.DataFrame(asked).join(driven)


def joined(cases: Sequence[tuple[Row, "pd.DataFrame"]]) -> "pd.DataFrame":
    """One table of several drives, architecture and strategy in front; empty where a drive lacks a column."""
    import pandas as pd

    names = ["architecture", "strategy"]
    tables = {(row.architecture, row.strategy): steps for row, steps in cases}
    if not tables:
        return pd.DataFrame(columns=names)
    whole = pd.concat(tables, names=names, sort=False)
    return whole.reset_index(level=names).reset_index(drop=True)


def write_frame(path: Path, frame: "pd.DataFrame", about: Mapping[str, Any]) -> None:
    """One table; in JSON as "steps" beside what it comes from."""
    kind = path.suffix.lower()
    if kind == ".json":
        whole = {**about, "steps": records_of(frame)}
        write_whole(path, json.dumps(whole, allow_nan=False).encode())
    else:
        write_whole(path, parquet_of([frame], about) if kind == ".parquet" else csv_of(frame))
