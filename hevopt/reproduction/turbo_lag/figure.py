"""The torque hole and the machines that fill it, as a picture."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from hevopt.display.axes import BLUE, GREEN, GREY, INK, RED
from hevopt.mean_value import states as s
from hevopt.measured.plot import png
from hevopt.reproduction.turbo_lag.cases import Filled, TurboLag

_LAST_S = 5.0
_STYLES = {"C1": (BLUE, "-"), "C2": (GREEN, "--"), "D": (RED, "-"), "E": (INK, ":")}


def filled_figure(found: TurboLag) -> bytes:
    """A PNG: acceleration by steady map, alone and helped, and what the machines give, a column per manoeuvre."""
    pedals = list(dict.fromkeys(filled.pedal for filled in found.filled))
    figure = Figure(figsize=(10, 7), layout="constrained")
    axes = figure.subplots(2, len(pedals), sharex=True, sharey="row", squeeze=False)
    for column, pedal in enumerate(pedals):
        of = [filled for filled in found.filled if filled.pedal == pedal]
        _accelerations(axes[0, column], of)
        _powers(axes[1, column], of)
        axes[0, column].set_title(pedal.text, loc="left")
        axes[1, column].set_xlabel("time after the pedal begins to move, s")
    axes[0, 0].set_ylabel("acceleration, m/s²")
    axes[1, 0].set_ylabel("power of the machine, kW")
    for each in axes.ravel():
        each.grid(color=GREY, alpha=0.25)
        each.set_xlim(0, _LAST_S)
        each.set_ylim(bottom=0)
    axes[0, 0].legend(loc="lower right", frameon=False, fontsize="small")
    axes[1, -1].legend(loc="upper right", frameon=False, fontsize="small")
    return png(figure)


def _accelerations(drawn: Axes, of: list[Filled]) -> None:
    first = of[0]
    time_s = first.alone.run.time_s
    drawn.plot(
        time_s, first.alone.by_map["accel_mps2"], color=GREY, linewidth=5, alpha=0.5,
        label=f"{first.car} by its steady map",
    )  # fmt: skip
    drawn.plot(
        time_s, first.alone.run["accel_mps2"], color=GREY, linewidth=1.5, label=f"{first.car} alone"
    )
    for filled in of:
        colour, line = _STYLES[filled.car]
        drawn.plot(
            time_s, filled.helped.run["accel_mps2"], line, color=colour, linewidth=1.3,
            label=f"{filled.car} with its machine",
        )  # fmt: skip


def _powers(drawn: Axes, of: list[Filled]) -> None:
    for filled in of:
        colour, line = _STYLES[filled.car]
        run = filled.helped.run
        power = np.gradient(run.states[:, s.ASSIST_WORK], run.time_s)
        drawn.plot(run.time_s, power / 1e3, line, color=colour, linewidth=1.3, label=filled.car)
