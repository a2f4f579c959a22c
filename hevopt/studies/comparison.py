"""The study: run strategies on architectures over one cycle, and collect a row for each."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from math import isfinite
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from hevopt.car.architecture import Architecture
from hevopt.car_files.load import load_architecture
from hevopt.driving.cycle import DISTANCE_MIN_M, Cycle, load_cycle, shipped_cycles
from hevopt.errors import DataError, HevoptError, InfeasibleError, SolverError, UnknownNoxError
from hevopt.files.lookup import shipped_names
from hevopt.powertrain.powertrain import build_problem
from hevopt.problem.problem import Plan, Problem, Trajectory
from hevopt.problem.simulation import simulate
from hevopt.strategies import STRATEGIES, fitting, strategy_named
from hevopt.studies.case import Case, prepare, require_nox
from hevopt.studies.rows import Row, against_reference, failed_row, row_of

_FAILURES = (InfeasibleError, SolverError, UnknownNoxError)


@dataclass(frozen=True, slots=True)
class Comparison:
    """All rows of a cycle, and the messages of what failed, by architecture and strategy.

    reference: the row that changes are against, None where there are none
    end_asked: car -> state of charge asked at the end, of those where it is another than the start's
    lost_proofs: architecture and kind of proof -> why it was tried and not found
    """

    cycle: str
    rows: list[Row]
    failures: dict[str, HevoptError] = field(default_factory=dict)
    nox_weight: float = 0.0
    reference: str | None = None
    free_gear: bool = False
    end_asked: Mapping[str, float] = field(default_factory=dict)
    lost_proofs: Mapping[str, str] = field(default_factory=dict)


def solve(problem: Problem, strategy: str = "dp", **settings: Any) -> Plan:
    """The plan of a strategy by name, with the settings that its `solve` names."""
    return strategy_named(strategy).solve(problem, **settings)


def compare(
    cycle: Cycle | str | Path = "nedc",
    architectures: Sequence[Architecture | str | Path] | None = None,
    strategies: Sequence[str] | None = None,
    *,
    nox_weight: float = 0.0,
    allow_shortfall: bool = False,
    free_gear: bool = False,
    refine: bool = False,
    horizon_s: float | None = None,
    changes: Mapping[str, Any] | None = None,
    progress: Callable[[str, int, int], None] = lambda text, done, total: None,
    observe: Callable[[Case, Row, Plan, Trajectory], None] = lambda *solved: None,
) -> Comparison:
    """Every strategy (by default the usual ones that fit) on every architecture (by default the shipped ones).

    strategies: names, or ["all"] for every one that fits. free_gear: the engine's gear is a control.
    refine: torque levels are added around dynamic programming's plan until its cost settles.
    horizon_s: preview of the predictive strategies, by default their own.
    changes: key path -> value in every architecture that is read, see load_architecture.
    progress: called with what comes next, and how many cases of how many are done.
    observe: called with every solved case, its row (no reference yet), plan and trajectory.
    Where an engine has no NOx data, what asks for NOx is a failed row; UnknownNoxError if nothing else is asked.
    """
    if not isinstance(cycle, Cycle):
        cycle = load_cycle(cycle)
    if cycle.distance_m < DISTANCE_MIN_M:
        raise DataError(
            f"cycle {cycle.name}: distance {cycle.distance_m:.3g} m; needed: {DISTANCE_MIN_M:g} m or more"
        )
    plans = _plans(architectures, strategies, free_gear, changes)
    check_horizon(horizon_s, [name for _, names in plans for name in names])
    total = sum(len(names) for _, names in plans)
    rows: list[Row] = []
    failures: dict[str, HevoptError] = {}
    lost: dict[str, str] = {}
    for car, wanted in plans:
        done = len(rows)
        progress(f"{car.name}: table and certificate", done, total)
        try:
            case = prepare(
                car,
                cycle,
                nox_weight=nox_weight,
                allow_shortfall=allow_shortfall,
                refine=refine,
            )
        except _FAILURES as error:
            failures[car.name] = error
            rows += [failed_row(car, name, error) for name in wanted]
            continue
        lost |= lost_proofs(case)
        for n, name in enumerate(wanted):
            progress(f"{car.name}: {name}", done + n, total)
            try:
                solved = run_case(case, name, horizon_s)
                rows.append(solved[0])
                observe(case, *solved)
            except _FAILURES as error:
                failures[f"{car.name} {name}"] = error
                rows.append(failed_row(car, name, error))
    if not any(row.solved for row in rows):
        unknown = [error for error in failures.values() if isinstance(error, UnknownNoxError)]
        if unknown and len(unknown) == len(failures):
            raise unknown[0]
    rows, reference = against_reference(rows)
    asked = end_asked(car for car, _ in plans)
    return Comparison(cycle.name, rows, failures, nox_weight, reference, free_gear, asked, lost)


def lost_proofs(case: Case) -> dict[str, str]:
    """Architecture and kind of proof -> why a proof was tried on a case and not found."""
    failures = case.certificate.failures.items()
    return {f"{case.car.name}, {kind}": message for kind, message in failures}


def end_asked(cars: Iterable[Architecture]) -> dict[str, float]:
    """Car -> state of charge asked at the end, of those where it is another than the start's."""
    return {car.name: car.soc_end for car in cars if car.soc_end != car.soc_start}


def check_horizon(horizon_s: float | None, strategies: Iterable[str]) -> None:
    """DataError for a preview that none of the strategies takes."""
    if horizon_s is None or any(strategy_named(name).previews for name in strategies):
        return
    able = ", ".join(name for name, strategy in STRATEGIES.items() if strategy.previews)
    raise DataError(
        f"horizon_s {horizon_s:g}: no strategy asked for looks ahead; add one that does ({able}), or leave it out"
    )


def _plans(
    architectures: Sequence[Architecture | str | Path] | None,
    strategies: Sequence[str] | None,
    free_gear: bool,
    changes: Mapping[str, Any] | None,
) -> list[tuple[Architecture, list[str]]]:
    """Every car, and the names of the strategies to run on it."""
    every = list(strategies or ()) == ["all"]
    if strategies is not None and not every:
        _check_strategies(strategies)
    cars = _cars(
        shipped_names("architectures", ".toml") if architectures is None else architectures,
        changes,
    )
    cars = [car.with_free_gear() for car in cars] if free_gear else cars
    return [
        (car, _usual(car, every=every) if every or not strategies else list(strategies))
        for car in cars
    ]


def _usual(car: Architecture, *, every: bool) -> list[str]:
    """What fits a car; without NOx data, no strategy that cuts it."""
    names = fitting(car.functions, every=every)
    return [name for name in names if car.engine.nox_known or not _cuts_nox(name)]


def _cuts_nox(strategy: str) -> bool:
    return "nox_cut" in strategy_named(strategy).needs


def _cars(
    wanted: Sequence[Architecture | str | Path], changes: Mapping[str, Any] | None
) -> list[Architecture]:
    """The architectures, no two of one name."""
    cars = [a if isinstance(a, Architecture) else load_architecture(a, changes) for a in wanted]
    if not cars:
        raise DataError("no architecture given; name at least one, or leave the list out for all")
    check_one_of_each_name(cars)
    return cars


def check_one_of_each_name(cars: Iterable[Architecture]) -> None:
    """DataError where two cars have one name: rows are told apart by it."""
    by_name: dict[str, Architecture] = {}
    for car in cars:
        if car.name in by_name:
            raise DataError(
                f"architecture {car.name} is given twice, in {by_name[car.name].source} and in "
                f"{car.source}; leave one out, or change its name"
            )
        by_name[car.name] = car


def _check_strategies(names: Sequence[str]) -> None:
    if not names:
        raise DataError("no strategy given; name at least one, or leave the list out for all")
    for name in names:
        strategy_named(name)
        if list(names).count(name) > 1:
            raise DataError(f"strategy {name} is given twice; name it once")


def run_case(
    case: Case, strategy: str, horizon_s: float | None = None
) -> tuple[Row, Plan, Trajectory]:
    """One strategy on a case: its row (no reference yet), plan and trajectory.

    Raises UnknownNoxError for a strategy that cuts NOx where the engine has no data on it.
    """
    if _cuts_nox(strategy):
        require_nox(case.car, f"strategy {strategy}")
    plan, trajectory, solve_s = case.dp_plan, case.dp_trajectory, case.dp_s
    if strategy != "dp":
        settings = _settings(case, strategy, horizon_s)
        began = perf_counter()
        plan = strategy_named(strategy).solve(case.problem, **settings)
        solve_s = perf_counter() - began
        trajectory = simulate(case.problem, plan.control)
    row = row_of(case, strategy, trajectory, solve_s)
    for name, value in row.as_dict().items():
        if isinstance(value, float) and not isfinite(value):
            raise SolverError(
                f"{case.car.name} {strategy}: {name} is {value}; the figures of {case.car.source} are "
                "too far from those of a car"
            )
    return row, plan, trajectory


def _settings(case: Case, strategy: str, horizon_s: float | None) -> dict[str, Any]:
    """What a strategy is told beyond the problem: its preview, the shipped cycles but this one to learn from."""
    chosen = strategy_named(strategy)
    settings: dict[str, Any] = {}
    if chosen.previews and horizon_s is not None:
        settings["horizon_s"] = horizon_s
    if chosen.learns:
        weight = case.problem.nox_weight
        settings["training"] = [
            build_problem(case.car, other, nox_weight=weight, allow_shortfall=True)
            for other in shipped_cycles()
            if not _same_drive(other, case.cycle)
        ]
    return settings


def _same_drive(one: Cycle, other: Cycle) -> bool:
    """Whether two cycles are one drive, under whatever names."""
    return np.array_equal(one.time_s, other.time_s) and np.array_equal(
        one.speed_mps, other.speed_mps
    )


def steps_of(cycle: str | Path) -> int:
    """Number of steps of a cycle."""
    return len(load_cycle(cycle).time_s) - 1
