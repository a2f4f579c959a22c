"""How fuel and NOx of a car move with its figures: each one lowered and raised alone, everything solved afresh.

Fuel is charge-corrected, so that a change shows and not what was left in the battery. A rule-based strategy
calibrates its thresholds again for each value. The elasticity is per cent of fuel per per cent of the figure, from
the lowest to the highest value: d ln(fuel) / d ln(figure). A value at which the car cannot be solved has no figures
but a reason; all others keep theirs.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields
from functools import partial
from math import log
from pathlib import Path
from typing import Any

from hevopt.car_files.load import load_architecture
from hevopt.driving.cycle import Cycle, load_cycle
from hevopt.errors import HevoptError
from hevopt.files.lookup import find
from hevopt.files.toml import read_contents
from hevopt.strategies import fitting, strategy_named
from hevopt.studies.case import Case, prepare
from hevopt.studies.comparison import run_case
from hevopt.studies.rows import Row

SHARE = 0.1
# Fuel or NOx of less is none: a change against it has no meaning.
_TINY = 1e-9
# The optimum, and the rule that drives the car: the first that fits.
_RULES = ("conventional", "start_stop", "baseline")
_STEEP_NOX = "engine_diesel_1600_steep_nox"
_LOSSES = ("loss_c0_w", "loss_c1_ws", "loss_c2_ws2", "loss_c3_wpnm2", "loss_map.loss_w")


@dataclass(frozen=True, slots=True)
class Parameter:
    """A figure of a car, or several that are changed together.

    keys: their key paths; the first one that a car has gives the value shown
    step: what is taken away and added; None: a share of 10 %; relative: the value shown is 1, as given
    whole: values are rounded to whole numbers
    """

    name: str
    unit: str
    keys: tuple[str, ...]
    step: float | None = None
    relative: bool = False
    whole: bool = False


PARAMETERS = (
    Parameter("vehicle mass", "kg", ("car.mass_kg",)),
    Parameter(
        "rolling resistance",
        "coefficient",
        tuple(f"car.road_load.rolling_{c}" for c in ("c0", "c1_spm", "c2_s2pm2", "c3_s3pm3")),
    ),
    Parameter("drag area", "m²", ("car.road_load.drag_area_m2",)),
    Parameter(
        "coast-down resistance",
        "x as given",
        tuple(f"car.road_load.coastdown_{c}" for c in ("c0_n", "c1_nspm", "c2_ns2pm2")),
        relative=True,
    ),
    Parameter("auxiliaries", "W", ("car.auxiliary_power_w",)),
    Parameter("driveline efficiency", "share", ("gearbox.efficiency",), step=0.01),
    Parameter("machine loss", "x as given", tuple(f"machine.{k}" for k in _LOSSES), relative=True),
    Parameter("machine efficiency", "share", ("machine.efficiency",), step=0.02),
    Parameter(
        "battery resistance",
        "ohm per cell",
        ("battery.resistance_ohm", "battery.discharge_ohm", "battery.charge_ohm"),
    ),
    Parameter("coulombic efficiency", "share", ("battery.coulombic_efficiency",), step=0.01),
    Parameter("battery cells in series", "cells", ("battery.cells_in_series",), whole=True),
    Parameter("engine inertia", "kg m²", ("engine.inertia_kgm2",)),
    Parameter("fuel of a start", "g", ("engine.start_fuel_g",)),
)


@dataclass(frozen=True, slots=True)
class Effect:
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

    def as_dict(self) -> dict[str, Any]:
        """All fields by name, in order."""
        return {f.name: getattr(self, f.name) for f in fields(self)}


@dataclass(frozen=True, slots=True)
class _Trial:
    """Values of a parameter, lowest first, and the changes that lead to each; {} is the car as given."""

    parameter: Parameter
    values: list[float]
    changes: list[Mapping[str, Any]]


def sensitivities(
    architecture: str | Path,
    cycle: Cycle | str | Path = "nedc",
    strategies: Sequence[str] | None = None,
    *,
    nox_weight: float = 0.0,
    allow_shortfall: bool = False,
    refine: bool = False,
    base: Mapping[str, Any] | None = None,
    progress: Callable[[str, int, int], None] = lambda text, done, total: None,
) -> list[Effect]:
    """The effect of every parameter that the architecture has, strategy by strategy.

    strategies: by default dynamic programming and the rule that fits the car; refine: see case.prepare
    base: key path -> value of what is another in the car from the start, see load_architecture
    progress: called with the value that comes next, and how many are done of how many
    Raises HevoptError where the car as given cannot be solved.
    """
    trace = cycle if isinstance(cycle, Cycle) else load_cycle(cycle)
    car = load_architecture(architecture, base)
    names = list(strategies or _usual(car.functions))
    for name in names:
        strategy_named(name)
    options = {"nox_weight": nox_weight, "allow_shortfall": allow_shortfall, "refine": refine}
    case_of = partial(prepare, cycle=trace, **options)
    trials = _trials(car.contents)
    total = 1 + sum(1 for trial in trials for changes in trial.changes if changes)
    done = 0

    def solved(changes: Mapping[str, Any], what: str) -> dict[str, Row | HevoptError]:
        nonlocal done
        progress(f"{car.name}: {what}", done, total)
        done += 1
        try:
            case = case_of(load_architecture(architecture, {**(base or {}), **changes}))
        except HevoptError as error:
            return dict.fromkeys(names, error)
        return {name: _row(case, name) for name in names}

    given = {name: _required(car.name, row) for name, row in solved({}, "as given").items()}
    effects: list[Effect] = []
    for trial in trials:
        found = [
            solved(changes, f"{trial.parameter.name} {value:g}") if changes else given
            for value, changes in zip(trial.values, trial.changes, strict=True)
        ]
        effects += [_effect(trial, given[name], [rows[name] for rows in found]) for name in names]
    return sorted(effects, key=lambda effect: names.index(effect.strategy))


def _row(case: Case, strategy: str) -> Row | HevoptError:
    try:
        return run_case(case, strategy)[0]
    except HevoptError as error:
        return error


def _required(car: str, row: Row | HevoptError) -> Row:
    """The row of the car as given, without which there is nothing to compare with."""
    if isinstance(row, HevoptError):
        raise type(row)(f"{car}, as given: {row}") from None
    return row


def _usual(functions: frozenset[str]) -> list[str]:
    fit = fitting(functions)
    return [name for name in ("dp",) if name in fit] + [n for n in _RULES if n in fit][:1]


def _trials(contents: Mapping[str, Any]) -> list[_Trial]:
    trials = [_trial(contents, parameter) for parameter in PARAMETERS]
    nox = contents["engine"].get("nox_coefficients")
    if nox is not None:
        steep = read_contents(find("architectures/components", _STEEP_NOX, ".toml"))
        trials.append(_nox_trial(nox, steep["nox_coefficients"]))
    return [trial for trial in trials if trial is not None]


def _trial(contents: Mapping[str, Any], parameter: Parameter) -> _Trial | None:
    """None where the car lacks the figure, has it at 0, or cannot have another."""
    found = {key: value for key in parameter.keys if (value := _at(contents, key)) is not None}
    if not found:
        return None
    first = _mean(next(iter(found.values())))
    if first <= 0:
        return None
    step = SHARE * first if parameter.step is None else parameter.step
    points: dict[float, Mapping[str, Any]] = {}
    for target in (first - step, first, first + step):
        value = round(target) if parameter.whole else target
        if value <= 0 or (parameter.step is not None and value > 1):
            continue
        changes = {
            key: value if old == first else _times(old, value / first) for key, old in found.items()
        }
        points[value / first if parameter.relative else value] = {} if value == first else changes
    return _Trial(parameter, list(points), list(points.values())) if len(points) > 1 else None


def _nox_trial(own: Mapping[str, float], steep: Mapping[str, float]) -> _Trial | None:
    """The steep set of NOx coefficients, by how many times a high load emits a low load's NOx per work."""
    parameter = Parameter("NOx map, high over low load", "ratio", ("engine.nox_coefficients",))
    if own["lo"] <= 0 or dict(own) == dict(steep):
        return None
    pairs = [(own["hi"] / own["lo"], {}), (steep["hi"] / steep["lo"], {parameter.keys[0]: steep})]
    pairs.sort(key=lambda pair: pair[0])
    return _Trial(parameter, [value for value, _ in pairs], [changes for _, changes in pairs])


def _at(contents: Mapping[str, Any], key: str) -> Any:
    value: Any = contents
    for part in key.split("."):
        value = value.get(part) if isinstance(value, Mapping) else None
    return value


def _mean(value: Any) -> float:
    """The value, or the mean of a list's."""
    return sum(map(_mean, value)) / len(value) if isinstance(value, list) else value


def _times(value: Any, factor: float) -> Any:
    return [_times(entry, factor) for entry in value] if isinstance(value, list) else value * factor


def _effect(trial: _Trial, given: Row, rows: Sequence[Row | HevoptError]) -> Effect:
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
