"""Compiled reachability, backward recursion and rollout, all on stored energy with the true battery step."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hevopt._compile import compiled
from hevopt.problem._battery_kernels import chemical_power, chemical_power_at, state_at

# Divisions of the grid between which a move over curved battery characteristics is taken as linear.
_PIECES = 24


@compiled()
def _may_turn(power, step, battery):
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
def _energy_before(after, power, step, low, high, battery):
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
def reachable(first, power, step_s, allowed, low, high, end_min, battery):
    """Least and greatest stored energy (time + 1, mode) from which the end can still be reached.

    least > greatest where it cannot. Between them there may be gaps: the rollout goes back from those.
    """
    steps, modes = first.shape[0], first.shape[1] - 1
    least = np.full((steps + 1, modes), np.inf)
    greatest = np.full((steps + 1, modes), -np.inf)
    slack = 1e-12 * high
    least[steps, :] = end_min
    greatest[steps, :] = high
    for k in range(steps - 1, -1, -1):
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
                if allowed[m, n]:
                    least[k, m] = min(least[k, m], lowest)
                    greatest[k, m] = max(greatest[k, m], highest)
    return least, greatest


class Progress(NamedTuple):
    """How far a rollout has come.

    path: (time,) entries; energy, mode: (time + 1,) before each step; closed: (entry,) dead ends
    at: [present step, furthest step, moves made]
    """

    path: NDArray[np.int64]
    energy: NDArray[np.float64]
    mode: NDArray[np.int64]
    closed: NDArray[np.bool_]
    at: NDArray[np.int64]


@compiled()
def rollout(first, cost, power, step_s, switch_kg, allowed, begin, value, grid_low, cell, least,
            greatest, battery, progress, budget):  # fmt: skip
    """Go on along a value function until its last step, or back out of its first one, `begin`.

    value: (step + 1, mode, node) cost-to-go from `begin` on at stored energy grid_low[k] + cell x node, linear
    between nodes and beyond them.
    A choice that leads where the end cannot be reached is not taken; a dead end is left the way it was
    entered and closed, so that with enough budget every path is tried.
    """
    modes, nodes = first.shape[1] - 1, value.shape[2]
    end = begin + len(value) - 1
    slack = 1e-12 * abs(greatest[-1, 0])
    path, energy, mode, closed, at = progress
    k, furthest, moves = at[0], at[1], at[2]
    while begin <= k < end and moves < budget:
        moves += 1
        best, chosen, chosen_mode, chosen_energy = np.inf, -1, 0, 0.0
        ahead = value[k + 1 - begin]
        _, voltage, discharge, charging = state_at(energy[k], battery)
        for n in range(modes):
            if not allowed[mode[k], n]:
                continue
            for i in range(first[k, n], first[k, n + 1]):
                if closed[i]:
                    continue
                drain = chemical_power(
                    power[i], voltage, discharge, charging, battery.coulombic_efficiency
                )
                after = energy[k] - step_s[k] * drain
                if not (least[k + 1, n] - slack <= after <= greatest[k + 1, n] + slack):
                    continue
                place = (after - grid_low[k + 1]) / cell
                j = min(max(int(np.floor(place)), 0), nodes - 2)
                share = place - j
                to_go = ahead[n, j] * (1.0 - share) + ahead[n, j + 1] * share
                total = cost[i] + switch_kg[mode[k], n] + to_go
                if total < best:
                    best, chosen, chosen_mode, chosen_energy = total, i, n, after
        if chosen < 0:
            closed[first[k, 0] : first[k, modes]] = False
            k -= 1
            if k >= 0:
                closed[path[k]] = True
            continue
        path[k] = chosen
        energy[k + 1], mode[k + 1] = chosen_energy, chosen_mode
        k += 1
        furthest = max(furthest, k)
    at[0], at[1], at[2] = k, furthest, moves


@compiled()
def _relax(best, value, cost, low, high, cells, share, share_slope):
    """best[j] = min(best[j], cost + value at node j + cells + share_j) for low <= j < high."""
    ahead = value[low + cells : high + cells + 1]
    here = best[low:high]
    for j in range(high - low):
        weight = share + share_slope * np.int32(j)
        candidate = cost + ahead[j] + weight * (ahead[j + 1] - ahead[j])
        here[j] = min(here[j], candidate)


@compiled()
def _line(best, low, high, start, slope):
    """best[j] = min(best[j], start + slope (j - low)) for low <= j < high."""
    here = best[low:high]
    for j in range(high - low):
        here[j] = min(here[j], start + slope * np.int32(j))


@compiled()
def _lower(best, other, extra):
    """best[j] = min(best[j], other[j] + extra)."""
    for j in range(len(best)):
        best[j] = min(best[j], other[j] + extra)


@compiled()
def _shift(best, value, cost, low, high, start, slope, floor_kg, ceiling_kg):
    """Relax nodes low <= j < high whose target lies start + slope (j - low) cells away.

    Beyond the bottom and the top node every cell costs floor_kg and ceiling_kg.
    """
    nodes = len(value)
    j = low
    while j < high:
        moved = start + slope * (j - low)
        cells = int(np.floor(moved))
        # The run of nodes over which the whole cells stay the same: slope is far below one.
        run = high
        if slope > 0:
            run = min(high, low + int(np.ceil((cells + 1 - start) / slope)))
        elif slope < 0:
            run = min(high, low + int(np.floor((cells - start) / slope)) + 1)
        run = max(run, j + 1)
        bottom = min(max(j, -cells), run)
        top = max(min(run, nodes - 1 - cells), bottom)
        if bottom > j:
            below = -(j + start + slope * (j - low))
            at_first = cost + value[0] + floor_kg * below
            _line(best, j, bottom, at_first, -floor_kg * (1.0 + slope))
        if top > bottom:
            first_share = start + slope * (bottom - low) - cells
            _relax(best, value, cost, bottom, top, cells, first_share, slope)
        if run > top:
            above = top + start + slope * (top - low) - (nodes - 1)
            at_first = cost + value[nodes - 1] + ceiling_kg * above
            _line(best, top, run, at_first, ceiling_kg * (1.0 + slope))
        j = run


@compiled()
def _bends(grid_low, cell, nodes, battery):
    """Nodes between which a move is taken as linear, and voltage and resistances there.

    The ends, where voltage is linear in SOC and resistance constant; else also _PIECES even divisions.
    """
    constant = np.ptp(battery.discharge_ohm) == 0.0 and np.ptp(battery.charge_ohm) == 0.0
    pieces = 1 if constant and len(battery.soc) == 2 else min(_PIECES, nodes - 1)
    breaks = np.empty(pieces + 1, dtype=np.int64)
    states = np.empty((pieces + 1, 3))
    for b in range(pieces + 1):
        breaks[b] = b * (nodes - 1) // pieces
        _, voltage, discharge, charging = state_at(grid_low + cell * breaks[b], battery)
        states[b, 0], states[b, 1], states[b, 2] = voltage, discharge, charging
    return breaks, states


@compiled()
def backward(first, cost, power, step_s, switch_kg, allowed, terminal, grid_low, cell, floor_kg,
             ceiling_kg, unreachable_kg, battery):  # fmt: skip
    """Cost-to-go (time + 1, mode, node) by value iteration over stored energy grid_low[k] + cell x node.

    terminal: (mode, node) cost-to-go after the last step.
    A choice moves every node by nearly the same energy; between the points of the battery's curves the move
    is taken as linear in the node, so that the inner loop runs over contiguous memory. Switching is added
    once per mode, after the minimum over the mode's choices.
    """
    steps, modes = first.shape[0], first.shape[1] - 1
    nodes = terminal.shape[1]
    value = np.empty((steps + 1, modes, nodes))
    least = np.empty((modes, nodes))
    efficiency = battery.coulombic_efficiency
    value[steps] = terminal
    for k in range(steps - 1, -1, -1):
        breaks, states = _bends(grid_low[k], cell, nodes, battery)
        drift = (grid_low[k] - grid_low[k + 1]) / cell
        scale = -step_s[k] / cell
        for n in range(modes):
            least[n] = unreachable_kg
            for i in range(first[k, n], first[k, n + 1]):
                p = power[i]
                end = drift + scale * chemical_power(
                    p, states[0, 0], states[0, 1], states[0, 2], efficiency
                )
                for b in range(len(breaks) - 1):
                    low, high = breaks[b], breaks[b + 1]
                    start = end
                    end = drift + scale * chemical_power(
                        p, states[b + 1, 0], states[b + 1, 1], states[b + 1, 2], efficiency
                    )
                    last = high + 1 if b == len(breaks) - 2 else high
                    slope = (end - start) / (high - low)
                    _shift(
                        least[n], value[k + 1, n], cost[i], low, last, start, slope, floor_kg,
                        ceiling_kg,
                    )  # fmt: skip
        for m in range(modes):
            value[k, m] = unreachable_kg
            for n in range(modes):
                if allowed[m, n]:
                    _lower(value[k, m], least[n], switch_kg[m, n])
    return value
