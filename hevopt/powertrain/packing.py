"""Points of a state, more than a table needs, to columns: those that no other beats in fuel, NOx and battery power.

A point that another of the same step and state equals in none and loses to in one of the three is in no optimal
plan, whatever the weight on NOx, as long as more charge is never worse; what is kept stands in the first columns.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from hevopt.powertrain.grids import Gridded
from hevopt.powertrain.operation import Setting, setting
from hevopt.powertrain.rejects import Bits
from hevopt.problem.arrays import Array, Flags, Indices
from hevopt.problem.battery import Battery, within_limits
from hevopt.problem.reject import Reject


class Packed(NamedTuple):
    """Columns of a state, (time, slot), and for each part of them the points kept: torques by actuator, (state, 1),
    and the column of each, (state,)."""

    fuel_kg: Array
    nox_kg: Array
    battery_power_w: Array
    reject: Bits
    kept: tuple[tuple[Setting, dict[str, Array], Indices], ...]


class _Flat(NamedTuple):
    """All points of all parts, one after the other: the part, its state and level, the step, and what they do."""

    part: Indices
    state: Indices
    level: Indices
    step: Indices
    fuel: Array
    nox: Array
    power: Array
    reject: Bits

    def picked(self, which: Indices) -> "_Flat":
        """Some of the points."""
        part, state, level, step = (values[which] for values in self[:4])
        fuel, nox, power = (values[which] for values in self[4:7])
        return _Flat(part, state, level, step, fuel, nox, power, self.reject[which])


def packed(parts: Sequence[Gridded], steps: int, battery: Battery) -> Packed:
    """The columns of a state whose points are given."""
    flat = _flat(parts, battery)
    usable = flat.picked(np.flatnonzero(flat.reject == 0))
    usable = usable.picked(np.argsort(usable.step, kind="stable"))
    usable = usable.picked(np.flatnonzero(_unbeaten(usable, steps)))
    counts = np.bincount(usable.step, minlength=steps)
    first = np.concatenate([[0], np.cumsum(counts)])
    slot = np.arange(len(usable.step)) - first[usable.step]
    shape = steps, max(1, int(counts.max(initial=0)))
    fuel, nox, power = (np.zeros(shape) for _ in range(3))
    reject = np.full(shape, int(Reject.BEATEN), dtype=np.uint16)
    _say_why(reject, flat, counts)
    for values, own in ((fuel, usable.fuel), (nox, usable.nox), (power, usable.power)):
        values[usable.step, slot] = own
    reject[usable.step, slot] = 0
    kept = []
    for n, part in enumerate(parts):
        of_part = np.flatnonzero(usable.part == n)
        if len(of_part):
            here, given = _kept(part, usable.state[of_part], usable.level[of_part])
            kept.append((here, given, slot[of_part]))
    return Packed(fuel, nox, power, reject, tuple(kept))


def _flat(parts: Sequence[Gridded], battery: Battery) -> _Flat:
    found = [_points(n, part, battery) for n, part in enumerate(parts)]
    part, state, level, step = (np.concatenate([p[n] for p in found]) for n in range(4))
    fuel, nox, power = (np.concatenate([p[n] for p in found]) for n in range(4, 7))
    reject = np.concatenate([p.reject for p in found])
    return _Flat(part, state, level, step, fuel, nox, power, reject)


def _points(number: int, part: Gridded, battery: Battery) -> _Flat:
    here, done = part.here, part.done
    states = len(here.shafts.step)
    torques = (torque.shape for torque in part.given.values())
    shape = np.broadcast_shapes((states, 1), part.repeats.shape, *torques)
    where = np.flatnonzero(np.broadcast_to(~part.repeats, shape))
    state, level = np.divmod(where, shape[1])
    values = (done.fuel_kg, done.nox_kg, done.battery_w)
    fuel, nox, power = (np.broadcast_to(whole, shape).ravel()[where] for whole in values)
    over = np.where(within_limits(battery, power), 0, int(Reject.BATTERY_LIMIT))
    reject = np.broadcast_to(done.reject, shape).ravel()[where] | over.astype(np.uint16)
    step = here.shafts.step[state]
    return _Flat(np.full(len(where), number), state, level, step, fuel, nox, power, reject)


def _unbeaten(points: _Flat, steps: int) -> Flags:
    from hevopt.powertrain._pruning_kernels import unbeaten

    first = np.searchsorted(points.step, np.arange(steps + 1))
    keep: Flags = unbeaten(first, points.power, points.fuel, points.nox)
    return keep


def _say_why(reject: Bits, flat: _Flat, counts: Indices) -> None:
    """At steps without any point: why its points cannot be used, as many as there are columns."""
    stuck = np.flatnonzero(counts == 0)
    if not len(stuck):
        return
    order = np.argsort(flat.step, kind="stable")
    first = np.searchsorted(flat.step[order], np.arange(len(counts) + 1))
    for k in stuck:
        reasons = flat.reject[order[first[k] : first[k + 1]]]
        if len(reasons):
            places = np.linspace(0, len(reasons) - 1, reject.shape[1]).astype(int)
            reject[k] = reasons[places]
        else:
            reject[k] = int(Reject.NO_PATH)


def _kept(part: Gridded, state: Indices, level: Indices) -> tuple[Setting, dict[str, Array]]:
    here = setting(part.here.car, part.here.way, part.here.shafts.picked(state))
    given = {
        name: torque[state, level if torque.shape[1] > 1 else 0][:, None]
        for name, torque in part.given.items()
    }
    return here, given
