"""How fuel and NOx of a car move with its figures: each one lowered and raised alone, everything solved afresh.

Fuel is charge-corrected, so that a change shows and not what was left in the battery. A rule-based strategy
calibrates its thresholds again for each value. The elasticity is per cent of fuel per per cent of the figure, from
the lowest to the highest value: d ln(fuel) / d ln(figure). A value at which the car cannot be solved has no figures
but a reason; all others keep theirs.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from math import log
from pathlib import Path
from typing import Any, Unpack

from hevopt.car.architecture import Architecture
from hevopt.car_files.load import load_architecture
from hevopt.display.facts import Shown
from hevopt.driving.cycle import Cycle, load_cycle
from hevopt.errors import DataError, HevoptError
from hevopt.strategies import Strategy, chosen, fitting, strategy_named
from hevopt.studies.by_car import Progress, unseen
from hevopt.studies.cars import cars_of
from hevopt.studies.case import Case, prepare
from hevopt.studies.comparison import Strategies
from hevopt.studies.given import settings_from
from hevopt.studies.rows import Row
from hevopt.studies.settings import Keywords, Settings
from hevopt.studies.solved import check_horizon, run_case
from hevopt.studies.trials import Trial, trials_of

# Fuel or NOx of less is none: a change against it has no meaning.
_TINY = 1e-9
# The optimum, and the rule that drives the car: the first that fits.
_RULES = ("conventional", "start_stop", "baseline")
_NO_OTHERS: Mapping[str, Strategy] = {}


@dataclass(frozen=True, slots=True, repr=False)
class Effect(Shown):
    """What one parameter does to one strategy's result; lists have one entry per value.

    fuel_l_per_100km: charge-corrected, None where the value cannot be solved; reasons: why, None where it is
    delta_*: change against the car as given, per cent, None where that burns or emits nothing
    elasticity: None where a value or a result is 0 or lacks, or the values cannot be put in proportion
    NOx is None where the engine has no data on it, too
    """

    architecture: str
    strategy: str
    parameter: str
    unit: str
    values: list[float]
    fuel_l_per_100km: list[float | None]
    delta_percent: list[float | None]
    nox_mg_per_km: list[float | None]
    delta_nox_percent: list[float | None]
    elasticity: float | None
    elasticity_nox: float | None
    reasons: list[str | None]

    def _facts(self) -> dict[str, object]:
        names = "architecture", "strategy", "parameter", "values", "delta_percent", "elasticity"
        return {name: getattr(self, name) for name in names}

    def as_dict(self) -> dict[str, Any]:
        """All fields by name, in order."""
        return {f.name: getattr(self, f.name) for f in fields(self)}


def sensitivities(
    architecture: str | Path,
    cycle: Cycle | str | Path = "nedc",
    strategies: Strategies | None = None,
    *,
    progress: Progress | None = None,
    **settings: Unpack[Keywords],
) -> list[Effect]:
    """The effect of every parameter that the architecture has, strategy by strategy.

    architecture: name of a shipped one, or a file
    strategies: as in `compare`, by default dynamic programming and the rule that fits the car
    progress: called with the value that comes next, and how many are done of how many
    settings: the fields of `Settings`, made in the car before any parameter is changed
    Raises DataError for a wrong name, file or setting, HevoptError where the car as given cannot be solved.
    """
    names, others = chosen(strategies)
    told = settings_from("sensitivities", settings, strategies=names)
    cars = cars_of([architecture], told)
    trace = cycle if isinstance(cycle, Cycle) else load_cycle(cycle)
    (car,) = cars.cars
    made, watch = cars.changes[car.name], progress or unseen
    return effects_on(car, made, trace, told, told.strategies, watch, others)


def effects_on(
    car: Architecture,
    made: Mapping[str, Any],
    trace: Cycle,
    settings: Settings,
    strategies: Sequence[str] | None = None,
    progress: Progress = unseen,
    others: Mapping[str, Strategy] = _NO_OTHERS,
) -> list[Effect]:
    """The effects on a car, see `sensitivities`. made: key path -> value of what was changed when it was read."""
    base = {**made, **({"gear": "free"} if car.gear == "free" else {})}
    if load_architecture(car.source, base).contents != car.contents:
        raise DataError(
            f"{car.name} is not what {car.source} holds: sensitivities are of a car as its file has it; give its "
            "name or file, and the changes beside"
        )
    names = list(strategies or _usual(car.marks))
    for name in names:
        strategy_named(name, others)
    check_horizon(settings.horizon_s, names, others)
    trials = trials_of(car.contents)
    total = 1 + sum(1 for trial in trials for changes in trial.changes if changes)
    done = 0

    def solved(changes: Mapping[str, Any], what: str) -> dict[str, Row | HevoptError]:
        nonlocal done
        progress(f"{car.name}: {what}", done, total)
        done += 1
        try:
            case = prepare(load_architecture(car.source, {**base, **changes}), trace, settings)
        except HevoptError as error:
            return dict.fromkeys(names, error)
        return {name: _row(case, name, settings, others) for name in names}

    given = {name: _required(car.name, row) for name, row in solved({}, "as given").items()}
    effects: list[Effect] = []
    for trial in trials:
        found = [
            solved(changes, f"{trial.parameter.name} {value:g}") if changes else given
            for value, changes in zip(trial.values, trial.changes, strict=True)
        ]
        effects += [_effect(trial, given[name], [rows[name] for rows in found]) for name in names]
    return sorted(effects, key=lambda effect: names.index(effect.strategy))


def _row(
    case: Case, strategy: str, settings: Settings, others: Mapping[str, Strategy]
) -> Row | HevoptError:
    try:
        return run_case(case, strategy, settings.horizon_s, others)[0]
    except HevoptError as error:
        return error


def _required(car: str, row: Row | HevoptError) -> Row:
    """The row of the car as given, without which there is nothing to compare with."""
    if isinstance(row, HevoptError):
        raise type(row)(f"{car}, as given: {row}") from None
    return row


def _usual(marks: frozenset[str]) -> list[str]:
    fit = fitting(marks)
    return [name for name in ("dp",) if name in fit] + [n for n in _RULES if n in fit][:1]


def _effect(trial: Trial, given: Row, rows: Sequence[Row | HevoptError]) -> Effect:
    fuel = [None if isinstance(r, HevoptError) else r.fuel_corrected_l_per_100km for r in rows]
    nox = [None if isinstance(r, HevoptError) else r.nox_mg_per_km for r in rows]
    return Effect(
        given.architecture,
        given.strategy,
        trial.parameter.name,
        trial.parameter.unit,
        trial.values,
        fuel,
        [_change(value, given.fuel_corrected_l_per_100km) for value in fuel],
        nox,
        [_change(value, given.nox_mg_per_km) for value in nox],
        _elasticity(trial.values, fuel),
        _elasticity(trial.values, nox),
        [row.headline if isinstance(row, HevoptError) else None for row in rows],
    )


def _change(value: float | None, base: float | None) -> float | None:
    if value is None or base is None or base < _TINY:
        return None
    return 100 * (value / base - 1)


def _elasticity(values: Sequence[float], results: Sequence[float | None]) -> float | None:
    first, last = results[0], results[-1]
    if first is None or last is None or values[0] == values[-1]:
        return None
    if min(values[0], values[-1]) <= 0 or min(first, last) < _TINY:
        return None
    return log(last / first) / log(values[-1] / values[0])


def unsolved(effects: Sequence[Effect]) -> list[str]:
    """Lines that name every value without figures, and why; once where the reason is that of every strategy."""
    lines = []
    for effect in effects:
        reasons = effect.reasons or [None] * len(effect.values)  # saved by an older version
        lines += [
            f"{effect.architecture}, {effect.parameter} {value:.4g}: {reason}"
            for value, reason in zip(effect.values, reasons, strict=True)
            if reason is not None
        ]
    return list(dict.fromkeys(lines))
