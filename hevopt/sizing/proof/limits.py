"""Linear limits of sizes: what of a box of sizes meets them, by its vertices.

A function that is concave in the sizes is least at a vertex of the box, or of what half spaces leave of it: linear
constraints cost no multiplier, they only move vertices.
"""

from itertools import combinations

import numpy as np

from hevopt.problem.arrays import Array

# By which share of its own terms a limit may be passed: vertices are rounded, and more of the box is no harm.
_ROUNDING = 1e-9


def meets(rows: Array, theta: Array) -> bool:
    """Whether sizes meet limits. rows: (limit, 4), 0 or more with a 1 before the sizes; theta: (3,)"""
    at = np.append(1.0, theta)
    return bool((rows @ at >= -_ROUNDING * (np.abs(rows) @ np.abs(at))).all())


def vertices(low: Array, high: Array, rows: Array) -> Array:
    """(vertex, 4) of a box within limits, a 1 in front of each; none where nothing of the box meets them.

    low, high: (3,); rows: (limit, 4), passed by up to a share of 1e-9 of their terms, so that no vertex is lost
    """
    free = np.flatnonzero(high > low)
    faces = [(n, end) for n in free for end in (low[n], high[n])]
    loose = rows.copy()
    loose[:, 0] += _ROUNDING * (
        np.abs(rows) @ np.append(1.0, np.maximum(np.abs(low), np.abs(high)))
    )
    equations = [(np.eye(len(low))[n], end) for n, end in faces]
    equations += [(row[1:], -row[0]) for row in loose]
    found = []
    for chosen in combinations(equations, len(free)):
        theta = low.copy()
        slopes = np.array([slope for slope, _ in chosen]).reshape(len(free), len(low))
        ends = np.array([end for _, end in chosen])
        matrix = slopes[:, free]
        if len(free) and np.linalg.cond(matrix) > 1e12:
            continue
        held = np.where(high > low, 0.0, low)
        theta[free] = np.linalg.solve(matrix, ends - slopes @ held)
        within = (theta >= low - _ROUNDING).all() and (theta <= high + _ROUNDING).all()
        if within and meets(loose, theta):
            found.append(np.clip(theta, low, high))
    unique = np.unique(np.array(found).reshape(-1, len(low)), axis=0)
    return np.column_stack([np.ones(len(unique)), unique])
