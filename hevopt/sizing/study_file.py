"""The file of a sizing: a car, cycles, parameters as those of a sweep, requirements and what is to be least.

    architecture = "C2"
    cycles = ["nedc", "wltc_class3b"]       weights = [0.4, 0.6]       strategy = "dp"
    objective = "fuel"                      "fuel", "co2", "price", "mass", or a sum { fuel = 1.0, price = 0.001 }
    objectives = ["fuel", "price"]          in place of it: the front of two
    trials = 100                            seed = 1
    constraints = [...]                     as in a sweep, and so are [parameters] and [derived]
    [[require]]                             see requirements.py
    figure = "time_to_speed_s"
    speed_kmh = 100
    at_most = 11.0

A range needs no count: any number in it is a value then.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from math import fsum
from pathlib import Path
from typing import Annotated, Any, Self

from pydantic import Field, model_validator

from hevopt.car.architecture import Architecture
from hevopt.errors import DataError
from hevopt.files.shown import shown
from hevopt.files.toml import FileModel, faults_of, good_keys, read_contents
from hevopt.sizing.requirements import RequirementFile, price_of
from hevopt.sweeps.plan.jobs import BOUND, NOX_WEIGHT
from hevopt.sweeps.plan.study_file import SweepStudy, contents_and_faults

GOODS = ("fuel", "co2", "price", "mass")
Weight = Annotated[float, Field(gt=0, le=1e6)]
_OWN = ("objective", "objectives", "trials", "seed", "require", "weights", "strategy")
_FAULTS_LISTED = 20


class SizeFile(FileModel):
    """What a sizing's file has beside the keys of a sweep."""

    objective: str | dict[str, Weight] | None = None
    objectives: (
        Annotated[list[str | dict[str, Weight]], Field(min_length=2, max_length=2)] | None
    ) = None
    trials: Annotated[int, Field(ge=1, le=100_000)] = 100
    seed: Annotated[int, Field(ge=0, le=2**31)] = 1
    require: Annotated[list[RequirementFile], Field(default_factory=list, max_length=100)]
    weights: Annotated[list[Weight], Field(min_length=1, max_length=1000)] | None = None
    strategy: str = "dp"

    @model_validator(mode="after")
    def _goods(self) -> Self:
        if self.objective is not None and self.objectives is not None:
            raise ValueError("give objective, or objectives for the front of two, not both")
        for given in self.objectives or [self.objective or "fuel"]:
            for good in [given] if isinstance(given, str) else given:
                if good not in GOODS:
                    raise ValueError(f"objective {shown(good)}; allowed: {', '.join(GOODS)}")
            if isinstance(given, dict) and not given:
                raise ValueError(
                    "objective: an empty sum; give at least one of " + ", ".join(GOODS)
                )
        if self.strategy == BOUND:
            raise ValueError("strategy: bound is none; allowed: dp and others that solve a design")
        return self


@dataclass(frozen=True, slots=True)
class Objective:
    """A sum of goods, each with its weight: fuel in l/100 km, CO2 in g/km, price as given, mass in kg."""

    weights: Mapping[str, float]

    @property
    def name(self) -> str:
        """What is counted, in words."""
        units = {"fuel": "fuel, l/100 km", "co2": "CO2, g/km", "price": "price", "mass": "mass, kg"}
        if list(self.weights.values()) == [1.0]:
            return units[next(iter(self.weights))]
        return " + ".join(f"{weight:g} x {units[good]}" for good, weight in self.weights.items())

    def value(self, car: Architecture, fuel_l_per_100km: float) -> float:
        """The sum for a car that burns so much; it rises with the fuel."""
        engine = car.engine
        grams = fuel_l_per_100km * engine.fuel_density_kgpm3 * engine.co2_kgpkg / 100
        found = {
            "fuel": lambda: fuel_l_per_100km,
            "co2": lambda: grams,
            "price": lambda: price_of(car),
            "mass": lambda: car.vehicle.mass_kg,
        }
        return fsum(weight * found[good]() for good, weight in self.weights.items())


@dataclass(frozen=True, slots=True, eq=False)
class SizeStudy:
    """What to size. sweep: car, cycles, strategy, parameters, constraints; weights: by cycle, their sum 1."""

    sweep: SweepStudy
    objectives: tuple[Objective, ...]
    weights: tuple[float, ...]
    require: tuple[RequirementFile, ...]
    trials: int
    seed: int


def read_size_study(path: str | Path) -> SizeStudy:
    """The sizing of a file; DataError with every fault."""
    path = Path(path)
    study, faults = size_study_and_faults(path)
    if len(faults) == 1:
        raise DataError(f"{path}, {faults[0]}")
    if study is None:
        raise DataError.of(str(path), faults[:_FAULTS_LISTED], len(faults))
    return study


def size_study_and_faults(path: Path) -> tuple[SizeStudy | None, list[str]]:
    """The sizing of a file, None where it has faults, and every fault."""
    contents = read_contents(path)
    own = {key: contents.pop(key) for key in _OWN if key in contents}
    _, faults = faults_of(own, SizeFile, _FAULTS_LISTED)
    strategy = good_keys(own, SizeFile).get("strategy", "dp")
    for key, why in (
        ("strategies", "a sizing has one strategy"),
        ("sample", "trials and seed take its place"),
    ):
        if key in contents:
            faults.append(f"{key}: {why}; leave it out")
            del contents[key]
    contents["strategies"] = [strategy]
    sweep, more = contents_and_faults(path, contents, open_ranges=True)
    faults += more
    if sweep is not None and NOX_WEIGHT in sweep.parameters:
        faults.append(f"parameters.{NOX_WEIGHT}: no size of a car; leave it out")
    file = None if faults else SizeFile.model_validate(own)
    if file is not None and sweep is not None and file.weights is not None:
        if len(file.weights) != len(sweep.cycles):
            faults.append(
                f"weights: {len(file.weights)} for {len(sweep.cycles)} cycles; give one for each"
            )
    if faults or file is None or sweep is None:
        return None, faults
    given = file.weights or [1.0] * len(sweep.cycles)
    weights = tuple(weight / fsum(given) for weight in given)
    chosen = file.objectives or [file.objective or "fuel"]
    return SizeStudy(
        sweep, tuple(map(_objective, chosen)), weights, tuple(file.require), file.trials, file.seed
    ), []


def _objective(given: str | dict[str, Any]) -> Objective:
    return Objective({given: 1.0} if isinstance(given, str) else dict(given))
