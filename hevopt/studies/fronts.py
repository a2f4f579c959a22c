"""The front of fuel against NOx of a car on a cycle, in the units of a report; the mathematics is in pareto.py."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Unpack

from hevopt.car.architecture import Architecture
from hevopt.display.facts import Shown
from hevopt.driving.cycle import Cycle, load_cycle
from hevopt.errors import DataError
from hevopt.files.frames import TYPES
from hevopt.powertrain.powertrain import build_problem
from hevopt.problem.problem import Problem
from hevopt.strategies import Strategy, chosen, strategy_named
from hevopt.studies.by_car import Progress, unseen
from hevopt.studies.cars import cars_of
from hevopt.studies.case import litres, prepare
from hevopt.studies.comparison import Strategies
from hevopt.studies.given import settings_from
from hevopt.studies.nox import require_nox
from hevopt.studies.pareto import GAP_ENOUGH, POINTS_MAX, SAME, Front, HalfPlane, front
from hevopt.studies.rows import shortfall_steps
from hevopt.studies.settings import Keywords, Settings
from hevopt.studies.solved import check_horizon

if TYPE_CHECKING:
    import pandas as pd

_NO_OTHERS: Mapping[str, Strategy] = {}


@dataclass(frozen=True, slots=True, repr=False)
class CarPoint(Shown):
    """A plan on the front.

    nox_weights: kg of fuel that a kg of NOx counts, those solved for which no plan found is better
    bound_l_per_100km: least fuel + weight x NOx of any plan, as fuel volume, at the first of them
    gap_percent: how far the point's own sum is above it; None for a bound of 0, and for a plan that ends with less
    charge than asked and costs less than the bound
    certificate: the proof of the bound
    """

    nox_weights: tuple[float, ...]
    strategy: str
    fuel_l_per_100km: float
    nox_mg_per_km: float
    bound_l_per_100km: float
    gap_percent: float | None
    certificate: str

    def as_dict(self) -> dict[str, Any]:
        """All figures by name, in order, the first weight in front."""
        return {
            "nox_weight": self.nox_weights[0],
            "nox_weights": list(self.nox_weights),
            "strategy": self.strategy,
            "fuel_l_per_100km": self.fuel_l_per_100km,
            "nox_mg_per_km": self.nox_mg_per_km,
            "bound_l_per_100km": self.bound_l_per_100km,
            "gap_percent": self.gap_percent,
            "certificate": self.certificate,
        }


@dataclass(frozen=True, slots=True, repr=False)
class CarFront(Shown):
    """The front of one car: plans from least fuel to least NOx, and what is proven of all others.

    points: on the inside; outer: (NOx in mg/km, fuel in l/100 km) of the outer front, beyond which no plan lies,
    from the points' most NOx to their least, its ends and the corners between
    gap_percent: largest share by which the best point costs more than the outer front, over all weights
    shortfall_steps: number of steps driven with less than the cycle asks
    """

    architecture: str
    cycle: str
    points: tuple[CarPoint, ...]
    outer: tuple[tuple[float, float], ...]
    gap_percent: float
    shortfall_steps: int

    def as_dict(self) -> dict[str, Any]:
        """The front as JSON and pages have it."""
        return {
            "architecture": self.architecture,
            "cycle": self.cycle,
            "points": [point.as_dict() for point in self.points],
            "outer": [{"nox_mg_per_km": n, "fuel_l_per_100km": f} for n, f in self.outer],
            "gap_percent": self.gap_percent,
        }

    def to_frame(self) -> "pd.DataFrame":
        """The points as a table of pandas, one line each, units in the names of columns."""
        import pandas as pd

        lines = [
            {"cycle": self.cycle, "architecture": self.architecture, **point.as_dict()}
            for point in self.points
        ]
        text = ("cycle", "architecture", "strategy", "certificate")
        return pd.DataFrame(
            {
                name: pd.Series(
                    [line[name] for line in lines], dtype=TYPES[str if name in text else float]
                )
                for name in lines[0]
                if name != "nox_weights"
            }
        )


def pareto(
    architecture: Architecture | str | Path,
    cycle: Cycle | str | Path = "nedc",
    *,
    weights: Sequence[float] | None = None,
    points: int | None = None,
    strategy: Strategies = "dp",
    progress: Progress | None = None,
    **settings: Unpack[Keywords],
) -> CarFront:
    """Fuel against NOx: plans over the weight on NOx, and the certified front that none can cross.

    architecture, cycle: name of a shipped one, a file, or what was loaded
    weights: kg of fuel that a kg of NOx counts; by default they are chosen, up to `points` of them where that is
    given, or until inner and outer front are close
    strategy: whose plans are the points, as in `compare`, one that learns from no other cycle
    progress: called with the weight that comes next, and how many are done of how many
    settings: the fields of `Settings` but nox_weight
    Raises DataError for a wrong name, file or setting, UnknownNoxError where the engine has no data on NOx,
    HevoptError where the car cannot be solved.
    """
    if weights is not None and points is not None:
        raise DataError("pareto: weights and points: choose one, the weights or how many to choose")
    if "nox_weight" in settings:
        raise DataError(
            "pareto: nox_weight: a front has many weights; give them as weights=[0, 10, 100]"
        )
    names, others = chosen(strategy)
    if names is None or len(names) != 1:
        raise DataError("pareto: a front has the plans of one strategy; name one")
    told = settings_from("pareto", settings)
    (car,) = cars_of([architecture], told).cars
    trace = cycle if isinstance(cycle, Cycle) else load_cycle(cycle)
    return front_of(
        car, trace, told, names[0], others=others, weights=weights, points=points, progress=progress or unseen
    )  # fmt: skip


def front_of(
    car: Architecture,
    cycle: Cycle,
    settings: Settings,
    strategy: str = "dp",
    *,
    others: Mapping[str, Strategy] = _NO_OTHERS,
    weights: Sequence[float] | None = None,
    points: int | None = None,
    progress: Progress = unseen,
) -> CarFront:
    """The front of a car in which the settings are made already; see `pareto`."""
    known = strategy_named(strategy, others)
    if known.learns:
        raise DataError(f"strategy {strategy} learns from other cycles; choose another, as dp")
    check_horizon(settings.horizon_s, [strategy], others)
    solve = known.solve
    if settings.horizon_s is not None:
        solve = partial(solve, horizon_s=settings.horizon_s)
    require_nox(car, "a front of fuel and NOx")
    problem = _problem(car, cycle, settings)
    found = front(
        problem,
        weights,
        points_max=POINTS_MAX if points is None else points,
        gap_enough=GAP_ENOUGH if points is None else 0.0,
        solve=solve,
        progress=lambda text, done, total: progress(f"{car.name}: {text}", done, total),
    )
    return in_units(found, car, cycle, strategy, shortfall_steps(problem))


def _problem(car: Architecture, cycle: Cycle, settings: Settings) -> Problem:
    """What a front is drawn on: the very table of the comparison's rows, so that none can lie beyond it."""
    if settings.refine:
        return prepare(car, cycle, settings).problem
    return build_problem(car, cycle, allow_shortfall=settings.allow_shortfall)


def in_units(found: Front, car: Architecture, cycle: Cycle, strategy: str, short: int) -> CarFront:
    """A front in the units of a report. short: number of steps driven with less than the cycle asks"""

    def milligrams(mass_kg: float) -> float:
        return mass_kg * 1e6 / (cycle.distance_m / 1e3)

    planes = {plane.nox_weight: plane for plane in found.half_planes}
    points = []
    for point in found.points:
        plane = planes[point.nox_weights[0]]
        excess_kg = point.cost_kg(plane.nox_weight) - plane.bound_kg
        # A plan that ends short of the charge asked may cost less than any that does not.
        known = plane.bound_kg > 0 and excess_kg >= -SAME * abs(plane.bound_kg)
        points.append(
            CarPoint(
                point.nox_weights,
                strategy,
                litres(car, cycle, point.fuel_kg),
                milligrams(point.nox_kg),
                litres(car, cycle, plane.bound_kg),
                100 * max(excess_kg, 0.0) / plane.bound_kg if known else None,
                str(plane.proof),
            )
        )
    outer = tuple(
        (milligrams(nox_kg), litres(car, cycle, fuel_kg)) for nox_kg, fuel_kg in _drawn(found)
    )
    return CarFront(car.name, cycle.name, tuple(points), outer, 100 * found.gap, short)


def _drawn(found: Front) -> list[tuple[float, float]]:
    """(nox_kg, fuel_kg) of the outer front over the points' NOx, from most to least."""
    most, least = found.points[0].nox_kg, found.points[-1].nox_kg
    inside = [corner for corner in found.corners if least < corner[0] < most]
    ends = [(nox_kg, _edge_kg(found.half_planes, nox_kg)) for nox_kg in (most, least)]
    return [ends[0], *inside, ends[1]]


def _edge_kg(half_planes: Sequence[HalfPlane], nox_kg: float) -> float:
    """Least fuel that the half planes leave open at a NOx."""
    return max(plane.bound_kg - plane.nox_weight * nox_kg for plane in half_planes)
