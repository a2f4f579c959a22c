"""A lattice around the best design, every design of it judged: what is known where no proof over ranges holds.

Each parameter takes the best design's value and one on either side: a twentieth of its range away, the next whole
number, the next of a list, or all of what has no order. The lattice moves with a better design that it finds, a
few times. It says nothing of what lies between its designs, or beyond them.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import product
from math import prod

from hevopt.sizing.candidates import Candidate, Candidates, least_bound, rank
from hevopt.sizing.search import levels_of, rounded
from hevopt.sizing.study_file import SizeStudy
from hevopt.sweeps.plan.parameters import Range, Scalar, Values

_STEP = 1 / 20
# So many designs a lattice has at most where fewer trials are asked for: three values of four parameters.
_DESIGNS = 81
_MOVES = 3


@dataclass(frozen=True, slots=True)
class Lattice:
    """A lattice that was judged whole.

    values: key path -> its values; held: what had no room in the lattice, at the best design's values
    designs: how many there are; least: bound on the first objective of all that meet what is asked, None where
    one of them has none
    """

    values: Mapping[str, tuple[Scalar, ...]]
    held: Mapping[str, Scalar]
    designs: int
    least: float | None


def around(study: SizeStudy, candidates: Candidates) -> Lattice | None:
    """Judge the lattice around the best design so far; None where no design meets what is asked."""
    found = None
    for _ in range(_MOVES):
        best = min(candidates.solved, key=rank, default=None)
        if best is None:
            return None
        found = _judged(study, candidates, best)
        if min(candidates.solved, key=rank) is best:
            break
    return found


def _judged(study: SizeStudy, candidates: Candidates, best: Candidate) -> Lattice:
    values: dict[str, tuple[Scalar, ...]] = {}
    held: dict[str, Scalar] = {}
    most = max(study.trials, _DESIGNS)
    for key, allowed in study.sweep.parameters.items():
        near = beside(allowed, best.design.values[key])
        if prod(map(len, values.values())) * len(near) <= most:
            values[key] = near
        else:
            held[key] = best.design.values[key]
    points = [dict(zip(values, point, strict=True)) for point in product(*values.values())]
    judged = candidates.judged([
        {key: point.get(key, held.get(key, 0.0)) for key in study.sweep.parameters} for point in points
    ])  # fmt: skip
    return Lattice(values, held, len(points), least_bound(judged))


def beside(allowed: Values, value: Scalar) -> tuple[Scalar, ...]:
    """A value and those on either side of it, in order."""
    levels = levels_of(allowed)
    if levels is not None:
        if any(isinstance(level, str | bool) for level in levels):
            return levels
        ordered = sorted(levels)
        at = ordered.index(value)
        return tuple(ordered[max(at - 1, 0) : at + 2])
    assert isinstance(allowed, Range) and isinstance(value, int | float)  # what has no levels
    low, high = float(allowed.low), float(allowed.high)
    if allowed.log:
        factor = (high / low) ** _STEP
        sides = [value / factor, value, value * factor]
    else:
        sides = [value - _STEP * (high - low), value, value + _STEP * (high - low)]
    if allowed.whole:
        sides = [min(round(sides[0]), value - 1), value, max(round(sides[2]), value + 1)]
    return tuple(
        dict.fromkeys(rounded(allowed, side) if side != value else value for side in sides)
    )
