"""A battery's curves at each temperature of its test, fitted or as a table gives them, and what they say."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from hevopt.display.facts import Shown
from hevopt.errors import DataError
from hevopt.measured.battery.events import BatteryEvents, events_of
from hevopt.measured.battery.fit import BatteryFit, fit_battery
from hevopt.measured.battery.samples import BatteryCurves, BatterySamples
from hevopt.measured.clusters import clusters

Array = NDArray[np.float64]

# Temperatures closer than this are one; room temperature is taken where none is asked for.
_APART_C, _ROOM_C = 5.0, 25.0
# Shares of the open-circuit voltage by which a rest may drift, and the rows may lie from the curves.
_DRIFT, _MISS = 1e-3, 0.02


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class MeasuredCurves(Shown):
    """Curves over (node,) states of charge at one temperature, None where it is not known.

    samples, events, fit: what they were fitted to, None of a table of curves
    """

    soc: Array
    open_circuit_v: Array
    discharge_ohm: Array
    charge_ohm: Array
    temperature_c: float | None = None
    samples: BatterySamples | None = None
    events: BatteryEvents | None = None
    fit: BatteryFit | None = None


def from_table(table: BatteryCurves, path: Path) -> tuple[MeasuredCurves, ...]:
    """The curves of a table, one set a temperature; DataError where charge repeats or voltage falls with it."""
    found = []
    for temperature, rows in _by_temperature(table.temperature_c, len(table.soc)):
        rows = rows[np.argsort(table.soc[rows], kind="stable")]
        soc, voltage = table.soc[rows], table.open_circuit_v[rows]
        at = "" if temperature is None else f" at {temperature:.3g} °C"
        if len(rows) < 2:
            raise DataError(f"{path.name}: one row{at}; curves over charge need two or more")
        for bad, what in (
            (
                np.diff(soc) <= 0,
                "the state of charge of the row before, or of another temperature, again",
            ),
            (np.diff(voltage) < 0, "an open-circuit voltage below that at less charge"),
        ):
            if bad.any():
                k = int(np.argmax(bad)) + 1
                raise DataError(
                    f"{path.name}, line {table.lines[rows[k]]}: soc {soc[k]:.4g}, {voltage[k]:.5g} V{at}: {what}; "
                    "correct the row, or name a column of temperature"
                )
        found.append(
            MeasuredCurves(
                soc, voltage, table.discharge_ohm[rows], table.charge_ohm[rows], temperature
            )
        )
    return tuple(found)


def at_temperatures(test: BatterySamples, path: Path) -> tuple[MeasuredCurves, ...]:
    """The curves fitted to a test, one set a temperature; DataError naming file and temperature."""
    found = []
    for temperature, rows in _by_temperature(test.temperature_c, len(test.time_s)):
        part = _rows_of(test, rows)
        at = "" if temperature is None else f", at {temperature:.3g} °C"
        try:
            events = events_of(part)
            fit = fit_battery(part, events)
        except DataError as error:
            raise DataError(f"{path.name}{at}: {error}") from None
        found.append(MeasuredCurves(
            fit.soc, fit.open_circuit_v, fit.discharge_ohm, fit.charge_ohm, temperature, part, events, fit
        ))  # fmt: skip
    return tuple(found)


def _rows_of(test: BatterySamples, rows: NDArray[np.int64]) -> BatterySamples:
    return replace(
        test, time_s=test.time_s[rows], current_a=test.current_a[rows], voltage_v=test.voltage_v[rows],
        soc=test.soc[rows], lines=test.lines[rows],
    )  # fmt: skip


def _by_temperature(
    temperature_c: Array | None, count: int
) -> list[tuple[float | None, NDArray[np.int64]]]:
    """Each temperature, rising, and its rows; one without where no column has it."""
    if temperature_c is None:
        return [(None, np.arange(count))]
    cluster, means = clusters(temperature_c, _APART_C, 0.0)
    return [(float(mean), np.flatnonzero(cluster == k)) for k, mean in enumerate(means)]


def the_asked(
    curves: Sequence[MeasuredCurves], temperature_c: float | None
) -> tuple[MeasuredCurves, list[str]]:
    """The curves that a component takes, and a note where there are several."""
    known = [c.temperature_c for c in curves if c.temperature_c is not None]
    if temperature_c is not None:
        if not known:
            raise DataError(
                "--temperature: the table has no column of it; name it with --column temperature=NAME, or leave "
                "the option out"
            )
        off = [abs(c - temperature_c) for c in known]
        if not min(off) <= _APART_C:
            raise DataError(
                f"--temperature {temperature_c:g}: measured at {', '.join(f'{c:.3g}' for c in known)} °C; name one "
                "of these"
            )
        return curves[int(np.argmin(off))], []
    if len(curves) == 1:
        return curves[0], []
    chosen = int(np.argmin([abs(c - _ROOM_C) for c in known]))
    return curves[chosen], [
        f"temperature: measured at {', '.join(f'{c:.3g}' for c in known)} °C; the component is that of "
        f"{known[chosen]:.3g} °C, nearest to room temperature; choose with --temperature"
    ]


def said_of(curves: Sequence[MeasuredCurves], taken: MeasuredCurves) -> list[str]:
    """What was measured and how near the curves come to it, the component's own first."""
    said = _one(taken)
    for other in curves:
        if other is not taken:
            said += [f"  {line}" for line in _one(other)]
    return said


def _one(curves: MeasuredCurves) -> list[str]:
    at = "" if curves.temperature_c is None else f"at {curves.temperature_c:.3g} °C: "
    soc, voltage = curves.soc, curves.open_circuit_v
    said = [
        f"{at}{len(soc)} states of charge, {soc[0]:.4g} to {soc[-1]:.4g}; open-circuit voltage {voltage[0]:.4g} to "
        f"{voltage[-1]:.4g} V",
        f"resistance: discharging {_range(curves.discharge_ohm)}, charging {_range(curves.charge_ohm)}",
    ]
    if curves.fit is None or curves.events is None or curves.samples is None:
        return [*said, "as the table gives them, nothing fitted"]
    return [*said, *_fitted(curves.events, curves.fit, curves.samples.lines)]


def _fitted(events: BatteryEvents, fit: BatteryFit, lines: NDArray[np.int64]) -> list[str]:
    said = [_used(events)]
    loaded = fit.told_discharge, fit.told_charge
    for told, name, other in zip(
        loaded, ("discharging", "charging"), ("charging", "discharging"), strict=True
    ):
        if not told.any():
            said.append(
                f"{name}: no load in this direction; ASSUMED that its resistance is that of {other}"
            )
        elif not told.all():
            said.append(
                f"{name}: no load near {np.sum(~told)} of {len(told)} states of charge; ASSUMED there: that of the "
                "nearest"
            )
    said += _apart(events, fit)
    rms, worst = float(np.sqrt(np.mean(fit.off_v**2))), int(np.argmax(np.abs(fit.off_v)))
    said.append(
        f"fit: to {fit.rows} rows; all {len(fit.off_v)} rows of the test lie {1e3 * rms:.3g} mV (root mean square) "
        f"from Uoc - R I, at most {1e3 * abs(fit.off_v[worst]):.3g} mV (line {lines[worst]} of the file); one "
        "resistance is too high just after a step of current, and knows no relaxation"
    )
    if rms > _MISS * fit.open_circuit_v[0]:
        said.append(
            f"  WARNING: that is more than {100 * _MISS:g} % of the voltage; check capacity, state of charge and "
            "the columns' units"
        )
    if events.drift_v > _DRIFT * fit.open_circuit_v[0]:
        said.append(
            f"  WARNING: voltage still moved by {1e3 * events.drift_v:.3g} mV in the last quarter of a rest; the "
            "open-circuit voltage is off by as much, longer rests are needed"
        )
    return said


def _used(events: BatteryEvents) -> str:
    parts = [f"{len(events.rest)} ends of rests"]
    if len(events.pulse):
        low, high = events.pulse_s.min(), events.pulse_s.max()
        length = f"{low:.3g} s" if high - low < 0.05 * high else f"{low:.3g} to {high:.3g} s"
        parts.append(
            f"{len(events.pulse)} pulses of {length}, the resistance is that after this time"
        )
    if len(events.steady):
        parts.append(f"{len(events.steady)} rows under steady current")
    return "read from " + ", ".join(parts)


def _apart(events: BatteryEvents, fit: BatteryFit) -> list[str]:
    """R0 beside what follows it, where the rows tell them apart."""
    said = []
    for name, all_ohm, ohmic in (
        ("discharging", fit.discharge_ohm, fit.ohmic_discharge_ohm),
        ("charging", fit.charge_ohm, fit.ohmic_charge_ohm),
    ):
        if np.isfinite(ohmic).all():
            said.append(
                f"{name}: R0 {_range(ohmic)} (within {events.jump_s.max():.2g} s of a step), Rct + Rd "
                f"{_range(np.maximum(all_ohm - ohmic, 0.0))}"
            )
    if not said:
        said.append(
            "R0 is not told from Rct + Rd: no two rows are close enough about a step of current; sample faster"
        )
    return said


def _range(ohm: Array) -> str:
    return f"{1e3 * ohm.min():.4g} to {1e3 * ohm.max():.4g} mohm"
