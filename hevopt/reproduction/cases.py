"""The published study done again: as shipped, and under other assumptions, to see what a difference comes from.

Everything is on the study's cycle with its rule-based strategies; dynamic programming is there for comparison. Fuel
is charge-corrected: less what the end charge is worth by the multiplier of the dual.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass

from hevopt.bounds.prices import one_price_dual
from hevopt.car.architecture import Architecture
from hevopt.car_files.load import load_architecture
from hevopt.driving.cycle import Cycle, load_cycle
from hevopt.driving.demand import demand_of
from hevopt.problem.simulation import simulate
from hevopt.reproduction import variations as v
from hevopt.reproduction.energies import Balance, balance
from hevopt.reproduction.members import Member, calibrated, curve, family, in_units, surplus_percent
from hevopt.reproduction.published import CARS, CYCLE, HYBRIDS, Cases, cases_of
from hevopt.reproduction.variations import Variation, varied
from hevopt.strategies import strategy_named
from hevopt.studies.comparison import Comparison, compare
from hevopt.studies.rows import NEUTRAL_PERCENT

_RULES = {"A": ("baseline",), "B": ("start_stop",)}
_HYBRID_RULES = ("conventional", "nox_cut")
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
# What the study's text leaves open, taken together: its start-stop rule and its map, and with them each speed up to
# which it may drive electrically.
JOINT_ELECTRIC = tuple(K_AND_STEEP.and_(e, f"both, {e.name}") for e in v.ELECTRIC)
# What keeps the cars of the study from being better than real ones, taken away: one by one, and all of it.
PHYSICS = (v.ALL_BRAKING, v.CELLS, v.NO_GAP, v.NO_INERTIA)
NO_PHYSICS = v.ALL_BRAKING.and_(v.CELLS, "").and_(v.NO_GAP, "").and_(v.NO_INERTIA, "all of them")
VARIATIONS = (
    v.K_PHASES, v.FREE_STARTS, v.DEAR_STARTS, v.ALTERNATOR, v.NO_INERTIA, v.NO_GAP, v.DRIVELINE, v.MACHINE_LOSS,
    v.CHARGING_LOSS, v.CELLS, v.EACH_WAY, v.RESISTANCE, v.HYBRID_MASS, v.AUXILIARIES, v.ROAD, LOSSES,
    v.STEEP_NOX, K_AND_STEEP,
    v.ALL_BRAKING, *v.BRAKING, v.NO_RECOVERY, *v.ELECTRIC, *JOINT_ELECTRIC, NO_PHYSICS,
)  # fmt: skip
# Asked of B alone, whose saving is less than the published one.
VARIATIONS_OF_B = (v.LESS_MACHINE_LOSS, v.LESS_CHARGING_LOSS)


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
    built = {car: varied(car, cycle, v.AS_SHIPPED) for car in CARS}
    return Reproduction(
        comparison,
        shipped,
        others,
        {car: curve(built[car], base) for car in HYBRIDS},
        {car: calibrated(built[car], base) for car in HYBRIDS},
        {car: family(built[car], shipped.cases[car, "conventional"]) for car in HYBRIDS},
        wheel_work(cycle),
        {car: balance(built[car], _RULES.get(car, _HYBRID_RULES)[0]) for car in CARS},
    )


def under(variation: Variation, cycle: Cycle, cars: Iterable[str] = CARS) -> Under:
    """The rule-based strategies of the study on some of its cars, under a variation."""
    cases, driven, off, untouched = {}, {}, {}, set()
    for name in cars:
        car, changed, problem, touched = varied(name, cycle, variation)
        if not touched:
            untouched.add(name)
        price_kgpj = one_price_dual(problem)[-1].price_kgpj
        for strategy in _RULES.get(name, _HYBRID_RULES):
            trajectory = simulate(problem, strategy_named(strategy).solve(problem).control)
            fuel_kg, nox_kg = trajectory.total_fuel_kg, trajectory.total_nox_kg
            surplus_j = trajectory.end_j - problem.end_min_j
            worth_kg = price_kgpj * surplus_j
            cases[name, strategy] = in_units(car, changed, fuel_kg - worth_kg, nox_kg)
            driven[name, strategy] = in_units(car, changed, fuel_kg, nox_kg)
            surplus = surplus_percent(car, surplus_j, fuel_kg)
            if abs(surplus) > NEUTRAL_PERCENT:
                off[name, strategy] = surplus
    return Under(variation.name, cases, driven, off, frozenset(untouched))


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
    return float(load_architecture(name).contents["hybrid_mass_kg"])


def _work_mjpkm(car: Architecture, cycle: Cycle) -> float:
    return demand_of(cycle, car.vehicle, car.gearbox).wheel_work_jpm / 1e3
