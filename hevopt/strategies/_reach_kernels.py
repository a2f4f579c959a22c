"""Compiled reachability: from which stored energy the end can still be reached, with the true battery step."""

from typing import NamedTuple

import numpy as np

from hevopt._compile import compiled
from hevopt.problem._battery_kernels import BatteryArrays, chemical_power_at
from hevopt.problem.arrays import Array
from hevopt.problem.choices import Choices


class Reach(NamedTuple):
    """Stored energy, (time + 1, mode), between which the end can be reached; least > greatest: nowhere.

    window_j: what it must keep to between switching and step
    """

    least_j: Array
    greatest_j: Array
    window_j: tuple[float, float]


@compiled()
def _may_turn(power: float, step: float, battery: BatteryArrays) -> bool:
    """Whether more stored energy before a step could leave less after it, its drain rising faster than the energy.

    Per joule the drain rises by at most I² (dR/dSOC) / (sqrt(U² - 4 R P) Q): only where resistance rises.
    """
    ohms = battery.charge_ohm if power < 0.0 else battery.discharge_ohm
    for i in range(len(battery.soc) - 1):
        rise = ohms[i + 1] - ohms[i]
        if rise <= 0.0:
            continue
        low_v = battery.open_circuit_v[i]
        root = low_v
        if power > 0.0:
            root = np.sqrt(max(low_v * low_v - 4.0 * ohms[i + 1] * power, 1e-12 * low_v * low_v))
        current = 2.0 * abs(power) / (low_v + root)
        width = battery.soc[i + 1] - battery.soc[i]
        if step * current * current * rise / width >= root * battery.capacity_as:
            return True
    return False


@compiled()
def _energy_before(
    after: float, power: float, step: float, low: float, high: float, battery: BatteryArrays
) -> float:
    """Stored energy within [low, high] from which a step leads to `after`; clipped to the window.

    What is left rises with what was stored (see _may_turn), so halving finds it where repetition does not settle.
    """
    energy = min(max(after, low), high)
    for _ in range(100):
        moved = after + step * chemical_power_at(power, energy, battery)
        moved = min(max(moved, low), high)
        if abs(moved - energy) <= 1e-12 * high:
            return energy
        energy = moved
    for _ in range(100):
        energy = 0.5 * (low + high)
        if energy - step * chemical_power_at(power, energy, battery) < after:
            low = energy
        else:
            high = energy
    return energy


@compiled()
def reachable(
    choices: Choices, window: tuple[float, float], end_min: float, battery: BatteryArrays
) -> Reach:
    """Least and greatest stored energy from which the end can still be reached.

    Between them there may be gaps: the rollout goes back from those.
    """
    first, power, step_s = choices.first, choices.power_w, choices.step_s
    low, high = window
    switching = choices.switching
    steps, modes = first.shape[0], first.shape[1] - 1
    least = np.full((steps + 1, modes), np.inf)
    greatest = np.full((steps + 1, modes), -np.inf)
    slack = 1e-12 * high
    least[steps, :] = end_min
    greatest[steps, :] = high
    for k in range(steps - 1, -1, -1):
        case = switching.case[k]
        for n in range(modes):
            bottom, top = least[k + 1, n], greatest[k + 1, n]
            if bottom > top:
                continue
            lowest, highest = np.inf, -np.inf
            # The energy before a step grows with its power: what lies between two powers adds nothing.
            least_w, most_w = np.inf, -np.inf
            start, count = first[k, n], first[k, n + 1] - first[k, n]
            for visit in range(count):
                i = start + (count - visit) % count  # the first, the last, then inwards
                if least_w <= power[i] <= most_w:
                    continue
                if _may_turn(power[i], step_s[k], battery):
                    lowest, highest = low, high  # anywhere: the rollout tells
                    break
                a = _energy_before(bottom, power[i], step_s[k], low, high, battery)
                b = _energy_before(top, power[i], step_s[k], low, high, battery)
                after_a = a - step_s[k] * chemical_power_at(power[i], a, battery)
                after_b = b - step_s[k] * chemical_power_at(power[i], b, battery)
                if after_a > top + slack or after_b < bottom - slack:
                    continue
                lowest, highest = min(lowest, a), max(highest, b)
                least_w, most_w = min(least_w, power[i]), max(most_w, power[i])
            for m in range(modes):
                taken = switching.energy_j[case, m, n]
                if not switching.allowed[case, m, n]:
                    continue
                if highest + taken < low - slack or lowest + taken > high + slack:
                    continue
                least[k, m] = min(least[k, m], max(lowest + taken, low))
                greatest[k, m] = max(greatest[k, m], min(highest + taken, high))
    return Reach(least, greatest, window)
