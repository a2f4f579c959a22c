"""A case: one car on one cycle, solved by dynamic programming and certified."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from time import perf_counter

from hevopt.bounds.certificate import TARGET_GAP, Certificate, certify
from hevopt.car.architecture import Architecture
from hevopt.display.facts import Shown
from hevopt.driving.cycle import Cycle
from hevopt.powertrain.levels import Around
from hevopt.powertrain.powertrain import TORQUE_LEVELS, around_plan, build_problem
from hevopt.problem.problem import Plan, Problem, Trajectory
from hevopt.problem.simulation import simulate
from hevopt.strategies import dp
from hevopt.studies.nox import require_nox
from hevopt.studies.settings import Settings
from hevopt.units import litres_per_100km

# Levels are added until the cost moves by less than this share.
_REFINED_ENOUGH = 2e-4
_REFINEMENTS_MAX = 8
# Gaps within which a plan counts as found, of a table of levels and of one with levels added. A bound on all that
# lies between the levels is a little lower than the table's own, and is to stay within its target.
_ENOUGH, _ENOUGH_REFINED = 0.6 * TARGET_GAP, 0.1 * TARGET_GAP


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Case(Shown):
    """A car on a cycle, with the plan of dynamic programming and the certificate along its rollout."""

    car: Architecture
    cycle: Cycle
    problem: Problem
    certificate: Certificate
    dp_plan: Plan
    dp_trajectory: Trajectory
    dp_s: float

    def _facts(self) -> dict[str, object]:
        bound_kg, proof = self.certificate.bound_kg(self.dp_trajectory.end_j)
        return {
            "car": self.car.name,
            "cycle": self.cycle.name,
            "dp_cost_kg": self.dp_trajectory.cost_kg,
            "bound_kg": bound_kg,
            "proof": proof,
        }


_DEFAULTS = Settings()


def unused(problem: Problem) -> None:
    """Nobody does anything with a problem before it is solved."""


def prepare(
    car: Architecture,
    cycle: Cycle,
    settings: Settings = _DEFAULTS,
    *,
    levels: int = TORQUE_LEVELS,
    begun: Callable[[Problem], None] = unused,
) -> Case:
    """The problem of a car on a cycle, solved by dynamic programming and certified.

    Of the settings it takes nox_weight, allow_shortfall and refine: then torque levels are added around the plan,
    closer each time, until its cost moves by less than 0.02 %; plans and certificate are those of the table with
    the added levels. begun: called with the first problem before it is solved. Raises UnknownNoxError for a weight
    on NOx where the engine has no data on it.
    """
    nox_weight = settings.nox_weight

    def case_with(around: Around | None) -> Case:
        problem = build_problem(
            car,
            cycle,
            levels=levels,
            nox_weight=nox_weight,
            allow_shortfall=settings.allow_shortfall,
            around=around,
        )
        if around is None:
            begun(problem)
        enough = _ENOUGH if around is None else _ENOUGH_REFINED
        return dp_case(car, cycle, problem, enough_gap=enough)

    if nox_weight > 0:
        require_nox(car, f"nox_weight {nox_weight:g}")
    case = case_with(None)
    share = 0.5 / (levels - 1)
    for _ in range(_REFINEMENTS_MAX if settings.refine else 0):
        before = case
        around = around_plan(case.dp_trajectory, case.problem.table, share)
        case = case_with(around)
        case = replace(case, dp_s=case.dp_s + before.dp_s)
        moved_kg = abs(case.dp_trajectory.cost_kg - before.dp_trajectory.cost_kg)
        if moved_kg < _REFINED_ENOUGH * before.dp_trajectory.cost_kg:
            break
        share /= 2
    return case


def litres(car: Architecture, cycle: Cycle, fuel_kg: float) -> float:
    """Fuel of a car on a cycle in l/100 km."""
    return litres_per_100km(fuel_kg, car.engine.fuel_density_kgpm3, cycle.distance_m)


def dp_case(
    car: Architecture,
    cycle: Cycle,
    problem: Problem,
    target_gap: float = TARGET_GAP,
    enough_gap: float = _ENOUGH,
) -> Case:
    """A problem of a car on a cycle, solved by dynamic programming and certified along its rollout.

    enough_gap: within which of the table's optimum a plan of few grids is taken
    """
    began = perf_counter()
    plan = dp.solve(problem, enough_gap=enough_gap)
    trajectory = simulate(problem, plan.control)
    dp_s = perf_counter() - began
    certificate = certify(problem, trajectory, target_gap=target_gap)
    return Case(car, cycle, problem, certificate, plan, trajectory, dp_s)
