"""What rows burn from a cold start, for the terminal and as JSON."""

from typing import Any

from rich import box
from rich.table import Table

from hevopt.files.shown import printable
from hevopt.studies.cold_start import ColdStarts


def cold_table(cold: ColdStarts) -> Table:
    """A line per row: its warm fuel, with what the cold engine burns more, and how warm it gets."""
    title = (
        f"started cold at {cold.start_c:g} °C: a correction after the solution; strategies and bounds are those of "
        "the warm car" + ("" if cold.figures else "; no row has an engine that warms up")
    )
    table = Table(box=box.SIMPLE_HEAD, title=title, title_justify="left")
    for head in ("car", "strategy"):
        table.add_column(head)
    for head in ("warm l/100km", "cold l/100km", "more %", "coolant at end °C", "warm after s"):
        table.add_column(head, justify="right")
    for (car, strategy), figures in cold.figures.items():
        table.add_row(
            printable(car), printable(strategy),
            f"{figures.warm_l_per_100km:.3f}", f"{figures.cold_l_per_100km:.3f}",
            f"{figures.added_percent:+.1f}", f"{figures.coolant_end_c:.0f}",
            "never" if figures.warm_after_s is None else f"{figures.warm_after_s:.0f}",
        )  # fmt: skip
    return table


def cold_contents(cold: ColdStarts) -> dict[str, Any]:
    """{"start_c", "rows"}: each row by car and strategy, its figures by their names."""
    rows = [
        {"architecture": car, "strategy": strategy, **figures.as_dict()}
        for (car, strategy), figures in cold.figures.items()
    ]
    return {"start_c": cold.start_c, "rows": rows}
