"""The settled full-load curve of a mean-value engine: a table for the terminal, and a picture."""

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray
from rich.table import Table

from hevopt.car.engine import Engine
from hevopt.mean_value import states as s
from hevopt.mean_value.full_load import FullLoad
from hevopt.measured.plot import png
from hevopt.output.tables import titled_table
from hevopt.units import RPM_PER_RADPS

Array = NDArray[np.float64]

_BAR = 1e5
_HEADS = (
    "rpm", "torque\nNm", "file\nNm", "of file\n%", "boost\nbar", "p4\nbar", "lambda", "turbo\nkrpm", "T4\nK",
    "air\nkg/h", "bsfc\ng/kWh", "map's\n%", "surge\nmargin", "vanes",
)  # fmt: skip


def columns(found: FullLoad, engine: Engine) -> dict[str, Array]:
    """(point,) figures by the names of `_HEADS` without their units."""
    torque, full, speed = found["torque_nm"], found["full_load_nm"], found.speed_radps
    fuel = found["fuel_kgps"]
    return {
        "rpm": speed * RPM_PER_RADPS,
        "torque": torque,
        "file": full,
        "of file": 100 * torque / full,
        "boost": found["p3_pa"] / _BAR,
        "p4": found["p4_pa"] / _BAR,
        "lambda": found["excess_air"],
        "turbo": found.states[:, s.TURBO] * RPM_PER_RADPS / 1e3,
        "T4": found["t4_k"],
        "air": found["air_kgps"] * 3600,
        "bsfc": fuel / (torque * speed) * 3.6e9,
        "map's": 100 * (fuel / engine.fuel_kgps(torque, speed) - 1),
        "surge": found["flow_number"] / found["surge_number"],
        "vanes": found.states[:, s.VANES],
    }


def full_load_table(found: FullLoad, engine: Engine) -> Table:
    """The curve, a row per speed."""
    table = titled_table(f"settled full load, {engine.name}")
    forms = (
        ".0f",
        ".1f",
        ".1f",
        ".1f",
        ".2f",
        ".2f",
        ".2f",
        ".0f",
        ".0f",
        ".0f",
        ".0f",
        "+.1f",
        ".2f",
        ".2f",
    )
    for head in _HEADS:
        table.add_column(head, justify="right", no_wrap=True)
    for row in zip(*columns(found, engine).values(), strict=True):
        table.add_row(*(format(value, form) for value, form in zip(row, forms, strict=True)))
    return table


NOTES = (
    "file: full_load of the engine's file, what the control unit asks for; of file: settled torque over it. "
    "boost: pressure of the intake manifold, absolute; p4, T4: before the turbine; map's: fuel above (+) or "
    "below that of fuel_coefficients or fuel_map at the same torque; surge margin: flow over that at surge, 1 is "
    "surge; vanes: share of the turbine's open area."
)


def full_load_figure(found: FullLoad, engine: Engine) -> bytes:
    """A PNG: torque with the file's curve, pressures, air ratio, turbocharger speed over engine speed."""
    of = columns(found, engine)
    figure = Figure(figsize=(9, 9), layout="constrained")
    axes = figure.subplots(2, 2, sharex=True).ravel()
    rpm = of["rpm"]
    axes[0].plot(rpm, of["file"], "--", color="#888888", label="file")
    axes[0].plot(rpm, of["torque"], "o-", color="#0b6e99", label="settled")
    axes[0].set(ylabel="torque, Nm", ylim=(0, None))
    axes[1].plot(rpm, of["boost"], "o-", color="#0b6e99", label="intake manifold")
    axes[1].plot(rpm, of["p4"], "s-", color="#c2571a", label="exhaust manifold")
    axes[1].set(ylabel="pressure, bar abs.", ylim=(1, None))
    axes[2].plot(rpm, of["lambda"], "o-", color="#0b6e99", label="lambda")
    axes[2].plot(rpm, of["surge"], "^-", color="#5a8f29", label="flow over flow at surge")
    axes[2].set(ylabel="-", xlabel="engine speed, 1/min")
    axes[3].plot(rpm, of["turbo"], "o-", color="#0b6e99", label="turbocharger")
    axes[3].set(ylabel="speed, 1000/min", xlabel="engine speed, 1/min", ylim=(0, None))
    for axis in axes:
        axis.grid(color="#dddddd")
        axis.legend()
    figure.suptitle(f"Settled full load: {engine.name}")
    return png(figure)
