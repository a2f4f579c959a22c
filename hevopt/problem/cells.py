"""What is known between neighbouring controls of a step: a cell, and two lines below each quantity on it.

Within a cell, t going from 0 at its low control to 1 at its high one, fuel, NOx and battery power of every control
in between are at least the greater of two lines. The first touches the low control, or stays below what the
quantity comes to next to it, the second likewise the high one: tangents or the chords of neighbours where the
quantity is convex in t, twice the same chord where it is linear. Where they come from is told by who makes them:
of a car, powertrain/cells.py; of arrays, `cells_between` from what their maker declares.
"""

from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np

from hevopt.display.facts import Shown
from hevopt.errors import DataError
from hevopt.problem.arrays import Array, Flags, Indices

Between = Literal["", "convex", "linear"]
BETWEEN: tuple[Between, ...] = ("", "convex", "linear")
# Share of the figures around it by which rounding may bend a straight line.
_ROUNDING = 1e-9
_EPSILON = 16 * float(np.finfo(float).eps)


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class SplitCells(Shown):
    """Cells of a table, every end of which is a usable control or lies between two.

    step, low, high: (cell,) step, and columns of the controls at the ends, of one mode
    fuel_kg, nox_kg, power_w: (line, end, cell) the lines' values at the cell's ends, 2 x 2 for each
    slack_kg: (time,) by how much at most the lines of fuel, and of NOx, may be too high at a step, by rounding
    apart: (end, cell) whether an end is no control of the table; its column is then one of the same mode
    """

    step: Indices
    low: Indices
    high: Indices
    fuel_kg: Array
    nox_kg: Array
    power_w: Array
    slack_kg: Array
    apart: Flags

    def _facts(self) -> dict[str, object]:
        return {"cells": len(self.step), "steps": len(self.slack_kg)}

    def kept(self, mask: Flags) -> "SplitCells":
        """The cells where a (cell,) mask holds."""
        return self._picked(np.flatnonzero(mask), self.low[mask], self.high[mask])

    def repeated(self, first: Indices, times: Indices) -> "SplitCells":
        """The cells of a table in which control c stands times[c] times, from column first[c] on."""
        count = times[self.low]
        which = np.repeat(np.arange(len(self.step)), count)
        number = np.arange(len(which)) - np.repeat(np.cumsum(count) - count, count)
        return self._picked(
            which, first[self.low[which]] + number, first[self.high[which]] + number
        )

    def _picked(self, which: Indices, low: Indices, high: Indices) -> "SplitCells":
        fuel, nox, power = (
            lines[..., which] for lines in (self.fuel_kg, self.nox_kg, self.power_w)
        )
        apart = self.apart[:, which]
        return SplitCells(self.step[which], low, high, fuel, nox, power, self.slack_kg, apart)


class TableFigures(NamedTuple):
    """What a table says of its controls, (time, control), for those who make cells; step_s: (time,)."""

    fuel_kg: Array
    nox_kg: Array
    power_w: Array
    usable: Flags
    step_s: Array

    def columns(self, which: Indices) -> "TableFigures":
        """Those of some controls."""
        fuel, nox, power = (values[:, which] for values in self[:3])
        return TableFigures(fuel, nox, power, self.usable[:, which], self.step_s)


def joined(parts: list[SplitCells], steps: int) -> SplitCells:
    """All cells of several parts of a table of as many steps."""
    slack = np.max([part.slack_kg for part in parts], axis=0, initial=0.0)
    if not parts:
        none, lines = np.zeros(0, dtype=np.int64), np.zeros((2, 2, 0))
        apart = np.zeros((2, 0), dtype=bool)
        return SplitCells(none, none, none, lines, lines, lines, np.zeros(steps), apart)
    step, low, high = (
        np.concatenate([getattr(part, name) for part in parts]) for name in ("step", "low", "high")
    )
    fuel, nox, power, apart = (
        np.concatenate([getattr(part, name) for part in parts], axis=-1)
        for name in ("fuel_kg", "nox_kg", "power_w", "apart")
    )
    return SplitCells(step, low, high, fuel, nox, power, slack, apart)


def cells_between(
    between: Between, fuel_kg: Array, nox_kg: Array, power_w: Array, usable: Flags, mode: Indices
) -> SplitCells:
    """The cells of arrays, (time, control), whose maker knows what lies between neighbours.

    Neighbours are usable controls of one step and mode next to each other in battery power, which goes evenly from
    one to the next.
    convex: fuel and NOx are convex functions of it; linear: they are straight lines between neighbours
    Raises DataError, with step and controls, where the arrays contradict that.
    """
    step, control = np.nonzero(usable)
    order = np.lexsort((fuel_kg[step, control], power_w[step, control], mode[control], step))
    step, control = step[order], control[order]
    power = power_w[step, control]
    pair = np.flatnonzero((step[1:] == step[:-1]) & (mode[control[1:]] == mode[control[:-1]]))
    _check_apart(step, control, power, pair)
    low, high = control[pair], control[pair + 1]
    quantities = [values[step, control] for values in (fuel_kg, nox_kg)]
    if between == "convex":
        _check_convex(step, control, power, pair, quantities)
    fuel, nox = (_lines(between, pair, power, values) for values in quantities)
    chord = np.array([power[pair], power[pair + 1]])
    slack = np.zeros(len(fuel_kg))
    np.maximum.at(slack, step[pair], _rounding_kg(pair, power, quantities))
    apart = np.zeros((2, len(pair)), dtype=bool)
    return SplitCells(step[pair], low, high, fuel, nox, np.array([chord, chord]), slack, apart)


def _lines(between: Between, pair: Indices, power: Array, values: Array) -> Array:
    """(line, end, cell) chords of the neighbouring cells continued, or the cell's own twice."""
    start, end = values[pair], values[pair + 1]
    if between == "linear":
        return np.array([[start, end], [start, end]])
    width = power[pair + 1] - power[pair]
    slope = (end - start) / width
    before = np.isin(pair - 1, pair)
    after = np.isin(pair + 1, pair)
    place = np.arange(len(pair))
    first = np.where(before, slope[np.maximum(place - 1, 0)], np.nan)
    second = np.where(after, slope[np.minimum(place + 1, max(len(pair) - 1, 0))], np.nan)
    lines = np.array([[start, start + first * width], [end - second * width, end]])
    # At the outermost cells one neighbour is all that is known.
    lines[0] = np.where(np.isnan(first), lines[1], lines[0])
    lines[1] = np.where(np.isnan(second), lines[0], lines[1])
    return lines


def _rounding_kg(pair: Indices, power: Array, quantities: list[Array]) -> Array:
    """(cell,) what rounding of neighbours' chords may come to when they are continued."""
    width, place = power[pair + 1] - power[pair], np.arange(len(pair))
    ratio = np.ones(len(pair))
    for near in (np.maximum(place - 1, 0), np.minimum(place + 1, len(pair) - 1)):
        ratio += width / width[near]
    most = np.max([np.abs(v[pair]) + np.abs(v[pair + 1]) for v in quantities], axis=0)
    rounding_kg: Array = _EPSILON * ratio * most
    return rounding_kg


def _check_apart(step: Indices, control: Indices, power: Array, pair: Indices) -> None:
    same = pair[power[pair + 1] == power[pair]]
    if len(same):
        raise DataError(
            f"between: at step {step[same[0]]} the controls {control[same[0]]} and {control[same[0] + 1]} have one "
            f"battery power, {power[same[0]]:g} W; keep the cheaper one, or leave `between` out"
        )


def _check_convex(
    step: Indices, control: Indices, power: Array, pair: Indices, quantities: list[Array]
) -> None:
    bend = pair[np.isin(pair + 1, pair)]
    alone = pair[~np.isin(pair + 1, pair) & ~np.isin(pair - 1, pair)]
    if len(alone):
        raise DataError(
            f"between 'convex': step {step[alone[0]]} has two usable controls of mode of control "
            f"{control[alone[0]]}, which bound nothing between them; give three or more, or one, or say 'linear'"
        )
    left, right = power[bend + 1] - power[bend], power[bend + 2] - power[bend + 1]
    for values in quantities:
        chord = (values[bend] * right + values[bend + 2] * left) / (left + right)
        scale = np.abs(values[bend]) + np.abs(values[bend + 1]) + np.abs(values[bend + 2])
        wrong = bend[values[bend + 1] > chord + _ROUNDING * scale]
        if len(wrong):
            n = wrong[0]
            raise DataError(
                f"between 'convex': at step {step[n]} the controls {control[n]}, {control[n + 1]} and "
                f"{control[n + 2]} are not: the middle one lies above the line through its neighbours, over "
                "battery power; leave `between` out, or give them other modes"
            )
