"""The shipped engines and the car of the tip-in, read once."""

from functools import cache
from typing import NamedTuple

from hevopt import load_architecture
from hevopt.car.architecture import Architecture
from hevopt.car_files.mean_value_parts import mean_value_of
from hevopt.mean_value.car import car_in_gear, cruise, model_of
from hevopt.mean_value.parameters import Diesel, Drive, Model
from hevopt.mean_value.paths import paths

RAMP = Drive(pedal_rate_ps=10.0)


class Shipped(NamedTuple):
    """A shipped car with its engine."""

    car: Architecture
    diesel: Diesel


@cache
def shipped(name: str) -> Shipped:
    """One of the two cars whose engines have a mean-value part."""
    car = load_architecture(name)
    return Shipped(car, mean_value_of(name, car.contents["engine"]))


@cache
def in_gear(name: str, gear: int) -> Model:
    """The model of a shipped car in a gear."""
    found = shipped(name)
    return model_of(
        found.diesel, car_in_gear(found.car, found.diesel, paths(found.car, gear, 10.0))
    )


@cache
def cruising(name: str, gear: int, kmh: float):
    """(state,) of a shipped car at constant speed."""
    return cruise(in_gear(name, gear), kmh / 3.6)
