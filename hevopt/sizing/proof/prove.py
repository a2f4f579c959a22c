"""No car of a box of sizes burns less than so much, proven; boxes are halved until the best car found is close.

The sizes are factors of engine, machine and battery; the bound holds for every car between, whatever its strategy,
on the cycle with the charge that its file asks for. Parameters of other kinds have no such proof: see
`NotProvable`.
"""

import heapq
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import count
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
    boxes_max: int = _BOXES_MAX,
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
    proof = _Proof(space, cycle)
    queue: list[tuple[float, int, Box, list[Planes]]] = []
    order = count()
    bound, bundle = proof.bound(space.root, [], target_gap)
    heapq.heappush(queue, (bound, next(order), space.root, bundle))
    done = 1
    while queue:
        bound, _, box, bundle = queue[0]
        gap = proof.best_kg / bound - 1
        progress(done, gap)
        if gap <= target_gap or done >= boxes_max:
            break
        heapq.heappop(queue)
        for half in _halves(box):
            below, own = proof.bound(half, bundle, target_gap)
            done += 1
            heapq.heappush(queue, (max(below, bound), next(order), half, own))
    if not np.isfinite(proof.best_kg):
        raise NotProvable(
            "no car was found that meets the constraints; loosen one or narrow the ranges"
        )
    engine, distance = space.base.engine, cycle.distance_m
    litres = [
        litres_per_100km(kg, engine.fuel_density_kgpm3, distance) for kg in (bound, proof.best_kg)
    ]
    return RangeProof(
        space.ranges, cycle.name, litres[0], space.values(proof.best_theta, whole=True), litres[1],
        done, proof.best_kg / bound - 1 <= target_gap, perf_counter() - began, tuple(space.within),
        tuple(space.apart),
    )  # fmt: skip


class _Proof:
    """Bounds of boxes, with the prices and the best car found on the way."""

    def __init__(self, space: Space, cycle: Cycle) -> None:
        self.space, self.cycle = space, cycle
        self.laws: Laws = laws_of(space.corners(), space.base, cycle, space.low, space.high)
        self.best_kg, self.best_theta = np.inf, space.root.middle
        self.shapes: list[Array] = []
        self.scale, self.solved = 0.0, 0
        self.cell: OneBattery | None = None
        if not self.solve(self.best_theta):
            raise NotProvable(
                f"{space.base.name}: the car in the middle of the ranges does not follow the cycle; narrow them"
            )

    def solve(self, theta: Array) -> bool:
        """Solve a design: the best so far, and the shape of prices along its plan. Whether it follows the cycle.

        A design that no number of whole cells brings within the limits gives prices alone.
        """
        self.solved += 1
        whole = self.space.whole(theta)
        theta = theta if whole is None else whole
        try:
            car = self.space.car(theta)
            problem = build_problem(car, self.cycle)
            case: Case = dp_case(car, self.cycle, problem)
        except DataError:
            raise
        except HevoptError:
            return False
        plan = case.dp_trajectory
        if plan.cost_kg < self.best_kg and whole is not None:
            self.best_kg, self.best_theta = plan.cost_kg, theta
        shape = kernels.costate(
            plan.energy_j[:-1] - plan.switch_energy_j, plan.battery_power_w, problem.table.step_s,
            problem.battery.within_window(),
        )  # fmt: skip
        self.shapes.append(shape / shape[-1])
        self.scale = self.scale or case.certificate.price_kgpj
        if self.cell is None:
            base = (
                build_problem(self.space.base, self.cycle)
                if car is not self.space.base
                else problem
            )
            self.cell = cell_of(self.laws, base.start_j, base.end_min_j)
        return True

    def bound(
        self, box: Box, bundle: Sequence[Planes], target_gap: float
    ) -> tuple[float, list[Planes]]:
        """The bound of a box from what is known of the box that it is part of, and more tangents."""
        if not len(box.corners):
            return np.inf, list(bundle)
        barred = impossible(self.laws, box)
        own, theta, scale = list(bundle), box.middle, self.scale
        best = -np.inf
        for turn in range(_TOUCHES):
            for factor in _SCALES if turn < 2 else _SCALES[:1]:
                own.append(self._touch(theta, scale * factor))
            found = best_bound(own, box, barred)
            best = max(best, found.bound_kg)
            if not np.isfinite(best):
                return np.inf, own
            scale = float(found.weights @ np.array([planes.scale for planes in own]))
            theta = np.clip(found.theta, box.low, box.high)
            if turn == 0 and self.solved < _INCUMBENTS + 1:
                self.solve(theta)
            if self.best_kg / best - 1 <= target_gap:
                break
            keep = np.argsort(-found.weights)[:_BUNDLE]
            own = [own[n] for n in sorted(keep)]
        self.scale = scale
        return best, own

    def _touch(self, theta: Array, scale: float) -> Planes:
        assert self.cell is not None  # there is one as soon as a design is solved
        prices = prices_of(self.shapes[-1] * scale)
        entries = Touch(self.laws, self.cell, theta, prices).entries()
        return planes_of(self.laws, self.cell, entries, prices, scale)


def _halves(box: Box) -> list[Box]:
    """Two halves across the size that varies most."""
    n = int(np.argmax(np.log(box.high / box.low)))
    middle = (box.low[n] + box.high[n]) / 2
    below, above = box.high.copy(), box.low.copy()
    below[n] = above[n] = middle
    return [Box(box.low, below, box.rows), Box(above, box.high, box.rows)]
