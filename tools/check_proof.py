#!/usr/bin/env python3
"""Derive a bound again that `hevopt compare --proof DIR` wrote, without hevopt: Python and NumPy are all it takes.

    python check_proof.py FILE.proof.json ...       every bound proven: status 0; a reason for each that is not: 1

The claim: no plan of the table's usable controls and allowed switches that keeps its stored energy x within the
window (and a billionth of it beyond) and ends with at least end_j costs less than bound_kg. A switch takes stored
energy s before the step, y = x - s, and the step of power P then x' = y - dt r(P, y), with r = e U I behind one
resistance, U² - 4 R P >= 0. For prices p_1 ... p_T >= 0 of stored energy after each step, p_0 = p_1, weak duality:

    bound = least over paths of sum [ min over u, y of (cost + p_t+1 dt r(P, y) + (p_t - p_t+1) y) + K + p_t s ]
            + p_T end_j - p_1 x_start,    the first step without the term (p_0 - p_1) y

The minimum over y: r falls with U² and rises with R, so in a part of the window it is least at the highest voltage
and the lowest resistance. Where R is constant and U² linear in y, r is convex in y and one tangent does as well.
`lower-bound DP` is a recursion instead: a cost-to-go that is piecewise linear, falling, and nowhere above the true
one. A move is replaced by the greatest of its cell, so h = f + V(x + d) has one break in it; the chord of the least
of all h at the nodes is above h by at most what it is at the breaks, and is lowered by that.
Scope `continuous split`: the claim is for all that lies between the levels of a joint as well. For that the table
holds virtual controls, counted among the others, no one's to choose, and what is taken off every cost of a step.
That they stand for what lies between is trusted, as the table's other arrays are; the bound is derived again.
Every sum is lowered by what rounding can have added: epsilon times its operations times the magnitudes in it.
"""

import hashlib
import json
import sys
from pathlib import Path

import numpy as np

EPS, CELLS = np.finfo(float).eps, 256
TABULATED, CONTINUOUS = "tabulated controls", "continuous split"


def require(holds, reason):
    if not holds:
        raise ValueError(reason)


class Battery:
    """Curves over stored energy, cut to the window; voltage rises, all are linear in state of charge."""

    def __init__(self, t):
        soc, volt, self.ohm = t["soc"], t["open_circuit_v"], (t["discharge_ohm"], t["charge_ohm"])
        self.charge_as, self.efficiency = float(t["capacity_as"]), float(t["coulombic_efficiency"])
        rising = (np.diff(soc) > 0).all() and (np.diff(volt) >= 0).all()
        require(rising and volt[0] > 0, "battery: soc and voltage must rise, voltage be above 0")
        require(min(map(np.min, self.ohm)) >= 0, "battery: resistance below 0")
        require(self.charge_as > 0 and 0 < self.efficiency <= 1, "battery: capacity, efficiency")
        area = self.charge_as * np.diff(soc) * (volt[1:] + volt[:-1]) / 2
        self.soc, self.volt, self.stored = soc, volt, np.append(0.0, np.cumsum(area))
        self.start = self.energy(float(t["soc_start"]))
        low, high = self.energy(float(t["soc_min"])), self.energy(float(t["soc_max"]))
        require(low < high, "an empty window")
        slack = max(1e-9 * (high - low), 4e-12 * high)
        self.low, self.high = self.ends = np.array([low - slack, high + slack])
        self.volt_low = self.at(self.low)[0]

    def energy(self, soc):
        i = np.clip(np.searchsorted(self.soc, soc, "right") - 1, 0, len(self.soc) - 2)
        mean = (self.volt[i] + np.interp(soc, self.soc, self.volt)) / 2
        return self.stored[i] + self.charge_as * mean * (soc - self.soc[i])

    def at(self, energy):
        """Voltage, discharge and charge resistance, state of charge at stored energies."""
        i = np.clip(np.searchsorted(self.stored, energy, "right") - 1, 0, len(self.soc) - 2)
        width, q = np.diff(self.soc)[i], (energy - self.stored[i]) / self.charge_as
        squared = self.volt[i] ** 2 + 2 * np.diff(self.volt)[i] / width * q
        volt = np.sqrt(np.maximum(squared, 1e-12 * self.volt[i] ** 2))
        share = 2 * q / (self.volt[i] + volt) / width
        ohms = (ohm[i] * (1 - share) + ohm[i + 1] * share for ohm in self.ohm)
        return volt, *ohms, self.soc[i] + share * width

    def least(self, edges):
        """(cell,) highest voltage and lowest resistances between edges."""
        inner = self.stored[(self.stored > edges[0]) & (self.stored < edges[-1])]
        cell = np.clip(np.searchsorted(edges, inner, "right") - 1, 0, len(edges) - 2)
        volt, *ohms = self.at(np.clip(edges, self.low, self.high))[:3]
        ohms = [np.minimum(ohm[1:], ohm[:-1]) for ohm in ohms]
        for ohm, inside in zip(ohms, self.at(inner)[1:3], strict=True):
            np.minimum.at(ohm, cell, inside)
        return volt[1:], *ohms

    def drain(self, power, volt, discharge, charge):
        """Rate at which stored energy falls, and the root sqrt(1 - 4 R P / U²); inf where U cannot deliver P."""
        inner = 1 - 4 * np.where(power < 0, charge, discharge) * power / volt**2
        root = np.sqrt(np.maximum(inner, 0))
        rate = np.where(power < 0, self.efficiency, 1.0) * 2 * power / (1 + root)
        return np.where(inner < -1e-9, np.inf, rate), root


def entries(t, b, virtual):
    """Per step (cost, power, mode) of usable controls, but those of no use or that move more than the window.

    virtual: whether virtual controls count; then none is left out for what it moves
    """
    order = np.argsort(t["virtual_step"], kind="stable")
    ends = np.searchsorted(t["virtual_step"][order], np.arange(len(t["step_s"]) + 1))
    top, points = b.least(b.ends), np.append(np.clip(b.stored, b.low, b.high), b.ends)
    bottom = b.volt_low, 0.0, b.at(points)[2].max()
    for k, step_s in enumerate(t["step_s"]):
        power, keep = t["power_w"][k], t["usable"][k]
        stored = -b.drain(np.minimum(power, 0), *bottom)[0]
        moved = step_s * np.maximum(b.drain(power, *top)[0], stored)
        cost, mode = t["cost_kg"][k], t["mode"]
        if virtual:
            own = order[ends[k] : ends[k + 1]]
            cost = np.append(cost, t["virtual_cost_kg"][own]) - t["virtual_slack_kg"][k]
            power = np.append(power, t["virtual_power_w"][own])
            mode = np.append(mode, t["virtual_mode"][own])
            keep = np.flatnonzero(np.append(keep, np.ones(len(own), bool)))
        else:
            keep = np.flatnonzero(keep & (moved <= (b.high - b.low) * (1 + 1e-6)))
        keep, best = keep[np.lexsort((power[keep], cost[keep]))], []
        for m in range(t["modes"]):  # none that another of its mode beats in cost and power
            own = keep[mode[keep] == m]
            lowest = np.append(np.inf, np.minimum.accumulate(power[own]))[: len(own)]
            best += own[power[own] < lowest].tolist()
        yield cost[best], power[best], mode[best]


def switching(t, k, name):
    return t[name] if t[name].ndim == 2 else t[name][k]


class Straight:
    """A battery of constant resistance whose U² is linear in stored energy; it loses no more than the real one."""

    def __init__(self, b, squared, ohms):
        self.b, self.base, self.ohms = b, squared[0], ohms
        self.rise = (squared[1] - squared[0]) / (b.high - b.low)

    def at(self, y, power):
        """r, its derivative by stored energy, and the root."""
        squared = self.base + self.rise * (y - self.b.low)
        rate, root = self.b.drain(power, np.sqrt(squared), *self.ohms)
        ohm = np.where(power < 0, self.ohms[1], self.ohms[0])
        slope = -rate * 2 * ohm * power / (squared**2 * np.maximum(root, 1e-8) * (1 + root))
        return rate, slope * self.rise, root

    def worth(self, power, after, tilt):
        """Least of  after r + tilt y  by a tangent where it is least: r is convex, any place is valid."""
        b, charging = self.b, power < 0
        resist = 2 * np.where(charging, self.ohms[1], self.ohms[0])
        share = resist * tilt / (after * np.where(charging, b.efficiency, 1.0) * self.rise)
        squared = resist * power
        squared = squared + np.abs(squared) * (1 + share) / np.sqrt(share * (2 + share))
        y = b.low + np.clip((squared - self.base) / self.rise, 0, b.high - b.low)
        y = np.where((tilt > 0) & np.isfinite(y), y, b.high)
        rate, slope, root = self.at(y, power)
        slope = slope * after + tilt
        least = after * rate + tilt * y
        least += np.minimum(np.minimum(slope * (b.low - y), slope * (b.high - y)), 0)
        flat = after * self.at(b.high, power)[0] + min(tilt * b.low, tilt * b.high)
        return np.where((root > 1e-3) & np.isfinite(least), np.maximum(least, flat), flat)


def by_prices(t, b, proof):
    price = np.array(proof["price_kgpj"], dtype=float)
    require(price.shape == t["step_s"].shape, "one price per step is needed")
    require(np.isfinite(price).all() and (price >= 0).all(), "prices must be finite and >= 0")
    before, steps = np.append(price[0], price[:-1]), len(price)
    even = b.energy(np.linspace(*b.at(b.ends)[3], CELLS + 1))[1:-1]
    edges = np.union1d(np.clip(np.append(even, b.stored), b.low, b.high), b.ends)
    cells, top = b.least(edges), b.least(b.ends)
    volt, *ohms = b.at(edges)[:3]
    over = volt**2 - np.interp(edges, b.ends, volt[[0, -1]] ** 2)
    line = None
    if np.abs(over).max() <= 1e-7 * volt[-1] ** 2 and all(
        np.ptp(o) <= 1e-7 * o.max() for o in ohms
    ):
        raised = volt[[0, -1]] ** 2 * (1 + 8 * EPS) + max(over.max(), 0.0)
        line = Straight(b, raised, [ohm.min() for ohm in ohms])
    total = np.where(np.arange(t["modes"]) == t["start_mode"], 0.0, np.inf)
    magnitude, fallen = price[-1] * abs(proof["end_j"]) + price[0] * b.start, 0.0
    virtual = proof["scope"] == CONTINUOUS
    for k, (cost, power, mode) in enumerate(entries(t, b, virtual)):
        after, tilt = price[k] * t["step_s"][k], before[k] - price[k]
        taken = switching(t, k, "switch_energy_j")
        if k == 0:  # what is stored is known
            y = np.clip(b.start - taken[t["start_mode"]][mode], b.low, b.high)
            worth = after * b.drain(power, *b.at(y)[:3])[0]
        elif line:
            worth = line.worth(power, after, tilt) if tilt else after * b.drain(power, *top)[0]
        else:
            rate = b.drain(power[:, None], *(part[None] for part in cells))[0]
            rate = np.where(np.isfinite(rate), after * rate, np.inf)
            rate = rate + np.minimum(tilt * edges[:-1], tilt * edges[1:])
            worth = rate.min(axis=1, initial=np.inf)
        steep = 1 / np.maximum(b.drain(power, volt[0], ohms[0].max(), 0.0)[1], 1e-8)
        grown = 4 + steep
        if line and tilt != 0:  # else no tangent is taken
            grown = grown + (volt[-1] / volt[0] - 1) * 2 * np.minimum(steep, 1e3) ** 3
        magnitude += after * np.max(2 * np.abs(power) * grown, initial=0.0)
        magnitude += abs(tilt) * b.high + before[k] * np.abs(taken).max()
        fallen += max(-cost.min(initial=0.0), 0.0)
        best = np.full(t["modes"], np.inf)
        np.minimum.at(best, mode, cost + worth)
        step = switching(t, k, "switch_fuel_kg") + before[k] * taken
        step = np.where(switching(t, k, "switch_allowed"), step, np.inf)
        total = (total[:, None] + step).min(axis=0) + best
    bound = total.min() + price[-1] * proof["end_j"] - price[0] * b.start
    own = (2 * steps + 48) * (abs(total.min()) + 2 * fallen + 4 * magnitude)
    return bound - EPS * (own + 8 * price.sum() * b.high) - np.finfo(float).tiny * price.any()


def by_recursion(t, b, proof):
    nodes, slope, end = int(proof["nodes"]), float(proof["slope_kgpj"]), proof["end_j"]
    require(3 <= nodes <= 10**6 and 0 < slope < np.inf, "nodes or slope")
    cell = (b.high - b.low) / (nodes - 1)
    below, above = np.ceil((end - b.low) / cell), max(np.ceil((b.high - end) / cell), 1)
    require(0 <= below <= nodes + 1, "end_j outside the window")
    grid = end + cell * np.arange(-below, above + 1)
    n, volt, fall = len(grid), b.least(grid), slope * cell
    value = np.tile(slope * np.maximum(end - grid, 0.0), (t["modes"], 1))
    worst = np.abs(t["cost_kg"]).max() + t["switch_fuel_kg"].max()
    unknown = worst * len(t["step_s"]) + 2 * value.max()
    for k, (cost, power, mode) in reversed(list(enumerate(entries(t, b, False)))):
        after = np.full((t["modes"], n), unknown)
        for m in set(mode.tolist()):
            own = power[mode == m][:, None]
            rate, root = b.drain(own, *(part[None] for part in volt))
            rounded = t["step_s"][k] * 2 * np.abs(own) * (4 + 1 / np.maximum(root, 1e-8)) + b.high
            move = np.clip((8 * EPS * rounded - t["step_s"][k] * rate) / cell, -n, n)
            h = np.where(np.isfinite(rate), cost[mode == m][:, None], np.inf)
            after[m] = lowered(h, move, padded(value[m], fall), after[m])
        value = np.full((t["modes"], n), unknown)
        taken = switching(t, k, "switch_energy_j")
        spared = 4 * EPS * (np.abs(taken) + b.high) * (taken != 0)
        down = np.clip(np.floor((taken - spared) / cell), -n, n).astype(int)
        for m, to in np.argwhere(switching(t, k, "switch_allowed")):
            shifted = padded(after[to], fall)[n + 1 - down[m, to] :][:n]
            value[m] = np.minimum(value[m], switching(t, k, "switch_fuel_kg")[m, to] + shifted)
    found = np.interp(b.start, grid, value[t["start_mode"]])
    most = abs(unknown) + 4 * slope * (grid[-1] - grid[0])
    return found - 16 * EPS * len(t["step_s"]) * most


def lowered(h, move, ahead, most):
    """(node,) a function below every h + V(x + move) and falling; h, move: (control, cell), ahead: V, padded."""
    nodes = len(most)
    whole = np.floor(move)
    share, to = move - whole, np.arange(nodes - 1) + whole.astype(int) + nodes + 1
    left, middle, right = (h + ahead[to + n] for n in range(3))
    low = most.copy()
    low[:-1] = np.minimum(low[:-1], ((1 - share) * left + share * middle).min(axis=0))
    low[1:] = np.minimum(low[1:], ((1 - share) * middle + share * right).min(axis=0))
    over = share * low[:-1] + (1 - share) * low[1:] - middle
    over = np.max(over, axis=0, initial=0.0)
    return np.minimum.accumulate(low - np.maximum(np.append(over, 0.0), np.append(0.0, over)))


def padded(value, fall):
    """Values with n + 1 nodes more below, steep, and n + 2 above, flat."""
    n = len(value)
    return np.concatenate(
        [value[0] + fall * np.arange(n + 1, 0, -1), value, np.full(n + 2, value[-1])]
    )


def follow(t, b, control):
    """Cost and stored energy at the end of a plan; ValueError where it breaks a rule."""
    require(len(control) == len(t["step_s"]), "the plan needs one control per step")
    cost, energy, mode = 0.0, b.start, t["start_mode"]
    for k, c in enumerate(control):
        require(
            isinstance(c, int) and 0 <= c < len(t["mode"]) and t["usable"][k, c],
            f"plan: control at step {k}",
        )
        to = t["mode"][c]
        require(switching(t, k, "switch_allowed")[mode, to], f"plan: forbidden switch at step {k}")
        energy -= switching(t, k, "switch_energy_j")[mode, to]
        between, power = energy, t["power_w"][k, c]
        energy = between - t["step_s"][k] * float(b.drain(power, *b.at(between)[:3])[0])
        require(
            b.low <= min(between, energy) and max(between, energy) <= b.high,
            f"plan: window left at step {k}",
        )
        cost, mode = cost + t["cost_kg"][k, c] + switching(t, k, "switch_fuel_kg")[mode, to], to
    return cost, energy


def derived(proof, t):
    """Bound, cost of the plan beside it, and stored energy at its end, of a proof and a table's arrays."""
    require((t["step_s"] > 0).all() and np.isfinite(t["cost_kg"]).all(), "table: steps or costs")
    if proof["scope"] == CONTINUOUS:
        require(t["virtual_slack_kg"].shape == t["step_s"].shape, "the table knows no split")
        finite = all(
            np.isfinite(t[f"virtual_{n}"]).all() for n in ("cost_kg", "power_w", "slack_kg")
        )
        known = np.isin(t["virtual_mode"], np.arange(t["switch_allowed"].shape[-1])).all()
        require(finite and known and (t["virtual_slack_kg"] >= 0).all(), "virtual controls")
    t = t | {"start_mode": int(t["start_mode"]), "modes": t["switch_allowed"].shape[-1]}
    require(all(np.isfinite(proof[name]) for name in ("bound_kg", "end_j")), "no figures")
    b = Battery(t)
    with np.errstate(all="ignore"):
        bound = (by_prices if proof["kind"] == "prices" else by_recursion)(t, b, proof)
        return bound, *follow(t, b, proof["plan"])


def check(path):
    """What was proven, as a sentence; ValueError with the reason where nothing was."""
    proof = json.loads(path.read_text())
    with np.load(path.parent / Path(proof["table"]).name, allow_pickle=False) as file:
        return judged(proof, {name: file[name] for name in sorted(file.files)})


def judged(proof, t):
    """The same of a proof and a table's arrays by name, in alphabetic order."""
    known = proof["scope"] == TABULATED or (
        proof["scope"] == CONTINUOUS and proof["kind"] == "prices"
    )
    require(proof["format"] == 2 and known, "format or scope unknown")
    digest = hashlib.sha256()
    for name, array in t.items():
        digest.update(f"{name} {array.dtype.str} {array.shape}\n".encode() + array.tobytes())
    require(
        digest.hexdigest() == proof["table_sha256"],
        "the table is not the one that the proof is for",
    )
    bound, cost, end = derived(proof, t)
    claim = proof["bound_kg"]
    require(claim <= bound, f"claimed {claim:.12g} kg, proven {bound:.12g} kg")
    require(end >= proof["end_j"], "the plan ends with less than the claim is for")
    return f"proven, {proof['scope']}: at least {claim:.9g} kg; its plan costs {cost:.9g} kg"


def main(paths):
    failed = 0
    for path in map(Path, paths):
        try:
            print(f"{path.name}: {check(path)}")
        except Exception as error:
            failed += 1
            print(f"{path.name}: NOT proven: {type(error).__name__}: {error}")
    return 1 if failed or not paths else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
