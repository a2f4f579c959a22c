"""Ways to drive: what a state and a phase leave of a driveline, which speeds are held, which torques are chosen.

Choosing or holding adds a row: a held or chosen speed to the system of speeds, a chosen torque to that of torques.
Both must come out square and regular; that is the whole count of freedom, and what is left over or lacks names the
parts that are wrong. Shafts that no torque reaches from the wheels or a turning engine rest.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from hevopt.car.driveline import BRAKE, ENGINE, Driveline, Phase, State, Use
from hevopt.car.linear import Coefficient
from hevopt.car.parts import (
    WHEEL,
    Clutch,
    Gearbox,
    Joint,
    OneWayClutch,
    Part,
)
from hevopt.errors import DataError

Array = NDArray[np.float64]
# How the speed of a shaft comes about that neither joints nor wheels determine.
Held = Literal["rest", "idle", "launch", "free"]
CHOICES_MAX = 2
_TINY = 1e-9


@dataclass(frozen=True, slots=True, eq=False)
class Way:
    """One configuration.

    uses: the parts that carry torque; shafts: those that turn with wheels or engine; held: shaft -> how
    active: actuators with a torque, and the shaft of each; chosen: those whose torque is chosen
    closing: those that are solved for, chosen -> those of its part
    slack: what gives way to the friction brake while the car brakes; None where nothing but the brake acts on
    the wheels, or where it holds them (standing)
    freed: the one-way clutches that do not push; tied: whether the engine turns with the wheels
    """

    uses: tuple[Use, ...]
    shafts: tuple[str, ...]
    held: Mapping[str, Held]
    active: Mapping[str, str]
    chosen: tuple[str, ...]
    closing: Mapping[str, tuple[str, ...]]
    slack: str | None
    freed: tuple[OneWayClutch, ...]
    tied: bool

    def joints(self, gear: NDArray[np.int64] | int) -> tuple[Joint, ...]:
        """The joints, with the gear that the cycle lists: one, or one per step."""
        return tuple(_joint(use, gear) for use in self.uses)


@lru_cache(maxsize=4096)
def way(driveline: Driveline, state: State, phase: Phase) -> Way:
    """The way of a state in a phase; DataError, naming parts, where speeds or torques are not determined."""
    uses = _without_dead_ends(driveline, driveline.uses(state, phase))
    turning = _turning(driveline, uses, state)
    uses = tuple(use for use in uses if set(use.part.shafts) <= turning)
    shafts = tuple(shaft for shaft in driveline.shafts if shaft in turning)
    joints = tuple(_joint(use, _any_gear(use)) for use in uses)
    held, tied = _held(driveline, state, shafts, joints)
    active = {name: shaft for name, shaft in driveline.machines if shaft in turning}
    if phase.standing:
        still = _still(shafts, joints, held)
        active = {name: shaft for name, shaft in active.items() if shaft not in still}
    if state.engine_on and driveline.engine is not None:
        active[ENGINE] = driveline.engine
    if phase.standing and not set(active.values()) & _joined(uses, WHEEL):
        # Nothing acts on what hangs on the wheels: it rests.
        rest = _joined(uses, WHEEL) - {WHEEL}
        uses = tuple(use for use in uses if not rest & set(use.part.shafts))
        shafts = tuple(shaft for shaft in shafts if shaft not in rest)
        joints = tuple(_joint(use, _any_gear(use)) for use in uses)
        held = {shaft: how for shaft, how in held.items() if shaft not in rest}
    free, follows = "free" in held.values(), driveline.follows_load
    balance = _Balance(driveline, shafts, joints, active, standing=phase.standing)
    chosen, slack = balance.choices(free, follows=follows)
    while phase.standing and len(chosen) + free > CHOICES_MAX:
        # At standstill machines may push against each other and the brakes: the last of them does not.
        del active[[name for name in active if name != ENGINE][-1]]
        balance = _Balance(driveline, shafts, joints, active, standing=phase.standing)
        chosen, slack = balance.choices(free, follows=follows)
    if len(chosen) + free > CHOICES_MAX:
        raise DataError(
            f"driveline: with {_words(state)}, {len(chosen) + 1} quantities are free (speed of the engine; torques "
            f"of {', '.join(chosen)}); allowed: {CHOICES_MAX}; join shafts by gears or clutches, or leave a "
            "machine out"
        )
    closing = {name: balance.solved_with(name, chosen) for name in chosen}
    freed = tuple(
        part
        for part in driveline.parts
        if isinstance(part, OneWayClutch) and part.name not in state.closed
    )
    return Way(uses, shafts, held, active, chosen, closing, slack, freed, tied)


def _joint(use: Use, listed: NDArray[np.int64] | int) -> Joint:
    part = use.part
    if isinstance(part, Gearbox):
        return part.joint(listed if use.gear is None else use.gear)
    if isinstance(part, Clutch):
        return part.slipping() if use.state == "slipping" else part.closed()
    return part.locked() if isinstance(part, OneWayClutch) else part.joint()


def _any_gear(use: Use) -> int:
    return use.part.gears[0] if isinstance(use.part, Gearbox) else 0


def _words(state: State) -> str:
    words = ["the engine on" if state.engine_on else "the engine off"]
    words += [f"{box} in gear {gear}" for box, gear in state.gears]
    return ", ".join([*words, *(f"{name} closed" for name in sorted(state.closed))])


def _without_dead_ends(driveline: Driveline, uses: tuple[Use, ...]) -> tuple[Use, ...]:
    """Without parts that end at a shaft on which nothing acts."""
    kept = {WHEEL, *(shaft for _, shaft in driveline.machines), driveline.engine}
    while True:
        ends = [shaft for use in uses for shaft in use.part.shafts if shaft not in kept]
        dead = {shaft for shaft in ends if ends.count(shaft) == 1}
        rest = tuple(
            use for use in uses if len(use.part.shafts) != 2 or not dead & set(use.part.shafts)
        )
        if len(rest) == len(uses):
            return uses
        uses = rest


def _turning(driveline: Driveline, uses: Iterable[Use], state: State) -> set[str]:
    """The shafts that torque reaches from the wheels or from a turning engine."""
    turning = _joined(uses, WHEEL)
    if state.engine_on and driveline.engine is not None:
        turning |= _joined(uses, driveline.engine)
    return turning


def joined(parts: Iterable[Part], shaft: str) -> set[str]:
    """A shaft and all that parts join it to."""
    found, groups, grown = {shaft}, [set(part.shafts) for part in parts], True
    while grown:
        reached = [group for group in groups if group & found and not group <= found]
        grown = bool(reached)
        found |= {other for group in reached for other in group}
    return found


def _joined(uses: Iterable[Use], shaft: str) -> set[str]:
    return joined((use.part for use in uses), shaft)


def _held(
    driveline: Driveline, state: State, shafts: Sequence[str], joints: Sequence[Joint]
) -> tuple[dict[str, Held], bool]:
    """The shafts whose speed is held or chosen and how, and whether joints tie the engine to the wheels."""
    rows = [_row(joint.speed, shafts) for joint in joints if joint.speed]
    names = [joint.name for joint in joints if joint.speed] + ["the wheels"]
    matrix = np.array([*rows, _row({WHEEL: 1.0}, shafts)])
    if np.linalg.matrix_rank(matrix) < len(matrix):
        raise DataError(
            f"driveline: with {_words(state)}, speeds are locked by {_dependent(matrix, names)}"
        )
    held: dict[str, Held] = {}
    tied, engine = True, driveline.engine
    if engine in shafts and engine in _loose(matrix, shafts):
        tied = False
        held[engine] = "rest"
        if state.engine_on:
            slips = any(not joint.speed for joint in joints)
            held[engine] = "launch" if slips else "free" if driveline.free_engine_speed else "idle"
        matrix = np.vstack([matrix, _row({engine: 1.0}, shafts)])
    if loose := _loose(matrix, shafts):
        raise DataError(
            f"driveline: with {_words(state)}, nothing determines the speed of {', '.join(loose)}; join it to "
            "another shaft, or hold it by a brake or clutch"
        )
    return held, tied


def _still(shafts: Sequence[str], joints: Sequence[Joint], held: Mapping[str, Held]) -> set[str]:
    """The shafts that do not turn while the wheels stand, whatever is held or chosen."""
    rows = [_row(joint.speed, shafts) for joint in joints if joint.speed]
    rows += [_row({WHEEL: 1.0}, shafts)]
    rows += [_row({shaft: 1.0}, shafts) for shaft, how in held.items() if how == "rest"]
    return set(shafts) - set(_loose(np.array(rows), shafts))


class _Balance:
    """The torques of a way in numbers: which may be chosen, and what closes the balance."""

    def __init__(
        self,
        driveline: Driveline,
        shafts: Sequence[str],
        joints: Sequence[Joint],
        active: Mapping[str, str],
        *,
        standing: bool,
    ) -> None:
        self.joints, self.shafts = joints, shafts
        self.names = [*(joint.name for joint in joints), *active, BRAKE]
        columns = [
            _row({s: c0 + c1 for s, (c0, c1) in joint.reaction.items()}, shafts) for joint in joints
        ]
        columns += [_row({shaft: 1.0}, shafts) for shaft in (*active.values(), WHEEL)]
        self.matrix = np.array(columns).T
        self.machines = [name for name in active if name != ENGINE]
        self.engine = [ENGINE] if ENGINE in active else []
        reached = self._reached({WHEEL}, shafts)
        self.wheels_moved = any(shaft in reached for shaft in active.values()) and not standing

    def choices(self, free_speed: bool, *, follows: bool) -> tuple[tuple[str, ...], str | None]:
        """The torques chosen, and the slack."""
        order = [*self.engine, *self.machines] if free_speed else [*self.machines, *self.engine]
        given = [BRAKE] if self.wheels_moved else []
        chosen = list(self.machines) if follows else []
        for name in order:
            if self._rank([*given, *chosen]) == len(self.names):
                break
            if self._rank([*given, *chosen, name]) > self._rank([*given, *chosen]):
                chosen.append(name)
        rows = self._rows([*given, *chosen])
        if np.linalg.matrix_rank(rows) < len(self.names):
            parts = ", ".join(self._undetermined(rows))
            raise DataError(
                f"driveline: the torques of {parts} are not determined: a redundant loop; leave one of its parts "
                "out, or open it by a clutch"
            )
        if len(rows) > len(self.names):
            parts = _dependent(rows, [*self.shafts, *given, *chosen])
            raise DataError(
                f"driveline: nothing balances the torques on {parts}; give one of them an engine, a machine or "
                "a brake"
            )
        slack = None
        if self.wheels_moved:
            closers = [name for name in (*self.engine, *self.machines[::-1]) if name not in chosen]
            fits = (n for n in closers if self._rank([*chosen, n]) == len(self.names))
            slack = next(fits, None)
        return tuple(chosen), slack

    def solved_with(self, name: str, chosen: Sequence[str]) -> tuple[str, ...]:
        """The actuators that close the balance of the shafts on which a chosen torque acts."""
        given = [BRAKE, *chosen] if self.wheels_moved else list(chosen)
        inverse = np.linalg.pinv(self._rows(given))
        effect = inverse[:, self.matrix.shape[0] + given.index(name)]
        closers = [*self.engine, *self.machines]
        return tuple(
            n for n in closers if n not in chosen and abs(effect[self.names.index(n)]) > _TINY
        )

    def _rows(self, given: Sequence[str]) -> Array:
        units = [np.eye(len(self.names))[self.names.index(name)] for name in given]
        return np.vstack([self.matrix, *units]) if units else self.matrix

    def _rank(self, given: Sequence[str]) -> int:
        return int(np.linalg.matrix_rank(self._rows(given)))

    def _undetermined(self, rows: Array) -> list[str]:
        null = np.linalg.svd(rows)[2][np.linalg.matrix_rank(rows) :]
        return [n for n, x in zip(self.names, np.abs(null).max(0), strict=True) if x > _TINY]

    def _reached(self, start: set[str], shafts: Sequence[str]) -> set[str]:
        for _ in shafts:
            for joint in self.joints:
                if start & set(joint.reaction):
                    start = start | set(joint.reaction)
        return start


def _row(coefficients: Mapping[str, Coefficient], shafts: Sequence[str]) -> Array:
    return np.array([float(coefficients.get(shaft, 0.0)) for shaft in shafts])


def _loose(matrix: Array, shafts: Sequence[str]) -> list[str]:
    """The shafts whose speed rows do not determine."""
    rank = np.linalg.matrix_rank(matrix)
    if rank == len(shafts):
        return []
    spread = np.abs(np.linalg.svd(matrix)[2][rank:]).max(0)
    return [shaft for shaft, x in zip(shafts, spread, strict=True) if x > _TINY]


def _dependent(matrix: Array, names: Sequence[str]) -> str:
    """The rows that depend on each other."""
    null = np.linalg.svd(matrix.T)[2][np.linalg.matrix_rank(matrix) :]
    found = [n for n, x in zip(names, np.abs(null).max(0), strict=True) if x > _TINY]
    return ", ".join(found)
