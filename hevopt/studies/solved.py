"""One strategy on one case: which strategies fit, what each is told, and the row of what it does."""

from collections.abc import Iterable, Mapping, Sequence
from math import isfinite
from time import perf_counter
from typing import Any

import numpy as np

from hevopt.car.architecture import Architecture
from hevopt.driving.cycle import Cycle, shipped_cycles
from hevopt.errors import DataError, SolverError
from hevopt.powertrain.powertrain import build_problem
from hevopt.problem.problem import Plan, Problem, Trajectory
from hevopt.problem.simulation import simulate
from hevopt.strategies import Strategy, every_strategy, fitting, is_causal, strategy_named
from hevopt.strategies.brought import Guarded
from hevopt.studies.case import Case
from hevopt.studies.nox import require_nox
from hevopt.studies.rows import Row, row_of

# In place of names: every strategy that fits the car.
EVERY = "all"


_NO_OTHERS: Mapping[str, Strategy] = {}


def run_case(
    case: Case,
    strategy: str,
    horizon_s: float | None = None,
    others: Mapping[str, Strategy] = _NO_OTHERS,
) -> tuple[Row, Plan, Trajectory]:
    """One strategy on a case: its row (no reference yet), plan and trajectory.

    others: strategies beside those shipped and registered
    Raises UnknownNoxError for a strategy that cuts NOx where the engine has no data on it.
    """
    chosen = strategy_named(strategy, others)
    if _cuts_nox(chosen):
        require_nox(case.car, f"strategy {strategy}")
    plan, trajectory, solve_s = case.dp_plan, case.dp_trajectory, case.dp_s
    if strategy != "dp":
        settings = told(case, chosen, horizon_s)
        began = perf_counter()
        plan = chosen.solve(case.problem, **settings)
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


def why_not_causal(
    case: Case, strategy: str, plan: Plan, others: Mapping[str, Strategy] = _NO_OTHERS
) -> str | None:
    """What shows that a brought strategy knows more of the cycle than it says; None for nothing."""
    chosen = strategy_named(strategy, others)
    if not isinstance(chosen.solve, Guarded) or not is_causal(chosen):
        return None
    return chosen.solve.why_not_causal(case.problem, plan.control)


def causal_among(
    rows: Iterable[Row],
    peeking: Mapping[tuple[str, str], str],
    others: Mapping[str, Strategy] = _NO_OTHERS,
) -> frozenset[str]:
    """Of the strategies of rows, those that decide without knowing the rest of the cycle.

    peeking: car and strategy -> what shows that it knows more. One that solved nothing has shown nothing.
    """
    names = {row.strategy for row in rows if row.solved} - {name for _, name in peeking}
    return frozenset(name for name in names if is_causal(strategy_named(name, others)))


def told(case: Case, chosen: Strategy, horizon_s: float | None) -> dict[str, Any]:
    """What a strategy is told beyond the problem: its preview, the shipped cycles but this one to learn from."""
    settings: dict[str, Any] = {}
    if chosen.previews and horizon_s is not None:
        settings["horizon_s"] = horizon_s
    if chosen.learns:
        settings["training"] = _training(case)
    return settings


def _training(case: Case) -> list[Problem]:
    """The shipped cycles but the case's own, for strategies that learn; SolverError where its steps differ."""
    step_s = case.problem.table.step_s
    others = [other for other in shipped_cycles() if not _same_drive(other, case.cycle)]
    taught_s = np.concatenate([np.diff(other.time_s) for other in others])
    if not np.allclose(step_s, taught_s[0], rtol=1e-6):
        raise SolverError(
            f"it learns from the shipped cycles, in steps of {taught_s[0]:g} s; cycle {case.cycle.name} has steps "
            f"of {step_s.min():g} to {step_s.max():g} s; resample it, or use a_ecms"
        )
    weight = case.problem.nox_weight
    return [
        build_problem(case.car, other, nox_weight=weight, allow_shortfall=True) for other in others
    ]


def _same_drive(one: Cycle, other: Cycle) -> bool:
    """Whether two cycles are one drive, under whatever names."""
    return np.array_equal(one.time_s, other.time_s) and np.array_equal(
        one.speed_mps, other.speed_mps
    )


def check_horizon(
    horizon_s: float | None,
    strategies: Iterable[str],
    others: Mapping[str, Strategy] = _NO_OTHERS,
) -> None:
    """DataError for a preview that none of the strategies takes."""
    if horizon_s is None or any(strategy_named(name, others).previews for name in strategies):
        return
    able = ", ".join(name for name, strategy in every_strategy().items() if strategy.previews)
    raise DataError(
        f"horizon_s {horizon_s:g}: no strategy asked for looks ahead; add one that does ({able}), or leave it out"
    )


def strategies_for(
    car: Architecture,
    wanted: Sequence[str] | None,
    others: Mapping[str, Strategy] = _NO_OTHERS,
) -> list[str]:
    """The strategies to run on a car: those named; every one that fits it, or the usual ones that do, and of the
    others those that are usual.

    Without NOx data, only what is named cuts NOx. DataError for a name that is none.
    """
    if wanted is not None and list(wanted) != [EVERY]:
        for name in wanted:
            strategy_named(name, others)
        return list(wanted)
    names = fitting(car.marks, every=wanted is not None)
    names = [name for name in names if car.engine.nox_known or not _cuts_nox(strategy_named(name))]
    return [*names, *(name for name, other in others.items() if other.usual and name not in names)]


def _cuts_nox(strategy: Strategy) -> bool:
    return "nox_cut" in strategy.needs
