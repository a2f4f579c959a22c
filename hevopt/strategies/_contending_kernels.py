"""Compiled choice of those that may be the best somewhere: of many at a step, few are, whatever comes after it."""

from typing import NamedTuple

import numpy as np

from hevopt._compile import compiled
from hevopt.problem.arrays import Array, Indices

# Cells whose least and greatest rises are kept as one.
_CELLS = 16


class Penalty(NamedTuple):
    """What takes the place of infinity: per cell below a grid and above it, and where no path is known."""

    floor_kg: float
    ceiling_kg: float
    unreachable_kg: float


class Room(NamedTuple):
    """Where a step's work is written, made once.

    least, greatest: (block,) rises per cell of the cost-to-go
    moved: (2, entry) cells that either end of some nodes moves by
    kept: (entry,) those that may be the best there
    """

    least: Array
    greatest: Array
    moved: Array
    kept: Indices


@compiled()
def room_for(nodes: int, entries: int) -> Room:
    """Room for a grid of some nodes and so many choices a step."""
    blocks = (nodes - 2) // _CELLS + 1
    moved, kept = np.empty((2, entries)), np.empty(entries, dtype=np.int64)
    return Room(np.empty(blocks), np.empty(blocks), moved, kept)


@compiled(bare=True)
def rises_of(value: Array, room: Room) -> None:
    """Fill the least and the greatest rise per cell of a cost-to-go (node,) over every _CELLS cells."""
    for block in range(len(room.least)):
        begin, end = block * _CELLS, min((block + 1) * _CELLS, len(value) - 1)
        # Each minimum waits for the one before: of two halves, only half as often.
        low, low_too, high, high_too = np.inf, np.inf, -np.inf, -np.inf
        for c in range(begin, end - 1, 2):
            rise, next_rise = value[c + 1] - value[c], value[c + 2] - value[c + 1]
            low, low_too = min(low, rise), min(low_too, next_rise)
            high, high_too = max(high, rise), max(high_too, next_rise)
        if (end - begin) % 2 == 1:
            rise = value[end] - value[end - 1]
            low, high = min(low, rise), max(high, rise)
        room.least[block], room.greatest[block] = min(low, low_too), max(high, high_too)


@compiled(bare=True)
def _extreme(
    sign: float, rises: Array, below: float, above: float, nodes: int, penalty: Penalty
) -> float:
    """The greatest (sign 1) or the least (sign -1) rise per cell between two nodes, beyond the grid too."""
    blocks = len(rises)
    begin = max(min(int(below) // _CELLS, blocks - 1), 0)
    end = max(min(int(above) // _CELLS, blocks - 1), 0)
    found: float = sign * rises[begin]
    for block in range(begin + 1, end + 1):
        found = max(found, sign * rises[block])
    if below < 0.0:
        found = max(found, -sign * penalty.floor_kg)
    if above > nodes - 1:
        found = max(found, sign * penalty.ceiling_kg)
    return sign * found


@compiled(bare=True)
def _beaten(one: int, other: int, rise: float, cost: Array, start: Array, after: Array) -> bool:
    """Whether an entry costs no less than another at both ends of some nodes, where a cell higher costs `rise`."""
    more: float = cost[one] - cost[other]
    first: float = more + rise * (start[one] - start[other])
    last: float = more + rise * (after[one] - after[other])
    return first >= 0.0 and last >= 0.0


@compiled(bare=True)
def _rises_reached(
    start: Array, after: Array, ends: tuple[int, int], nodes: int, penalty: Penalty, room: Room
) -> tuple[float, float]:
    """The greatest and the least rise per cell of all that entries lead to; 0 where no battery gives any."""
    low, high = ends
    bottom, top = np.inf, -np.inf
    for i in range(len(start)):
        if np.isfinite(start[i] + after[i]):
            first, last = low + start[i], high + after[i]
            bottom = min(bottom, min(first, last))
            top = max(top, max(first, last))
    if bottom > top:
        return 0.0, 0.0
    greatest: float = _extreme(1.0, room.greatest, bottom, top, nodes, penalty)
    least: float = _extreme(-1.0, room.least, bottom, top, nodes, penalty)
    return greatest, least


@compiled(bare=True)
def _likely(
    cost: Array, start: Array, after: Array, rises: tuple[float, float], kept: Indices
) -> int:
    """Keep the entries that the best of them at either rise of the cost-to-go does not beat; how many these are.

    rises: the greatest and the least of all that the entries lead to. What beats others is kept itself, and so is
    what no battery gives.
    """
    (greatest, least), low, high = rises, -1, -1
    at_low, at_high = np.inf, np.inf
    for i in range(len(cost)):
        gentle, dear = cost[i] + greatest * start[i], cost[i] + least * start[i]
        if gentle < at_low:
            at_low, low = gentle, i
        if dear < at_high:
            at_high, high = dear, i
    high = min(high, low)
    count = 0
    for i in range(len(cost)):
        beaten = False
        if low >= 0:
            other, rise = (low, greatest) if i > low else (high, least)
            beaten = (i > low or i < high) and _beaten(i, other, rise, cost, start, after)
        kept[count] = i
        count += not beaten
    return count


@compiled(bare=True)
def contenders(
    cost: Array,
    start: Array,
    after: Array,
    ends: tuple[int, int],
    nodes: int,
    penalty: Penalty,
    room: Room,
) -> tuple[int, int]:
    """Keep the entries, whose moves fall from one to the next, that may be the best at some node: from and to.

    start, after: (entry,) cells that each moves the first and the last of the nodes, `ends`, by

    Of two, the one that moves lower finds a cost-to-go that is lower by at most the cells between them times the
    greatest rise between where they lead, and higher by at most minus the least rise times that. One that costs
    more than that more than the other is the best nowhere: what holds at both ends of the nodes holds
    between them, where moves are linear. Beyond the grid, rises are those of the penalty. What no battery gives
    (NaN) is kept, and beats nothing. Most are beaten by the rises of all that the entries lead to, which are looked
    for once; only the others ask for those between two.
    """
    low, high = ends
    kept, rises = room.kept, _rises_reached(start, after, ends, nodes, penalty, room)
    count, other = 0, -1
    for c in range(_likely(cost, start, after, rises, kept)):
        i = kept[c]
        possible = np.isfinite(start[i] + after[i])
        if possible and other >= 0:
            bottom = min(low + start[i], high + after[i])
            top = max(low + start[other], high + after[other])
            rise = _extreme(1.0, room.greatest, bottom, top, nodes, penalty)
            if _beaten(i, other, rise, cost, start, after):
                continue
        kept[count] = i
        count += 1
        other = i if possible else other
    first, other = count, -1
    for c in range(count - 1, -1, -1):
        i = kept[c]
        possible = np.isfinite(start[i] + after[i])
        if possible and other >= 0:
            bottom = min(low + start[other], high + after[other])
            top = max(low + start[i], high + after[i])
            rise = _extreme(-1.0, room.least, bottom, top, nodes, penalty)
            if _beaten(i, other, rise, cost, start, after):
                continue
        first -= 1
        kept[first] = i
        other = i if possible else other
    return first, count
