"""The torques of a way: engine, machines, friction brake and joints from what is chosen, by one linear system.

Every shaft is in balance: reactions of joints and torques of actuators equal what inertia and wheels take. A joint
with loss passes on less on the side that power leaves by; which side that is depends on the torques themselves, so
that all combinations are tried and the one taken that agrees with its own result.
"""

from collections.abc import Mapping, Sequence
from functools import lru_cache

import numpy as np

from hevopt.car.balance import acting_on, directions, joints_of, torques_of
from hevopt.car.linear import Coefficient
from hevopt.car.parts import Joint
from hevopt.car.ways import Way
from hevopt.powertrain.shafts import Shafts
from hevopt.problem.arrays import Array


class Torques:
    """Balance of the shafts of a way at its states."""

    def __init__(self, way: Way, shafts: Shafts) -> None:
        self.way, self.shafts = way, shafts
        self._on = tuple(shafts.acting_nm)
        self._acting_nm = np.array([shafts.acting_nm[shaft] for shaft in self._on])
        lossy = [joint for joint in joints_of(way) if not joint.lossless]
        states = len(shafts.step)
        sense = [self.sense_radps(joint) for joint in lossy]
        self._sense_radps = np.array(sense) if sense else np.empty((0, states))

    def solve(self, given: Mapping[str, Array], wanted: Sequence[str]) -> dict[str, Array]:
        """(state, level) torques of actuators and joints by name, from as many as leave one solution.

        given: (state, level), (state, 1) or (1, 1) each. NaN where no direction of power agrees with its own
        result. What is given as nothing, (1, 1) and 0, costs nothing.
        """
        from hevopt.powertrain._torque_kernels import resolved

        names = tuple(sorted(given))
        acting = tuple(name for name in names if given[name].size > 1 or given[name].item() != 0)
        states = len(self.shafts.step)
        shape = np.broadcast_shapes((states, 1), *(given[name].shape for name in acting))
        values = np.empty((len(acting), *shape))
        for place, name in enumerate(acting):
            values[place] = given[name]
        terms = _terms(self.way, names, self._on, acting, tuple(wanted))
        signs = np.array(directions(self.way), dtype=float).reshape(len(terms), -1)
        gear = self.shafts.gear if terms.shape[-1] > 1 else np.zeros(states, dtype=np.int64)
        found = resolved(terms, signs, self._sense_radps, gear, self._acting_nm, values)
        return dict(zip(wanted, found, strict=True))

    def sense_radps(self, joint: Joint) -> Array:
        """(state,) speed that times the joint's lambda is the power that enters it."""
        speeds = self.shafts.speed_radps
        total = np.zeros(self.shafts.step.shape)
        for shaft, coefficient in joint.sense.items():
            total = total + self.shafts.at(coefficient) * speeds[shaft]
        return total


@lru_cache(maxsize=16384)
def _terms(
    way: Way,
    given: tuple[str, ...],
    on: tuple[str, ...],
    acting: tuple[str, ...],
    wanted: tuple[str, ...],
) -> Array:
    """(direction, unknown, input, gear) coefficients: joints with loss, then the wanted, over shafts and given."""
    lossy = [joint.name for joint in joints_of(way) if not joint.lossless]
    inputs = (*map(acting_on, on), *acting)
    systems = [torques_of(way, given, signs) for signs in directions(way)]
    unknowns = [[system[name] for name in (*lossy, *wanted)] for system in systems]
    entries: list[list[list[Coefficient]]] = [
        [[terms.get(name, 0.0) for name in inputs] for terms in system] for system in unknowns
    ]
    sizes = [np.size(entry) for system in entries for terms in system for entry in terms]
    gears = max(sizes, default=1)
    result = np.empty((len(systems), len(lossy) + len(wanted), len(inputs), gears))
    for c, system in enumerate(entries):
        for u, terms in enumerate(system):
            for i, entry in enumerate(terms):
                result[c, u, i] = entry
    return result
