#!/usr/bin/env python3
"""Derive a bound again that `hevopt compare --proof DIR` wrote, with Python and NumPy alone.

    python check_proof.py FILE.proof.json ...     status 0 if every bound is proven, else 1 and why

The claim: no plan of the table's entries and allowed switches that keeps stored energy x within
energy_j and ends with at least end_j costs less than bound_kg. A switch takes energy s before the
step, y = x - s, and the step of power P then x' = y - dt r(P, y), r = 2 e P / (1 + root) behind one
resistance R, root = sqrt(1 - 4 R P / a), a = U²; e is the coulombic efficiency of charging, else 1.
For prices of stored energy after each step p_1 ... p_T >= 0, and p_0 = p_1, both equations
multiplied by them and added up make (weak duality)  bound = least over paths of
    sum [ min over entries, y of (cost + p_t+1 dt r(P, y) + (p_t - p_t+1) (y - x_start))
          + K + p_t s ] + p_T (end_j - x_start)
The minimum over y: between two points of the battery a is linear in y (as U is in charge), and R
between those of the ends; r falls with a, is convex in it, and rises with R. So its tangent at any
a, at the lesser R, lies below r and is linear in y: it is least at one end.
`lower-bound DP` is a recursion instead, over a cost-to-go V, piecewise linear, falling and nowhere
above the true one. In a cell of its grid a move is replaced by the greatest, d: h = f + V(x + d)
breaks once there. The chord of the least h of all entries at the nodes is above h by at most what
it is at the breaks, and is lowered by that.
For a claim on all between the levels of a joint the entries marked `split` count, virtual ones
too, less split_slack_kg. That these stand for what lies between is trusted, as are all arrays.
"""

import hashlib
import json
import sys
from pathlib import Path

import numpy as np

SCOPES = {"tabulated controls": "tabulated", "continuous split": "split"}
# Taken off for rounding, times the magnitudes: of each term some operations of half an epsilon.
ROUND = 8 * np.finfo(float).eps


def require(holds, reason):
    if not holds:
        raise ValueError(reason)


def cells_of(t):
    """(6, cell) of the battery: both ends, from the start's energy; U² there; least resistances."""
    energy, volt, e = t["energy_j"] - t["start_j"], t["open_circuit_v"], t["coulombic_efficiency"]
    rising = (np.diff(energy) > 0).all() and (np.diff(volt) >= 0).all() and volt[0] > 0
    ohms = [np.minimum(t[name][1:], t[name][:-1]) for name in ("discharge_ohm", "charge_ohm")]
    require(rising and np.min(ohms) >= 0 and 0 < e <= 1, "the battery is none that this holds for")
    return np.array([energy[:-1], energy[1:], volt[:-1] ** 2, volt[1:] ** 2, *ohms])


def drain(t, power, squared, discharge, charge):
    """r, inf where U cannot deliver P; its root; R and e."""
    ohm = np.where(power < 0, charge, discharge)
    e = np.where(power < 0, t["coulombic_efficiency"], 1.0)
    inner = 1 - 4 * ohm * power / squared
    root = np.sqrt(np.maximum(inner, 0))
    return np.where(inner < -1e-9, np.inf, 2 * e * power / (1 + root)), root, ohm, e


def worth(t, power, after, tilt, cell):
    """(entry,) least of  after r + tilt (y - x_start)  in a cell, rounded down."""
    left, right, lower, upper, *ohms = cell
    _, _, ohm, e = drain(t, power, upper, *ohms)
    # r falls as tilt rises where root + 1 / root = 2 + share; the tangent is taken there.
    share = np.minimum(4 * ohm * tilt * (right - left) / (after * e * (upper - lower)), 100)
    root = 1 + share / 2 - np.sign(power) * np.sqrt(share + share**2 / 4)
    place = np.clip(4 * ohm * power / (1 - root**2), lower, upper)
    place = np.where((share > 0) & np.isfinite(place), place, upper)
    rate, root, _, _ = drain(t, power, place, *ohms)
    # All but upright it is at the upper end, where a flat one does as well.
    slope = np.where(root > 0.005, -after * ohm * rate**2 / (e * place**2 * root), 0.0)
    ends = [slope * (a - place) + tilt * y for a, y in ((lower, left), (upper, right))]
    size = (after * np.abs(rate) - slope * (upper - lower)) * (4 + 1 / np.maximum(root, 1e-4) ** 2)
    least = after * rate + np.minimum(*ends)
    least -= ROUND * (size + np.abs(tilt) * t["energy_j"][-1])
    return np.where(np.isfinite(rate), least, np.inf)


def entries(t, scope):
    """Step, cost, power, mode of what counts and no other of its step and mode beats; sorted."""
    counts, names = t[SCOPES[scope]], ("step", "cost_kg", "power_w", "mode")
    step, cost, power, mode = (t[name][counts] for name in names)
    group = step * t["switch_allowed"].shape[-1] + mode
    order = np.lexsort((power, cost, group))
    rank = (np.unique(power, return_inverse=True)[1] - group * len(power))[order]
    order = order[rank < np.append(len(power), np.minimum.accumulate(rank)[:-1])]
    return step[order], cost[order], power[order], mode[order]


def by_prices(t, cells, proof):
    price, scope = np.array(proof["price_kgpj"], dtype=float), proof["scope"]
    valid = price.shape == t["step_s"].shape and 0 <= price.min() <= price.max() < np.inf
    require(valid, "one price per step is needed, finite and >= 0")
    before, (step, cost, power, mode) = np.append(price[0], price[:-1]), entries(t, scope)
    after, tilt, best = (price * t["step_s"])[step], (before - price)[step], np.inf
    for cell in cells.T:
        best = np.minimum(best, worth(t, power, after, tilt, cell))
    first = step == 0  # there it is known in which cell stored energy is
    y = -t["switch_energy_j"][0, t["start_mode"]][mode[first]]
    cell = cells[:, np.maximum(np.searchsorted(cells[0], y, "right") - 1, 0)]
    best[first] = worth(t, power[first], after[first], tilt[first], cell)
    # A plan's own trace of stored energy is rounded as well.
    best += cost - ROUND * (np.abs(cost) + price[step] * t["energy_j"][-1])
    best -= t["split_slack_kg"][step] * (SCOPES[scope] == "split")
    least = np.full(t["switch_allowed"].shape[:2], np.inf)
    np.minimum.at(least, (step, mode), best)
    total = np.where(np.arange(least.shape[1]) == t["start_mode"], 0.0, np.inf)
    for k, fuel in enumerate(t["switch_fuel_kg"]):
        paid = before[k] * t["switch_energy_j"][k]
        switched = fuel + paid - ROUND * (np.abs(fuel) + np.abs(paid))
        reached = (total * (1 - ROUND * np.sign(total)))[:, None] + switched
        total = np.where(t["switch_allowed"][k], reached, np.inf).min(axis=0) + least[k]
    size = abs(total.min()) + price[-1] * (abs(proof["end_j"]) + t["start_j"])
    bound = total.min() + price[-1] * (proof["end_j"] - t["start_j"])
    return bound - ROUND * size - np.finfo(float).tiny * price.any()


def by_recursion(t, cells, proof):
    nodes, slope, end = int(proof["nodes"]), float(proof["slope_kgpj"]), proof["end_j"]
    (low, high), dt, fuel = t["energy_j"][[0, -1]], t["step_s"], t["switch_fuel_kg"]
    cell = (high - low) / (nodes - 1)
    valid = 3 <= nodes <= 10**6 and 0 < slope < np.inf and low - cell < end <= high
    require(valid, "nodes, slope or end_j are out of range")
    grid = end + cell * np.arange(-np.ceil((end - low) / cell), np.ceil((high - end) / cell) + 1)
    squared = np.interp(grid[1:], t["energy_j"], t["open_circuit_v"] ** 2)
    at = np.maximum(np.searchsorted(t["energy_j"][:-1], grid, "right") - 1, 0)
    pairs = np.stack([at[:-1], at[1:] + 1], axis=1).ravel()
    ohms = [np.minimum.reduceat(np.append(ohm, np.inf), pairs)[::2] for ohm in cells[4:]]
    step, cost, power, mode = entries(t, proof["scope"])
    value = np.tile(slope * np.maximum(end - grid, 0.0), (fuel.shape[-1], 1))
    unknown = (np.abs(t["cost_kg"]).max() + fuel.max()) * len(dt) + 2 * value.max()
    for k in reversed(range(len(dt))):
        after, value_before = np.full((2, *value.shape), unknown)
        for m in set(mode[step == k]):
            own = (step == k) & (mode == m)
            rate, root, _, _ = drain(t, power[own, None], squared, *ohms)
            size = np.abs(2 * power[own, None]) * (4 + 1 / np.maximum(root, 1e-8)) * dt[k] + high
            h = np.where(np.isfinite(rate), cost[own, None], np.inf)
            move = (ROUND * size - dt[k] * rate) / cell
            after[m] = lowered(h, move, value[m], slope * cell, unknown)
        taken = t["switch_energy_j"][k]
        move = np.ceil((ROUND * (np.abs(taken) + high) * (taken != 0) - taken) / cell)
        for m, to in np.argwhere(t["switch_allowed"][k]):
            reached = lowered(fuel[k, m, to], move[m, to], after[to], slope * cell, unknown)
            value_before[m] = np.minimum(value_before[m], reached)
        value = value_before
    found = np.interp(t["start_j"], grid, value[t["start_mode"]])
    return found - 2 * ROUND * len(dt) * (abs(unknown) + 4 * slope * (grid[-1] - grid[0]))


def lowered(h, move, value, fall, most):
    """(node,) a falling function below every h + V(x + move); h, move: (entry, cell), V: value."""
    n, move = len(value), np.clip(np.atleast_2d(move), -len(value), len(value))
    share, to = move - np.floor(move), np.arange(n - 1) + np.floor(move).astype(int)
    # Below the grid V rises steeply, above it stays.
    ahead = (value[np.clip(to + i, 0, n - 1)] + fall * np.maximum(-to - i, 0) for i in range(3))
    left, middle, right = (h + v for v in ahead)
    low = np.full(n, most)
    low[:-1] = np.minimum(low[:-1], ((1 - share) * left + share * middle).min(axis=0))
    low[1:] = np.minimum(low[1:], ((1 - share) * middle + share * right).min(axis=0))
    over = np.max(share * low[:-1] + (1 - share) * low[1:] - middle, axis=0, initial=0.0)
    return np.minimum.accumulate(low - np.maximum(np.append(over, 0.0), np.append(0.0, over)))


def derived(proof, t):
    """The bound that a proof's prices, or nodes and slope, prove of a table's arrays."""
    require(t["step_s"].min() > 0 and all(np.isfinite(a).all() for a in t.values()), "table values")
    shape = t["step_s"].shape + t["switch_allowed"].shape[-2:]
    t = t | {name: np.broadcast_to(t[name], shape) for name in t if name.startswith("switch_")}
    with np.errstate(all="ignore"):
        return (by_prices if proof["kind"] == "prices" else by_recursion)(t, cells_of(t), proof)


def judged(proof, t):
    """What is proven of a table's arrays by name, in alphabetic order; ValueError where nothing."""
    scopes = list(SCOPES)[: 2 if proof["kind"] == "prices" else 1]
    require(proof["format"] == 3 and proof["scope"] in scopes, "format or scope unknown")
    told = (f"{n} {a.dtype.str} {a.shape}\n".encode() + a.tobytes() for n, a in t.items())
    digest = hashlib.sha256(b"".join(told)).hexdigest()
    require(digest == proof["table_sha256"], "the table is not the one that the proof is for")
    bound, claim = derived(proof, t), proof["bound_kg"]
    require(claim <= bound < np.inf, f"claimed {claim:.12g} kg, proven {bound:.12g} kg")
    return f"proven, {proof['scope']}: at least {claim:.9g} kg"


def main(paths):
    failed = not paths
    for path in map(Path, paths):
        try:
            proof = json.loads(path.read_text())
            with np.load(path.parent / Path(proof["table"]).name, allow_pickle=False) as file:
                print(f"{path.name}: {judged(proof, {name: file[name] for name in sorted(file)})}")
        except Exception as error:
            failed = True
            print(f"{path.name}: NOT proven: {type(error).__name__}: {error}")
    return int(failed)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
