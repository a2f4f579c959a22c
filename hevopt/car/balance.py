"""The two linear systems of a way to drive: its speeds, and its torques, with the listed gear as an axis.

Both are solved once for a way and kept: coefficients are numbers, or (gear,) arrays over the number of the gear
that the cycle lists. A speed is a sum over the wheels' and the held speeds, a torque a sum over the torques that
act on the shafts (inertia, wheels) and those that are given.
"""

from collections.abc import Mapping
from functools import lru_cache
from itertools import product

import numpy as np

from hevopt.car.driveline import BRAKE
from hevopt.car.linear import Row, Terms, solved
from hevopt.car.parts import WHEEL, Gearbox, Joint
from hevopt.car.ways import Way

Signs = tuple[int, ...]


@lru_cache(maxsize=4096)
def joints_of(way: Way) -> tuple[Joint, ...]:
    """The joints of a way, over the number of the listed gear where they depend on it."""
    listed = [use.part for use in way.uses if use.gear is None and isinstance(use.part, Gearbox)]
    count = max((len(box.ratios) for box in listed), default=1)
    return way.joints(np.arange(count))


@lru_cache(maxsize=4096)
def speeds_of(way: Way) -> Mapping[str, Terms]:
    """Shaft -> its speed in terms of the shafts that are held and the wheels."""
    rows = [Row(joint.name, joint.speed, {}) for joint in joints_of(way) if joint.speed]
    rows += [Row(shaft, {shaft: 1.0}, {shaft: 1.0}) for shaft in (WHEEL, *way.held)]
    return solved(rows)


@lru_cache(maxsize=4096)
def directions(way: Way) -> tuple[Signs, ...]:
    """All combinations of the directions in which power may pass the joints with loss; +1 along their sense."""
    lossy = [joint for joint in joints_of(way) if not joint.lossless]
    return tuple(product((1, -1), repeat=len(lossy)))


@lru_cache(maxsize=65536)
def torques_of(way: Way, given: tuple[str, ...], signs: Signs) -> Mapping[str, Terms]:
    """Actuator or joint -> its torque (lambda) in terms of given torques and of `acting_on` every shaft.

    given: actuators whose torque is known, as many as leave one solution; SingularError where there is none
    """
    lossy = [joint.name for joint in joints_of(way) if not joint.lossless]
    direction = dict(zip(lossy, signs, strict=True))
    rows = []
    for shaft in way.shafts:
        left: Terms = {}
        right: Terms = {acting_on(shaft): 1.0}
        for joint in joints_of(way):
            if shaft in joint.reaction:
                c0, c1 = joint.reaction[shaft]
                along = direction.get(joint.name, 1) > 0
                left[joint.name] = c0 + c1 * (joint.efficiency if along else 1 / joint.efficiency)
        for name, at in (*way.active.items(), (BRAKE, WHEEL)):
            if at == shaft and name in given:
                right[name] = -1.0
            elif at == shaft:
                left[name] = 1.0
        rows.append(Row(shaft, left, right))
    return solved(rows)


def acting_on(shaft: str) -> str:
    """The name of the torque that a shaft's inertia, and on the wheels the road, takes."""
    return f"on {shaft}"
