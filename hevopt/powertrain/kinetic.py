"""Kinetic energy of engine and machines, and what its jumps take where one way of driving follows another.

Within a step the shafts' inertia is part of the balance of torques. Between steps the energy jumps: at changes of
gear, at starts and stops, where a clutch closes or opens. Of each jump

    engine, and machines on its shaft    at a start it is spun up by a machine, from the battery; a rise while it
                                         runs is the engine's own work, at its best efficiency; a fall is lost
    any other machine                    it spins itself up from the battery, and gives back what it loses in speed

each passing the machine's `spin_efficiency` between the battery's store and the shaft.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from hevopt.car.architecture import Architecture
from hevopt.car.parts import WHEEL
from hevopt.car.ways import Way
from hevopt.display.facts import Shown
from hevopt.powertrain.phases import Stretch
from hevopt.powertrain.shafts import Shafts, placed, wheel_ratio
from hevopt.problem.arrays import Array, Flags, Indices

# Of a car without machines, whose starter is of its own.
_STARTER_EFFICIENCY = 0.65
# Share of two kinetic energies by which they differ by rounding only.
_ROUNDING = 1e-13


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Kinetic(Shown):
    """Kinetic energy of a state's shafts at the start and the end of every step, J.

    engine_j: (2, time) of the engine and the machines on its shaft; machines_j: (machine, 2, time) of the others
    """

    engine_j: Array
    machines_j: Array

    @property
    def total_j(self) -> Array:
        """(2, time) of all together."""
        total: Array = self.engine_j + self.machines_j.sum(axis=0)
        return total

    def same_as(self, other: "Kinetic") -> bool:
        """Whether both are equal at every step."""
        return np.array_equal(self.engine_j, other.engine_j) and np.array_equal(
            self.machines_j, other.machines_j
        )


class Taken(NamedTuple):
    """What jumps take, each of one shape: fuel burnt, stored energy, and what of both and of the shafts is lost."""

    fuel_kg: Array
    energy_j: Array
    lost_j: Array


def kinetic_of(car: Architecture, found: Sequence[Stretch], step_s: Array) -> Kinetic:
    """The energies of a state by its stretches; 0 at steps where it is not possible.

    Where an engine's speed is free, the energy is that at free speed 0, as the balance of torques has it, and that
    of the engine at idle speed.
    """
    line, steps = car.driveline, len(step_s)
    engine, machines = np.zeros((2, steps)), np.zeros((len(car.machines), 2, steps))
    for stretch in found:
        shafts = stretch.shafts
        half_s = step_s[stretch.step] / 2
        for owner, inertia, shaft in placed(car):
            if shaft not in shafts.speed_radps:
                continue
            speed, accel = shafts.speed_radps[shaft], shafts.accel_radps2[shaft]
            beside = 0.0
            if line.free_engine_speed:
                ratio = wheel_ratio(stretch.way, shaft, shafts.gear)
                speed, accel = ratio * shafts.speed_radps[WHEEL], ratio * shafts.accel_radps2[WHEEL]
                if owner is None and shaft in stretch.way.held:
                    beside = inertia * car.engine.idle_radps**2 / 2
            into = engine if owner is None or shaft == line.engine else machines[owner]
            for end, sign in enumerate((-1, 1)):
                into[end, stretch.step] += (
                    beside + inertia * (speed + sign * half_s * accel) ** 2 / 2
                )
    return Kinetic(engine, machines)


def left_out_j(car: Architecture, way: Way, shafts: Shafts) -> Array:
    """(state,) kinetic energy at the steps' mean speeds beyond what is booked: that of engine speeds that are free.

    A machine may turn more slowly by it, so that it may be below 0.
    """
    left: Array = np.zeros(len(shafts.step))
    for owner, inertia, shaft in placed(car):
        if shaft in shafts.speed_radps:
            ratio = wheel_ratio(way, shaft, shafts.gear)
            squares = shafts.speed_radps[shaft] ** 2 - (ratio * shafts.speed_radps[WHEEL]) ** 2
            if owner is None and shaft in way.held:
                squares = squares - car.engine.idle_radps**2 * (shafts.speed_radps[shaft] > 0)
            left = left + inertia * squares / 2
    return left


class Jumps:
    """The jumps of a car's shafts from one state to the next."""

    def __init__(self, car: Architecture) -> None:
        engine, machines = car.engine, car.machines
        self._each = np.array([machine.spin_efficiency for machine in machines])
        self._start = max(self._each, default=_STARTER_EFFICIENCY)
        self.heat_jpkg = engine.heating_value_jpkg
        self._work_jpkg = engine.best_efficiency * self.heat_jpkg

    def taken(self, before: Kinetic, after: Kinetic, first: Kinetic, *, runs: bool) -> Taken:
        """(time,) what each step takes whose state is `after`, the step before having been in `before`.

        first: the state before the first step; runs: whether the engine does, before and after
        """
        return self.between(
            _before(before.engine_j, first.engine_j),
            after.engine_j[0],
            _before(before.machines_j, first.machines_j),
            after.machines_j[:, 0],
            runs,
        )

    def within(self, before: Kinetic, after: Kinetic, *, runs: bool) -> Taken:
        """(time,) what each step would take that goes from one state to the other at its own mean speeds."""
        one, other = before.engine_j.mean(axis=0), after.engine_j.mean(axis=0)
        own = before.machines_j.mean(axis=1), after.machines_j.mean(axis=1)
        return self.between(one, other, *own, runs)

    def between(
        self,
        engine_from: Array,
        engine_to: Array,
        from_j: Array,
        to_j: Array,
        runs: bool | Flags,
    ) -> Taken:
        """(time,) what the jumps take; engine_*: (time,), from_j, to_j: (machine, time), runs: before and after."""
        rise, own = _rise(engine_from, engine_to), _rise(from_j, to_j)
        by_fuel = np.where(runs, np.maximum(rise, 0.0), 0.0)
        spun = np.where(runs, 0.0, np.maximum(rise, 0.0))
        each = self._each[:, None]
        battery = spun / self._start + np.sum(np.where(own > 0, own / each, own * each), axis=0)
        lost = by_fuel * (self.heat_jpkg / self._work_jpkg - 1) + spun * (1 / self._start - 1)
        lost = lost + np.maximum(-rise, 0.0)
        lost = lost + np.sum(np.where(own > 0, own * (1 / each - 1), -own * (1 - each)), axis=0)
        return Taken(by_fuel / self._work_jpkg, battery, lost)


def jumps_along(
    car: Architecture, kinetics: Sequence[Kinetic], on: Flags, taken: Indices
) -> dict[str, Array]:
    """What a plan's shafts hold and what their jumps take, (time,); taken: index of its states, on: (state,).

    Before the first step it was in the first of the states.
    """
    step = np.arange(len(taken))
    engine = np.array([kinetic.engine_j for kinetic in kinetics])[taken, :, step]
    machines = np.array([kinetic.machines_j for kinetic in kinetics])[taken, :, :, step]
    first = kinetics[0]
    engine_from = np.concatenate([first.engine_j[:1, 0], engine[:-1, 1]])
    from_j = np.concatenate([first.machines_j[None, :, 0, 0], machines[:-1, :, 1]]).T
    runs = on[taken] & np.concatenate([on[:1], on[taken[:-1]]])
    jumps = Jumps(car)
    found = jumps.between(engine_from, engine[:, 0], from_j, machines[:, :, 0].T, runs)
    return {
        "shafts_before_j": engine_from + from_j.sum(axis=0),
        "shafts_start_j": engine[:, 0] + machines[:, :, 0].sum(axis=1),
        "shafts_end_j": engine[:, 1] + machines[:, :, 1].sum(axis=1),
        "spin_fuel_j": found.fuel_kg * jumps.heat_jpkg,
        "spin_loss_j": found.lost_j,
    }


def _rise(from_j: Array, to_j: Array) -> Array:
    """From one energy to another, none where they differ by rounding only."""
    rise = to_j - from_j
    return np.where(np.abs(rise) <= _ROUNDING * (from_j + to_j), 0.0, rise)


def _before(energy_j: Array, start_j: Array) -> Array:
    """(..., time) energy at the end of the step before each, that of the state before the first at its start."""
    return np.concatenate([start_j[..., 0, :1], energy_j[..., 1, :-1]], axis=-1)
