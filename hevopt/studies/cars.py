"""The cars of a comparison: architectures with the settings made in them."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hevopt.car.architecture import Architecture
from hevopt.errors import DataError
from hevopt.files.lookup import shipped_names
from hevopt.files.shown import printable
from hevopt.studies.settings import KEYS, NEUTRAL, Settings


@dataclass(frozen=True, slots=True)
class Cars:
    """The cars of a comparison; car -> what was changed in it; what was left out where it has no meaning."""

    cars: list[Architecture]
    changes: dict[str, dict[str, Any]]
    left_out: list[str]

    def said(self) -> list[str]:
        """Lines that say what was changed in the cars, and what was left out."""
        told: dict[str, list[str]] = {}
        for car, changes in self.changes.items():
            for key, value in changes.items():
                told.setdefault(f"{key} = {value}", []).append(car)
        every = len(self.changes)
        lines = [
            f"set: {change}" + ("" if len(names) == every else f" in {', '.join(names)}")
            for change, names in told.items()
        ]
        return lines + self.left_out


def cars_of(wanted: Iterable[Architecture | str | Path] | None, settings: Settings) -> Cars:
    """The architectures, by default the shipped ones, with the settings made in those that are read here.

    Raises DataError where there is none, two have one name, a setting has a meaning for none of them, or would have
    to change one that is read already.
    """
    names = shipped_names("architectures", ".toml") if wanted is None else wanted
    cars: list[Architecture] = []
    changes: dict[str, dict[str, Any]] = {}
    without: dict[str, list[str]] = {}
    for name in names:
        car, made, left = _car(name, settings)
        cars.append(car)
        changes[car.name] = made
        for setting in left:
            without.setdefault(setting, []).append(car.name)
    if not cars:
        raise DataError("no architecture given; name at least one, or leave the list out for all")
    check_one_of_each_name(cars)
    for setting, unfit in without.items():
        if len(unfit) == len(cars):
            raise DataError(f"{setting} = {getattr(settings, setting)}: {_why(setting, unfit)}")
    return Cars(cars, changes, [f"{setting}: {_why(setting, u)}" for setting, u in without.items()])


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


def _car(
    wanted: Architecture | str | Path, settings: Settings
) -> tuple[Architecture, dict[str, Any], list[str]]:
    """A car, what was changed in it, and the settings that have no meaning for it."""
    # Here, as the models of files take long to make, and cars that are read already need none.
    from hevopt.car_files.load import load_architecture

    if isinstance(wanted, Architecture):
        _check_unchanged(wanted, settings)
        return _with_gear(wanted, settings), {}, []
    car = _with_gear(load_architecture(wanted, settings.changes), settings)
    named, left = _named_changes(settings, car)
    made = {**settings.changes, **named}
    if named:
        car = _with_gear(load_architecture(wanted, made), settings)
    return car, made, left


def _with_gear(car: Architecture, settings: Settings) -> Architecture:
    return car.with_free_gear() if settings.free_gear else car


def _check_unchanged(car: Architecture, settings: Settings) -> None:
    """DataError where a setting would change a car that is read already."""
    made = [name for name in (*KEYS, "changes") if getattr(settings, name) not in (None, {})]
    if made:
        raise DataError(
            f"architecture {car.name} is given as it was read, and {', '.join(made)} would change its file; give "
            "its name or file, or make the changes in load_architecture"
        )


def _named_changes(settings: Settings, car: Architecture) -> tuple[dict[str, Any], list[str]]:
    """Key path -> value of the settings that have a meaning for a car, and the names of those without."""
    drives = bool(car.functions - {"start_stop"})
    named, left = {}, []
    for name in KEYS:
        value = getattr(settings, name)
        if value is None:
            continue
        fits = {"soc": drives, "shift": car.gear == "free"}.get(name.partition("_")[0], True)
        if not drives and name == "soc_end" and value == NEUTRAL:
            continue  # what such a battery is anyway
        if fits:
            named[KEYS[name]] = value
        else:
            left.append(name)
    if named.get(KEYS["soc_end"]) == NEUTRAL:
        named[KEYS["soc_end"]] = named.get(KEYS["soc_start"], car.soc_start)
    return named, left


def _why(setting: str, cars: Sequence[str]) -> str:
    listed = printable(", ".join(cars))
    if setting == "shift_cost_g":
        return (
            f'not for {listed}, whose gear is the cycle\'s; free it with free_gear or gear = "free"'
        )
    return (
        f"not for {listed}, whose battery carries the electric load only; set {KEYS[setting]} changes it "
        "all the same"
    )
