"""The parts of a driveline, and what each does to the shafts that it joins.

A joint has a speed row a (a . w = 0) and reacts on its shafts with torques proportional to one unknown lambda.
Without loss the reaction is -a (virtual power); with it the side that power leaves by gets less, by an efficiency h
that is eta where power enters on the side of the joint's sense, else 1 / eta:

    gear, gearbox, axle   w_a - i w_b                   T_a = -lambda, T_b = i h lambda
    closed clutch         w_a - w_b                     T_a = -lambda, T_b = lambda
    slipping clutch       none                          the same; it only ever loses
    planetary set         w_sun + k w_ring - (1 + k) w_carrier (Willis), k = z_ring / z_sun
                          (-1, -k h, 1 + k h) lambda; the loss is on the rolling power, sun against carrier
    shaft brake           w = 0                         T = -lambda
    one-way clutch        locked like a closed one while it pushes, else none
    torque converter      locked like a closed clutch; slipping none: its torques follow from both speeds
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import inf
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from hevopt.car.gear_loss import GearLoss
from hevopt.car.linear import Coefficient
from hevopt.car.torque_converter import HydraulicConverter
from hevopt.display.facts import Shown

WHEEL = "wheel"
Loss = Literal["clutch", "gearbox", "gear"]
# How a gear of a gearbox comes about: as the cycle lists it, chosen by the strategy, or chosen until the cycle
# lists one of its gears.
GearChoice = Literal["listed", "free", "preselected"]


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Joint(Shown):
    """A part in one of its states.

    speed: shaft -> coefficient of its speed row; empty where it ties no speeds
    reaction: shaft -> (c0, c1), torque (c0 + c1 h) lambda on it
    sense: shaft -> coefficient; lambda x (sense . w) is the power that enters
    pushes: whether lambda may not be negative
    lost: torque that is lost over gear, speed and lambda, taken from the output, and the gear, or one per step
    """

    name: str
    loss: Loss
    speed: Mapping[str, Coefficient]
    reaction: Mapping[str, tuple[Coefficient, Coefficient]]
    sense: Mapping[str, Coefficient]
    efficiency: Coefficient = 1.0
    pushes: bool = False
    lost: tuple[GearLoss, int | NDArray[np.int64]] | None = None

    @property
    def ends(self) -> tuple[str, str]:
        """Input and output of a pair of gears or a gearbox."""
        first, second = self.reaction
        return first, second

    @property
    def lossless(self) -> bool:
        """Whether it passes on all power that enters, but for what `lost` says."""
        return bool(np.all(np.asarray(self.efficiency) == 1.0))


@dataclass(frozen=True, slots=True)
class Gear:
    """A pair of gears, or an axle: first turns `ratio` times as fast as second.

    speed_max_radps: above this speed of the first shaft a coupling of its own opens it
    """

    name: str
    first: str
    second: str
    ratio: float
    efficiency: float = 1.0
    speed_max_radps: float = inf

    @property
    def shafts(self) -> tuple[str, ...]:
        """The shafts that it joins."""
        return self.first, self.second

    def joint(self) -> Joint:
        """In mesh."""
        return _geared(self.name, "gear", self.first, self.second, self.ratio, self.efficiency)


@dataclass(frozen=True, slots=True)
class Gearbox:
    """Gears between an input and an output, one at a time or none.

    ratios, efficiencies: by number of the gear, 0 being neutral; gears: the numbers that it has
    shift_fuel_kg: what a change that the strategy chooses counts
    loss: what is lost over gear, speed and torque, in place of efficiencies, which are 1 then
    """

    name: str
    first: str
    second: str
    ratios: tuple[float, ...]
    efficiencies: tuple[float, ...]
    gears: tuple[int, ...]
    choice: GearChoice
    shift_fuel_kg: float = 0.0
    loss: GearLoss | None = None

    @property
    def shafts(self) -> tuple[str, ...]:
        """The shafts that it joins."""
        return self.first, self.second

    def joint(self, gear: int | NDArray[np.int64]) -> Joint:
        """In a gear, or in one per step."""
        ratio, efficiency = np.array(self.ratios)[gear], np.array(self.efficiencies)[gear]
        if np.ndim(gear) == 0:
            ratio, efficiency = float(ratio), float(efficiency)
        found = _geared(self.name, "gearbox", self.first, self.second, ratio, efficiency)
        return found if self.loss is None else replace(found, lost=(self.loss, gear))


@dataclass(frozen=True, slots=True)
class Clutch:
    """A clutch or coupling. The driver's follows the step (locked, slipping, open), first being the engine's side;
    the strategy's is closed or open as it chooses.
    """

    name: str
    first: str
    second: str
    operation: Literal["driver", "strategy"]

    @property
    def shafts(self) -> tuple[str, ...]:
        """The shafts that it joins."""
        return self.first, self.second

    def closed(self) -> Joint:
        """Both shafts turn as one."""
        return _geared(self.name, "clutch", self.first, self.second, 1.0, 1.0)

    def slipping(self) -> Joint:
        """Torque passes, from first to second, and the difference of speeds is lost."""
        reaction = {self.first: (-1.0, 0.0), self.second: (1.0, 0.0)}
        sense = {self.first: 1.0, self.second: -1.0}
        return Joint(self.name, "clutch", {}, reaction, sense, pushes=True)


@dataclass(frozen=True, slots=True)
class OneWayClutch:
    """Lets `first` push `second`, or without a second shaft the case hold `first` against turning backwards."""

    name: str
    first: str
    second: str | None = None

    @property
    def shafts(self) -> tuple[str, ...]:
        """The shafts that it joins."""
        return (self.first,) if self.second is None else (self.first, self.second)

    def locked(self) -> Joint:
        """While it pushes: lambda >= 0."""
        speed, reaction = {self.first: 1.0}, {self.first: (1.0, 0.0)}
        if self.second is not None:
            speed = {self.first: 1.0, self.second: -1.0}
            reaction = {self.first: (-1.0, 0.0), self.second: (1.0, 0.0)}
        return Joint(self.name, "clutch", speed, reaction, {}, pushes=True)

    def freed(self) -> Mapping[str, float]:
        """Coefficients of what must not be negative while it does not push."""
        return {self.first: 1.0} if self.second is None else {self.first: -1.0, self.second: 1.0}


@dataclass(frozen=True, slots=True)
class Planetary:
    """A planetary set; ratio: teeth of the ring over teeth of the sun."""

    name: str
    sun: str
    ring: str
    carrier: str
    ratio: float
    efficiency: float = 1.0

    @property
    def shafts(self) -> tuple[str, ...]:
        """The shafts that it joins."""
        return self.sun, self.ring, self.carrier

    def joint(self) -> Joint:
        """Willis' equation."""
        k = self.ratio
        return Joint(
            self.name,
            "gear",
            {self.sun: 1.0, self.ring: k, self.carrier: -1.0 - k},
            {self.sun: (-1.0, 0.0), self.ring: (0.0, -k), self.carrier: (1.0, k)},
            {self.sun: 1.0, self.carrier: -1.0},
            self.efficiency,
        )


@dataclass(frozen=True, slots=True)
class ShaftBrake:
    """Holds a shaft at rest where the strategy chooses so."""

    name: str
    shaft: str

    @property
    def shafts(self) -> tuple[str, ...]:
        """The shaft that it holds."""
        return (self.shaft,)

    def joint(self) -> Joint:
        """At rest, with any torque."""
        return Joint(self.name, "clutch", {self.shaft: 1.0}, {self.shaft: (-1.0, 0.0)}, {})


@dataclass(frozen=True, slots=True)
class TorqueConverter:
    """A torque converter in the place of the driver's clutch: first is the engine's side, the impeller's."""

    name: str
    first: str
    second: str
    data: HydraulicConverter

    @property
    def shafts(self) -> tuple[str, ...]:
        """The shafts that it joins."""
        return self.first, self.second

    def closed(self) -> Joint:
        """Both shafts turn as one, by the lock-up clutch."""
        return _geared(self.name, "clutch", self.first, self.second, 1.0, 1.0)


Part = Gear | Gearbox | Clutch | OneWayClutch | Planetary | ShaftBrake | TorqueConverter


def _geared(
    name: str, loss: Loss, first: str, second: str, ratio: Coefficient, efficiency: Coefficient
) -> Joint:
    return Joint(
        name,
        loss,
        {first: 1.0, second: -ratio},
        {first: (-1.0, 0.0), second: (0.0, ratio)},
        {first: 1.0},
        efficiency,
    )
