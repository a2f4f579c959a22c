"""A battery's curves over charge, with the measurements that they were fitted to and what these miss by."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from hevopt.display.axes import BLUE, GREEN, GREY, INK, RED, plain
from hevopt.measured.battery.curves import MeasuredCurves
from hevopt.measured.plot import png

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_POINTS = 4000
_COLOURS = (BLUE, RED, GREEN, INK)


def battery_figure(name: str, curves: Sequence[MeasuredCurves]) -> bytes:
    """A PNG: open-circuit voltage, resistances, and of a fit the residuals; a colour each temperature."""
    fitted = any(c.fit is not None for c in curves)
    figure = Figure(figsize=(9, 9 if fitted else 6.5), layout="constrained")
    axes = figure.subplots(3 if fitted else 2, 1, sharex=True)
    for n, one in enumerate(curves):
        colour = _COLOURS[n % len(_COLOURS)]
        _curves(axes, one, colour)
        if one.fit is not None and one.samples is not None and one.events is not None:
            rest = one.events.rest
            axes[0].plot(
                one.samples.soc[rest], one.samples.voltage_v[rest], "o", color=colour, markersize=3
            )
            off = 1e3 * one.fit.off_v
            every = slice(None, None, 1 + len(off) // _POINTS)
            axes[2].plot(one.samples.soc[every], off[every], ".", color=colour, markersize=2)
    axes[0].set_ylabel("open-circuit voltage, V")
    axes[1].set(ylabel="resistance, mΩ", ylim=(0, None))
    axes[1].legend(frameon=False, ncols=2, fontsize="small")
    if fitted:
        axes[2].axhline(0, color=GREY, linewidth=0.8)
        axes[2].set_ylabel("measured less fitted, mV")
    axes[-1].set_xlabel("state of charge")
    for each in axes:
        each.grid(color=GREY, alpha=0.25)
    figure.suptitle(plain(name))
    return png(figure)


def _curves(axes: "Sequence[Axes]", one: MeasuredCurves, colour: str) -> None:
    at = "" if one.temperature_c is None else f", {one.temperature_c:.3g} °C"
    axes[0].plot(one.soc, one.open_circuit_v, color=colour, linewidth=1.2)
    for label, ohm, style in (
        ("discharging", one.discharge_ohm, "-"), ("charging", one.charge_ohm, "--"),
    ):  # fmt: skip
        axes[1].plot(one.soc, 1e3 * ohm, style, color=colour, linewidth=1.2, label=f"{label}{at}")
    if one.fit is None:
        axes[1].plot(one.soc, 1e3 * one.discharge_ohm, "o", color=colour, markersize=3)
        axes[0].plot(one.soc, one.open_circuit_v, "o", color=colour, markersize=3)
        return
    for ohm, label in (
        (one.fit.ohmic_discharge_ohm, "R0 alone, discharging"), (one.fit.ohmic_charge_ohm, "R0 alone, charging"),
    ):  # fmt: skip
        if np.isfinite(ohm).all():
            axes[1].plot(one.soc, 1e3 * ohm, ":", color=colour, linewidth=1.2, label=f"{label}{at}")
