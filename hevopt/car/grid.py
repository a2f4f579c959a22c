"""A quantity on a rectangular grid of speed and torque, never extrapolated.

A cell with four measured corners is interpolated bilinearly; one with three, linearly on the triangle of those
three, its other half being outside. The two agree on the edges that they share.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
# Share of a cell by which a point may miss an edge: rounding of a point computed to lie on it.
_ROUNDING = 1e-9


def interpolated(
    grid_speed_radps: Array,
    grid_torque_nm: Array,
    values: Array,
    torque_nm: Array,
    speed_radps: Array,
) -> Array:
    """The quantity at any torques and speeds, NaN outside the grid and next to what was not measured.

    grid_speed_radps: (speed,), grid_torque_nm: (torque,), values: (speed, torque), NaN where not measured
    """
    i, x = _place(grid_speed_radps, np.asarray(speed_radps))
    j, y = _place(grid_torque_nm, np.asarray(torque_nm))
    known, row = ~np.isnan(values), values.shape[1]
    filled, first = np.where(known, values, 0.0).ravel(), i * row + j
    below, above = 1 - y, y
    result = np.asarray(filled[first] * ((1 - x) * below))
    result += filled[first + 1] * ((1 - x) * above)
    result += filled[first + row] * (x * below)
    result += filled[first + row + 1] * (x * above)
    whole = known[:-1, :-1] & known[:-1, 1:] & known[1:, :-1] & known[1:, 1:]
    if not whole.all():
        beside = ~whole[i, j]
        i, j, x, y = np.broadcast_arrays(i, j, x, y)
        result[beside] = _beside_holes(values, i[beside], j[beside], x[beside], y[beside])
    result[_beyond(x) | _beyond(y)] = np.nan
    return result


def _beside_holes(
    values: Array, i: NDArray[np.int64], j: NDArray[np.int64], x: Array, y: Array
) -> Array:
    """The quantity in cells with a corner that was not measured, which spoils only what leans on it."""
    corners = values[i, j], values[i, j + 1], values[i + 1, j], values[i + 1, j + 1]
    weights = (1 - x) * (1 - y), (1 - x) * y, x * (1 - y), x * y
    result = np.zeros(x.shape)
    for corner, weight in zip(corners, weights, strict=True):
        result += np.where(weight == 0, 0.0, weight * corner)
    return np.where(np.isnan(result), _on_triangle(corners, x, y), result)


def along(axis: Array, values: Array, at: Array) -> Array:
    """A quantity on an axis, linear between its points; NaN beyond its ends."""
    i, share = _place(axis, np.asarray(at, dtype=float))
    return np.where(_beyond(share), np.nan, values[i] * (1 - share) + values[i + 1] * share)


def highest_known(
    grid_speed_radps: Array, grid_torque_nm: Array, values: Array, speed_radps: Array
) -> Array:
    """Highest torque at which `interpolated` knows the quantity at each speed; NaN where there is none."""
    known = ~np.isnan(values)
    i, x = _place(grid_speed_radps, speed_radps)
    left, right = known[i], known[i + 1]
    # On a grid line its own cells count alone, between two lines what both know.
    both = np.where((x == 0)[..., None], left, np.where((x == 1)[..., None], right, left & right))
    top = _last(both)
    above = np.minimum(top + 1, len(grid_torque_nm) - 1)
    # A cell above with one more known corner is used on the triangle, as far as its slanted edge.
    share = np.where(_at(left, above), 1 - x, np.where(_at(right, above), x, 0.0))
    share = np.where((x == 0) | (x == 1), 0.0, share)
    torque = grid_torque_nm[top] + share * (grid_torque_nm[above] - grid_torque_nm[top])
    # Just inside, so that a torque computed back from this one does not land in an unknown cell.
    torque = torque - _ROUNDING * (grid_torque_nm[-1] - grid_torque_nm[0])
    torque = np.maximum(torque, grid_torque_nm[0])
    return np.where(_beyond(x) | ~both.any(axis=-1), np.nan, torque)


def _last(where: NDArray[np.bool_]) -> NDArray[np.int64]:
    last: NDArray[np.int64] = where.shape[-1] - 1 - np.argmax(where[..., ::-1], axis=-1)
    return last


def _at(where: NDArray[np.bool_], index: NDArray[np.int64]) -> NDArray[np.bool_]:
    return np.take_along_axis(where, index[..., None], axis=-1)[..., 0]


def _place(axis: Array, at: Array) -> tuple[NDArray[np.int64], Array]:
    """The cell's number along an axis, and the share of it passed."""
    cell = np.clip(np.searchsorted(axis, at, "right") - 1, 0, len(axis) - 2)
    return cell, (at - axis[cell]) / (axis[cell + 1] - axis[cell])


def _beyond(share: Array) -> NDArray[np.bool_]:
    return np.abs(share - 0.5) > 0.5 + _ROUNDING


def _on_triangle(corners: Sequence[Array], x: Array, y: Array) -> Array:
    """Linear on the three known corners: (0, 0) low, (0, 1) up, (1, 0) right, (1, 1) far; else NaN."""
    low, up, right, far = corners
    result = np.full(x.shape, np.nan)
    # The corner opposite the missing one, its two neighbours, and the distances from it along x and y.
    for opposite, along_x, along_y, u, v in (
        (low, right, up, x, y),
        (up, far, low, x, 1 - y),
        (right, low, far, 1 - x, y),
        (far, up, right, 1 - x, 1 - y),
    ):
        plane = opposite + (along_x - opposite) * u + (along_y - opposite) * v
        result = np.where(np.isnan(result) & (u + v <= 1 + _ROUNDING), plane, result)
    return result
