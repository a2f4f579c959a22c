"""How the shafts of a way turn: speeds and accelerations from wheels and held speeds, by one linear system."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from hevopt.car.architecture import Architecture
from hevopt.car.balance import speeds_of
from hevopt.car.driveline import ENGINE
from hevopt.car.linear import Coefficient, Terms
from hevopt.car.parts import WHEEL
from hevopt.car.ways import Way
from hevopt.display.facts import Shown
from hevopt.driving.demand import Demand
from hevopt.problem.arrays import Array, Indices


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Slip(Shown):
    """A torque converter, (state,): what its impeller takes, its turbine gives, and the power turned into heat."""

    impeller_nm: Array
    turbine_nm: Array
    heat_w: Array

    def picked(self, state: Indices) -> "Slip":
        """Those of some states."""
        return Slip(self.impeller_nm[state], self.turbine_nm[state], self.heat_w[state])


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Shafts(Shown):
    """Speeds at the steps of a way; every array (state,), a state being a step, or one of its speeds to choose.

    step, gear: index and listed gear of each state's step; wheel_nm: torque that the wheels ask for
    acting_nm: shaft -> torque that its inertia takes, and on the wheels also what they ask for, on a torque
    converter's what that takes less what it gives; none where it is 0
    gap: share of the step without torque through the listed gearbox; load_w: electric load
    inertia_w: power that the inertia of the engine takes, and that of all machines
    slip: what a torque converter does that slips; None where none does
    """

    step: Indices
    gear: Indices
    speed_radps: Mapping[str, Array]
    accel_radps2: Mapping[str, Array]
    acting_nm: Mapping[str, Array]
    inertia_w: tuple[Array, Array]
    wheel_nm: Array
    gap: Array
    load_w: Array
    slip: Slip | None = None

    def at(self, coefficient: Coefficient) -> Coefficient:
        """A coefficient in the gear of each state."""
        return coefficient[self.gear] if isinstance(coefficient, np.ndarray) else coefficient

    def picked(self, state: Indices) -> "Shafts":
        """Those of some states."""

        def cut(terms: Mapping[str, Array]) -> dict[str, Array]:
            return {name: values[state] for name, values in terms.items()}

        return replace(
            self,
            step=self.step[state],
            gear=self.gear[state],
            speed_radps=cut(self.speed_radps),
            accel_radps2=cut(self.accel_radps2),
            acting_nm=cut(self.acting_nm),
            inertia_w=(self.inertia_w[0][state], self.inertia_w[1][state]),
            wheel_nm=self.wheel_nm[state],
            gap=self.gap[state],
            load_w=self.load_w[state],
            slip=None if self.slip is None else self.slip.picked(state),
        )


def shafts_of(
    car: Architecture,
    demand: Demand,
    way: Way,
    step: Indices,
    launch_radps: Array,
    free_radps: Array | None = None,
) -> Shafts:
    """The shafts at some steps, (state,); free_radps: (state,) engine speed where it is a choice.

    Where a torque converter slips the engine idles here; `slipped` makes it turn as fast as torques ask for.
    """
    gear, ratios = demand.gear[step], speeds_of(way)
    inputs = {WHEEL: demand.wheel_speed_radps[step]}
    idle = np.full(step.shape, car.engine.idle_radps)
    held = {
        "rest": np.zeros(step.shape),
        "idle": idle,
        "launch": launch_radps[step],
        "impeller": idle,
        "free": idle if free_radps is None else free_radps,
    }
    inputs |= {shaft: held[how] for shaft, how in way.held.items()}
    accel = {WHEEL: demand.wheel_accel_radps2[step]}
    speeds = {shaft: value_of(ratios[shaft], inputs, gear) for shaft in way.shafts}
    accels = {shaft: value_of(ratios[shaft], accel, gear) for shaft in way.shafts}
    wheel_nm = demand.wheel_torque_nm[step]
    acting, inertia_w = _inertia(car, way, gear, speeds, accels)
    acting[WHEEL] = acting[WHEEL] + wheel_nm if WHEEL in acting else wheel_nm
    gap = np.zeros(step.shape)
    own_w = car.vehicle.load_w(engine_on=ENGINE in way.active)
    load_w = np.full(step.shape, own_w) if demand.auxiliary_w is None else demand.auxiliary_w[step]
    return Shafts(step, gear, speeds, accels, acting, inertia_w, wheel_nm, gap, load_w)


def value_of(terms: Terms, inputs: Mapping[str, Array], gear: Indices) -> Array:
    """(state,) a speed from its terms and the inputs known, in the gear of each state."""
    total = np.zeros(gear.shape)
    for name, values in inputs.items():
        if name in terms:
            coefficient = terms[name]
            if isinstance(coefficient, np.ndarray):
                coefficient = coefficient[gear]
            total = total + coefficient * values
    return total


def placed(car: Architecture) -> list[tuple[int | None, float, str]]:
    """Index of each machine, None for the engine; its inertia; its shaft."""
    found: list[tuple[int | None, float, str]] = [
        (n, machine.inertia_kgm2, shaft)
        for n, (machine, (_, shaft)) in enumerate(
            zip(car.machines, car.driveline.machines, strict=True)
        )
    ]
    if car.driveline.engine is not None:
        found.append((None, car.engine.inertia_kgm2, car.driveline.engine))
    return found


def wheel_ratio(way: Way, shaft: str, gear: Indices) -> Array:
    """(state,) how many times as fast as the wheels a shaft turns, beside what held speeds add."""
    return value_of(speeds_of(way)[shaft], {WHEEL: np.ones(gear.shape)}, gear)


def _inertia(
    car: Architecture,
    way: Way,
    gear: Indices,
    speeds: Mapping[str, Array],
    accels: Mapping[str, Array],
) -> tuple[dict[str, Array], tuple[Array, Array]]:
    """Shaft -> torque of its inertia, and the power that engine and machines take by theirs.

    Where an engine's speed is free, holding it constant over a step would let a machine give up energy while the
    car accelerates and have it back for nothing at the next step. So such a driveline books the energy that its
    shafts have at free speed 0, a mass on the wheels, and nothing of what the free speed adds.
    """
    line, torques = car.driveline, dict[str, Array]()
    powers = [np.zeros(gear.shape), np.zeros(gear.shape)]
    for owner, inertia, shaft in placed(car):
        if shaft not in speeds or inertia == 0:
            continue
        on, torque = shaft, inertia * accels[shaft]
        if line.free_engine_speed:
            on, torque = WHEEL, inertia * wheel_ratio(way, shaft, gear) ** 2 * accels[WHEEL]
        torques[on] = torques[on] + torque if on in torques else torque
        kind = 0 if owner is None else 1
        powers[kind] = powers[kind] + torque * speeds[on]
    return torques, (powers[0], powers[1])
