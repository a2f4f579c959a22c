"""Plots that a user asks an object for: on axes of their own, or on those given.

A value per step is drawn as a level over its step, a value per end of a step as a line. matplotlib is imported
where something is drawn, not before.
"""

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hevopt.errors import DataError
from hevopt.units import KMH_PER_MPS

if TYPE_CHECKING:
    from matplotlib.axes import Axes

INK, BLUE, RED, GREEN, GREY = "#24292f", "#1f6feb", "#c93c37", "#1a7f37", "#8b949e"
_COLOURS = (BLUE, RED, GREEN, INK)
_WIDTH_IN, _PANEL_IN = 9.0, 1.9


class Panel(NamedTuple):
    """One of several plots above each other. lines: label -> (time,) or (time + 1,); limits: dashed heights."""

    label: str
    lines: Mapping[str, NDArray[Any]]
    limits: Sequence[float] = ()


def speed_panel(speed_mps: NDArray[np.float64]) -> Panel:
    """A speed, in km/h as drivers have it."""
    return Panel("speed, km/h", {"speed": speed_mps * KMH_PER_MPS})


def drawn_over_time(
    edges_s: NDArray[np.float64],
    panels: Sequence[Panel],
    title: str = "",
    axes: "Axes | Iterable[Axes] | None" = None,
) -> "list[Axes]":
    """The panels above each other; edges_s: (time + 1,) ends of the steps; axes: as many as panels, or new ones."""
    drawn = axes_of(len(panels), axes, _PANEL_IN * len(panels) + 0.5)
    for each, panel in zip(drawn, panels, strict=True):
        for colour, (label, values) in zip(_COLOURS, panel.lines.items(), strict=False):
            style: dict[str, Any] = {"color": colour, "label": label, "linewidth": 1.1}
            if len(values) == len(edges_s):
                each.plot(edges_s, values, **style)
            else:
                each.stairs(values, edges_s, baseline=None, **style)
        for height in panel.limits:
            each.axhline(height, color=GREY, linewidth=0.9, linestyle="--")
        each.set_ylabel(panel.label)
        if len(panel.lines) > 1:
            each.legend(loc="upper left", frameon=False, ncols=len(panel.lines), fontsize="small")
            each.margins(y=0.25)
        each.margins(x=0.01)
    drawn[-1].set_xlabel("time, s")
    drawn[0].set_title(plain(title), loc="left")
    return drawn


def axes_of(
    count: int, axes: "Axes | Iterable[Axes] | None" = None, height_in: float = 4.0
) -> "list[Axes]":
    """The axes given, or new ones above each other; DataError where there are not as many as needed."""
    if axes is None:
        from matplotlib import pyplot

        size = (_WIDTH_IN, height_in)
        _, grid = pyplot.subplots(
            count, 1, sharex=True, squeeze=False, figsize=size, layout="constrained"
        )
        found: list[Axes] = list(grid.flat)
        for each in found:
            each.spines[["top", "right"]].set_visible(False)
        return found
    found = list(axes) if isinstance(axes, Iterable) else [axes]
    if len(found) != count:
        raise DataError(
            f"{len(found)} axes were given to draw on; needed: {count}, as of pyplot.subplots({count}, 1), or none"
        )
    return found


def plain(text: str) -> str:
    """Text without what matplotlib takes for a formula."""
    return text.replace("$", r"\$")
