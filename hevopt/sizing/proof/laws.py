"""The laws of a car by its sizes, step by step: what engine, machine, battery and mass make of each.

Sizes are theta = (engine, machine, battery), factors of the car as its file has it, and the mass that goes with
them, m = m0 + mass . theta. At every step the driveline is in one of two modes, engine on or at rest; what it
does in each is in modes.py. A gap in which gears change leaves a share of the step; where it depends on the
sizes its least value in the box is taken, which burns and loses no more.
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
from hevopt.powertrain.branches import Branch, branches
from hevopt.powertrain.kinetic import Jumps
from hevopt.powertrain.phases import driver_of
from hevopt.problem.arrays import Array
from hevopt.sizing.proof.modes import Mode, NotProvable, mode_of

_FUNCTIONS = {"start_stop", "e_boost", "regenerative_braking", "nox_cut", "power_management"}
_LEVELS = 3
# Engine on, engine at rest.
MODES = 2


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Laws(Shown):
    """A car's laws over the sizes of a box.

    modes: engine on, at rest; static: (mode, time) loss of the machine that no torque changes; c3: of its loss
    switch_kg, switch_j: (size, time, mode, mode) [from, to], per engine and machine factor
    mass0, mass: m = mass0 + mass . theta
    """

    car: Architecture
    step_s: Array
    modes: tuple[Mode, Mode]
    static: Array
    c3: float
    auxiliary_w: float
    switch_kg: Array
    switch_j: Array
    mass0: float
    mass: Array


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
    car: Architecture,
    cycle: Cycle,
    low: Array,
    high: Array,
) -> Laws:
    """The laws of a car for a box of factors.

    cars: corner of the box, 0 or 1 for each size, -> its car
    """
    check_car(car)
    mass, mass0 = _masses(cars, car, low, high)
    ends = [car.of_mass(float(mass0 + mass @ corner)) for corner in (low, high)]
    heavy = {corner: demand_of(cycle, of.vehicle, of.gearbox) for corner, of in cars.items()}
    if cycle.gear is None:
        raise NotProvable(f"{cycle.name}: no proof over ranges on a cycle without listed gears")
    demand = demand_of(cycle, car.vehicle, car.gearbox)
    _check_driver(cars, heavy)
    gaps = [driver_of(of, heavy[corner]).gap for corner, of in cars.items()]
    gap = np.min(gaps, axis=0)
    found = branches(car, demand, _LEVELS, None)
    wheel = [demand_of(cycle, of.vehicle, of.gearbox).wheel_torque_nm for of in ends]
    kgs = [of.vehicle.mass_kg for of in ends]
    modes = [mode_of(car, demand, branch, gap, wheel, kgs) for branch in _sorted(found)]
    loss = car.machines[0].loss
    assert isinstance(loss, LossByCoefficients)  # as check_car has made sure
    static = np.array([
        np.where(mode.turns & (mode.w > 0), loss.c0 + loss.c1 * mode.w + loss.c2 * mode.w**2, 0.0)
        for mode in modes
    ])  # fmt: skip
    kg, joule = _switching(car, _sorted(found))
    return Laws(
        car, demand.step_s, (modes[0], modes[1]), static, loss.c3, car.vehicle.auxiliary_power_w,
        kg, joule, mass0, mass,
    )  # fmt: skip


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
    drivers = {corner: driver_of(car, demands[corner]) for corner, car in cars.items()}
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


def _sorted(found: Sequence[Branch]) -> list[Branch]:
    ordered = sorted(found, key=lambda branch: not branch.driven.state.engine_on)
    if [branch.driven.state.engine_on for branch in ordered] != [True, False]:
        raise NotProvable(
            "no proof over ranges: engine on and engine at rest must be the only states"
        )
    return ordered


def _switching(car: Architecture, found: Sequence[Branch]) -> tuple[Array, Array]:
    """What switching takes per factor: of the engine what its inertia and starts take, of the machine its own."""
    jumps, first = Jumps(car), found[0].driven.kinetic
    steps = first.engine_j.shape[-1]
    kg, joule = np.zeros((2, steps, MODES, MODES)), np.zeros((2, steps, MODES, MODES))
    none = np.zeros_like(first.machines_j), np.zeros_like(first.engine_j)
    for i, before in enumerate(found):
        for j, after in enumerate(found):
            runs = before.driven.state.engine_on and after.driven.state.engine_on
            a, b = before.driven.kinetic, after.driven.kinetic
            for size in range(2):
                parts = [
                    replace(one, machines_j=none[0])
                    if size == 0
                    else replace(one, engine_j=none[1])
                    for one in (a, b, first)
                ]
                taken = jumps.taken(*parts, runs=runs)
                kg[size, :, i, j], joule[size, :, i, j] = taken.fuel_kg, taken.energy_j
            if after.driven.state.engine_on and not before.driven.state.engine_on:
                kg[0, :, i, j] += car.engine.start_fuel_kg
    return kg, joule
