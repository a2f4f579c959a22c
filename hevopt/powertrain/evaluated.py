"""What torques burn and draw at every state, and why they cannot be used."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from hevopt.car.driveline import State
from hevopt.powertrain.operation import Setting, completed, flowing
from hevopt.powertrain.rejects import Bits, bits, braking_rejects, function_rejects, limit_rejects
from hevopt.problem.arrays import Array, Flags
from hevopt.problem.reject import Reject

_ROUNDING_W = 1e-9


class Evaluated(NamedTuple):
    """Fuel, NOx, battery power and rejections; arrays that broadcast to (state, level)."""

    fuel_kg: Array
    nox_kg: Array
    battery_w: Array
    reject: Bits


def evaluated(here: Setting, state: State, given: Mapping[str, Array], step_s: Array) -> Evaluated:
    """Torques given, (state, level), with everything that follows; step_s: (time,)."""
    torques = completed(here, given)
    flows, length_s = flowing(here, torques), step_s[here.shafts.step][:, None]
    battery = flows.machines_w + here.shafts.load_w[:, None]
    # What an alternator that follows its load leaves to the battery is rounding, not charge.
    battery = here.car.terminal_w(np.where(np.abs(battery) < _ROUNDING_W, 0.0, battery))
    reject = (
        bits(Reject.ENGINE_MAP, flows.off_engine_map)
        | bits(Reject.MACHINE_MAP, flows.off_machine_map)
        | limit_rejects(here, torques)
        | braking_rejects(here, torques, battery)
        | function_rejects(here, state, torques, battery)
    )
    return Evaluated(flows.fuel_kgps * length_s, flows.nox_kgps * length_s, battery, reject)


def battery_idle(
    here: Setting, given: Mapping[str, Array], name: str, battery_w: Array, passes: int = 8
) -> tuple[Array, Flags]:
    """(state, 1) torque of one actuator at which the battery is idle, between its levels, and whether there is one.

    given: its torques rise from level to level; battery_w: (state, level) what they draw. By regula falsi with
    halved weights (Illinois), for the loss of a machine has kinks.
    """
    torque = given[name]
    above = battery_w > 0
    crossing = above[:, :-1] != above[:, 1:]
    found = crossing.any(axis=1)
    at = np.argmax(crossing, axis=1)[:, None]
    a, b = (np.take_along_axis(torque, at + n, 1) for n in (0, 1))
    fa, fb = (np.take_along_axis(battery_w, at + n, 1) for n in (0, 1))
    rest = {other: values for other, values in given.items() if other != name}
    middle, load_w = a, here.shafts.load_w[:, None]
    for _ in range(passes):
        with np.errstate(invalid="ignore", divide="ignore"):
            middle = np.where(fb != fa, b - fb * (b - a) / (fb - fa), b)
        middle = np.where(np.isfinite(middle), middle, b)
        drawn_w = flowing(here, completed(here, {**rest, name: middle})).machines_w + load_w
        fm = np.broadcast_to(drawn_w, middle.shape)
        if np.max(np.abs(fm), where=found[:, None], initial=0.0) < _ROUNDING_W:
            break
        other = fm * fb < 0
        a, fa = np.where(other, b, a), np.where(other, fb, fa / 2)
        b, fb = middle, fm
    return middle, found[:, None]
