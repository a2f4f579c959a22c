"""Members of the rule families: what every threshold and every cap would have given."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf

from hevopt.car.architecture import Architecture
from hevopt.driving.cycle import Cycle
from hevopt.problem.problem import Plan
from hevopt.reproduction.published import Figures, percent
from hevopt.reproduction.variations import Varied
from hevopt.strategies import conventional, strategy_named
from hevopt.studies.case import litres
from hevopt.studies.rows import NEUTRAL_PERCENT

CURVE_KW = tuple(range(15))


@dataclass(frozen=True, slots=True)
class Member:
    """A member of a rule family against another case, per cent; electric driving below its power and speed and
    above its state of charge.

    driven_percent: fuel as driven; surplus_percent: stored energy at the end above the start's, of the fuel's
    neutral: that is at most 1 %, as for rows, and the charge stays in its window
    passed_over: the calibration, which asks for less than neutral, does not take it
    """

    threshold_w: float
    fuel_percent: float
    nox_percent: float
    driven_percent: float
    surplus_percent: float
    neutral: bool
    passed_over: bool = False
    threshold_mps: float = inf
    threshold_soc: float = 0.0


def curve(
    shipped: Varied, base: Figures, thresholds_kw: Sequence[float] = CURVE_KW
) -> list[Member]:
    """The members of conventional over its power threshold, the others as calibrated, against `base`."""
    notes = conventional.solve(shipped.problem).notes
    best = notes["calibration"][notes["chosen"]]
    plan = conventional.solve(
        shipped.problem,
        thresholds_w=[1e3 * kw for kw in thresholds_kw],
        thresholds_mps=[best["threshold_mps"]],
        thresholds_soc=[best["threshold_soc"]],
    )
    return _members(shipped, plan, base)


def calibrated(shipped: Varied, base: Figures) -> Member:
    """The member of conventional that its own calibration takes, against `base`."""
    plan = conventional.solve(shipped.problem)
    return _members(shipped, plan, base)[int(plan.notes["chosen"])]


def family(shipped: Varied, base: Figures) -> list[Member]:
    """The members of nox_cut, against `base`."""
    return _members(shipped, strategy_named("nox_cut").solve(shipped.problem), base)


def _members(shipped: Varied, plan: Plan, base: Figures) -> list[Member]:
    car, cycle = shipped.car, shipped.cycle
    found = []
    for member in plan.notes["calibration"]:
        fuel_kg, nox_kg = member["cost_kg"], member["nox_kg"]
        corrected = in_units(car, cycle, member["corrected_kg"], nox_kg)
        driven = in_units(car, cycle, fuel_kg, nox_kg)
        surplus = surplus_percent(car, member["surplus_j"], fuel_kg)
        found.append(
            Member(
                threshold_w=member["threshold_w"],
                fuel_percent=percent(corrected.fuel_l_per_100km, base.fuel_l_per_100km),
                nox_percent=percent(corrected.nox_mg_per_km, base.nox_mg_per_km),
                driven_percent=percent(driven.fuel_l_per_100km, base.fuel_l_per_100km),
                surplus_percent=surplus,
                neutral=member["inside"] and abs(surplus) <= NEUTRAL_PERCENT,
                passed_over=not member["eligible"],
                threshold_mps=member["threshold_mps"],
                threshold_soc=member["threshold_soc"],
            )
        )
    return found


def least_penalty(members: Sequence[Member], cut_percent: float) -> float | None:
    """Least fuel penalty of the neutral members that cut NOx by so much or more as printed, per cent."""
    able = [
        m.fuel_percent for m in members if m.neutral and round(m.nox_percent, 1) <= -cut_percent
    ]
    return min(able, default=None)


def surplus_percent(car: Architecture, surplus_j: float, fuel_kg: float) -> float:
    """Stored energy at the end above the start's, of the fuel's energy."""
    return 100 * surplus_j / (fuel_kg * car.engine.heating_value_jpkg)


def in_units(car: Architecture, cycle: Cycle, fuel_kg: float, nox_kg: float) -> Figures:
    """Fuel and NOx of a cycle in the units of a report."""
    return Figures(
        litres(car, cycle, fuel_kg),
        nox_kg * 1e6 / (cycle.distance_m / 1e3),
    )
