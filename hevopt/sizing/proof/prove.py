"""No car of a box of sizes burns less than so much, proven; boxes are halved until the best car found is close.

The sizes are factors of engine, machine and battery; the bound holds for every car between, whatever its strategy,
on the cycle with the charge that its file asks for. A final drive is branched over: pieces of its range, each with
laws of its own (geared.py), until the gap is closed or the boxes are used up. Parameters of other kinds have no
such proof: see `NotProvable`.
"""

import heapq
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import count, pairwise
from math import ceil, log
from time import perf_counter
from typing import Any

import numpy as np

from hevopt.bounds import _step_prices_kernels as kernels
from hevopt.display.facts import Shown
from hevopt.driving.cycle import Cycle
from hevopt.errors import DataError, HevoptError
from hevopt.powertrain.powertrain import build_problem
from hevopt.problem.arrays import Array
from hevopt.sizing.proof.bundle import Planes, best_bound, planes_of
from hevopt.sizing.proof.entries import Box, OneBattery, Touch, cell_of, impossible, prices_of
from hevopt.sizing.proof.laws import Laws, laws_of
from hevopt.sizing.proof.modes import NotProvable
from hevopt.sizing.proof.space import Space
from hevopt.studies.case import Case, dp_case
from hevopt.units import litres_per_100km

TARGET_GAP = 3e-3
_BOXES_MAX, _TOUCHES, _BUNDLE = 60, 7, 14
_SCALES = (1.0, 0.97, 1.03)
_INCUMBENTS = 3
# Final drives are cut into pieces of such a width at once: wider ones prove next to nothing.
_PIECE = 0.03
# Boxes of final drives: so many more, tangents at so few designs for each.
_DRIVE_BOXES, _DRIVE_TOUCHES = 120, 2
# With the boxes grown by such a factor the design that keeps the lowest one down is solved.
_SOLVE_AGAIN = 1.25
# Share of the fuel that a box gives away, per square of a size's range and per range of the final drive, both in
# logarithms: measured on C2. They choose what is halved, and are part of no bound.
_LOST_BY_SIZE, _LOST_BY_DRIVE = 0.004, 0.28


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class RangeProof(Shown):
    """What no car of some ranges is below, and the best car found inside.

    ranges: key path -> lowest and highest value; bound_l_per_100km: proven; best: the best design solved and
    what it burns, charge no less than asked; boxes: how many were looked at; closed: whether the gap is the
    target; within, apart: constraints that the cars meet, and those of which not all is linear, which the bound
    leaves out
    """

    ranges: Mapping[str, tuple[float, float]]
    cycle: str
    bound_l_per_100km: float
    best: Mapping[str, float]
    best_l_per_100km: float
    boxes: int
    closed: bool
    seconds: float
    within: tuple[str, ...] = ()
    apart: tuple[str, ...] = ()

    @property
    def gap(self) -> float:
        """How far the best design is above the bound, as a share of it."""
        return self.best_l_per_100km / self.bound_l_per_100km - 1

    def _facts(self) -> dict[str, object]:
        return {
            "cycle": self.cycle,
            "bound_l_per_100km": self.bound_l_per_100km,
            "best_l_per_100km": self.best_l_per_100km,
            "gap": self.gap,
            "boxes": self.boxes,
        }


def prove(
    architecture: str,
    ranges: Mapping[str, tuple[float, float]],
    cycle: Cycle,
    *,
    fixed: Mapping[str, Any] | None = None,
    constraints: Sequence[str] = (),
    target_gap: float = TARGET_GAP,
    boxes_max: int | None = None,
    progress: Callable[[int, float], None] = lambda boxes, gap: None,
) -> RangeProof:
    """The least that a car of some ranges can burn on a cycle, and the best one found.

    ranges: key path of SIZES -> lowest and highest value; fixed: other keys of the car; constraints: between
    them, as in a study: the linear ones hold of the cars that the bound speaks of
    progress: called with the boxes done and the gap that is left
    NotProvable, with the reason, where the car's or the cycle's laws are none of those that the proof knows.
    """
    began = perf_counter()
    space = Space(architecture, ranges, fixed or {}, constraints)
    proof = _Proof(space, cycle, target_gap)
    most = boxes_max or (_BOXES_MAX if space.drive is None else _DRIVE_BOXES)
    bound, done = _branched(proof, most, progress)
    if not np.isfinite(proof.best_kg):
        raise NotProvable(
            "no car was found that meets the constraints; loosen one or narrow the ranges"
        )
    engine, distance = space.base.engine, cycle.distance_m
    litres = [
        litres_per_100km(kg, engine.fuel_density_kgpm3, distance) for kg in (bound, proof.best_kg)
    ]
    return RangeProof(
        space.ranges, cycle.name, litres[0], space.values(proof.best_theta, proof.best_drive), litres[1],
        done, proof.best_kg / bound - 1 <= target_gap, perf_counter() - began, tuple(space.within),
        tuple(space.apart),
    )  # fmt: skip


def _branched(
    proof: "_Proof", boxes_max: int, progress: Callable[[int, float], None]
) -> tuple[float, int]:
    """The least bound of the boxes that a space is cut into, and how many were looked at."""
    queue: list[tuple[float, int, _Bounded]] = []
    waiting = [(-np.inf, box, list[Planes]()) for box in _first(proof.space.root)]
    order, done, solve_at = count(), 0, len(waiting)
    while True:
        for above, box, bundle in waiting:
            found = proof.bound(box, bundle)
            done += 1
            heapq.heappush(queue, (max(found.bound_kg, above), next(order), found))
        bound, _, lowest = queue[0]
        if lowest.box.drive is not None and done >= solve_at:
            proof.solve(lowest.theta, lowest.box.drive)
            solve_at = ceil(_SOLVE_AGAIN * done)
        gap = proof.best_kg / bound - 1
        progress(done, gap)
        if gap <= proof.target_gap or done >= boxes_max:
            return bound, done
        heapq.heappop(queue)
        box, kept = lowest.box, lowest.bundle
        waiting = [
            (bound, half, kept if half.drive == box.drive else list[Planes]())
            for half in _halves(box)
        ]


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class _Bounded(Shown):
    """A box with its bound, the planes that gave it, and the sizes that keep it down, (3,)."""

    bound_kg: float
    box: Box
    bundle: list[Planes]
    theta: Array


class _Proof:
    """Bounds of boxes, with the prices and the best car found on the way."""

    def __init__(self, space: Space, cycle: Cycle, target_gap: float = TARGET_GAP) -> None:
        self.space, self.cycle, self.target_gap = space, cycle, target_gap
        self._cars = space.corners()
        self._laws: dict[tuple[float, float] | None, Laws] = {}
        self.best_kg, self.best_theta = np.inf, space.root.middle
        self.best_drive = space.middle_drive(space.drive)
        self.shapes: list[Array] = []
        self.scale, self.solved = 0.0, 0
        self.cell: OneBattery | None = None
        if space.drive is None:
            self.laws_of(space.root)
        if not self.solve(self.best_theta, space.drive):
            raise NotProvable(
                f"{space.base.name}: the car in the middle of the ranges does not follow the cycle; narrow them"
            )

    def laws_of(self, box: Box) -> Laws:
        """The laws of a box's final drives."""
        if box.drive not in self._laws:
            ends = self.space.ends(box.drive)
            self._laws[box.drive] = laws_of(
                self._cars, ends, self.cycle, self.space.low, self.space.high
            )
        return self._laws[box.drive]

    def solve(self, theta: Array, drive: tuple[float, float] | None) -> bool:
        """Solve a design: the best so far, and the shape of prices along its plan. Whether it follows the cycle.

        A design that no number of whole cells brings within the limits gives prices alone.
        """
        self.solved += 1
        whole = self.space.whole(theta)
        theta = theta if whole is None else whole
        ratio = self.space.middle_drive(drive)
        try:
            car = self.space.car(theta, ratio)
            problem = build_problem(car, self.cycle)
            case: Case = dp_case(car, self.cycle, problem)
        except DataError:
            raise
        except HevoptError:
            return False
        plan = case.dp_trajectory
        if plan.cost_kg < self.best_kg and whole is not None:
            self.best_kg, self.best_theta, self.best_drive = plan.cost_kg, theta, ratio
        shape = kernels.costate(
            plan.energy_j[:-1] - plan.switch_energy_j, plan.battery_power_w, problem.table.step_s,
            problem.battery.within_window(),
        )  # fmt: skip
        self.shapes.append(shape / shape[-1])
        self.scale = self.scale or case.certificate.price_kgpj
        if self.cell is None:
            base = build_problem(self.space.base, self.cycle)
            self.cell = cell_of(self.space.base, base.start_j, base.end_min_j)
        return True

    def bound(self, box: Box, bundle: Sequence[Planes]) -> _Bounded:
        """The bound of a box from what is known of the box that it is part of, and more tangents."""
        if not len(box.corners):
            return _Bounded(np.inf, box, [], box.middle)
        laws = self.laws_of(box)
        barred = impossible(laws, box)
        own, theta, scale = list(bundle), box.middle, self.scale
        best = -np.inf
        for turn in range(_TOUCHES if box.drive is None else _DRIVE_TOUCHES):
            for factor in _SCALES if turn < 2 else _SCALES[:1]:
                own.append(self._touch(laws, theta, scale * factor))
            found = best_bound(own, box, barred)
            best = max(best, found.bound_kg)
            if not np.isfinite(best):
                return _Bounded(np.inf, box, [], theta)
            scale = float(found.weights @ np.array([planes.scale for planes in own]))
            theta = np.clip(found.theta, box.low, box.high)
            if turn == 0 and box.drive is None and self.solved < _INCUMBENTS + 1:
                self.solve(theta, None)
            if self.best_kg / best - 1 <= self.target_gap:
                break
            keep = np.argsort(-found.weights)[:_BUNDLE]
            own = [own[n] for n in sorted(keep)]
        self.scale = scale
        return _Bounded(best, box, own, theta)

    def _touch(self, laws: Laws, theta: Array, scale: float) -> Planes:
        assert self.cell is not None  # there is one as soon as a design is solved
        prices = prices_of(self.shapes[-1] * scale)
        entries = Touch(laws, self.cell, theta, prices).entries()
        return planes_of(laws, self.cell, entries, prices, scale)


def _first(root: Box) -> list[Box]:
    """The box to begin with, in pieces where the final drive has a range."""
    if root.drive is None:
        return [root]
    low, high = root.drive
    pieces = max(1, ceil(log(high / low) / _PIECE))
    ends = [low, *(low * (high / low) ** (n / pieces) for n in range(1, pieces)), high]
    return [Box(root.low, root.high, root.rows, each) for each in pairwise(ends)]


def _halves(box: Box) -> list[Box]:
    """Two halves across what gives away most: a size, or the final drive."""
    lost = _LOST_BY_SIZE * np.log(box.high / box.low) ** 2
    if box.drive is not None and _LOST_BY_DRIVE * log(box.drive[1] / box.drive[0]) > lost.max():
        middle_drive = (box.drive[0] + box.drive[1]) / 2
        drives = (box.drive[0], middle_drive), (middle_drive, box.drive[1])
        return [replace(box, drive=drive) for drive in drives]
    n = int(np.argmax(lost))
    middle = (box.low[n] + box.high[n]) / 2
    below, above = box.high.copy(), box.low.copy()
    below[n] = above[n] = middle
    return [replace(box, high=below), replace(box, low=above)]
