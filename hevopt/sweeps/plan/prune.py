"""Which designs to solve, and which to discard unsolved because their bound is worse than a solved design.

Designs of one NOx weight compete; each weight has an incumbent of its own, the best objective so far of designs
that follow their cycles. In every round each weight gives its next designs in order of their bound. Before a round,
designs whose bound is above the incumbent's objective are discarded: whatever their plans, they are strictly worse.
What is discarded depends on bounds and objectives alone, neither on the order they came in nor on how many workers
there are.
"""

from bisect import bisect_right
from collections.abc import Generator, Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import count
from math import fsum, inf, isfinite
from typing import Any, TypeGuard

from hevopt.studies.status import Status

# Designs of one weight in a round, the last size for ever: few at first, so that an incumbent spares most of a
# small study; later enough to keep some dozen workers busy, few enough to be few too many.
WAVES = (4, 8, 16, 32)


@dataclass(frozen=True, slots=True)
class Bounded:
    """A design with what bounds its objective from below; None where its bound failed."""

    design: int
    nox_weight: float
    bound: float | None


@dataclass(frozen=True, slots=True)
class Pruned:
    """A design discarded unsolved: its bound is above the objective that the incumbent design reached."""

    design: int
    bound: float
    incumbent: int
    objective: float

    @property
    def excess(self) -> float:
        """How far the bound is above the objective, as a share of that; infinite above one of 0."""
        return self.bound / self.objective - 1 if self.objective else inf


@dataclass(frozen=True, slots=True)
class Wave:
    """What a round discards, and the designs to solve next; none are left to solve after the last."""

    designs: tuple[int, ...]
    pruned: tuple[Pruned, ...]


Search = Generator[Wave, Mapping[int, float | None], None]


def mean_bound(bounds: Sequence[float | None]) -> float | None:
    """The bound of a design, mean of those on each cycle in any order; None where one failed."""
    return _mean(bounds)


def mean_objective(objectives: Sequence[Sequence[float | None]]) -> float | None:
    """The objective of a design, mean over the cycles of its best strategy's; None where a cycle has none.

    Sums are rounded once: with bounds nowhere above the objectives, their mean is not above that of these.
    """
    best = [
        min((figure for figure in cycle if _usable(figure)), default=None) for cycle in objectives
    ]
    return _mean(best)


def follows(rows: Iterable[Mapping[str, Any] | None]) -> bool:
    """Whether a design follows its cycles, by what rows of it there are: no step with less than the cycle asks."""
    return not any(
        Status.read(row.get("status", "ok")).shortfall_steps for row in rows if row is not None
    )


def search(designs: Iterable[Bounded], sizes: Sequence[int] = WAVES) -> Search:
    """Yields waves; each expects, sent back, design -> objective of the wave's designs.

    The objective is None where a design failed or does not follow a cycle: it condemns no other. A design without
    a bound, because it failed or is infeasible, is solved all the same: its error is on record. sizes: how many
    designs of a weight each wave takes, the last for all later ones.
    """
    groups: dict[float, _Group] = {}
    for given in sorted(designs, key=_order):
        groups.setdefault(given.nox_weight, _Group([])).queue.append(given)
    for turn in count():
        if not any(group.queue for group in groups.values()):
            return
        wave = sizes[min(turn, len(sizes) - 1)]
        pruned = [discarded for group in groups.values() for discarded in group.discard()]
        taken = [(group, given) for group in groups.values() for given in group.take(wave)]
        objectives = yield Wave(tuple(given.design for _, given in taken), tuple(pruned))
        for group, given in taken:
            group.learn(given.design, objectives[given.design])


@dataclass(slots=True)
class _Group:
    """Designs of one weight that wait, by ascending bound, and the best of those solved: (objective, design)."""

    queue: list[Bounded]
    incumbent: tuple[float, int] | None = None

    def discard(self) -> list[Pruned]:
        if self.incumbent is None:
            return []
        objective, design = self.incumbent
        kept = bisect_right(self.queue, objective, key=_bound)
        worse, self.queue = self.queue[kept:], self.queue[:kept]
        return [Pruned(given.design, _bound(given), design, objective) for given in worse]

    def take(self, count: int) -> list[Bounded]:
        taken, self.queue = self.queue[:count], self.queue[count:]
        return taken

    def learn(self, design: int, objective: float | None) -> None:
        if _usable(objective):
            found = (objective, design)
            self.incumbent = found if self.incumbent is None else min(self.incumbent, found)


def _order(given: Bounded) -> tuple[float, float, int]:
    return given.nox_weight, _bound(given), given.design


def _bound(given: Bounded) -> float:
    """A bound that failed discards nothing."""
    return given.bound if _usable(given.bound) else -inf


def _usable(value: float | None) -> TypeGuard[float]:
    return value is not None and isfinite(value)


def _mean(values: Sequence[float | None]) -> float | None:
    usable = [value for value in values if _usable(value)]
    if not usable or len(usable) < len(values):
        return None
    return fsum(usable) / len(usable)
