"""What a comparison takes for granted, and what each of it is worth there, where the results tell."""

from collections.abc import Iterator
from itertools import pairwise
from typing import NamedTuple

from hevopt.pages.comparison.energy import (
    BRAKES,
    BURNT,
    LEFT_OUT,
    OF_STARTS,
    TAKEN_IN_BRAKING,
    UNREGAINED,
)
from hevopt.pages.comparison.results import Item, Results, SavedRow, Sensitivity
from hevopt.pages.comparison.saved_car import CarAbout, CarFigures
from hevopt.pages.comparison.verdict import corrected_cost, cost
from hevopt.pages.render import fixed
from hevopt.units import KMH_PER_MPS

_EFFECTS_LISTED = 3
_FROM = {
    "cycle": "gears as the cycle lists them",
    "shift speeds": "gears by the car's own shift speeds",
    "plan": "gears chosen with the plan",
    "none": "no gears to change",
}


class Assumption(NamedTuple):
    """What is assumed; what it is worth here, line by line; to which side it errs."""

    what: str
    here: list[str]
    way: str


def assumptions(results: Results) -> list[Assumption]:
    """The assumptions of a comparison whose cars are known; none of one saved without them."""
    known = list(_known(results))
    if not known:
        return []
    burns = any(one.about.engine_shaft is not None for one in known)
    found = [
        Assumption(
            "The engine, its oil and its catalyst are warm from start to end.",
            ["not modelled, so no figure"] if burns else [],
            "too good, most on short cycles",
        ),
        _starts(known),
        _free_speeds(known),
        _braking(results, known),
        _gears(known),
        Assumption(
            "The cycle's speed is met exactly, and fuel and NOx are those of a steady load."
            if burns
            else "The cycle's speed is met exactly.",
            ["not modelled, so no figure"],
            "either; NOx too good where load changes fast" if burns else "either",
        ),
        _figures(results),
    ]
    return [assumption for assumption in found if assumption.here]


class _Known(NamedTuple):
    """A car with what it is, and its solved rows, the least in cost first."""

    name: str
    car: CarFigures
    about: CarAbout
    rows: list[SavedRow]


def _known(results: Results) -> Iterator[_Known]:
    for name, car in results.cars.items():
        rows = [
            row
            for row in results.rows
            if row.detail is not None and row.figures.architecture == name
        ]
        rows.sort(key=lambda row: corrected_cost(row.figures) or 0.0)
        if car.about is not None and rows:
            yield _Known(name, car, car.about, rows)


def _energy_j(items: list[Item], *names: str) -> float:
    return sum(item.energy_j for item in items if item.name in names)


def _fuel_j(row: SavedRow) -> float:
    return _energy_j(row.detail.energy.taken, BURNT, OF_STARTS) if row.detail else 0.0


def _span(values: list[float], form: str) -> str:
    """The least and the largest of some numbers, or the one that they are."""
    ends = dict.fromkeys(format(value, form) for value in (min(values), max(values)))
    return " to ".join(ends)


def _by_cars(said: list[tuple[str, str]]) -> list[str]:
    """A line for each thing said, after the names of all cars that it is said of."""
    cars: dict[str, list[str]] = {}
    for name, text in said:
        cars.setdefault(text, []).append(name)
    return [f"{', '.join(names)}: {text}" for text, names in cars.items()]


def _starts(known: list[_Known]) -> Assumption:
    lines = []
    for name, _, about, rows in known:
        counts = [float(row.figures.engine_starts or 0) for row in rows]
        shares = []
        for row in rows:
            spun_j = _energy_j(row.detail.energy.spent, UNREGAINED) if row.detail else 0.0
            fuel_j = _fuel_j(row)
            started_j = _energy_j(row.detail.energy.taken, OF_STARTS) if row.detail else 0.0
            shares.append(100 * (started_j + spun_j) / fuel_j if fuel_j > 0 else 0.0)
        if max(counts):
            lines.append(
                (
                    name,
                    f"{about.start_fuel_kg * 1e3:g} g a start; {_span(counts, '.0f')} starts, with spin-up not "
                    f"regained, are {_span(shares, '.1f')} % of the fuel's energy",
                )
            )
    return Assumption(
        "A start costs fuel and spins the engine up, but no time, comfort or wear.",
        _by_cars(lines),
        "too good",
    )


def _free_speeds(known: list[_Known]) -> Assumption:
    """What shafts take up where the engine's speed is free: no plan pays for it, nor is it given back."""
    lines = []
    for name, car, _, rows in known:
        energy, best = rows[0].detail.energy if rows[0].detail else None, rows[0]
        rises_j = 0.0 if energy is None else _energy_j(energy.of_which, LEFT_OUT)
        if rises_j:
            worth = rises_j * car.price_kgpj * car.heating_value_jpkg / max(_fuel_j(best), 1e-9)
            lines.append(
                f"{name}: in {best.figures.strategy} they rise by {rises_j / 1e3:.0f} kJ in all, worth "
                f"{100 * worth:.1f} % of its fuel were nothing of it regained"
            )
    return Assumption(
        "An engine whose speed is free changes it at once, and its shafts' energy with it costs nothing.",
        lines,
        "too good, most where the plan changes speed often; hevopt drive has it",
    )


def _braking(results: Results, known: list[_Known]) -> Assumption:
    lines = []
    for name, car, about, rows in known:
        energy, best = rows[0].detail.energy if rows[0].detail else None, rows[0]
        whole_j = 0.0 if energy is None else _energy_j(energy.of_which, TAKEN_IN_BRAKING)
        if energy is None or "regenerative braking" not in about.functions or not whole_j:
            continue
        brakes_j, price = _energy_j(energy.spent, BRAKES), car.price_kgpj
        share = brakes_j * price * car.heating_value_jpkg / max(_fuel_j(best), 1e-9)
        if results.nox_weight:
            share *= (best.figures.fuel_l_per_100km or 0.0) / max(cost(best.figures), 1e-9)
        of_what = "objective" if results.nox_weight else "fuel"
        worth = f"stored without loss they would be worth {100 * share:.1f} % of its {of_what}"
        lines.append(
            f"{name}: {_braking_words(about)}; in {best.figures.strategy} friction brakes take "
            f"{brakes_j / 1e3:.0f} of {whole_j / 1e3:.0f} kJ of braking, "
            f"{worth if _fuel_j(best) else 'no fuel burnt'}"
        )
    return Assumption(
        "The machine takes its share of the braking, as the car's file says; friction brakes the rest.",
        lines,
        "either",
    )


def _braking_words(about: CarAbout) -> str:
    """The limits at the lowest speed with any share, and from the highest on."""
    points = [p for p in zip(about.braking_mps, about.braking_share, strict=True) if p[1] > 0]
    if not points:
        return "all that machine and battery can take" if not about.braking_mps else "none"
    (low, least), (high, most) = points[0], points[-1]
    return (
        f"at most {100 * least:.0f} % at {low * KMH_PER_MPS:.0f} km/h, {100 * most:.0f} % from "
        f"{high * KMH_PER_MPS:.0f} km/h"
    )


def _gears(known: list[_Known]) -> Assumption:
    lines = []
    for name, _, about, rows in known:
        changes = [float(_changes(row)) for row in rows]
        text = _FROM[about.gears]
        if about.gears != "none":
            gap = (
                f"{about.shift_gap_s:g} s without torque each"
                if about.shift_gap_s
                else "under load"
            )
            text += f"; {_span(changes, '.0f')} changes, {gap}"
        lines.append((name, text))
    if all(one.about.gears == "none" for one in known):
        lines = []
    return Assumption(
        "Gears are not part of what is optimised, but where they are chosen with the plan; a manual gearbox "
        "interrupts.",
        _by_cars(lines),
        "either; --free-gear and --set gearbox.shift_gap_s=0 tell what it is worth",
    )


def _changes(row: SavedRow) -> int:
    gears = row.detail.trace.engine_gear if row.detail else []
    return sum(a != b and a > 0 and b > 0 for a, b in pairwise(gears))


def _figures(results: Results) -> Assumption:
    """The largest effects of the cars' figures on fuel, where they were measured."""
    by_car: dict[str, list[Sensitivity]] = {}
    for line in results.sensitivity or []:
        by_car.setdefault(f"{line.architecture} {line.strategy}", []).append(line)
    lines = []
    for name, effects in by_car.items():
        moved = [
            (
                effect,
                [d for d in (effect.delta_percent[0], effect.delta_percent[-1]) if d is not None],
            )
            for effect in effects
        ]
        moved = [(effect, ends) for effect, ends in moved if ends]
        moved.sort(key=lambda pair: -max(map(abs, pair[1])))
        said = [
            f"{effect.parameter} {_values(effect)}: {' and '.join(fixed(end, '+.1f') for end in ends)} %"
            for effect, ends in moved[:_EFFECTS_LISTED]
        ]
        if said:
            lines.append(f"{name}: {'; '.join(said)} of fuel")
    return Assumption("The cars are what their files say.", lines, "either; see Sensitivity below")


def _values(effect: Sensitivity) -> str:
    return f"{effect.values[0]:.4g} or {effect.values[-1]:.4g} {effect.unit}".strip()
