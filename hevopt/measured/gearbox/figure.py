"""A gearbox's measured efficiency over torque with the map between the points, gear by gear."""

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from hevopt.car.grid import interpolated
from hevopt.display.axes import BLUE, GREEN, GREY, RED, plain
from hevopt.measured.gearbox.grid import MeasuredGear
from hevopt.measured.gearbox.points import GearPoints
from hevopt.measured.plot import png
from hevopt.units import RPM_PER_RADPS

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_COLUMNS = 3
_PLACES = ((0.15, BLUE), (0.5, GREEN), (0.9, RED))


def gearbox_figure(name: str, points: GearPoints, grids: tuple[MeasuredGear, ...]) -> bytes:
    """A PNG with a panel a gear: efficiency by direction of power at three speeds."""
    rows = -(-len(grids) // _COLUMNS)
    figure = Figure(figsize=(11, 3.2 * rows + 0.6), layout="constrained")
    panels = figure.subplots(rows, _COLUMNS, squeeze=False, sharey=True).ravel()
    for panel, grid in zip(panels, grids, strict=False):
        _gear(panel, points, grid)
    for panel in panels[len(grids) :]:
        panel.set_visible(False)
    figure.supxlabel("input torque, Nm")
    figure.supylabel("efficiency")
    figure.suptitle(plain(name))
    return png(figure)


def _gear(panel: "Axes", points: GearPoints, grid: MeasuredGear) -> None:
    data = grid.data
    torque = np.linspace(data.torque_nm[0], data.torque_nm[-1], 400)
    for share, colour in _PLACES:
        speed = data.speed_radps[round(share * (len(data.speed_radps) - 1))]
        loss = interpolated(data.speed_radps, data.torque_nm, data.loss_nm, torque, np.array(speed))
        panel.plot(torque, _efficiency(torque, loss), color=colour, linewidth=1,
                   label=f"{speed * RPM_PER_RADPS:.0f} rpm")  # fmt: skip
        near = grid.points[np.abs(points.speed_radps[grid.points] / speed - 1) < 0.01]
        panel.plot(points.torque_nm[near], _efficiency(points.torque_nm[near], points.loss_nm[near]), ".",
                   color=colour, markersize=3)  # fmt: skip
    panel.set(title=f"gear {grid.number}", ylim=(0, 1.02))
    panel.grid(color=GREY, alpha=0.25)
    panel.legend(frameon=False, fontsize="x-small", loc="lower right")


def _efficiency(torque: np.ndarray, loss: np.ndarray) -> np.ndarray:
    """By the direction of power; NaN where the input gives power and none comes out."""
    with np.errstate(invalid="ignore", divide="ignore"):
        driving, overrun = 1 - loss / torque, 1 / (1 - loss / torque)
    found = np.where(torque > 0, driving, overrun)
    return np.where((torque != 0) & (found >= 0), found, np.nan)
