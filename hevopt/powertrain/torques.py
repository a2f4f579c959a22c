"""The torques of a way: engine, machines, friction brake and joints from what is chosen, by one linear system.

Every shaft is in balance: reactions of joints and torques of actuators equal what inertia and wheels take. A joint
with loss passes on less on the side that power leaves by; which side that is depends on the torques themselves, so
that all combinations are tried and the one taken that agrees with its own result. A gearbox whose losses are a map
is a lossless joint, and what it loses acts on its output; the torque in it follows in closed form.

Slopes. Give a joint a drag e >= 0 more on the side that power leaves by: what it delivers there is then at most
its share of lambda by either direction, two linear conditions. If no drag of any joint makes the engine's torque
less, in whichever combination of directions, the torque without drags is the least under those conditions, of a
linear program, and so convex in what is given, and every combination's line stays at or below it. Then the lines
that agree at a point are slopes there, the steepest upwards and downwards those of its two sides.
"""

from collections.abc import Mapping, Sequence
from functools import lru_cache

import numpy as np

from hevopt.car.balance import acting_on, directions, joints_of, torques_of
from hevopt.car.driveline import BRAKE, ENGINE
from hevopt.car.gear_loss import GearLoss, loss_at
from hevopt.car.linear import Coefficient
from hevopt.car.parts import Joint
from hevopt.car.ways import Way
from hevopt.powertrain.shafts import Shafts
from hevopt.problem.arrays import Array, Flags, Indices

# Power against the direction assumed that is rounding, and a coefficient that is none.
_POWER_W, _NOTHING = 1e-9, 1e-12


class Torques:
    """Balance of the shafts of a way at its states."""

    def __init__(self, way: Way, shafts: Shafts) -> None:
        self.way, self.shafts = way, shafts
        self._mapped = mapped_of(way)
        states = len(shafts.step)
        outputs = (joint.ends[1] for joint in self._mapped)
        self._on = tuple(dict.fromkeys((*shafts.acting_nm, *outputs)))
        nothing = np.zeros(states)
        self._acting_nm = np.array([shafts.acting_nm.get(shaft, nothing) for shaft in self._on])
        self._losses = [_lost(joint, shafts) for joint in self._mapped]
        lossy = [joint for joint in joints_of(way) if not joint.lossless]
        sense = [self.sense_radps(joint) for joint in lossy]
        self._sense_radps = np.array(sense) if sense else np.empty((0, states))

    def solve(self, given: Mapping[str, Array], wanted: Sequence[str]) -> dict[str, Array]:
        """(state, level) torques of actuators and joints by name, from as many as leave one solution.

        given: (state, level), (state, 1) or (1, 1) each. NaN where no direction of power agrees with its own
        result. What is given as nothing, (1, 1) and 0, costs nothing.
        """
        from hevopt.powertrain._torque_kernels import resolved, resolved_with_losses

        names = tuple(sorted(given))
        acting = tuple(name for name in names if given[name].size > 1 or given[name].item() != 0)
        states = len(self.shafts.step)
        shape = np.broadcast_shapes((states, 1), *(given[name].shape for name in acting))
        values = np.empty((len(acting), *shape))
        for place, name in enumerate(acting):
            values[place] = given[name]
        asked = (*(joint.name for joint in self._mapped), *wanted)
        terms = _terms(self.way, names, self._on, acting, asked)
        signs = np.array(directions(self.way), dtype=float).reshape(len(terms), -1)
        gear = self.shafts.gear if terms.shape[-1] > 1 else np.zeros(states, dtype=np.int64)
        if not self._mapped:
            found = resolved(terms, signs, self._sense_radps, gear, self._acting_nm, values)
            return dict(zip(wanted, found, strict=True))
        places = np.array([self._on.index(joint.ends[1]) for joint in self._mapped])
        ratio, knot_nm, lost_nm = (np.array(part) for part in zip(*self._losses, strict=True))
        found = resolved_with_losses(
            terms,
            signs,
            self._sense_radps,
            gear,
            self._acting_nm,
            values,
            places,
            ratio,
            knot_nm,
            lost_nm,
        )
        return dict(zip(wanted, found[len(self._mapped) :], strict=True))

    def lost_w(self, joint: Joint, torque_nm: Array) -> Array:
        """(state, level) what a gearbox with a map loses at torques in it."""
        n = [other.name for other in self._mapped].index(joint.name)
        _, knot_nm, lost_nm = self._losses[n]
        torque = np.broadcast_to(torque_nm, (len(knot_nm), torque_nm.shape[1]))
        speed: Array = self.shafts.speed_radps[joint.ends[0]]
        return loss_at(knot_nm, lost_nm, torque) * speed[:, None]

    def off_map(self, joint: Joint, torque_nm: Array) -> Flags:
        """(state, level) where a gearbox with a map has no data for a torque in it."""
        losses, gear = _data(joint, self.shafts)
        return losses.unknown(gear, self.shafts.speed_radps[joint.ends[0]], torque_nm)

    def engine_slopes(self, name: str, torque_nm: Array) -> tuple[Array, Array] | None:
        """(state, level) slopes of the engine's torque over that of one actuator, towards less and more of it.

        All else is solved for, but the friction brakes where something else moves the wheels: these rest. None
        where the torque is not shown to be convex, as with the losses of a gearbox in a map.
        """
        if self._mapped:
            return None
        braked = self.way.slack is not None and self.way.slack != name
        names = tuple(sorted({name, BRAKE} if braked else {name}))
        terms = _terms(self.way, names, self.way.shafts, (name,), (ENGINE,))
        gear = self.shafts.gear if terms.shape[-1] > 1 else np.zeros_like(self.shafts.gear)
        lossy = [joint for joint in joints_of(self.way) if not joint.lossless]
        for joint, sense in zip(lossy, self._sense_radps, strict=True):
            if not self._drags(joint, sense, terms[:, -1, :-1], gear):
                return None
        none = np.zeros(len(gear))
        acting = np.array([self.shafts.acting_nm.get(shaft, none) for shaft in self.way.shafts])
        left, right = np.full(torque_nm.shape, np.inf), np.full(torque_nm.shape, -np.inf)
        for signs, own in zip(directions(self.way), terms, strict=True):
            agrees = np.ones(torque_nm.shape, dtype=bool)
            for sign, sense, unknown in zip(signs, self._sense_radps, own, strict=False):
                passed = np.sum(unknown[:-1, gear] * acting, axis=0)[:, None]
                passed = passed + unknown[-1, gear][:, None] * torque_nm
                agrees &= passed * (sign * sense)[:, None] >= -_POWER_W
                # Where no power can pass, the first direction counts.
                agrees &= (sense != 0)[:, None] | (sign > 0)
            slope = own[-1, -1, gear][:, None]
            left = np.where(agrees, np.minimum(left, slope), left)
            right = np.where(agrees, np.maximum(right, slope), right)
        return left, right

    def _drags(self, joint: Joint, sense: Array, on_shafts: Array, gear: Indices) -> bool:
        """Whether more drag where a joint delivers never takes less of the engine.

        on_shafts: (direction, shaft, gear) what a torque acting on each shaft takes of it
        """
        total = np.zeros((len(on_shafts), len(gear)))
        for place, shaft in enumerate(self.way.shafts):
            if shaft in joint.reaction:
                total = total + self.shafts.at(joint.reaction[shaft][1]) * on_shafts[:, place, gear]
        return bool((np.sign(sense) * total >= -_NOTHING).all())

    def sense_radps(self, joint: Joint) -> Array:
        """(state,) speed that times the joint's lambda is the power that enters it."""
        speeds = self.shafts.speed_radps
        total = np.zeros(self.shafts.step.shape)
        for shaft, coefficient in joint.sense.items():
            total = total + self.shafts.at(coefficient) * speeds[shaft]
        return total


@lru_cache(maxsize=4096)
def mapped_of(way: Way) -> tuple[Joint, ...]:
    """The joints of a way whose losses are a map."""
    return tuple(joint for joint in joints_of(way) if joint.lost is not None)


def _data(joint: Joint, shafts: Shafts) -> tuple[GearLoss, Indices]:
    """A joint's map, and the gear of each state."""
    assert joint.lost is not None
    losses, gear = joint.lost
    of_state = (
        gear[shafts.gear] if isinstance(gear, np.ndarray) else np.full(len(shafts.gear), gear)
    )
    return losses, of_state


def _lost(joint: Joint, shafts: Shafts) -> tuple[Array, Array, Array]:
    """(state,) input over output speed, and (state, knot) torques and losses at the input."""
    losses, gear = _data(joint, shafts)
    first, second = joint.ends
    ratio = np.broadcast_to(-np.asarray(shafts.at(joint.speed[second])), gear.shape)
    return ratio.astype(float), *losses.knots(gear, shafts.speed_radps[first])


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
