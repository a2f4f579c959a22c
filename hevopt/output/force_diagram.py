"""The tractive-force diagram: force in every gear over speed, resistance on slopes, and what the tyres hold."""

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from hevopt.forward.performance import Performance
from hevopt.measured.plot import png, vectors
from hevopt.units import KMH_PER_MPS, STANDARD_GRAVITY_MPS2

_SLOPES = (0.0, 0.05, 0.10, 0.20, 0.30)
_COLOURS = ("#0b6e99", "#c2571a", "#3a7d44", "#7b4f9d", "#8a6d1d", "#444444")


def force_diagram(found: Sequence[Performance], kind: str) -> bytes:
    """A picture of one or more cars, resistance being the first one's; kind: "png", "svg" or "pdf"."""
    figure = Figure(figsize=(9, 6), layout="constrained")
    axes = figure.subplots()
    first = found[0].curves
    weight = found[0].car.vehicle.mass_kg * STANDARD_GRAVITY_MPS2
    kmh = first.speed_mps * KMH_PER_MPS
    for n, of in enumerate(found):
        for gear, force in enumerate(of.curves.by_gear_n):
            label = of.name if gear == 0 else None
            axes.plot(
                kmh, force / 1e3, color=_COLOURS[n % len(_COLOURS)], linewidth=1.2, label=label
            )
    for slope in _SLOPES:
        against = first.resistance_n + weight * np.sin(np.arctan(slope))
        axes.plot(kmh, against / 1e3, color="#999999", linewidth=0.8)
        axes.annotate(f"{slope:.0%}", (kmh[700], against[700] / 1e3), color="#666666", fontsize=8)
    axes.axhline(first.grip_n / 1e3, color="black", linestyle="--", linewidth=0.9, label="grip")
    axes.set(
        xlabel="speed, km/h", ylabel="force at the tyres, kN", xlim=(0, 230),
        ylim=(0, 1.05 * max(np.nanmax(of.curves.by_gear_n) for of in found) / 1e3),
        title="full load in every gear, resistance on slopes",
    )  # fmt: skip
    axes.legend()
    return png(figure) if kind == "png" else vectors(figure, kind)
