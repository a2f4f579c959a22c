"""Carried out of hevopt/pareto.py."""

from collections.abc import Sequence
from typing import Any

from hevopt.car.architecture import Architecture
from hevopt.driving.cycle import Cycle
from hevopt.studies.pareto import _SAME, Front, HalfPlane
from hevopt.units import litres_per_100km


def _drawn(found: Front) -> list[tuple[float, float]]:
    """(nox_kg, fuel_kg) of the outer front over the points' NOx, from most to least."""
    most, least = found.points[0].nox_kg, found.points[-1].nox_kg
    inside = [corner for corner in found.corners if least < corner[0] < most]
    ends = [(nox_kg, _edge_kg(found.half_planes, nox_kg)) for nox_kg in (most, least)]
    return [ends[0], *inside, ends[1]]


def _edge_kg(half_planes: Sequence[HalfPlane], nox_kg: float) -> float:
    """Least fuel that the half planes leave open at a NOx."""
    return max(plane.bound_kg - plane.nox_weight * nox_kg for plane in half_planes)


def figures_of(found: Front, car: Architecture, cycle: Cycle, strategy: str) -> dict[str, Any]:
    """The front in the units of a report, for JSON and pages.

    bound_l_per_100km: least fuel + weight x NOx of any plan, as fuel volume, at the point's first weight
    gap_percent: how far the point's own sum is above it; None for a bound of 0, and for a plan that ends with less
    charge than asked and costs less than the bound
    outer: the outer front from the points' most NOx to their least, its ends and the corners between
    """

    def litres(mass_kg: float) -> float:
        return litres_per_100km(mass_kg, car.engine.fuel_density_kgpm3, cycle.distance_m)

    def milligrams(mass_kg: float) -> float:
        return mass_kg * 1e6 / (cycle.distance_m / 1e3)

    planes = {plane.nox_weight: plane for plane in found.half_planes}
    points = []
    for point in found.points:
        plane = planes[point.nox_weights[0]]
        excess_kg = point.cost_kg(plane.nox_weight) - plane.bound_kg
        # A plan that ends short of the charge asked may cost less than any that does not.
        short = excess_kg < -_SAME * abs(plane.bound_kg)
        known = plane.bound_kg > 0 and not short
        points.append(
            {
                "nox_weight": plane.nox_weight,
                "nox_weights": list(point.nox_weights),
                "strategy": strategy,
                "fuel_l_per_100km": litres(point.fuel_kg),
                "nox_mg_per_km": milligrams(point.nox_kg),
                "bound_l_per_100km": litres(plane.bound_kg),
                "gap_percent": 100 * max(excess_kg, 0.0) / plane.bound_kg if known else None,
                "certificate": str(plane.proof),
            }
        )
    return {
        "architecture": car.name,
        "cycle": cycle.name,
        "points": points,
        "outer": [
            {"nox_mg_per_km": milligrams(nox_kg), "fuel_l_per_100km": litres(fuel_kg)}
            for nox_kg, fuel_kg in _drawn(found)
        ],
        "gap_percent": 100 * found.gap,
    }
