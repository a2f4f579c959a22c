"""What differs between two saved comparisons of the same cycle: inputs, cars, settings, versions and figures."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import NamedTuple

from hevopt.pages.comparison.results import Results, RowFigures
from hevopt.pages.comparison.saved_car import CarAbout
from hevopt.pages.comparison.verdict import best_rows, corrected_cost
from hevopt.pages.render import fixed

# A figure that moves by less, per cent, has not moved.
MOVED_PERCENT = 0.005
_NONE = "–"


@dataclass(frozen=True, slots=True)
class SavedComparison:
    """What an index needs of a saved comparison, traces left behind.

    rows: architecture and strategy -> figures; about: car -> what it is, where known; best: the best row's name
    """

    file: str
    cycle: str
    nox_weight: float
    command: str
    changes: tuple[str, ...]
    inputs: Mapping[str, str]
    versions: Mapping[str, str]
    rows: Mapping[str, RowFigures]
    about: Mapping[str, CarAbout]
    best: str | None


class Difference(NamedTuple):
    """One thing that differs: of which kind, what, before and after."""

    kind: str
    what: str
    before: str
    after: str


class Moved(NamedTuple):
    """A row that both have: its corrected cost before and after, l/100 km, and the change in per cent."""

    name: str
    before: float
    after: float
    percent: float


def saved_comparison(file: str, results: Results) -> SavedComparison:
    """What an index needs of results."""
    best = best_rows(results)
    return SavedComparison(
        file=file,
        cycle=results.cycle,
        nox_weight=results.nox_weight,
        command=results.command,
        changes=tuple(results.changes),
        inputs=dict(results.inputs),
        versions=dict(results.versions),
        rows={_name(row.figures): row.figures for row in results.rows},
        about={n: car.about for n, car in results.cars.items() if car.about is not None},
        best=_name(best[0]) if best else None,
    )


def _name(row: RowFigures) -> str:
    return f"{row.architecture} {row.strategy}"


def differences(before: SavedComparison, after: SavedComparison) -> list[Difference]:
    """Everything that was put in differently, inputs first."""
    found = [*_of_mapping("input file", _short(before.inputs), _short(after.inputs))]
    for car in before.about.keys() & after.about.keys():
        found += _of_mapping(f"car {car}", _facts(before, car), _facts(after, car))
    settings = [
        {"weight on NOx": f"{s.nox_weight:g}", "command": s.command, "changes": " · ".join(s.changes) or _NONE}
        for s in (before, after)
    ]  # fmt: skip
    found += _of_mapping("setting", *settings)
    found += _of_mapping("version", before.versions, after.versions)
    return sorted(found, key=lambda d: (_ORDER.index(d.kind.split(" ")[0]), d.kind, d.what))


_ORDER = ("input", "car", "setting", "version")


def _of_mapping(
    kind: str, before: Mapping[str, str], after: Mapping[str, str]
) -> Iterator[Difference]:
    for what in before.keys() | after.keys():
        pair = before.get(what, _NONE), after.get(what, _NONE)
        if pair[0] != pair[1]:
            yield Difference(kind, what, *pair)


def _short(digests: Mapping[str, str]) -> dict[str, str]:
    return {file: digest[:12] for file, digest in digests.items()}


def _facts(saved: SavedComparison, car: str) -> dict[str, str]:
    """A car's figures as text; nothing of a car that is not there."""
    about = saved.about.get(car)
    if about is None:
        return {}
    told = {
        "mass, kg": f"{about.mass_kg:g}",
        "engine": f"{about.engine}, {about.engine_w / 1e3:.3g} kW",
        "fuel of a start, g": f"{about.start_fuel_kg * 1e3:g}",
        "battery, kWh": f"{about.battery_j / 3.6e6:.4g}",
        "battery's window, kWh": f"{about.window_j / 3.6e6:.4g}",
        "functions": ", ".join(about.functions) or _NONE,
        "gears from": about.gears,
    }
    for machine in about.machines:
        power = _NONE if machine.power_w is None else f"{machine.power_w / 1e3:.4g} kW"
        told[machine.name] = f"{machine.component}, {power}"
    for part in about.parts:
        told[part.name] = " ".join(filter(None, [part.kind, part.note, ", ".join(part.shafts)]))
    return told


def moved(before: SavedComparison, after: SavedComparison) -> list[Moved]:
    """Rows that both have and that moved, the largest change first; empty where the objectives differ."""
    found = []
    if before.nox_weight != after.nox_weight:
        return []
    for name, row in before.rows.items():
        costs = [corrected_cost(r) for r in (row, after.rows.get(name, row)) if r is not None]
        old, new = costs
        if name in after.rows and old and new is not None:
            percent = 100 * (new / old - 1)
            if abs(percent) >= MOVED_PERCENT:
                found.append(Moved(name, old, new, percent))
    return sorted(found, key=lambda line: -abs(line.percent))


def rows_apart(before: SavedComparison, after: SavedComparison) -> list[str]:
    """Rows that only one of them has, in words."""
    gone = [name for name in before.rows if name not in after.rows]
    new = [name for name in after.rows if name not in before.rows]
    return [f"no longer there: {', '.join(gone)}"] * bool(gone) + [f"new: {', '.join(new)}"] * bool(
        new
    )


def cell(saved: SavedComparison, name: str) -> tuple[float | None, str]:
    """The corrected cost of a row and how it is told, a mark included."""
    row = saved.rows.get(name)
    value = None if row is None else corrected_cost(row)
    mark = "" if row is None or row.status.ok else f" ({row.status})"
    return value, fixed(value, ".3f") + mark
