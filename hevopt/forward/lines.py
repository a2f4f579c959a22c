"""A driveline as the plant reads it: rates, yields and loads of every way to drive, from the same parts and joints.

The ways are those in which the driver's clutch slips, so that the engine's side turns by itself: the wheels and
that side are free, every joint but the clutch gives a speed row, and the torques on the units reach wheels and side
by the balance of the other shafts. A closed clutch is then a torque, an open one none. A car without an engine has
that side as well, with nothing on it: it rests. Where the engine has a speed of its own there is one way: a lock-up
clutch slips.
"""

from dataclasses import dataclass, replace
from itertools import permutations, product
from typing import NamedTuple

import numpy as np

from hevopt.car.architecture import Architecture
from hevopt.car.balance import speeds_of
from hevopt.car.driveline import ENGINE, Driveline, Phase, State
from hevopt.car.linear import Row, Terms, solved
from hevopt.car.parts import WHEEL, Clutch, Joint
from hevopt.car.ways import Way, way
from hevopt.display.facts import Shown
from hevopt.errors import DataError
from hevopt.forward._rows_kernels import NO_FLUID, NO_LOSS, Fluid, Lost, Ways
from hevopt.forward.drivable import check_drivable, limited_gears, mapped_boxes

_NET = "net torque on "
_OUTPUT = "clutch's output"
_NO_ENGINE = "engine's side of a car that has none"
_ONLY_GEAR = 1
# Below it two machines cannot give torques at wheels and engine's side apart from each other.
_DEPENDENT = 1e-6
Key = tuple[int, tuple[tuple[str, int], ...], frozenset[str]]


class Free(NamedTuple):
    """Of an engine that has a speed of its own: numbers of the machine that keeps it and of the one that drives."""

    governor: int
    driving: int


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Line(Shown):
    """A driveline's ways as arrays, and which is which.

    keys: of each way the gear listed, the gears chosen beside it, and what its own speed has opened
    losses: of each lossy joint, what its loss is called
    fast_way: (way,) the way with couplings opened that turn too fast; fast_radps: (way,) speed of the wheels for it
    free: of an engine that has a speed of its own, else None
    order: numbers of the machines in the order of the units: the one first that has what the others leave
    """

    ways: Ways
    keys: tuple[Key, ...]
    losses: tuple[str, ...]
    fast_way: np.ndarray
    fast_radps: np.ndarray
    free: Free | None = None
    order: tuple[int, ...] = (0,)

    def index(self, gear: int, gears: tuple[tuple[str, int], ...]) -> int:
        """The way of a listed gear and the gears chosen beside it; of the nearest gear where these exclude it."""
        fits = [
            n for n, (_, chosen, open_) in enumerate(self.keys) if chosen == gears and not open_
        ]
        return min(fits, key=lambda n: (abs(self.keys[n][0] - gear), self.keys[n][0]))

    @property
    def mapped(self) -> bool:
        """Whether its gearbox's losses are in a map."""
        return self.ways.lost.loss_nm.size > 0

    @property
    def gears(self) -> np.ndarray:
        """(way,) the listed gear."""
        return np.array([gear for gear, _, _ in self.keys])


def line_of(car: Architecture) -> Line:
    """The ways of a car; DataError where its driveline asks for more than a driver decides."""
    check_drivable(car)
    line = car.driveline
    keys = [key for key in _keys(line)]
    joints = {key: _way(line, key).joints(key[0]) for key in keys}
    lossy = _lossy(joints[key] for key in keys)
    order = _order(car, keys)
    machines = [line.machines[n][0] for n in order]
    inertia = [car.engine.inertia_kgm2, *(car.machines[n].inertia_kgm2 for n in order), 0.0]
    units, count, variants = len(inertia), len(keys), 1 << len(lossy)
    ways = Ways(
        np.zeros((count, units)), np.zeros((count, units)),
        np.ones((count, variants, units)), np.ones((count, variants, units)),
        np.zeros((count, variants, len(lossy), units)), np.zeros((count, len(lossy), 2)),
        np.ones((count, len(lossy))), np.array(inertia), _lost(line, lossy, keys), _fluid(car, keys),
    )  # fmt: skip
    for n, key in enumerate(keys):
        _fill(ways, n, _way(line, key), joints[key], tuple(lossy), (ENGINE, *machines), key[0])
    fast_way, fast = np.arange(count), np.full(count, np.inf)
    for n, (gear, gears, opened) in enumerate(keys):
        for part in limited_gears(line):
            if not opened:
                fast_way[n] = keys.index((gear, gears, frozenset([part.name])))
                per_wheel = speeds_of(_way(line, keys[n]))[part.first][WHEEL]
                fast[n] = part.speed_max_radps / abs(float(np.max(np.abs(per_wheel))))
    free = _free(car, ways) if line.free_engine_speed else None
    return Line(ways, tuple(keys), tuple(lossy.values()), fast_way, fast, free, order)


def _order(car: Architecture, keys: list[Key]) -> tuple[int, ...]:
    """Numbers of the machines, first the one that gives what is left of what the driver asks for.

    It is the one that changes gear, else of those that turn with the wheels the most powerful one; a car whose
    engine has a speed of its own has none such.
    """
    line, count = car.driveline, len(car.machines)
    if count == 1 or line.free_engine_speed:
        return tuple(range(count))
    rates = np.zeros((count, len(keys)))
    for k, key in enumerate(keys):
        speeds = speeds_of(_way(line, key))
        for n, (_, shaft) in enumerate(line.machines):
            rates[n, k] = _rate(speeds.get(shaft, {}), WHEEL, key[0])
    moved = (np.ptp(rates, axis=1) > 0).tolist()
    if sum(moved) > 1:
        names = ", ".join(
            name for (name, _), moves in zip(line.machines, moved, strict=True) if moves
        )
        raise DataError(
            f"{car.name}: cannot be driven forward, as {names} all change gear and one machine can; `hevopt run` "
            "solves it backward"
        )
    turns = np.any(rates, axis=1).tolist()
    first = max(range(count), key=lambda n: (moved[n], turns[n], car.machines[n].power_max_w, -n))
    return (first, *(n for n in range(count) if n != first))


def _rate(terms: Terms, base: str, gear: int) -> float:
    """Speed of a shaft per speed of wheels or engine's side, in a gear."""
    coefficient = terms.get(base, 0.0)
    return float(coefficient[gear] if isinstance(coefficient, np.ndarray) else coefficient)


def _free(car: Architecture, ways: Ways) -> Free:
    """Which machine keeps the engine's speed and which drives: by their shares at engine's side and wheels."""
    at_wheels = ways.wheel[0] * ways.wheel_yield[0, 0]
    at_side = ways.side[0] * ways.side_yield[0, 0]
    pairs = permutations(range(1, len(car.machines) + 1), 2)
    apart = {
        pair: at_side[pair[0]] * at_wheels[pair[1]] - at_wheels[pair[0]] * at_side[pair[1]]
        for pair in pairs
    }
    both = max(
        apart, key=lambda pair: (round(abs(apart[pair]), 9), abs(at_side[pair[0]]), -pair[0])
    )
    if abs(apart[both]) < _DEPENDENT:
        raise DataError(
            f"{car.name}: cannot be driven forward, as no two machines keep the engine's speed and drive each by "
            "itself; `hevopt run` solves it backward"
        )
    return Free(both[0] - 1, both[1] - 1)


def _keys(line: Driveline) -> list[Key]:
    """Every listed gear with every choice beside it that goes with it, couplings closed, then open."""
    chosen = [box for box in line.boxes if box.choice == "preselected"]
    listed = sorted(gear for box in line.boxes for gear in box.gears) or [_ONLY_GEAR]
    opened = [frozenset[str](), *(frozenset([part.name]) for part in limited_gears(line))]
    keys: list[Key] = []
    for open_, gear in product(opened, listed):
        for gears in product(*([(box.name, g) for g in box.gears] for box in chosen)):
            if all(gear not in box.gears or (box.name, gear) in gears for box in chosen):
                keys.append((gear, gears, open_))
    return keys


def _way(line: Driveline, key: Key) -> Way:
    gear, gears, opened = key
    if line.free_engine_speed:
        # The strategy's clutch slips as a driver's does, for what it passes is found by the step.
        parts = tuple(
            replace(p, operation="driver") if isinstance(p, Clutch) else p for p in line.parts
        )
        return way(replace(line, parts=parts), State(True), Phase(False, "slipping"))
    if line.converter is not None:
        # What a torque converter passes is found by the step; its lock-up clutch is one like a driver's.
        part = line.converter
        slips = Clutch(part.name, part.first, part.second, "driver")
        line = replace(line, parts=tuple(slips if p is part else p for p in line.parts))
    if line.engine is None:
        return way(line, State(False, gears), Phase(False, "open", None, opened))
    box = next(box.name for box in line.boxes if gear in box.gears)
    return way(line, State(True, gears), Phase(False, "slipping", box, opened))


def _lossy(joints: object) -> dict[str, str]:
    """Joint with loss -> what the loss is called, of all ways."""
    found: dict[str, str] = {}
    for of_way in joints:  # type: ignore[attr-defined]
        found |= {j.name: j.loss for j in of_way if not j.lossless or j.lost is not None}
    return found


def _fluid(car: Architecture, keys: list[Key]) -> Fluid:
    """A car's torque converter."""
    part = car.driveline.converter
    if part is None:
        return NO_FLUID
    data = part.data
    locks = np.array([gear >= data.lock_up_gear for gear, _, _ in keys])
    least = float(data.least_lock_radps(car.engine.idle_radps))
    return Fluid(data.pieces, locks, least, bool(data.in_gear_at_rest))


def _lost(line: Driveline, lossy: dict[str, str], keys: list[Key]) -> Lost:
    """The map of a gearbox that has one, every gear's as wide as the widest, going on as its own ends."""
    boxes = mapped_boxes(line)
    if not boxes:
        return NO_LOSS
    loss = boxes[0].loss
    assert loss is not None  # as of _mapped
    speeds, torques = (
        max(len(axis) for axis in axes)
        for axes in zip(*((g.speed_radps, g.torque_nm) for g in loss.gears), strict=True)
    )
    shape = len(loss.gears), speeds, torques
    found = Lost(list(lossy).index(boxes[0].name), np.array([gear - 1 for gear, _, _ in keys], dtype=np.int64),
                 np.zeros(shape[:2]), np.zeros((shape[0], shape[2])), np.zeros(shape))  # fmt: skip
    for n, gear in enumerate(loss.gears):
        over = speeds - len(gear.speed_radps), torques - len(gear.torque_nm)
        found.speed_radps[n] = np.append(
            gear.speed_radps, gear.speed_radps[-1] + np.arange(1, over[0] + 1)
        )
        found.torque_nm[n] = np.append(
            gear.torque_nm, gear.torque_nm[-1] + np.arange(1, over[1] + 1)
        )
        found.loss_nm[n] = np.pad(gear.filled(), ((0, over[0]), (0, over[1])), "edge")
    return found


def _fill(
    ways: Ways, n: int, found: Way, joints: tuple[Joint, ...], lossy: tuple[str, ...],
    units: tuple[str, ...], gear: int,
) -> None:  # fmt: skip
    """One way's entries."""
    clutch = next((joint for joint in joints if not joint.speed), None)
    side, at = next(iter(found.held), _NO_ENGINE), dict(found.active)
    if clutch is not None:
        at[_OUTPUT] = next(shaft for shaft, (c0, _) in clutch.reaction.items() if float(c0) > 0)
    rates = speeds_of(found)

    def rate(shaft: str, base: str) -> float:
        return _rate(rates[shaft], base, gear)

    for u, name in enumerate((*units, _OUTPUT)):
        if name in at:
            ways.wheel[n, u], ways.side[n, u] = rate(at[name], WHEEL), rate(at[name], side)
        elif name == ENGINE:
            ways.side[n, u] = 1.0
    for j, name in enumerate(lossy):
        joint = next((joint for joint in joints if joint.name == name), None)
        if joint is not None:
            ways.efficiency[n, j] = float(joint.efficiency)
            for b, base in enumerate((WHEEL, side)):
                terms = (float(c) * rate(shaft, base) for shaft, c in joint.sense.items())
                ways.sense[n, j, b] = sum(terms)
    for variant in range(1 << len(lossy)):
        sums = _sums(found, joints, clutch, side, at, lossy, variant)
        for u, name in enumerate((*units, _OUTPUT)):
            for base, of_unit, yields in (
                (WHEEL, ways.wheel, ways.wheel_yield),
                (side, ways.side, ways.side_yield),
            ):
                if of_unit[n, u] != 0.0 and _NET + base in sums:
                    passed = float(sums[_NET + base].get(name, 0.0))
                    yields[n, variant, u] = passed / of_unit[n, u]
            for j, joint_name in enumerate(lossy):
                ways.load[n, variant, j, u] = float(sums.get(joint_name, {}).get(name, 0.0))


def _sums(
    found: Way, joints: tuple[Joint, ...], clutch: Joint | None, side: str, at: dict[str, str],
    lossy: tuple[str, ...], variant: int,
) -> dict[str, Terms]:  # fmt: skip
    """Torque in each joint, and left on wheels and engine's side, in terms of the torques on the units."""
    rows = []
    for shaft in found.shafts:
        left: Terms = {_NET + shaft: -1.0} if shaft in (WHEEL, side) else {}
        for joint in joints:
            if joint is not clutch and shaft in joint.reaction:
                c0, c1 = (float(c) for c in joint.reaction[shaft])
                backward = joint.name in lossy and variant >> lossy.index(joint.name) & 1
                passed = 1 / float(joint.efficiency) if backward else float(joint.efficiency)
                left[joint.name] = c0 + c1 * passed
        right: Terms = {name: -1.0 for name, where in at.items() if where == shaft}
        rows.append(Row(shaft, left, right))
    return solved(rows)
