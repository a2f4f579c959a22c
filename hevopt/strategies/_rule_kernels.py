"""Compiled parts of the rule-based strategies."""

import numpy as np

from hevopt._compile import compiled
from hevopt.problem._battery_kernels import BatteryArrays, chemical_power_at
from hevopt.problem.arrays import Array, Flags, Indices
from hevopt.problem.choices import Choices, State


@compiled()
def load_point_choices(
    choices: Choices, nox: Array, fired: Flags, charge_w: Array, nox_cap_kgps: float
) -> Indices:
    """(level, time) entry of least cost among fired ones that charge at least charge_w[level] within the cap.

    Where none does: the entry within the cap that charges most; where none is within it, that of least NOx.
    -1 where the step has no fired entry at all.
    """
    first, cost, power, step_s = choices.first, choices.cost_kg, choices.power_w, choices.step_s
    steps, levels = len(step_s), len(charge_w)
    chosen = np.full((levels, steps), -1, dtype=np.int64)
    for k in range(steps):
        most, least_nox = -1, -1
        best = np.full(levels, np.inf)
        for i in range(first[k, 0], first[k, -1]):
            if not fired[i]:
                continue
            if least_nox < 0 or (nox[i], cost[i]) < (nox[least_nox], cost[least_nox]):
                least_nox = i
            if nox[i] > nox_cap_kgps * step_s[k]:
                continue
            if most < 0 or (power[i], cost[i]) < (power[most], cost[most]):
                most = i
            for level in range(levels):
                if power[i] > -charge_w[level]:
                    break
                if cost[i] < best[level]:
                    best[level] = cost[i]
                    chosen[level, k] = i
        for level in range(levels):
            if chosen[level, k] < 0:
                chosen[level, k] = most if most >= 0 else least_nox
    return chosen


@compiled()
def taken(wanted: Indices, fallback: Indices, k: int, energy_j: float, least_j: float) -> int:
    """What a rule takes at step k: the wanted while more than least_j is stored, else the fallback."""
    return int(wanted[k] if energy_j > least_j else fallback[k])


@compiled()
def drive(
    wanted: Indices,
    fallback: Indices,
    choices: Choices,
    modes: Indices,
    start: State,
    least_j: float,
    battery: BatteryArrays,
) -> tuple[Indices, Array]:
    """Entries (time,) that take `wanted` while more than least_j is stored and else `fallback`, and the energy.

    wanted, fallback: (time,) entries; they agree where there is nothing to choose.
    modes: (entry,) that they lead to
    """
    power, step_s = choices.power_w, choices.step_s
    _, _, switch_j, _ = choices.switching
    steps, mode = len(step_s), start.mode
    entry = np.empty(steps, dtype=np.int64)
    energy = np.empty(steps + 1)
    energy[0] = start.energy_j
    for k in range(steps):
        entry[k] = taken(wanted, fallback, k, energy[k], least_j)
        between = energy[k] - switch_j[choices.switching.case[k], mode, modes[entry[k]]]
        mode = modes[entry[k]]
        energy[k + 1] = between - step_s[k] * chemical_power_at(power[entry[k]], between, battery)
    return entry, energy
