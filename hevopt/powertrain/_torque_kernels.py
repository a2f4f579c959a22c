"""Compiled balance of a way's torques, all directions of power tried; see torques.py."""

import numpy as np

from hevopt._compile import compiled
from hevopt.problem.arrays import Array, Indices

# Power against the direction assumed that is rounding.
_POWER_W = 1e-9


@compiled()
def resolved(
    terms: Array, signs: Array, sense: Array, gear: Indices, acting: Array, given: Array
) -> Array:
    """(wanted, state, level) torques of the first combination of directions that agrees with itself; else NaN.

    terms: (combination, unknown, input, gear) coefficients, inputs being the torques acting on shafts and then
    those given; unknowns are the joints with loss, in the order of signs and sense, and then whatever is wanted
    signs: (combination, joint) direction of power; sense: (joint, state) speed that makes power of its torque
    gear: (state,) index into the last axis; acting: (shaft, state); given: (given, state, level)
    """
    combinations, unknowns = terms.shape[:2]
    joints, shafts = signs.shape[1], len(acting)
    count, states, levels = given.shape
    result = np.full((unknowns - joints, states, levels), np.nan)
    torque, agrees, found = np.empty(levels), np.empty(levels, np.bool_), np.empty(levels, np.bool_)
    for s in range(states):
        g, left = gear[s], levels
        found[:] = False
        for c in range(combinations):
            agrees[:] = ~found
            for u in range(unknowns):
                constant = 0.0
                for i in range(shafts):
                    constant += terms[c, u, i, g] * acting[i, s]
                torque[:] = constant
                for i in range(count):
                    factor = terms[c, u, shafts + i, g]
                    for k in range(levels):
                        torque[k] += factor * given[i, s, k]
                if u < joints:
                    along = sense[u, s] * signs[c, u]
                    for k in range(levels):
                        agrees[k] &= torque[k] * along >= -_POWER_W
                else:
                    for k in range(levels):
                        if agrees[k]:
                            result[u - joints, s, k] = torque[k]
            for k in range(levels):
                if agrees[k]:
                    found[k] = True
                    left -= 1
            if left == 0:
                break
    return result


# Rounds in which gearboxes with a map settle that act on each other, and the share of a torque that is rounding.
_ROUNDS, _SETTLED = 60, 1e-13


@compiled()
def _balanced(base: float, per_nm: float, ratio: float, knot: Array, lost: Array) -> float:
    """Torque T in a gearbox whose loss D acts on its output: T = base + per_nm ratio D(T), D linear in it.

    T - per_nm ratio D(T) rises with T, as no gearbox loses more of a torque than that torque adds; beyond the knots
    D is that of the last.
    """
    last, share = len(knot) - 1, per_nm * ratio
    if knot[0] - share * lost[0] >= base:
        return float(base + share * lost[0])
    if knot[last] - share * lost[last] <= base:
        return float(base + share * lost[last])
    low, high = 0, last
    while high - low > 1:
        middle = (low + high) // 2
        if knot[middle] - share * lost[middle] <= base:
            low = middle
        else:
            high = middle
    slope = (lost[high] - lost[low]) / (knot[high] - knot[low])
    return float((base + share * (lost[low] - slope * knot[low])) / (1.0 - share * slope))


@compiled()
def _loss(torque: float, knot: Array, lost: Array) -> float:
    last = len(knot) - 1
    if torque <= knot[0]:
        return float(lost[0])
    if torque >= knot[last]:
        return float(lost[last])
    k = np.searchsorted(knot, torque) - 1
    return float(lost[k] + (lost[k + 1] - lost[k]) * (torque - knot[k]) / (knot[k + 1] - knot[k]))


@compiled()
def _settle(
    base: Array,
    terms: Array,
    first: int,
    places: Indices,
    ratio: Array,
    knot: Array,
    lost: Array,
    taken: Array,
) -> bool:
    """Torques that losses take at the gearboxes' outputs, by turns until none changes; whether they settle.

    base: (unknown,) torques without losses; terms: (unknown, input); first: the first gearbox among unknowns
    knot, lost: (box, knot); taken: (box,) filled
    """
    boxes = len(places)
    taken[:] = 0.0
    for _ in range(_ROUNDS):
        moved = 0.0
        for b in range(boxes):
            known = base[first + b]
            for other in range(boxes):
                if other != b:
                    known += terms[first + b, places[other]] * taken[other]
            torque = _balanced(known, terms[first + b, places[b]], ratio[b], knot[b], lost[b])
            now = ratio[b] * _loss(torque, knot[b], lost[b])
            moved = max(moved, abs(now - taken[b]) / max(abs(now), 1.0))
            taken[b] = now
        if boxes == 1 or moved <= _SETTLED:
            return True
    return False


@compiled()
def resolved_with_losses(
    terms: Array,
    signs: Array,
    sense: Array,
    gear: Indices,
    acting: Array,
    given: Array,
    places: Indices,
    ratio: Array,
    knot: Array,
    lost: Array,
) -> Array:
    """(unknown, state, level) as `resolved`, with gearboxes that lose by a map: their torques, then the wanted.

    places: (box,) of each output among the shafts; ratio: (box, state); knot, lost: (box, state, knot) at the input
    """
    combinations, unknowns, inputs = terms.shape[:3]
    joints, shafts = signs.shape[1], len(acting)
    count, states, levels = given.shape
    boxes = len(places)
    result = np.full((unknowns - joints, states, levels), np.nan)
    base, taken, own = np.empty(unknowns), np.empty(boxes), np.empty((unknowns, inputs))
    for s in range(states):
        for k in range(levels):
            for c in range(combinations):
                own[:, :] = terms[c, :, :, gear[s]]
                for u in range(unknowns):
                    base[u] = 0.0
                    for i in range(shafts):
                        base[u] += own[u, i] * acting[i, s]
                    for i in range(count):
                        base[u] += own[u, shafts + i] * given[i, s, k]
                agrees = _settle(
                    base, own, joints, places, ratio[:, s], knot[:, s], lost[:, s], taken
                )
                for u in range(unknowns):
                    for b in range(boxes):
                        base[u] += own[u, places[b]] * taken[b]
                for j in range(joints):
                    agrees &= base[j] * sense[j, s] * signs[c, j] >= -_POWER_W
                if agrees:
                    result[:, s, k] = base[joints:]
                    break
    return result
