"""The published study done again: as shipped, and under other assumptions, to see what a difference comes from.

Everything is on the study's cycle with its rule-based strategies; dynamic programming is there for comparison. Fuel
is charge-corrected: less what the end charge is worth by the multiplier of the dual.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hevopt.architecture import Architecture, load_architecture
from hevopt.certificate import certify
from hevopt.cycle import Cycle, load_cycle
from hevopt.demand import demand_of
from hevopt.problem import Plan
from hevopt.published import CARS, CYCLE, HYBRIDS, Cases, Figures, cases_of, percent
from hevopt.reproduction import variations as v
from hevopt.reproduction.variations import Variation, varied
from hevopt.simulation import simulate
from hevopt.strategies import conventional, strategy_named
from hevopt.study import Comparison, compare
from hevopt.units import litres_per_100km

_RULES = {"A": ("baseline",), "B": ("start_stop",)}
_HYBRID_RULES = ("conventional", "nox_cut")
CURVE_KW = tuple(range(15))
# NOx cut by at least so many per cent against conventional.
CUTS_PERCENT = (0, 6, 10, 15, 20, 25)

LOSSES = (
    v.DRIVELINE.and_(v.MACHINE_LOSS, "")
    .and_(v.CHARGING_LOSS, "")
    .and_(v.RESISTANCE, "")
    .and_(v.HYBRID_MASS, "")
    .and_(v.AUXILIARIES, "driveline, machine, battery, mass and auxiliaries together")
)
K_AND_STEEP = v.K_PHASES.and_(v.STEEP_NOX, f"{v.K_PHASES.name}, {v.STEEP_NOX.name}")
# What the study's text leaves open, taken together step by step: its start-stop rule, a speed threshold, its map.
JOINT = (
    v.AS_SHIPPED,
    v.K_PHASES,
    v.K_PHASES.and_(v.ELECTRIC[1], f"and {v.ELECTRIC[1].name}"),
    v.K_PHASES.and_(v.ELECTRIC[1], "").and_(v.STEEP_NOX, f"and {v.STEEP_NOX.name}"),
)
VARIATIONS = (
    v.K_PHASES, v.FREE_STARTS, v.DEAR_STARTS, v.ALTERNATOR, v.NO_INERTIA, v.DRIVELINE, v.MACHINE_LOSS,
    v.CHARGING_LOSS, v.RESISTANCE, v.HYBRID_MASS, v.AUXILIARIES, v.ROAD, LOSSES, v.STEEP_NOX, K_AND_STEEP,
    *v.BRAKING, v.NO_RECOVERY, *v.ELECTRIC, *JOINT[2:],
)  # fmt: skip
# Asked of B alone, whose saving is less than the published one.
VARIATIONS_OF_B = (v.LESS_MACHINE_LOSS, v.LESS_CHARGING_LOSS)
# A plan is neutral while what its end charge is worth is at most so much of its fuel, as in the rules' calibration.
NEUTRAL_WORTH_PERCENT = 1.0


@dataclass(frozen=True, slots=True, eq=False)
class Under:
    """The study's cases under a variation.

    cases: charge-corrected; driven: as driven, the end charge worth nothing
    surplus_percent: of the cases that are not neutral, stored energy at the end above the start's, of the fuel's
    untouched: cars in whose model the variation changes nothing
    """

    name: str
    cases: Cases
    driven: Cases
    surplus_percent: Mapping[tuple[str, str], float]
    untouched: frozenset[str] = frozenset()


class Balance(NamedTuple):
    """Energies of a car over the cycle, kJ/km, and the engine's mean efficiency while it burns, per cent.

    recovered: taken by the battery at its terminals while the wheels brake; idle_fuel: burnt while the car stands
    """

    traction: float
    braking: float
    recovered: float
    engine_work: float
    engine_drag: float
    idle_fuel: float
    fuel: float
    engine_efficiency: float


@dataclass(frozen=True, slots=True)
class Member:
    """A member of a rule family against another case, per cent; electric driving below the threshold.

    driven_percent: fuel as driven; surplus_percent: stored energy at the end above the start's, of the fuel's
    """

    threshold_w: float
    fuel_percent: float
    nox_percent: float
    driven_percent: float
    surplus_percent: float
    neutral: bool


@dataclass(frozen=True, slots=True, eq=False)
class Reproduction:
    """All that the page shows.

    shipped: as shipped; others: by the name of the variation; curves: car -> members over the threshold
    calibrated: car -> the member that conventional's own, finer calibration takes
    families: car -> members of nox_cut against conventional
    work_mjpkm: what is another -> positive work at A's wheels; balances: car -> energies under its first rule
    """

    comparison: Comparison
    shipped: Under
    others: dict[str, Under]
    curves: dict[str, list[Member]]
    calibrated: dict[str, Member]
    families: dict[str, list[Member]]
    work_mjpkm: dict[str, float]
    balances: dict[str, Balance]


def reproduce(
    progress: Callable[[str, int, int], None] = lambda text, done, total: None,
) -> Reproduction:
    """The study as shipped and under every variation."""
    cycle, total = load_cycle(CYCLE), len(VARIATIONS) + len(VARIATIONS_OF_B) + 2
    progress("as shipped", 0, total)
    comparison = compare(cycle)
    shipped = under(v.AS_SHIPPED, cycle)
    others = {}
    for n, variation in enumerate((*VARIATIONS, *VARIATIONS_OF_B)):
        progress(variation.name, 1 + n, total)
        cars = ("A", "B") if variation in VARIATIONS_OF_B else CARS
        others[variation.name] = under(variation, cycle, cars)
    progress("calibration curves", total - 1, total)
    base = cases_of(comparison)["A", "baseline"]
    return Reproduction(
        comparison,
        shipped,
        others,
        {car: curve(car, cycle, base) for car in HYBRIDS},
        {car: calibrated(car, cycle, base) for car in HYBRIDS},
        {car: family(car, cycle, shipped.cases[car, "conventional"]) for car in HYBRIDS},
        wheel_work(cycle),
        {car: balance(car, cycle) for car in CARS},
    )


def under(variation: Variation, cycle: Cycle, cars: Iterable[str] = CARS) -> Under:
    """The rule-based strategies of the study on some of its cars, under a variation."""
    cases, driven, surplus_percent, untouched = {}, {}, {}, set()
    for name in cars:
        car, changed, problem, touched = varied(name, cycle, variation)
        if not touched:
            untouched.add(name)
        price_kgpj = certify(problem).price_kgpj
        for strategy in _RULES.get(name, _HYBRID_RULES):
            trajectory = simulate(problem, strategy_named(strategy).solve(problem).control)
            fuel_kg, nox_kg = trajectory.total_fuel_kg, trajectory.total_nox_kg
            surplus_j = trajectory.end_j - problem.end_min_j
            worth_kg = price_kgpj * surplus_j
            cases[name, strategy] = _in_units(car, changed, fuel_kg - worth_kg, nox_kg)
            driven[name, strategy] = _in_units(car, changed, fuel_kg, nox_kg)
            if 100 * abs(worth_kg) > NEUTRAL_WORTH_PERCENT * fuel_kg:
                surplus_percent[name, strategy] = _surplus_percent(car, surplus_j, fuel_kg)
    return Under(variation.name, cases, driven, surplus_percent, frozenset(untouched))


def _surplus_percent(car: Architecture, surplus_j: float, fuel_kg: float) -> float:
    return 100 * surplus_j / (fuel_kg * car.engine.heating_value_jpkg)


def _in_units(car: Architecture, cycle: Cycle, fuel_kg: float, nox_kg: float) -> Figures:
    return Figures(
        litres_per_100km(fuel_kg, car.engine.fuel_density_kgpm3, cycle.distance_m),
        nox_kg * 1e6 / (cycle.distance_m / 1e3),
    )


def curve(
    name: str, cycle: Cycle, base: Figures, thresholds_kw: Sequence[float] = CURVE_KW
) -> list[Member]:
    """The members of conventional over its threshold, against `base`."""
    car, cycle, problem, _ = varied(name, cycle, v.AS_SHIPPED)
    plan = conventional.solve(problem, thresholds_w=[1e3 * kw for kw in thresholds_kw])
    return _members(car, cycle, plan, base)


def calibrated(name: str, cycle: Cycle, base: Figures) -> Member:
    """The member of conventional that its own calibration takes, against `base`."""
    car, cycle, problem, _ = varied(name, cycle, v.AS_SHIPPED)
    plan = conventional.solve(problem)
    return _members(car, cycle, plan, base)[plan.notes["chosen"]]


def family(name: str, cycle: Cycle, base: Figures) -> list[Member]:
    """The members of nox_cut, against `base`."""
    car, cycle, problem, _ = varied(name, cycle, v.AS_SHIPPED)
    return _members(car, cycle, strategy_named("nox_cut").solve(problem), base)


def _members(car: Architecture, cycle: Cycle, plan: Plan, base: Figures) -> list[Member]:
    found = []
    for member in plan.notes["calibration"]:
        figures = _in_units(car, cycle, member["corrected_kg"], member["nox_kg"])
        changes = [percent(ours, theirs) for ours, theirs in zip(figures, base, strict=True)]
        fuel_kg = member["cost_kg"]
        driven = _in_units(car, cycle, fuel_kg, member["nox_kg"])
        found.append(
            Member(
                member["threshold_w"],
                *changes,
                percent(driven.fuel_l_per_100km, base.fuel_l_per_100km),
                _surplus_percent(car, member["surplus_j"], fuel_kg),
                bool(member["neutral"]),
            )
        )
    return found


def least_penalty(members: Sequence[Member], cut_percent: float) -> float | None:
    """Least fuel penalty of the neutral members that cut NOx by so much or more as printed, per cent."""
    able = [
        m.fuel_percent for m in members if m.neutral and round(m.nox_percent, 1) <= -cut_percent
    ]
    return min(able, default=None)


def balance(name: str, cycle: Cycle) -> Balance:
    """Where the energy of a shipped car goes under its first rule."""
    _, cycle, problem, _ = varied(name, cycle, v.AS_SHIPPED)
    rule = _RULES.get(name, _HYBRID_RULES)[0]
    trajectory = simulate(problem, strategy_named(rule).solve(problem).control)
    flows, table = trajectory.flows, problem.table
    wheel_w, fuel_w = flows["wheel_power_w"], flows["fuel_power_w"]
    engine_w = flows["engine_torque_nm"] * flows["engine_speed_radps"]
    fired, standing = fuel_w > 0, table.signals.speed_mps == 0

    def sum_of(power_w: NDArray[np.float64]) -> float:
        return float(np.sum(power_w * table.step_s)) / cycle.distance_m

    work, fuel = sum_of(np.where(fired, np.maximum(engine_w, 0), 0)), sum_of(fuel_w)
    return Balance(
        sum_of(np.maximum(wheel_w, 0)),
        sum_of(np.maximum(-wheel_w, 0)),
        sum_of(np.where(wheel_w < 0, np.maximum(-trajectory.battery_power_w, 0), 0)),
        work,
        sum_of(np.where(fired, 0, -engine_w)),
        sum_of(np.where(standing, fuel_w, 0)),
        fuel,
        100 * work / fuel,
    )


def wheel_work(cycle: Cycle) -> dict[str, float]:
    """Positive work at the wheels by what is another in A, MJ/km."""
    parts = {f"{name}'s hybrid parts": _parts_kg(name) for name in (*HYBRIDS, "B")}
    heaviest = max(parts, key=lambda what: parts[what])
    trials = {
        "A as shipped": {},
        f"with {heaviest}, {parts[heaviest]:g} kg": {"hybrid_mass_kg": parts[heaviest]},
        v.ROAD.name: dict(v.ROAD.changes(load_architecture("A"))),
    }
    both = {key: value for changes in trials.values() for key, value in changes.items()}
    trials["both"] = both
    return {
        what: _work_mjpkm(load_architecture("A", changes), cycle)
        for what, changes in trials.items()
    }


def _parts_kg(name: str) -> float:
    return load_architecture(name).contents["hybrid_mass_kg"]


def _work_mjpkm(car: Architecture, cycle: Cycle) -> float:
    return demand_of(cycle, car.vehicle, car.gearbox).wheel_work_jpm / 1e3
