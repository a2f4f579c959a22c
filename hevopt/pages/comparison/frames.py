"""A saved comparison as tables of pandas: its rows, and what every row does step by step."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

from hevopt.pages.comparison.results import Results, SavedTrace
from hevopt.pages.comparison.saved import load_results
from hevopt.pages.comparison.saved_car import CarFigures
from hevopt.studies.frames import rows_frame
from hevopt.studies.rows import Row

if TYPE_CHECKING:
    import pandas as pd

_LEADING = ("cycle", "architecture", "strategy")


def read_saved(path: str | Path) -> "pd.DataFrame":
    """The rows of a file that `hevopt compare --save` wrote: the table of `Comparison.to_frame`.

    Raises DataError where the file is no saved comparison.
    """
    results = load_results(Path(path))
    rows = (
        Row(**{name: getattr(row.figures, name) for name in Row.__dataclass_fields__})
        for row in results.rows
    )
    return rows_frame(results.cycle, rows)


def read_saved_steps(path: str | Path) -> "pd.DataFrame":
    """The steps of every solved row of a file that `hevopt compare --save` wrote, one line each.

    What is a state is told at the step's start and at its end; figures are rounded as saved. operation: what the
    car does in the step, in words; engine_gear: 0 where no gear is engaged. Raises DataError where the file is no
    saved comparison.
    """
    import pandas as pd

    results = load_results(Path(path))
    tables = [
        pd.DataFrame(_steps_of(results, results.cars[row.figures.architecture], row.detail.trace))
        .assign(**{name: getattr(row.figures, name) for name in _LEADING[1:]})
        .assign(cycle=results.cycle)
        for row in results.rows
        if row.detail is not None
    ]
    whole = pd.concat(tables or [pd.DataFrame(columns=list(_LEADING))], ignore_index=True)
    return whole[[*_LEADING, *whole.columns.drop(list(_LEADING))]]


def _steps_of(results: Results, car: CarFigures, trace: SavedTrace) -> dict[str, Any]:
    """Column name -> value of each step."""
    of_car = ("time_s", "step_s", "speed_mps", "wheel_power_w", "missing_torque_nm")
    driven = trace.model_dump(exclude={"soc", "operation"})
    return {
        **{name: getattr(car, name) for name in of_car},
        "operation": [results.operations[n] for n in trace.operation],
        "soc_start": trace.soc[:-1],
        "soc_end": trace.soc[1:],
        **driven,
    }
