"""Measured points of a compressor or turbine over the compact map that was fitted to them."""

import numpy as np
from matplotlib.figure import Figure

from hevopt.display.axes import BLUE, GREEN, GREY, RED, plain
from hevopt.mean_value.compressor_map import speed_line
from hevopt.mean_value.parameters import Ambient, Gas
from hevopt.measured.maps.compressor import CompressorFit
from hevopt.measured.maps.turbine import TurbineFit
from hevopt.measured.maps.turbo import ImportedTurbo
from hevopt.measured.plot import png
from hevopt.units import RPM_PER_RADPS

_SLOW_LINES = 3


def turbo_figure(imported: ImportedTurbo) -> bytes:
    """A PNG: flow and efficiency, measured as points and fitted as lines."""
    figure = Figure(figsize=(9, 8), layout="constrained")
    if isinstance(imported.fit, CompressorFit):
        _compressor(figure, imported, imported.fit)
    else:
        _turbine(figure, imported, imported.fit)
    figure.suptitle(plain(imported.file.name))
    return png(figure)


def _compressor(figure: Figure, imported: ImportedTurbo, fit: CompressorFit) -> None:
    points, (upper, lower) = imported.points, figure.subplots(2, 1, sharex=True)
    grams, gas, around = 1e3 * fit.flow_kgps, Gas(), Ambient()
    measured = [fit.speed_radps[points.line == k].mean() for k in range(len(points.line_speed))]
    slower = [measured[0] * k / (_SLOW_LINES + 1) for k in range(1, _SLOW_LINES + 1)]
    for speed in [*slower, *measured]:
        line = speed_line(fit.wheel, speed, gas, around)
        known = speed >= measured[0]
        style = {
            "color": BLUE if known else GREY,
            "linestyle": "-" if known else "--",
            "linewidth": 1,
        }
        upper.plot(1e3 * line.flow_kgps, line.ratio, **style)
        lower.plot(1e3 * line.flow_kgps, line.efficiency, **style)
        if not known:
            continue
        upper.annotate(
            f"{speed * RPM_PER_RADPS / 1e3:.0f}", (1e3 * line.flow_kgps[0], line.ratio[0]), fontsize=8,
            ha="right",
        )  # fmt: skip
    upper.plot(grams, points.ratio, "o", color=RED, markersize=3, label="measured")
    lower.plot(grams, points.efficiency, "o", color=RED, markersize=3)
    upper.plot([], [], color=BLUE, label="compact map, krpm")
    upper.plot([], [], "--", color=GREY, label="below the lowest line")
    upper.set_ylabel("pressure ratio")
    lower.set(ylabel="efficiency", xlabel="flow at 25 °C and 1.013 bar, g/s", ylim=(0, 1))
    upper.legend(frameon=False, loc="upper left")
    for axes in (upper, lower):
        axes.grid(color=GREY, alpha=0.25)


def _turbine(figure: Figure, imported: ImportedTurbo, fit: TurbineFit) -> None:
    points, (upper, lower) = imported.points, figure.subplots(2, 1)
    ratio = np.linspace(1.0, points.ratio.max() * 1.05, 200)
    passing = np.sqrt(1 - ratio**-fit.wheel.flow_exponent) / np.sqrt(Gas().constant_jpkgk)
    for area in fit.areas_m2:
        upper.plot(ratio, 1e6 * area * passing, color=BLUE, linewidth=1)
    upper.plot(points.ratio, 1e6 * points.flow, "o", color=RED, markersize=3, label="measured")
    upper.plot([], [], color=BLUE, label="compact map")
    upper.set(xlabel="expansion ratio", ylabel="flow, g/s √K/kPa", ylim=(0, None))
    upper.legend(frameon=False, loc="lower right")
    blade = np.linspace(0.0, max(fit.blade_speed.max(), fit.wheel.blade_speed_ratio) * 1.1, 200)
    z = blade / fit.wheel.blade_speed_ratio
    lower.plot(blade, fit.wheel.efficiency_max * z * (2 - z), color=GREEN, linewidth=1)
    lower.plot(fit.blade_speed, points.efficiency, "o", color=RED, markersize=3)
    lower.set(xlabel="blade speed ratio", ylabel="efficiency", ylim=(0, 1))
    for axes in (upper, lower):
        axes.grid(color=GREY, alpha=0.25)
