"""The study: run strategies on architectures over one cycle, and collect a row for each."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from math import isfinite
from pathlib import Path
from time import perf_counter
from typing import Any

from hevopt.architecture import Architecture, load_architecture
from hevopt.balance import Around
from hevopt.certificate import SCOPE, TARGET_GAP, Certificate, certify
from hevopt.cycle import DISTANCE_MIN_M, Cycle, load_cycle
from hevopt.errors import DataError, HevoptError, InfeasibleError, SolverError
from hevopt.files import shipped_names
from hevopt.powertrain import TORQUE_LEVELS, build_problem, torques_of
from hevopt.problem import Plan, Problem, Trajectory
from hevopt.simulation import simulate
from hevopt.strategies import dp, fitting, strategy_named
from hevopt.units import litres_per_100km

NEUTRAL_PERCENT = 1.0
REFERENCE_ARCHITECTURE = "A"
# A percentage of less than this is none: the figure it would stand beside is rounding.
_TINY = 1e-9
_ROUNDING_J = 1.0
# Levels are added until the cost moves by less than this share.
_REFINED_ENOUGH = 2e-4
_REFINEMENTS_MAX = 8


@dataclass(frozen=True, slots=True)
class Row:
    """One architecture and strategy. None where a case failed, or where there is nothing to compare with:
    no reference, no fuel, or a bound of 0.

    status: "ok", "not neutral" (end charge off by more than 1 % of the fuel's energy; "end charge missed" where
    another end charge than the start's is asked), "shortfall" (steps driven with less than the cycle asks), joined
    by commas, or "failed: ..." with the reason
    delta_energy_percent: stored energy at the end above what is asked, as a share of the fuel's;
    fuel_corrected_l_per_100km: fuel less what that energy is worth
    bound_l_per_100km: least of fuel + weighted NOx that any plan with this row's end charge could reach,
    as fuel volume; gap_percent: this row's own sum above it
    """

    architecture: str
    strategy: str
    status: str
    fuel_l_per_100km: float | None = None
    delta_fuel_percent: float | None = None
    co2_g_per_km: float | None = None
    nox_mg_per_km: float | None = None
    delta_nox_percent: float | None = None
    soc_start: float | None = None
    soc_end: float | None = None
    delta_energy_percent: float | None = None
    fuel_corrected_l_per_100km: float | None = None
    engine_starts: int | None = None
    bound_l_per_100km: float | None = None
    gap_percent: float | None = None
    certificate: str | None = None
    solve_s: float | None = None

    def as_dict(self) -> dict:
        """All fields by name, in order."""
        return {f.name: getattr(self, f.name) for f in fields(self)}


@dataclass(frozen=True, slots=True)
class Comparison:
    """All rows of a cycle, and the messages of what failed, by architecture and strategy."""

    cycle: str
    rows: list[Row]
    failures: dict[str, HevoptError] = field(default_factory=dict)
    nox_weight: float = 0.0
    reference: str | None = None
    free_gear: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class Case:
    """A car on a cycle, with the plan of dynamic programming and the certificate along its rollout."""

    car: Architecture
    cycle: Cycle
    problem: Problem
    certificate: Certificate
    dp_plan: Plan
    dp_trajectory: Trajectory
    dp_s: float


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
    observe: Callable[["Case", Row, Plan, Trajectory], None] = lambda *solved: None,
) -> Comparison:
    """Every strategy (by default the usual ones that fit) on every architecture (by default the shipped ones).

    strategies: names, or ["all"] for every one that fits. free_gear: the engine's gear is a control.
    refine: torque levels are added around dynamic programming's plan until its cost settles.
    horizon_s: preview of the predictive strategies, by default their own.
    changes: key path -> value in every architecture that is read, see load_architecture.
    progress: called with what comes next, and how many cases of how many are done.
    observe: called with every solved case, its row (no reference yet), plan and trajectory.
    """
    if not isinstance(cycle, Cycle):
        cycle = load_cycle(cycle)
    if cycle.distance_m < DISTANCE_MIN_M:
        raise DataError(
            f"cycle {cycle.name}: distance {cycle.distance_m:.3g} m; needed: {DISTANCE_MIN_M:g} m or more"
        )
    plans = _plans(architectures, strategies, free_gear, changes)
    total = sum(len(names) for _, names in plans)
    rows: list[Row] = []
    failures: dict[str, HevoptError] = {}
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
        except (InfeasibleError, SolverError) as error:
            failures[car.name] = error
            rows += [_failed(car, name, error) for name in wanted]
            continue
        for n, name in enumerate(wanted):
            progress(f"{car.name}: {name}", done + n, total)
            try:
                solved = run_case(case, name, horizon_s)
                rows.append(solved[0])
                observe(case, *solved)
            except (InfeasibleError, SolverError) as error:
                failures[f"{car.name} {name}"] = error
                rows.append(_failed(car, name, error))
    rows, reference = _against_reference(rows)
    return Comparison(cycle.name, rows, failures, nox_weight, reference, free_gear)


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
        (car, fitting(car.functions, every=every) if every or not strategies else list(strategies))
        for car in cars
    ]


def steps_of(cycle: str | Path) -> int:
    """Number of steps of a cycle."""
    return len(load_cycle(cycle).time_s) - 1


def _cars(
    wanted: Sequence[Architecture | str | Path], changes: Mapping[str, Any] | None
) -> list[Architecture]:
    """The architectures, no two of one name: rows are told apart by it."""
    cars = [a if isinstance(a, Architecture) else load_architecture(a, changes) for a in wanted]
    if not cars:
        raise DataError("no architecture given; name at least one, or leave the list out for all")
    by_name: dict[str, Architecture] = {}
    for car in cars:
        if car.name in by_name:
            raise DataError(
                f"architecture {car.name} is given twice, in {by_name[car.name].source} and in "
                f"{car.source}; leave one out, or change its name"
            )
        by_name[car.name] = car
    return cars


def _check_strategies(names: Sequence[str]) -> None:
    if not names:
        raise DataError("no strategy given; name at least one, or leave the list out for all")
    for name in names:
        strategy_named(name)
        if list(names).count(name) > 1:
            raise DataError(f"strategy {name} is given twice; name it once")


def prepare(
    car: Architecture,
    cycle: Cycle,
    *,
    levels: int = TORQUE_LEVELS,
    nox_weight: float = 0.0,
    allow_shortfall: bool = False,
    refine: bool = False,
) -> Case:
    """The problem of a car on a cycle, solved by dynamic programming and certified.

    refine: add torque levels around the plan, closer each time, until its cost moves by less than 0.02 %; plans
    and certificate are then those of the table with the added levels.
    """

    def case_with(around: Around | None) -> Case:
        problem = build_problem(
            car,
            cycle,
            levels=levels,
            nox_weight=nox_weight,
            allow_shortfall=allow_shortfall,
            around=around,
        )
        return dp_case(car, cycle, problem)

    case = case_with(None)
    share = 0.5 / (levels - 1)
    for _ in range(_REFINEMENTS_MAX if refine else 0):
        before = case
        around = Around(torques_of(case.dp_trajectory, case.problem.table), share)
        case = case_with(around)
        case = replace(case, dp_s=case.dp_s + before.dp_s)
        moved_kg = abs(case.dp_trajectory.cost_kg - before.dp_trajectory.cost_kg)
        if moved_kg < _REFINED_ENOUGH * before.dp_trajectory.cost_kg:
            break
        share /= 2
    return case


def dp_case(
    car: Architecture, cycle: Cycle, problem: Problem, target_gap: float = TARGET_GAP
) -> Case:
    """A problem of a car on a cycle, solved by dynamic programming and certified along its rollout."""
    began = perf_counter()
    plan = dp.solve(problem)
    trajectory = simulate(problem, plan.control)
    dp_s = perf_counter() - began
    certificate = certify(problem, trajectory, target_gap=target_gap)
    return Case(car, cycle, problem, certificate, plan, trajectory, dp_s)


def run_case(
    case: Case, strategy: str, horizon_s: float | None = None
) -> tuple[Row, Plan, Trajectory]:
    """One strategy on a case: its row (no reference yet), plan and trajectory."""
    plan, trajectory, solve_s = case.dp_plan, case.dp_trajectory, case.dp_s
    if strategy != "dp":
        settings = _settings(case, strategy, horizon_s)
        began = perf_counter()
        plan = strategy_named(strategy).solve(case.problem, **settings)
        solve_s = perf_counter() - began
        trajectory = simulate(case.problem, plan.control)
    row = _row(case, strategy, trajectory, solve_s)
    for name, value in row.as_dict().items():
        if isinstance(value, float) and not isfinite(value):
            raise SolverError(
                f"{case.car.name} {strategy}: {name} is {value}; the figures of {case.car.source} are "
                "too far from those of a car"
            )
    return row, plan, trajectory


def _settings(case: Case, strategy: str, horizon_s: float | None) -> dict[str, Any]:
    """What a strategy is told beyond the problem: its preview, the other cycles it may learn from."""
    chosen = strategy_named(strategy)
    settings: dict[str, Any] = {}
    if chosen.previews and horizon_s is not None:
        settings["horizon_s"] = horizon_s
    if chosen.learns:
        others = [name for name in shipped_names("cycles", ".csv") if name != case.cycle.name]
        weight = case.problem.nox_weight
        settings["training"] = [
            build_problem(case.car, load_cycle(name), nox_weight=weight, allow_shortfall=True)
            for name in others
        ]
    return settings


def _row(case: Case, strategy: str, trajectory: Trajectory, solve_s: float) -> Row:
    car, cycle, problem, certificate = case.car, case.cycle, case.problem, case.certificate
    fuel_kg, km = trajectory.total_fuel_kg, cycle.distance_m / 1e3
    surplus_j = trajectory.end_j - problem.end_min_j
    fuel_j = fuel_kg * car.engine.heating_value_jpkg
    bound_kg, proof = certificate.bound_kg(trajectory.end_j)

    def litres(mass_kg: float) -> float:
        return litres_per_100km(mass_kg, car.engine.fuel_density_kgpm3, cycle.distance_m)

    return Row(
        architecture=car.name,
        strategy=strategy,
        status=_status(problem, surplus_j, fuel_j),
        fuel_l_per_100km=litres(fuel_kg),
        co2_g_per_km=fuel_kg * car.engine.co2_kgpkg * 1e3 / km,
        nox_mg_per_km=trajectory.total_nox_kg * 1e6 / km,
        soc_start=float(trajectory.soc[0]),
        soc_end=float(trajectory.soc[-1]),
        delta_energy_percent=_percent(surplus_j, fuel_j),
        fuel_corrected_l_per_100km=litres(fuel_kg - certificate.price_kgpj * surplus_j),
        engine_starts=engine_starts(problem, trajectory),
        bound_l_per_100km=litres(bound_kg),
        gap_percent=_percent(trajectory.cost_kg - bound_kg, abs(bound_kg)),
        certificate=f"{proof}, {SCOPE}",
        solve_s=solve_s,
    )


def engine_starts(problem: Problem, trajectory: Trajectory) -> int:
    """How often the engine goes from rest to turning."""
    on = [problem.table.controls[c].engine_on for c in trajectory.control]
    start_on = any(
        control.engine_on
        for control, mode in zip(problem.table.controls, problem.table.mode, strict=True)
        if mode == problem.start_mode
    )
    return sum(now and not before for before, now in zip([start_on, *on], on, strict=False))


def _percent(part: float, whole: float) -> float | None:
    return 100 * part / whole if whole > _TINY else None


def _status(problem: Problem, surplus_j: float, fuel_j: float) -> str:
    marks = []
    if 100 * abs(surplus_j) > max(NEUTRAL_PERCENT * fuel_j, 100 * _ROUNDING_J):
        neutral = problem.end_min_j == problem.start_j
        marks.append("not neutral" if neutral else "end charge missed")
    missing = problem.table.missing_torque_nm
    if missing is not None and (missing > 0).any():
        count = int((missing > 0).sum())
        marks.append(f"shortfall at {count} step{'s' if count > 1 else ''}")
    return ", ".join(marks) or "ok"


def _failed(car: Architecture, strategy: str, error: HevoptError) -> Row:
    return Row(car.name, strategy, f"failed: {str(error).splitlines()[0].rstrip(':')}")


def _against_reference(rows: list[Row]) -> tuple[list[Row], str | None]:
    """Rows with their change against the first good row of architecture A, or else of the table."""
    good = [row for row in rows if row.fuel_l_per_100km is not None]
    named = [row for row in good if row.architecture == REFERENCE_ARCHITECTURE]
    if not good:
        return rows, None
    base = (named or good)[0]

    def change(value: float | None, reference: float | None) -> float | None:
        if value is None or reference is None or reference < _TINY:
            return None
        return 100 * (value / reference - 1)

    changed = [
        Row(
            **row.as_dict()
            | {
                "delta_fuel_percent": change(row.fuel_l_per_100km, base.fuel_l_per_100km),
                "delta_nox_percent": change(row.nox_mg_per_km, base.nox_mg_per_km),
            }
        )
        for row in rows
    ]
    return changed, f"{base.architecture} {base.strategy}"
