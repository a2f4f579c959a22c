"""What an agent observes of a step, what is done about an action that cannot be used, and agents as policies."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hevopt.errors import InfeasibleError
from hevopt.problem.arrays import Array
from hevopt.problem.problem import Problem
from hevopt.strategies.policy import policy
from hevopt.strategies.stepwise import Step, index_of

Mask = NDArray[np.int8]

# Name -> what it is, in the order of the numbers of an observation. Nothing of what comes is among them.
OBSERVED: dict[str, str] = {
    "charge": "state of charge, 0 and 1 at the ends of its window",
    "charge_asked": "the least asked at the end of the drive, likewise",
    "turning": "1 where the engine turns before the step, else 0",
    "mode": "number of the mode that the last control left",
    "speed_mps": "mean speed of the step; 0 where the table has no signals, as the next two",
    "wheel_power_kw": "power at the wheels",
    "gear": "gear of the cycle",
    "battery_least_kw": "least battery power of the usable controls, < 0 charges",
    "battery_most_kw": "most battery power of the usable controls",
    "fuel_least_g": "least fuel of the usable controls in the step, switching left out",
    "fuel_most_g": "most fuel of the usable controls in the step, likewise",
}


def observed(now: Step) -> Array:
    """(11,) numbers of a step, as OBSERVED names them; those of its usable controls 0 where none is left."""
    span = now.soc_max - now.soc_min
    charge = float(np.clip((now.soc - now.soc_min) / span, 0.0, 1.0))
    asked = (now.soc_end_min - now.soc_min) / span
    power_kw, fuel_g = now.battery_power_w[now.usable] / 1e3, now.fuel_kg[now.usable] * 1e3
    ends = [0.0] * 4
    if now.usable.any():
        ends = [power_kw.min(), power_kw.max(), fuel_g.min(), fuel_g.max()]
    known = now.speed_mps == now.speed_mps
    car = (now.speed_mps, now.wheel_power_w / 1e3, now.gear) if known else (0.0, 0.0, 0.0)
    return np.array([charge, asked, float(now.turning), float(now.mode), *car, *ends])


def limits(problems: Sequence[Problem]) -> tuple[Array, Array]:
    """(11,) least and most of every number of an observation, 0 among them, for problems of one car."""
    low, high = np.zeros(len(OBSERVED)), np.zeros(len(OBSERVED))
    for problem in problems:
        table = problem.table
        power_kw = np.where(table.feasible, table.battery_power_w, 0.0) / 1e3
        fuel_g = np.where(table.feasible, table.fuel_kg, 0.0) * 1e3
        car: list[Any] = [np.zeros(1)] * 3
        if table.signals is not None:
            signals = table.signals
            car = [signals.speed_mps, signals.wheel_power_w / 1e3, signals.gear]
        whole = [
            [0, 1], [0, 1], [0, 1], [0, table.modes - 1], *car, power_kw, power_kw, fuel_g, fuel_g
        ]  # fmt: skip
        low = np.minimum(low, [np.min(values) for values in whole])
        high = np.maximum(high, [np.max(values) for values in whole])
    return low, np.where(high > low, high, low + 1.0)


def taken(now: Step, action: Any) -> int:
    """The control that an action stands for: itself, or where it cannot be used one that can.

    That is the one of the nearest battery power, among those that run the engine as the action does, or stop it as
    it does, if there is any; the first of equals. InfeasibleError where no control is left, DataError for what is
    no index of a control.
    """
    index = index_of(now, action)
    if now.usable[index]:
        return index
    if not now.usable.any():
        raise InfeasibleError(f"at step {now.k} (t = {now.time_s:g} s) no control is left")
    alike = now.usable & (now.engine_on == now.engine_on[index])
    among = alike if alike.any() else now.usable
    apart_w = np.abs(now.battery_power_w - now.battery_power_w[index])
    return int(np.argmin(np.where(among, apart_w, np.inf)))


def as_policy(choose: Callable[[Array, Mask], Any]) -> Callable[[Step], int]:
    """An agent as a policy, for `compare`, `register` and `--policy`: marked causal only where the check agrees.

    choose: from an observation, (11,), and its mask, (control,), to an action, the index of a control; one that
    cannot be used is treated as the environment treats it
    """

    @policy
    def asked(now: Step) -> int:
        return taken(now, choose(observed(now), now.usable.astype(np.int8)))

    return asked
