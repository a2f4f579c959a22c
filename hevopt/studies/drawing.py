"""Rows as a plot: what each needs, and the bound that none can undercut."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from hevopt.display.axes import BLUE, GREY, INK, RED, axes_of, plain
from hevopt.studies.rows import Row

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_ROW_IN, _FRAME_IN = 0.3, 1.2


def draw_rows(
    cycle: str, rows: Sequence[Row], nox_weight: float = 0.0, axes: "Axes | None" = None
) -> "Axes":
    """A line per row: a dot for fuel (with a weight on NOx, for the sum), a stroke for its bound, both in words."""
    (drawn,) = axes_of(1, axes, _FRAME_IN + _ROW_IN * max(len(rows), 3))
    for n, row in enumerate(rows):
        _draw_row(drawn, n, row, _reached(row, nox_weight))
    names = [plain(f"{row.architecture}  {row.strategy}") for row in rows]
    drawn.set_yticks(range(len(rows)), names)
    drawn.set_ylim(len(rows) - 0.4, -0.6)
    drawn.margins(x=0.25)
    drawn.grid(axis="y", color=GREY, alpha=0.25)
    objective = f"fuel + {nox_weight:g} x NOx as fuel" if nox_weight else "fuel"
    drawn.set_xlabel(f"{objective}, l/100 km")
    drawn.set_title(plain(f"cycle {cycle}"), loc="left")
    handles, labels = drawn.get_legend_handles_labels()
    once = dict(zip(labels, handles, strict=True))
    if once:
        drawn.legend(
            once.values(), once.keys(), loc="lower right", bbox_to_anchor=(1, 1), ncols=len(once),
            frameon=False, fontsize="small",
        )  # fmt: skip
    return drawn


def _draw_row(drawn: "Axes", n: int, row: Row, reached: float | None) -> None:
    """The n-th row from the top."""
    beside: dict[str, Any] = {"va": "center", "fontsize": "small"}
    if reached is None:
        drawn.annotate(" failed", (0.0, n), xycoords=("axes fraction", "data"), color=RED, **beside)
        return
    least, ok = row.bound_l_per_100km, row.status.ok
    if least is not None:
        drawn.plot([least, reached], [n, n], color=GREY, linewidth=1.5, zorder=1)
        drawn.plot(least, n, "|", color=INK, markersize=11, label="proven bound")
    drawn.plot(
        reached, n, "o", color=BLUE if ok else RED, fillstyle="full" if ok else "none",
        label="reached" if ok else "reached, marked",
    )  # fmt: skip
    offset: dict[str, Any] = {"xytext": (9, 0), "textcoords": "offset points"}
    drawn.annotate(_words(row, reached), (reached, n), color=INK, **beside, **offset)


def _reached(row: Row, nox_weight: float) -> float | None:
    """What a row's bound speaks of: fuel, or with a weight on NOx the sum of both."""
    if nox_weight and row.bound_l_per_100km is not None and row.gap_percent is not None:
        return row.bound_l_per_100km * (1 + row.gap_percent / 100)
    return row.fuel_l_per_100km


def _words(row: Row, reached: float) -> str:
    gap = [] if row.gap_percent is None else [f"gap {max(0.0, row.gap_percent):.3f} %"]
    marks = [] if row.status.ok else [plain(str(row.status))]
    return ", ".join([f"{reached:.3f}", *gap, *marks])
