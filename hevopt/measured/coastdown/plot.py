"""Carried out of hevopt/imports/figures.py."""

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from hevopt.measured.coastdown.fit import RoadLoad, Run
from hevopt.units import KMH_PER_MPS

if TYPE_CHECKING:
    pass
from hevopt.measured.plot import png, vectors

_COLOURS = {1: "#0b6e99", -1: "#c2571a"}


def coastdown_figure(runs: list[Run], fit: RoadLoad, kind: str) -> bytes:
    """Speeds with the fit, what is left, and the resistance with its 95 % band; kind: "png", "svg" or "pdf"."""
    figure = Figure(figsize=(9, 10), layout="constrained")
    speeds, residuals, force = figure.subplots(3, 1, height_ratios=(2, 1, 2))
    said: set[int] = set()
    for run, fitted in zip(runs, fit.speeds_mps, strict=True):
        t, colour = run.time_s - run.time_s[0], _COLOURS[run.direction]
        label = None if run.direction in said else f"direction {run.direction:+d}"
        said.add(run.direction)
        speeds.plot(t, run.speed_mps * KMH_PER_MPS, ".", color=colour, markersize=2, label=label)
        speeds.plot(t, fitted * KMH_PER_MPS, "-", color="black", linewidth=0.7)
        residuals.plot(t, (run.speed_mps - fitted) * KMH_PER_MPS, "-", color=colour, linewidth=0.7)
    low = min(run.speed_mps.min() for run in runs)
    high = max(run.speed_mps.max() for run in runs)
    v = np.linspace(low, high, 100)
    resistance, half = fit.force_n(v)
    force.plot(v * KMH_PER_MPS, resistance, "k-", label="both directions")
    force.fill_between(
        v * KMH_PER_MPS,
        resistance - half,
        resistance + half,
        color="#bbbbbb",
        label="95 % confidence",
    )
    speeds.set(xlabel="time, s", ylabel="speed, km/h", title="coast-down: samples and fit (black)")
    residuals.set(xlabel="time, s", ylabel="sample less fit, km/h")
    force.set(xlabel="speed, km/h", ylabel="resistance, N")
    for axes in (speeds, force):
        axes.legend()
    return png(figure) if kind == "png" else vectors(figure, kind)
