"""The car file that carries a measured road load, and what else it needs: tyres, wheels, auxiliaries."""

from collections.abc import Mapping
from dataclasses import dataclass
from numbers import Real
from typing import Any

from hevopt.car_files.car import CarFile
from hevopt.errors import DataError
from hevopt.files.lookup import find
from hevopt.files.shown import shown
from hevopt.files.toml import checked, read_toml
from hevopt.measured.coastdown.fit import RoadLoad

_MASS_KG = (50.0, 100_000.0)
_LIKE_KEYS = ("tyre_radius_m", "wheel_inertia_kgm2", "auxiliary_power_w")


@dataclass(frozen=True, slots=True)
class CarBase:
    """Keys of a car file besides mass and road load, where each comes from, and the rotating parts as a mass."""

    contents: Mapping[str, Any]
    origins: Mapping[str, str]
    rotating_kg: float


def car_base(like: str | None, given: Mapping[str, Any], rotating_kg: float | None) -> CarBase:
    """What is known of the car: given keys before those of `like`.

    rotating_kg: what wheels and shafts add to the inertia; None: wheel inertia over tyre radius squared. Raises
    DataError where neither is known.
    """
    allowed = ("name", *_LIKE_KEYS)
    for key, value in given.items():
        number = isinstance(value, int | float) and not isinstance(value, bool)
        if key not in allowed or (key != "name" and not (number and value >= 0)):
            raise DataError(f"{key} = {value!r}; allowed: {', '.join(allowed)}, numbers from 0 up")
    contents: dict[str, Any] = {"name": "car from coast-down"}
    origins = {
        "mass_kg": "as tested, given; without hybrid parts",
        "road_load.coastdown_mass_kg": "as tested, given; C0 grows with the car's mass over it",
    }
    if like is not None:
        car = read_toml(find("architectures/components", like, ".toml"), CarFile)
        contents |= {key: getattr(car, key) for key in _LIKE_KEYS}
        origins |= dict.fromkeys(_LIKE_KEYS, f"from {like}")
    contents |= given
    origins |= dict.fromkeys(given, "given")
    radius_m, inertia = contents.get("tyre_radius_m"), contents.get("wheel_inertia_kgm2")
    if rotating_kg is None:
        if not radius_m or inertia is None:
            raise DataError(
                "the inertia of wheels and shafts is missing, about 3 % of the mass; give --rotating-mass-kg, or "
                "--wheel-inertia-kgm2 and --tyre-radius-m, or --like NAME (such as car_compact)"
            )
        return CarBase(contents, origins, inertia / radius_m**2)
    if not 0 <= rotating_kg <= _MASS_KG[1]:
        raise DataError(f"--rotating-mass-kg {rotating_kg:g}; allowed: 0 to {_MASS_KG[1]:g}")
    if "wheel_inertia_kgm2" in given:
        raise DataError("give either --rotating-mass-kg or --wheel-inertia-kgm2, not both")
    if radius_m:
        contents["wheel_inertia_kgm2"] = rotating_kg * radius_m**2
        origins["wheel_inertia_kgm2"] = "rotating mass times tyre radius squared"
    return CarBase(contents, origins, rotating_kg)


def mass_of_test(mass_kg: float | None) -> float:
    """The mass of the tested car, if it is given and can be one; else DataError."""
    low, high = _MASS_KG
    number = isinstance(mass_kg, Real) and not isinstance(mass_kg, bool)
    if mass_kg is None or not (number and low <= mass_kg <= high):
        found = "is missing" if mass_kg is None else shown(mass_kg)
        raise DataError(
            f"--mass-kg {found}: coast-downs give force per mass; give the mass of the car as tested, driver "
            f"included, {low:g} to {high:g} kg"
        )
    return float(mass_kg)


def car_contents(fit: RoadLoad, base: CarBase, mass_kg: float) -> dict[str, Any]:
    """Contents of a car file with the fit; DataError where such a file cannot be."""
    if fit.coefficients[0] < 0:
        raise DataError(
            f"C0 = {fit.coefficients[0]:.4g} N is below 0: these runs do not separate the coefficients, no car "
            "file is written; add runs over a wider range of speeds"
        )
    missing = [key for key in _LIKE_KEYS if key not in base.contents]
    if missing:
        raise DataError(
            f"the car file needs {', '.join(missing)}; give --like NAME (such as car_compact) to take them from "
            "another car, or --set KEY=VALUE for each"
        )
    names = ("coastdown_c0_n", "coastdown_c1_nspm", "coastdown_c2_ns2pm2")
    load = {name: float(value) for name, value in zip(names, fit.coefficients, strict=True)}
    load["coastdown_mass_kg"] = mass_kg
    contents = {**base.contents, "mass_kg": mass_kg, "road_load": load}
    checked("car from coast-down", contents, CarFile)
    return contents


def said_of_mass(mass_kg: float) -> list[str]:
    """Lines of text: what the mass of the test stands for in the car file."""
    return [
        f"mass_kg: {mass_kg:g} kg as tested becomes the car's mass without hybrid parts; an architecture's "
        "hybrid_mass_kg comes on top",
        f"coastdown_mass_kg: {mass_kg:g} kg; C0 is taken as rolling resistance and scales with the car's mass over "
        "it, C1 and C2 stay",
    ]
