"""Results as tidy tables in files, CSV, Parquet or JSON by the suffix: rows of a comparison, steps of a drive.

Units stand in the column names. A CSV number is the shortest text that reads back to the same bits; what does not
exist is an empty cell, null in the other two; CSV text that a spreadsheet would run has an apostrophe in front.
JSON and Parquet carry inputs, versions and settings along.
"""

import csv
import io
import json
from collections.abc import Mapping, Sequence
from importlib.util import find_spec
from math import isfinite
from pathlib import Path
from typing import Any

import numpy as np

from hevopt.errors import DataError
from hevopt.files.shown import printable
from hevopt.files.writing import check_writable, csv_cells, write_whole
from hevopt.problem.problem import Problem, Trajectory
from hevopt.studies.case import Case
from hevopt.studies.comparison import Comparison
from hevopt.studies.rows import Row

SUFFIXES = (".csv", ".parquet", ".json")
Columns = Mapping[str, Sequence[Any]]


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
    """{"cycle", "rows"} and what the rows come from; None where a figure does not exist.

    "lost_proofs" is there where a proof was tried and not found, see `Comparison`.
    """
    rows = [row.as_dict() for row in comparison.rows]
    lost = {"lost_proofs": dict(comparison.lost_proofs)} if comparison.lost_proofs else {}
    return {"cycle": comparison.cycle, "rows": rows, **lost, **about}


def result_json(comparison: Comparison, about: Mapping[str, Any]) -> str:
    """`result` as JSON text."""
    return json.dumps(result(comparison, about), indent=1, allow_nan=False)


def write_rows(path: Path, comparison: Comparison, about: Mapping[str, Any]) -> None:
    """The rows of a comparison, one line each, the cycle in front."""
    if path.suffix.lower() == ".json":
        write_whole(path, result_json(comparison, about).encode())
        return
    rows = [{"cycle": comparison.cycle, **row.as_dict()} for row in comparison.rows]
    names = rows[0] if rows else ["cycle", *Row.__dataclass_fields__]
    _write_columns(path, {name: [row[name] for row in rows] for name in names}, about)


def write_steps(
    path: Path, comparison: Comparison, steps: Columns, about: Mapping[str, Any]
) -> None:
    """The steps of one or more drives, one line each, the cycle in front; in JSON as "steps" beside the rows."""
    if path.suffix.lower() == ".json":
        names = list(steps)
        lines = zip(*(map(_existing, values) for values in steps.values()), strict=True)
        records = [dict(zip(names, line, strict=True)) for line in lines]
        whole = {**result(comparison, about), "steps": records}
        write_whole(path, json.dumps(whole, allow_nan=False).encode())
    else:
        lines = len(next(iter(steps.values()), ()))
        _write_columns(path, {"cycle": [comparison.cycle] * lines, **steps}, about)


def step_columns(case: Case, trajectory: Trajectory) -> dict[str, Any]:
    """Column name to (time,) values: what the cycle asks, then what the car does, every power and loss.

    Step k goes from time_s to time_s + step_s; speed_mps is its mean, distance_m that driven at its end.
    nox_kg: None where the engine has no data on it
    """
    cycle, problem = case.cycle, case.problem
    step_s, speed = np.diff(cycle.time_s), cycle.speed_mps
    asked = {
        "time_s": problem.table.time_s,
        "step_s": problem.table.step_s,
        "speed_start_mps": speed[:-1],
        "speed_end_mps": speed[1:],
        "acceleration_mps2": np.diff(speed) / step_s,
        "grade": cycle.grade[:-1],
        "distance_m": np.cumsum(step_s * (speed[1:] + speed[:-1]) / 2),
    }
    columns = asked | _trajectory_columns(problem, trajectory)
    if not case.car.engine.nox_known:
        columns["nox_kg"] = [None] * len(step_s)
    return columns


def _trajectory_columns(problem: Problem, trajectory: Trajectory) -> dict[str, Any]:
    """Column name to (time,) values of a trajectory."""
    table = problem.table
    labels = [table.controls[c] for c in trajectory.control]
    columns: dict[str, Any] = {"time_s": table.time_s, "step_s": table.step_s}
    if table.signals is not None:
        columns["speed_mps"] = table.signals.speed_mps
        columns["gear"] = table.signals.gear
        columns["clutch_open"] = table.signals.clutch_open.astype(int)
    columns |= {
        "engine_on": [int(label.engine_on) for label in labels],
        "machine_gear": [label.machine_gear for label in labels],
        "engine_gear_chosen": [label.engine_gear for label in labels],
        "level": [label.level for label in labels],
        "soc": trajectory.soc[:-1],
        "soc_after": trajectory.soc[1:],
        "energy_j": trajectory.energy_j[:-1],
        "fuel_kg": trajectory.fuel_kg,
        "switch_fuel_kg": trajectory.switch_fuel_kg,
        "nox_kg": trajectory.nox_kg,
        "battery_power_w": trajectory.battery_power_w,
    }
    columns |= trajectory.flows
    if table.missing_torque_nm is not None:
        columns["missing_torque_nm"] = table.missing_torque_nm
    residuals = {
        f"residual_{name.replace(' ', '_')}_w": r for name, r in trajectory.residuals.items()
    }
    return columns | residuals


def joined(cases: Sequence[tuple[Row, Columns]]) -> dict[str, list[Any]]:
    """One table of several drives, architecture and strategy in front; None where a drive lacks a column."""
    names = dict.fromkeys(name for _, columns in cases for name in columns)
    table: dict[str, list[Any]] = {"architecture": [], "strategy": [], **{n: [] for n in names}}
    for row, columns in cases:
        steps = len(columns["time_s"])
        table["architecture"] += [row.architecture] * steps
        table["strategy"] += [row.strategy] * steps
        for name in names:
            table[name] += list(columns.get(name, [None] * steps))
    return table


def _write_columns(path: Path, columns: Columns, about: Mapping[str, Any]) -> None:
    if path.suffix.lower() == ".parquet":
        write_whole(path, _parquet(columns, about))
        return
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    for values in zip(*columns.values(), strict=True):
        writer.writerow(csv_cells(map(_existing, values)))
    write_whole(path, text.getvalue().encode())


def _parquet(columns: Columns, about: Mapping[str, Any]) -> bytes:
    import pyarrow
    from pyarrow import parquet

    arrays = {name: list(map(_existing, values)) for name, values in columns.items()}
    table = pyarrow.table(arrays).replace_schema_metadata({"hevopt": json.dumps(about)})
    contents = io.BytesIO()
    parquet.write_table(table, contents)
    return contents.getvalue()


def _existing(value: Any) -> Any:
    """A plain Python value; None for a number that is none."""
    value = value.item() if isinstance(value, np.generic) else value
    return None if isinstance(value, float) and not isfinite(value) else value
