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
from hevopt.car.architecture import Architecture
from hevopt.car_files.load import load_architecture
from hevopt.display.facts import Shown
from hevopt.driving.cycle import Cycle
from hevopt.errors import DataError, HevoptError
from hevopt.powertrain.powertrain import build_problem
from hevopt.problem.arrays import Array
from hevopt.sizing.proof.bundle import Planes, best_bound, planes_of
from hevopt.sizing.proof.entries import Box, OneBattery, Touch, cell_of, impossible, prices_of
from hevopt.sizing.proof.laws import Laws, check_car, corners_of, laws_of
from hevopt.sizing.proof.modes import NotProvable
from hevopt.studies.case import Case, dp_case
from hevopt.units import litres_per_100km

# Key path -> which size it is a factor of, and whether it is a whole number.
SIZES: dict[str, tuple[int, bool]] = {
    "engine.scale.displacement": (0, False), "engine.scale.torque": (0, False), "engine.scale.power": (0, False),
    "machine.scale.power": (1, False), "machine.scale.torque": (1, False),
    "battery.cells_in_series": (2, True), "battery.parallel": (2, True), "battery.scale.capacity": (2, False),
}  # fmt: skip
TARGET_GAP = 3e-3
_BOXES_MAX, _TOUCHES, _BUNDLE = 60, 7, 14
_SCALES = (1.0, 0.97, 1.03)
_INCUMBENTS = 3


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class RangeProof(Shown):
    """What no car of some ranges is below, and the best car found inside.

    ranges: key path -> lowest and highest value; bound_l_per_100km: proven; best: the best design solved and
    what it burns, charge no less than asked; boxes: how many were looked at; closed: whether the gap is the
    target
    """

    ranges: Mapping[str, tuple[float, float]]
    cycle: str
    bound_l_per_100km: float
    best: Mapping[str, float]
    best_l_per_100km: float
    boxes: int
    closed: bool
    seconds: float

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


class Space:
    """The cars of some ranges, by factors of the sizes of a car as its file has it."""

    def __init__(
        self,
        architecture: str,
        ranges: Mapping[str, tuple[float, float]],
        fixed: Mapping[str, Any],
    ) -> None:
        self.architecture, self.ranges, self.fixed = architecture, dict(ranges), dict(fixed)
        self.base = load_architecture(architecture, fixed)
        check_car(self.base)
        self.low, self.high, self._one = np.ones(3), np.ones(3), np.ones(3)
        seen: dict[int, str] = {}
        for key, (low, high) in self.ranges.items():
            if key not in SIZES:
                raise NotProvable(
                    f"{key}: no proof over its range; there is one for {', '.join(SIZES)}"
                )
            size, _ = SIZES[key]
            if size in seen:
                raise NotProvable(f"{key} and {seen[size]} are one size; give one of them")
            if not 0 < low <= high:
                raise NotProvable(f"{key}: {low:g} to {high:g} is no range")
            seen[size] = key
            part, _, inner = key.partition(".")
            self._one[size] = _own(self.base.contents[part], inner)
            self.low[size], self.high[size] = low / self._one[size], high / self._one[size]

    def values(self, theta: Array, *, whole: bool) -> dict[str, float]:
        """Values of the parameters at some factors; whole: cells rounded, as a car has them."""
        found: dict[str, float] = {}
        for key in self.ranges:
            size, is_whole = SIZES[key]
            value = float(theta[size] * self._one[size])
            found[key] = round(value) if is_whole and whole else value
        return found

    def car(self, theta: Array) -> Architecture:
        """The car of some factors, whole cells."""
        return load_architecture(
            self.architecture, {**self.fixed, **self.values(theta, whole=True)}
        )

    def corners(self) -> dict[tuple[int, ...], Architecture]:
        """Corner, 0 or 1 by size, -> its car."""
        return {
            corner: self.car(np.where(np.array(corner) == 1, self.high, self.low))
            for corner in corners_of(3)
        }


def _own(contents: Mapping[str, object], key: str) -> float:
    """A factor or count that a component's file has itself."""
    if not key.startswith("scale."):
        return float(contents.get(key, 1))  # type: ignore[arg-type]
    scale = contents.get("scale")
    own = next(iter(scale.values()), 1.0) if isinstance(scale, Mapping) else 1.0
    return float(own)


def prove(
    architecture: str,
    ranges: Mapping[str, tuple[float, float]],
    cycle: Cycle,
    *,
    fixed: Mapping[str, Any] | None = None,
    target_gap: float = TARGET_GAP,
    boxes_max: int = _BOXES_MAX,
    progress: Callable[[int, float], None] = lambda boxes, gap: None,
) -> RangeProof:
    """The least that a car of some ranges can burn on a cycle, and the best one found.

    ranges: key path of SIZES -> lowest and highest value; fixed: other keys of the car
    progress: called with the boxes done and the gap that is left
    NotProvable, with the reason, where the car's or the cycle's laws are none of those that the proof knows.
    """
    began = perf_counter()
    space = Space(architecture, ranges, fixed or {})
    proof = _Proof(space, cycle)
    queue: list[tuple[float, int, Box, list[Planes]]] = []
    order = count()
    root = Box(space.low, space.high)
    bound, bundle = proof.bound(root, [], target_gap)
    heapq.heappush(queue, (bound, next(order), root, bundle))
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
    engine, distance = space.base.engine, cycle.distance_m
    litres = [
        litres_per_100km(kg, engine.fuel_density_kgpm3, distance) for kg in (bound, proof.best_kg)
    ]
    return RangeProof(
        space.ranges, cycle.name, litres[0], space.values(proof.best_theta, whole=True), litres[1],
        done, proof.best_kg / bound - 1 <= target_gap, perf_counter() - began,
    )  # fmt: skip


class _Proof:
    """Bounds of boxes, with the prices and the best car found on the way."""

    def __init__(self, space: Space, cycle: Cycle) -> None:
        self.space, self.cycle = space, cycle
        self.laws: Laws = laws_of(space.corners(), space.base, cycle, space.low, space.high)
        self.best_kg, self.best_theta = np.inf, (space.low + space.high) / 2
        self.shapes: list[Array] = []
        self.scale, self.solved = 0.0, 0
        self.cell: OneBattery | None = None
        if not self.solve(self.best_theta):
            raise NotProvable(
                f"{space.base.name}: the car in the middle of the ranges does not follow the cycle; narrow them"
            )

    def solve(self, theta: Array) -> bool:
        """Solve a design: the best so far, and the shape of prices along its plan. Whether it follows the cycle."""
        self.solved += 1
        try:
            car = self.space.car(theta)
            problem = build_problem(car, self.cycle)
            case: Case = dp_case(car, self.cycle, problem)
        except DataError:
            raise
        except HevoptError:
            return False
        plan = case.dp_trajectory
        if plan.cost_kg < self.best_kg:
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
    return [Box(box.low, below), Box(above, box.high)]
