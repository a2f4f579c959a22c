"""The laws of a car by its sizes, step by step: what engine, machine, battery and mass make of each.

Sizes are theta = (engine, machine, battery), factors of the car as its file has it, and the mass that goes with
them, m = m0 + mass . theta. At every step the driveline is in one of two modes, engine on or at rest; what it
does in each is in modes.py. A gap in which gears change leaves a share of the step; where it depends on the
sizes its least value in the box is taken, which burns and loses no more. Where the final drive has a range, see
geared.py.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from hevopt.car.architecture import Architecture
from hevopt.car.engine_laws import CompactLaw
from hevopt.car.machine_laws import LossByCoefficients
from hevopt.display.facts import Shown
from hevopt.driving.cycle import Cycle
from hevopt.driving.demand import Demand, demand_of
from hevopt.driving.driver import least_gap_shares
from hevopt.powertrain.phases import Driver, driver_of
from hevopt.problem.arrays import Array, Flags
from hevopt.sizing.proof.geared import Pattern, between, check_launches, patterns_of, switching_of
from hevopt.sizing.proof.modes import Mode, NotProvable, mode_of

_FUNCTIONS = {"start_stop", "e_boost", "regenerative_braking", "nox_cut", "power_management"}


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Laws(Shown):
    """A car's laws over the sizes of a box.

    on: modes of the engine turning, a second one where the driver's clutch is another with other final drives of a
    range, at the steps `apart` (time,); off: with the engine at rest
    switch_kg, switch_j: (size, time, mode, mode) [from, to], per engine and machine factor, engine on first
    mass0, mass: m = mass0 + mass . theta
    """

    car: Architecture
    step_s: Array
    on: tuple[Mode, ...]
    off: Mode
    apart: Flags
    switch_kg: Array
    switch_j: Array
    mass0: float
    mass: Array

    @property
    def modes(self) -> tuple[Mode, ...]:
        """All modes, the engine turning first."""
        return *self.on, self.off


def check_car(car: Architecture) -> None:
    """NotProvable where a car's laws are none of those that the proof knows."""
    engine, machines = car.engine, car.machines
    wrong = None
    if (
        car.driveline.kind != "gearbox_input"
        or not car.driveline.driver_clutches
        or car.gearbox is None
    ):
        wrong = f"its driveline is {car.driveline.kind}; needed: gearbox_input with a second clutch"
    elif not isinstance(engine.law, CompactLaw) or engine.law.fuel.a2 > 0:
        wrong = "its engine burns by a map; needed: fuel_coefficients"
    elif not isinstance(machines[0].loss, LossByCoefficients) or machines[0].full_load is not None:
        wrong = "its machine loses by a map or an efficiency; needed: kind loss"
    elif not _FUNCTIONS <= car.functions or car.gear != "cycle":
        wrong = "it lacks a function, or its gear is free"
    elif car.converter is not None:
        wrong = "a converter stands between battery and bus"
    elif car.vehicle.rolling_n[0] == 0.0:
        wrong = "its rolling resistance does not follow its mass"
    if wrong:
        raise NotProvable(f"{car.name}: no proof over ranges, {wrong}")


def laws_of(
    cars: Mapping[tuple[int, ...], Architecture],
    ends: Sequence[Architecture],
    cycle: Cycle,
    low: Array,
    high: Array,
) -> Laws:
    """The laws of a car for a box of factors.

    cars: corner of the box, 0 or 1 for each size, -> its car, whatever its final drive
    ends: the car of factors 1, with the lowest and with the highest final drive where that has a range
    """
    car = ends[0]
    check_car(car)
    if cycle.gear is None:
        raise NotProvable(f"{cycle.name}: no proof over ranges on a cycle without listed gears")
    mass, mass0 = _masses(cars, car, low, high)
    heavy = {corner: demand_of(cycle, of.vehicle, of.gearbox) for corner, of in cars.items()}
    for end in ends:
        _check_driver({corner: _geared(of, end) for corner, of in cars.items()}, heavy)
    gap = np.min([_least_gap(of, heavy[corner], ends) for corner, of in cars.items()], axis=0)
    demand = demand_of(cycle, car.vehicle, car.gearbox)
    drivers = [driver_of(end, demand) for end in ends]
    if len(ends) > 1:
        for corner, of in cars.items():
            check_launches([_geared(of, end) for end in ends], heavy[corner])
    masses = [car.of_mass(float(mass0 + mass @ corner)) for corner in (low, high)]
    wheel = [demand_of(cycle, of.vehicle, of.gearbox).wheel_torque_nm for of in masses]
    kgs = [of.vehicle.mass_kg for of in masses]

    def mode(pattern: Pattern, *, on: bool) -> Mode:
        found = [
            mode_of(end, demand, pattern.settings(n, on=on), gap, wheel, kgs)
            for n, end in enumerate(ends)
        ]
        return between(car, found[0], found[-1]) if len(found) > 1 else found[0]

    patterns, apart = patterns_of(ends, drivers)
    kg, joule = switching_of(car, patterns, apart)
    return Laws(
        car, demand.step_s, tuple(mode(pattern, on=True) for pattern in patterns), mode(patterns[0], on=False),
        apart, kg, joule, mass0, mass,
    )  # fmt: skip


def _geared(car: Architecture, end: Architecture) -> Architecture:
    """A car with the gearbox of another."""
    return replace(car, gearbox=end.gearbox, driveline=end.driveline)


def _least_gap(car: Architecture, demand: Demand, ends: Sequence[Architecture]) -> Array:
    if len(ends) == 1:
        return driver_of(_geared(car, ends[0]), demand).gap
    slow, fast = (end.gearbox for end in (ends[0], ends[-1]))
    assert slow is not None and fast is not None  # as check_car has made sure
    if car.shift_gap_s == 0:
        return np.zeros(len(demand.gear))
    return least_gap_shares(demand, car.vehicle, car.engine, slow, fast)


def corners_of(sizes: int) -> list[tuple[int, ...]]:
    """All corners of a box."""
    return list(product((0, 1), repeat=sizes))


def _masses(
    cars: Mapping[tuple[int, ...], Architecture], car: Architecture, low: Array, high: Array
) -> tuple[Array, float]:
    """Mass per factor and the rest; NotProvable where the corners' masses are not linear in the factors."""
    sizes = len(low)
    zero = (0,) * sizes
    base = cars[zero].vehicle.mass_kg
    mass = np.zeros(sizes)
    for n in range(sizes):
        if high[n] > low[n]:
            corner = tuple(int(n == other) for other in range(sizes))
            mass[n] = (cars[corner].vehicle.mass_kg - base) / (high[n] - low[n])
    mass0 = base - float(mass @ low)
    for corner, of in cars.items():
        theta = np.where(np.array(corner) == 1, high, low)
        if abs(mass0 + mass @ theta - of.vehicle.mass_kg) > 1e-6 or (mass < 0).any():
            raise NotProvable(
                f"{car.name}: no proof over ranges, its mass is not linear in the sizes, or falls"
            )
    return mass, mass0


def _check_driver(
    cars: Mapping[tuple[int, ...], Architecture], demands: Mapping[tuple[int, ...], Demand]
) -> None:
    """NotProvable where the driver does something else in one corner of the box than in another."""
    drivers: dict[tuple[int, ...], Driver] = {
        corner: driver_of(car, demands[corner]) for corner, car in cars.items()
    }
    first = next(iter(drivers.values()))
    for driver in drivers.values():
        changed = driver.launch_radps != first.launch_radps
        for on in (True, False):
            for (_, here), (_, there) in zip(driver.phases[on], first.phases[on], strict=True):
                changed = changed | (here != there)
        if changed.any():
            k = int(np.argmax(changed))
            raise NotProvable(
                f"no proof over ranges: at {first.demand.time_s[k]:g} s the driver's clutch is another with "
                "other sizes of this box; narrow the ranges"
            )
