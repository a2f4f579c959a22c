"""Main effects: what a parameter does to the objective, over all values of the others."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# Numbers with more distinct values than this are put into BINS bins.
VALUES_MAX = 12
BINS = 8
# Positive values that span this factor are looked at in logarithms.
_LOG_SPAN = 20.0


@dataclass(frozen=True, slots=True)
class ParameterEffect:
    """The objective over the values of one parameter; lists are (value or bin,), in ascending order.

    values: numbers (of a bin, its middle) or texts; low, high: ends of the bin, the value itself where it is none
    best: least objective; floor: least bound of designs that were pruned; None where there are none
    mean: None where a design was pruned: those left are the better ones, more so at some values than at others
    share: of the objective's variance, what lies between the values' means (correlation ratio, eta squared);
    chance: what unrelated random values would reach on average. None where nothing varies, or designs were pruned
    """

    key: str
    numeric: bool
    binned: bool
    log: bool
    values: list[float] | list[str]
    low: list[Any]
    high: list[Any]
    mean: list[float] | None
    best: list[float | None]
    floor: list[float | None]
    count: list[int]
    share: float | None
    chance: float | None


def is_numeric(values: Sequence[Any]) -> bool:
    """Whether all are numbers; true and false are none."""
    return all(isinstance(v, int | float) and not isinstance(v, bool) for v in values)


def is_log(values: Sequence[float]) -> bool:
    """Whether values are better looked at in logarithms."""
    low, high = min(values), max(values)
    return low > 0 and high / low >= _LOG_SPAN


def effect(
    key: str, values: Sequence[Any], objective: Array, pruned: Sequence[tuple[Any, float]] = ()
) -> ParameterEffect:
    """The effect of a parameter on the objective, both of one entry per design. pruned: others' value, bound"""
    solved = len(objective)
    values = [*values, *(value for value, _ in pruned)]
    whole = np.array([*objective, *(bound for _, bound in pruned)])
    numeric = is_numeric(values)
    log = numeric and is_log(values)
    distinct = sorted(set(values)) if numeric else list(dict.fromkeys(values))
    binned = numeric and len(distinct) > VALUES_MAX
    if binned:
        edges = _edges(distinct[0], distinct[-1], log)
        place = np.clip(np.searchsorted(edges, values, side="right") - 1, 0, BINS - 1)
        low, high = edges[:-1].tolist(), edges[1:].tolist()
        middle = np.sqrt(edges[:-1] * edges[1:]) if log else (edges[:-1] + edges[1:]) / 2
        shown = middle.tolist()
    else:
        at = {value: n for n, value in enumerate(distinct)}
        place = np.array([at[value] for value in values])
        shown = low = high = distinct if numeric else [_text(value) for value in distinct]
    used = np.unique(place).tolist()
    groups = [objective[place[:solved] == n] for n in used]
    floors = [whole[solved:][place[solved:] == n] for n in used]
    share, chance = (None, None) if pruned else _share(groups, objective)
    return ParameterEffect(
        key, numeric, binned, log,
        *([of[n] for n in used] for of in (shown, low, high)),
        None if pruned else [float(group.mean()) for group in groups],
        [float(group.min()) if len(group) else None for group in groups],
        [float(floor.min()) if len(floor) else None for floor in floors],
        [len(group) for group in groups],
        share, chance,
    )  # fmt: skip


def _text(value: Any) -> str:
    return str(value).lower() if isinstance(value, bool) else str(value)


def _edges(low: float, high: float, log: bool) -> Array:
    edges = np.geomspace(low, high, BINS + 1) if log else np.linspace(low, high, BINS + 1)
    edges[0], edges[-1] = low, high
    return edges


def _share(groups: Sequence[Array], objective: Array) -> tuple[float | None, float | None]:
    whole = float(((objective - objective.mean()) ** 2).sum())
    # A millionth of a per cent of the objective is rounding.
    if len(groups) < 2 or whole <= len(objective) * (1e-8 * abs(objective.mean())) ** 2:
        return None, None
    between = sum(len(group) * (group.mean() - objective.mean()) ** 2 for group in groups)
    return float(between / whole), (len(groups) - 1) / (len(objective) - 1)
