"""Prices of stored energy that jump where the charge window binds, and the path of charge that they stand for.

With one price on a stretch the path of least cost ends above or below what is asked; two neighbouring prices, one
of each, are mixed so that it ends there. Where the mix leaves the window most, stored energy is put to the limit
and the stretch is cut in two, each with a price of its own, until no mix leaves the window.

As prices of a bound they are taken with the drift of the costate equation along a rollout, and first made to jump
as the multiplier of a limit does, down at the lower one and up at the upper one: of two stretches between which
they jump the other way, as where a cut leaves one of a single step, the shorter takes the other's price. Any prices
are valid (step_prices.py), and a bound is concave in them: the mean of two prices bounds no worse than the mean of
their bounds, and often better than either.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from hevopt.bounds._prices_kernels import priced_path
from hevopt.bounds.bounded import drain_at_j, undominated_bounded
from hevopt.bounds.lines import Line
from hevopt.bounds.prices import one_price_dual
from hevopt.bounds.step_prices import after_switching_j, costate_prices, dual_of_shape
from hevopt.problem.arrays import Array
from hevopt.problem.choices import Choices
from hevopt.problem.problem import Problem, Trajectory

_CUTS_MAX = 60
_DOUBLINGS_MAX = 40
_HALVINGS_MAX = 40
_PRICE_TOLERANCE = 1e-7
# Share of the window that a mix may leave it by.
_TOLERANCE = 1e-6


class Segments(NamedTuple):
    """price_kgpj: (time,) after each step; energy_j: (time + 1,) of the mixed path; cuts: how many there are."""

    price_kgpj: Array
    energy_j: Array
    cuts: int


class _Path(NamedTuple):
    energy_j: Array
    mode: int


def segment_dual(
    problem: Problem,
    rollout: Trajectory,
    choices: Choices | None = None,
    beside: Sequence[Line] = (),
) -> list[Line]:
    """Lines of the dual whose prices jump at the window's limits and drift along a rollout, the highest last.

    choices: those to count in place of the table's own, as of virtual.py
    beside: lines of other prices, the highest last; then lines of the mean of both are among those found
    """
    own = undominated_bounded(problem) if choices is None else choices
    low, high = problem.window_j
    drain_j = drain_at_j(problem, own, np.clip(after_switching_j(rollout), low, high))
    found = segments(problem, own, drain_j, one_price_dual(problem)[-1].price_kgpj)
    price = in_order(found, (low + high) / 2) * costate_prices(problem, rollout)
    lines = dual_of_shape(problem, rollout, price, choices)
    if beside:
        one, other = (line.scale * line.shape for line in (lines[-1], beside[-1]))
        lines += dual_of_shape(problem, rollout, (one + other) / 2, choices)
    return sorted(lines, key=lambda line: line.value_kg)


def in_order(found: Segments, middle_j: float) -> Array:
    """(time,) prices that jump down at the lower limit of the window and up at the upper one."""
    price = found.price_kgpj.copy()
    while True:
        begins = np.flatnonzero(np.diff(price)) + 1
        wrong = (price[begins] > price[begins - 1]) == (found.energy_j[begins] < middle_j)
        if not wrong.any():
            return price
        ends = np.concatenate([[0], begins, [len(price)]])
        lengths = np.diff(ends)
        # Jump i stands between the stretches i and i + 1.
        shorter = np.minimum(lengths[:-1], lengths[1:])
        jump = int(np.flatnonzero(wrong)[np.argmin(shorter[wrong])])
        goes, stays = (jump, jump + 1) if lengths[jump] < lengths[jump + 1] else (jump + 1, jump)
        price[ends[goes] : ends[goes + 1]] = price[ends[stays]]


def binds(problem: Problem, choices: Choices, drain_j: Array, cheap: float, dear: float) -> bool:
    """Whether the mix of the paths at two neighbouring factors leaves the window."""
    start, (low, high) = (problem.start_mode, problem.start_j), problem.window_j
    below, above = (_path(problem, choices, drain_j, start, price) for price in (cheap, dear))
    mixed = _mix(below, above, problem.end_min_j).energy_j
    slack = _TOLERANCE * (high - low)
    return bool((mixed < low - slack).any() or (mixed > high + slack).any())


def segments(problem: Problem, choices: Choices, drain_j: Array, guess_kgpj: float) -> Segments:
    """The prices of a problem whose entries take drain_j, (entry,); guess_kgpj: a price to begin with."""
    low, high = problem.window_j
    steps = choices.steps
    price, energy = np.empty(steps), np.empty(steps + 1)
    energy[0] = problem.start_j
    waiting = [(0, steps, problem.end_min_j)]
    cuts, mode = 0, problem.start_mode
    while waiting:
        begin, end, target = waiting.pop()
        part = choices.part(begin, end)
        first = choices.first[begin, 0]
        drain = drain_j[first : first + len(part.control)]
        found, mixed = _mixed(problem, part, drain, (mode, energy[begin]), target, guess_kgpj)
        outside = np.maximum(low - mixed.energy_j, mixed.energy_j - high)[1:-1]
        if len(outside) and outside.max() > _TOLERANCE * (high - low) and cuts < _CUTS_MAX:
            at = 1 + int(np.argmax(outside))
            cuts += 1
            limit = low if mixed.energy_j[at] < low else high
            waiting += [(begin + at, end, target), (begin, begin + at, limit)]
            continue
        price[begin:end] = found
        energy[begin + 1 : end + 1] = mixed.energy_j[1:]
        mode = mixed.mode
    return Segments(price, np.clip(energy, low, high), cuts)


def _mixed(
    problem: Problem,
    part: Choices,
    drain_j: Array,
    start: tuple[int, float],
    target_j: float,
    guess_kgpj: float,
) -> tuple[float, _Path]:
    """A price, and the mix of the two paths at it that ends with the energy asked for."""
    below = _path(problem, part, drain_j, start, 0.0)
    if below.energy_j[-1] >= target_j:
        return 0.0, below
    cheap, dear = 0.0, guess_kgpj
    above = _path(problem, part, drain_j, start, dear)
    for _ in range(_DOUBLINGS_MAX):
        if above.energy_j[-1] >= target_j:
            break
        cheap, below, dear = dear, above, 2.0 * dear
        above = _path(problem, part, drain_j, start, dear)
    else:
        return dear, above
    for _ in range(_HALVINGS_MAX):
        if dear - cheap <= _PRICE_TOLERANCE * dear:
            break
        middle = (cheap + dear) / 2
        between = _path(problem, part, drain_j, start, middle)
        if between.energy_j[-1] >= target_j:
            dear, above = middle, between
        else:
            cheap, below = middle, between
    return dear, _mix(below, above, target_j)


def _mix(below: _Path, above: _Path, target_j: float) -> _Path:
    """The mix of two paths that ends with the energy asked for, or the nearer one."""
    rise = above.energy_j[-1] - below.energy_j[-1]
    share = 0.0 if rise <= 0 else float(np.clip((target_j - below.energy_j[-1]) / rise, 0.0, 1.0))
    energy_j = (1 - share) * below.energy_j + share * above.energy_j
    return _Path(energy_j, (above if share > 0.5 else below).mode)


def _path(
    problem: Problem, part: Choices, drain_j: Array, start: tuple[int, float], price_kgpj: float
) -> _Path:
    """The path of least cost at a price."""
    mode, energy_j = start
    every = np.full(part.steps, price_kgpj)
    _, path, _ = priced_path(part, drain_j, every, every, mode)
    modes = problem.table.mode[part.control[path]]
    before = np.concatenate([[mode], modes[:-1]])
    switched_j = part.switching.energy_j[part.switching.case, before, modes]
    fallen = np.cumsum(drain_j[path] + switched_j)
    return _Path(np.concatenate([[energy_j], energy_j - fallen]), int(modes[-1]))
