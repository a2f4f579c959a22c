"""Open-circuit voltage and resistances over charge by least squares, from what a test in time tells.

    end of a rest, steady current    V = Uoc(x) - R(x, sign of I) I
    pulse after a rest               V_end - V_before = Uoc(x_end) - Uoc(x_before) - R(x_end) I_end + R I_before
    step of current                  R0 = -dV / dI

Uoc and R are piecewise linear in charge; Uoc never falls and no resistance is below 0. Where a direction has no
row near a node, its resistance there is the nearest one's.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import lsq_linear

from hevopt.display.facts import Shown
from hevopt.errors import DataError
from hevopt.measured.battery.events import BatteryEvents
from hevopt.measured.battery.samples import BatterySamples
from hevopt.measured.clusters import clusters

Array = NDArray[np.float64]

# Charges closer than this are one node, as those of a pulse test's levels; else nodes are this far apart.
_LEVEL, _SPACING, _NODES_MAX = 0.03, 0.05, 21
_SPAN_MIN = 0.02
# Weight of what holds nodes together where no row tells them, beside rows of weight 1.
_HELD = 1e-4


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class BatteryFit(Shown):
    """Curves at (node,) states of charge, and how far the rows lie from them.

    discharge_ohm, charge_ohm: in all, R0 + Rct + Rd; ohmic_*: R0 alone, NaN where the rows do not tell it
    told_*: (node,) whether rows near the node tell the resistance of that direction
    rows: how many rows the curves were fitted to
    off_v: (row,) of every row of the test, what was measured less Uoc - R I, one resistance's voltage
    """

    soc: Array
    open_circuit_v: Array
    discharge_ohm: Array
    charge_ohm: Array
    ohmic_discharge_ohm: Array
    ohmic_charge_ohm: Array
    told_discharge: NDArray[np.bool_]
    told_charge: NDArray[np.bool_]
    rows: int
    off_v: Array


def fit_battery(test: BatterySamples, found: BatteryEvents) -> BatteryFit:
    """The curves nearest to a test's rests, pulses and steady loads."""
    still, pulses = np.concatenate([found.rest, found.steady]), found.pulse
    nodes = _nodes(test.soc[np.concatenate([still, pulses.ravel()])])
    count, current = len(nodes), test.current_a
    most = float(np.abs(current).max())
    level = _levels(test, nodes, still)
    moved = _levels(test, nodes, pulses[:, 1]) - _levels(test, nodes, pulses[:, 0])
    matrix = np.concatenate([level, moved])
    value = np.concatenate([
        test.voltage_v[still], test.voltage_v[pulses[:, 1]] - test.voltage_v[pulses[:, 0]]
    ])  # fmt: skip
    # Voltages as a first one and rises of 0 or more, resistances as drops at the largest current.
    rises = np.tril(np.ones((count, count)))
    turn = np.block([
        [rises, np.zeros((count, 2 * count))], [np.zeros((2 * count, count)), np.eye(2 * count) / most]
    ])  # fmt: skip
    held, drop = _HELD * _differences(count, 2), _HELD * _differences(count, 1)
    ties = np.zeros((len(held) + 2 * len(drop), 3 * count))
    ties[: len(held), :count] = held
    for n in (1, 2):
        begin = len(held) + (n - 1) * len(drop)
        ties[begin : begin + len(drop), n * count : (n + 1) * count] = drop * most
    whole = np.concatenate([matrix, ties]) @ turn
    right = np.concatenate([value, np.zeros(len(ties))])
    solved = lsq_linear(whole, right, (0.0, np.inf), method="bvls", tol=1e-14, max_iter=1000)
    if solved.status not in (1, 2, 3):
        raise DataError(
            "the least squares of voltage and resistance do not converge; check the test's columns"
        )
    curves = (turn @ solved.x).reshape(3, count)
    loaded = np.concatenate([found.steady, pulses[:, 1]])
    drawn, taken = (_told(nodes, test.soc[loaded[s * current[loaded] > 0]]) for s in (1, -1))
    voltage, discharge, charge = curves
    # A direction without any load has the other's resistance.
    discharge, charge = (
        _nearest(nodes, discharge, drawn) if drawn.any() else _nearest(nodes, charge, taken),
        _nearest(nodes, charge, taken) if taken.any() else _nearest(nodes, discharge, drawn),
    )
    every = _levels(test, nodes, np.arange(len(current)))
    off = test.voltage_v - every @ np.concatenate([voltage, discharge, charge])
    return BatteryFit(
        nodes, voltage, discharge, charge, _ohmic(test, found, nodes, 1), _ohmic(test, found, nodes, -1),
        drawn, taken, len(still) + len(pulses), off,
    )  # fmt: skip


def _nodes(soc: Array) -> Array:
    low, high = float(soc.min()), float(soc.max())
    if high - low < _SPAN_MIN:
        raise DataError(
            f"the test's rests and loads lie at states of charge from {low:.3g} to {high:.3g}; curves over charge "
            f"need {_SPAN_MIN:g} or more between them"
        )
    cluster, means = clusters(soc, _LEVEL, 0.0)
    wide = max(np.ptp(soc[cluster == k]) for k in range(len(means)))
    if len(means) >= 3 and wide <= 2 * _LEVEL and len(means) <= _NODES_MAX:
        return np.concatenate([[low], means[1:-1], [high]])
    return np.linspace(low, high, int(np.clip(round((high - low) / _SPACING) + 1, 2, _NODES_MAX)))


def _weights(nodes: Array, soc: Array) -> Array:
    """(row, node) of values at nodes in the value at a state of charge, linear between them."""
    k = np.clip(np.searchsorted(nodes, soc, "right") - 1, 0, len(nodes) - 2)
    share = np.clip((soc - nodes[k]) / (nodes[k + 1] - nodes[k]), 0.0, 1.0)
    found, rows = np.zeros((len(soc), len(nodes))), np.arange(len(soc))
    found[rows, k] = 1 - share
    found[rows, k + 1] = share
    return found


def _levels(test: BatterySamples, nodes: Array, rows: NDArray[np.int64]) -> Array:
    """(row, 3 node) of Uoc, discharge and charge resistance in the voltage at rows of the test."""
    weights, current = _weights(nodes, test.soc[rows]), test.current_a[rows, None]
    return np.hstack([
        weights, -weights * np.maximum(current, 0.0), -weights * np.minimum(current, 0.0)
    ])  # fmt: skip


def _differences(count: int, order: int) -> Array:
    return np.diff(np.eye(count), order, axis=0)


def _told(nodes: Array, soc: Array) -> NDArray[np.bool_]:
    told: NDArray[np.bool_] = np.any(_weights(nodes, soc) > 0, axis=0)
    return told


def _nearest(nodes: Array, values: Array, told: NDArray[np.bool_]) -> Array:
    """Values at nodes, beyond those that rows tell the outermost told."""
    return np.interp(nodes, nodes[told], values[told])


def _ohmic(test: BatterySamples, found: BatteryEvents, nodes: Array, sign: int) -> Array:
    """R0 at nodes from steps of current in one direction; NaN where there is none."""
    before, after = found.jump.T if len(found.jump) else np.zeros((2, 0), dtype=np.int64)
    load = np.where(np.abs(test.current_a[after]) > np.abs(test.current_a[before]), after, before)
    own = sign * test.current_a[load] > 0
    if not own.any():
        return np.full(len(nodes), np.nan)
    before, after, load = before[own], after[own], load[own]
    ohm = -(test.voltage_v[after] - test.voltage_v[before]) / (
        test.current_a[after] - test.current_a[before]
    )
    cluster, at = clusters(test.soc[load], _LEVEL / 3, 0.0)
    return np.interp(nodes, at, np.bincount(cluster, ohm) / np.bincount(cluster))
