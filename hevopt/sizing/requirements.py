"""What a design must be able to do: figures of the same car driven at full pedal, and limits on them.

A trailer adds mass and its rolling resistance, not the car's load on the driven wheels, and no air resistance.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from hevopt.car.architecture import Architecture
from hevopt.errors import DataError
from hevopt.files.toml import FileModel
from hevopt.forward.performance import SPEEDS_KMH, SUSTAINED_KMH, Performance, performance
from hevopt.units import KMH_PER_MPS

# Figure -> the side on which it is limited, and the keys that say which one is meant.
_SIDES: dict[str, tuple[str, tuple[str, ...]]] = {
    "time_to_speed_s": ("at_most", ("speed_kmh",)),
    "time_in_gear_s": ("at_most", ("gear", "from_kmh", "to_kmh")),
    "top_speed_kmh": ("at_least", ()),
    "slope": ("at_least", ("speed_kmh",)),
    "start_slope": ("at_least", ()),
    "mass_kg": ("at_most", ()),
    "price": ("at_most", ()),
}
_WHICH = ("speed_kmh", "gear", "from_kmh", "to_kmh")
_SPEEDS = {"time_to_speed_s": SPEEDS_KMH, "slope": SUSTAINED_KMH}
# How far off a figure counts that a car does not reach at all.
MISSED = 1.0
Load = Annotated[float, Field(ge=0, le=5000)]


class RequirementFile(FileModel):
    """A limit on a figure; which speed or gear is meant, whether the machine helps, and what the car carries."""

    figure: Literal[
        "time_to_speed_s", "time_in_gear_s", "top_speed_kmh", "slope", "start_slope", "mass_kg", "price"
    ]  # fmt: skip
    at_most: Annotated[float, Field(gt=0, le=1e9)] | None = None
    at_least: Annotated[float, Field(gt=0, le=1e9)] | None = None
    speed_kmh: Annotated[int, Field(ge=1, le=500)] | None = None
    gear: Annotated[int, Field(ge=1, le=20)] | None = None
    from_kmh: Annotated[int, Field(ge=1, le=500)] | None = None
    to_kmh: Annotated[int, Field(ge=1, le=500)] | None = None
    boost: bool = False
    added_kg: Load = 0.0
    trailer_kg: Load = 0.0

    @model_validator(mode="after")
    def _fits(self) -> Self:
        side, which = _SIDES[self.figure]
        other = "at_least" if side == "at_most" else "at_most"
        if getattr(self, side) is None or getattr(self, other) is not None:
            raise ValueError(f"figure {self.figure!r} needs {side}, and no {other}")
        given = {key for key in _WHICH if getattr(self, key) is not None}
        if given != set(which):
            raise ValueError(
                f"figure {self.figure!r} needs {', '.join(which) or 'no speed or gear'}"
            )
        allowed = _SPEEDS.get(self.figure)
        if allowed and self.speed_kmh not in allowed:
            raise ValueError(f"speed_kmh {self.speed_kmh}; allowed: {', '.join(map(str, allowed))}")
        return self


@dataclass(frozen=True, slots=True)
class Required:
    """A requirement and what a car reaches of it, None where it does not get there at all."""

    file: RequirementFile
    reached: float | None

    @property
    def limit(self) -> float:
        """The limit."""
        value = self.file.at_least if self.file.at_most is None else self.file.at_most
        assert value is not None  # one of them is there, as the file's check makes sure
        return value

    @property
    def excess(self) -> float:
        """By which share of the limit it is missed; 0 or less where it is met."""
        if self.reached is None:
            return MISSED
        share = self.reached / self.limit - 1
        return share if self.file.at_most is not None else -share

    @property
    def name(self) -> str:
        """What is required, in words."""
        file = self.file
        text = {
            "time_to_speed_s": f"0 to {file.speed_kmh} km/h, s",
            "time_in_gear_s": f"{file.from_kmh} to {file.to_kmh} km/h in gear {file.gear}, s",
            "top_speed_kmh": "top speed, km/h",
            "slope": f"slope at {file.speed_kmh} km/h",
            "start_slope": "slope to start off on",
            "mass_kg": "mass, kg",
            "price": "price",
        }[file.figure]
        extra = [f"+ {file.added_kg:g} kg"] if file.added_kg else []
        extra += [f"trailer {file.trailer_kg:g} kg"] if file.trailer_kg else []
        return " ".join([text, *(["with e-boost"] if file.boost else []), *extra])


def reached(car: Architecture, wanted: Sequence[RequirementFile]) -> list[Required]:
    """What a car reaches of each requirement; DataError for one that it cannot be asked."""
    runs: dict[tuple[bool, float, float], Performance] = {}
    found = []
    for file in wanted:
        if file.figure == "mass_kg":
            found.append(Required(file, car.vehicle.mass_kg))
        elif file.figure == "price":
            found.append(Required(file, price_of(car)))
        else:
            key = file.boost, file.added_kg, file.trailer_kg
            if key not in runs:
                runs[key] = _driven(car, *key)
            found.append(Required(file, _figure(runs[key], file)))
    return found


def price_of(car: Architecture) -> float:
    """A car's price; DataError where no part has one."""
    if car.price is None:
        raise DataError(
            f"{car.name}: no part has a price; add price_pl to the engine's file, price_pkw to the machine's or "
            'price_pkwh to the battery\'s, or give it under [derived], such as machine.price_pkw = "20"'
        )
    return car.price


def _driven(car: Architecture, boost: bool, added_kg: float, trailer_kg: float) -> Performance:
    own_kg = car.vehicle.mass_kg + added_kg
    all_kg, tyre = own_kg + trailer_kg, car.handling.tyre
    tyre = tyre._replace(driven_share=tyre.driven_share * own_kg / all_kg)
    return performance(car.of_mass(all_kg), boosts=boost, handling=car.handling._replace(tyre=tyre))


def _figure(run: Performance, file: RequirementFile) -> float | None:
    if file.figure == "time_in_gear_s":
        asked = (file.gear or 0, file.from_kmh or 0, file.to_kmh or 0)
        known = run.in_gear_s
        if asked not in known:
            listed = ", ".join(
                f"{low} to {high} in gear {gear}" for gear, low, high in run.in_gear_s
            )
            raise DataError(
                f"{run.car.name}: {file.from_kmh} to {file.to_kmh} km/h in gear {file.gear} is no figure; allowed: "
                f"{listed}"
            )
        return known[asked]
    if file.figure == "time_to_speed_s":
        return {**run.to_speed_s}[file.speed_kmh or 0]
    if file.figure == "slope":
        return run.slope[file.speed_kmh or 0]
    if file.figure == "start_slope":
        return run.start_slope
    return max(run.top_mps.values()) * KMH_PER_MPS
