"""Plots as bytes of a file: what a map covers, and a coast-down with its fit. Same data, same bytes."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from hevopt.car_files.engine import EngineFile
from hevopt.display.axes import plain
from hevopt.measured.maps.envelope import Envelope, accepted, envelope_of
from hevopt.measured.maps.gaps import WIDE, lowest_fired_nm, widest_gap
from hevopt.measured.maps.request import ImportedMap
from hevopt.measured.plot import png
from hevopt.units import RPM_PER_RADPS

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Array = NDArray[np.float64]

# Cells of the plot along each axis, finer than its pixels are wide.
_CELLS = 500
# Share of the axes that a label keeps free around it.
_LABEL_ROOM = 0.06


def map_figure(imported: ImportedMap) -> bytes:
    """Coverage of a map: what a car can use, measured points, limits, and efficiency as contours."""
    figure = Figure(figsize=(9, 6), layout="constrained")
    axes = figure.subplots()
    file = imported.file
    speed, torque, usable = covered_mesh(imported)
    ends = [e * RPM_PER_RADPS for e in (speed[0, 0], speed[-1, 0])] + [torque[0, 0], torque[0, -1]]
    axes.imshow(
        np.where(usable, 1.0, np.nan).T, cmap="Greens", vmin=0, vmax=3, origin="lower", aspect="auto",
        extent=ends, interpolation="nearest",
    )  # fmt: skip
    _efficiency_contours(axes, imported, speed, torque, usable)
    points = imported.lines.points
    axes.plot(
        points.speed_radps * RPM_PER_RADPS, points.torque_nm, ".", color="#444444", markersize=3,
        label=f"{len(points.value)} measured points",
    )  # fmt: skip
    envelope = envelope_of(file)
    high, low = ("full load", "motoring") if isinstance(file, EngineFile) else ("limit", None)
    axes.plot(envelope.speed_radps * RPM_PER_RADPS, envelope.high_nm, "k-", label=high)
    axes.plot(envelope.speed_radps * RPM_PER_RADPS, envelope.low_nm, "k--", label=low)
    _doubts(axes, imported, envelope)
    axes.set(
        xlabel="speed, rpm", ylabel="torque, Nm", title=plain(f"{file.name}: what the map covers")
    )
    axes.legend(loc="upper right")
    return png(figure)


def _doubts(axes: "Axes", imported: ImportedMap, envelope: Envelope) -> None:
    """Hatches where an engine's flow is assumed, and a ring around a wide gap between points."""
    if isinstance(imported.file, EngineFile):
        lowest = lowest_fired_nm(imported.lines, envelope.speed_radps)
        axes.fill_between(
            envelope.speed_radps * RPM_PER_RADPS, envelope.low_nm, np.minimum(lowest, envelope.high_nm),
            where=lowest > envelope.low_nm, facecolor="none", edgecolor="#b00020", hatch="///", linewidth=0,
            label="assumed, not measured",
        )  # fmt: skip
    gap = widest_gap(imported.lines, envelope)
    if gap is not None and gap.times > WIDE:
        turn = np.linspace(0, 2 * np.pi, 100)
        axes.plot(
            (gap.speed_radps + gap.reach[0] * np.cos(turn)) * RPM_PER_RADPS,
            gap.torque_nm + gap.reach[1] * np.sin(turn),
            "-", color="#b00020", label="wide gap between points",
        )  # fmt: skip


def covered_mesh(imported: ImportedMap) -> tuple[Array, Array, NDArray[np.bool_]]:
    """(speed, torque) centres of the plot's cells over the map and the limits, and which are usable."""
    grid, envelope = imported.grid, envelope_of(imported.file)
    low = min(grid.torque_nm[0], envelope.low_nm.min())
    high = max(grid.torque_nm[-1], envelope.high_nm.max())
    speeds = grid.speed_radps[0], grid.speed_radps[-1]
    shares = (np.arange(_CELLS) + 0.5) / _CELLS
    axis = [a + shares * (b - a) for a, b in (speeds, (low, high))]
    speed, torque = np.meshgrid(*axis, indexing="ij")
    return speed, torque, accepted(imported, speed, torque)


def _efficiency_contours(
    axes: "Axes", imported: ImportedMap, speed: Array, torque: Array, usable: NDArray[np.bool_]
) -> None:
    flow, file = imported.grid.at(torque, speed), imported.file
    power = np.where(torque * speed == 0, np.nan, np.abs(torque * speed))
    with np.errstate(invalid="ignore", divide="ignore"):
        if isinstance(file, EngineFile):
            heat = flow * file.fuel.heating_value_mjpkg * 1e6
            efficiency = np.where((torque > 0) & (heat > 0), power / heat, np.nan)
        else:
            efficiency = np.where(torque > 0, power / (power + flow), 1 - flow / power)
    shown = np.ma.masked_invalid(np.where(usable, efficiency, np.nan))
    if not shown.count():
        return
    top = float(shown.max())
    levels = [top * share for share in (0.5, 0.7, 0.8, 0.9, 0.95, 0.98)]
    contours = axes.contour(
        speed * RPM_PER_RADPS, torque, shown, levels=levels, colors="#1b5e20", linewidths=0.8
    )
    size = np.array([np.ptp(speed) * RPM_PER_RADPS, np.ptp(torque)])
    lines = [line / size for level in contours.allsegs for line in level]
    places = [place * size for place in label_places(lines)]
    axes.clabel(contours, fmt=lambda value: f"{value:.0%}", fontsize=8, manual=places)


def label_places(lines: Sequence[Array]) -> list[Array]:
    """A point of each line, (point, 2) with y = 0 at no torque, for its label; none for a line that has no room.

    Near the line's middle, away from other labels and from no torque, where a machine's lines crowd.
    """
    places: list[Array] = []
    for line in lines:
        inner = line[len(line) // 8 : len(line) - len(line) // 8]
        if not len(inner) or np.hypot(*np.ptp(line, axis=0)) < 2 * _LABEL_ROOM:
            continue
        room = np.abs(inner[:, 1])
        for place in places:
            room = np.minimum(room, np.hypot(*(inner - place).T))
        if room.max() >= _LABEL_ROOM:
            wide = np.flatnonzero(room >= min(2 * _LABEL_ROOM, room.max()))
            places.append(inner[wide[len(wide) // 2]])
    return places
