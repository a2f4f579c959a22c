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
