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

from hevopt.car.driveline import ENGINE, Driveline, Phase, State, Use
from hevopt.car.freedom import Freedom, dependent, loose, row
from hevopt.car.parts import (
    WHEEL,
    Clutch,
    Gearbox,
    Joint,
    OneWayClutch,
    Part,
    TorqueConverter,
)
from hevopt.errors import DataError

# How the speed of a shaft comes about that neither joints nor wheels determine.
Held = Literal["rest", "idle", "launch", "impeller", "free"]
CHOICES_MAX = 2


@dataclass(frozen=True, slots=True, eq=False)
class Way:
    """One configuration.

    uses: the parts that carry torque; shafts: those that turn with wheels or engine; held: shaft -> how
    active: actuators with a torque, and the shaft of each; chosen: those whose torque is chosen
    closing: those that are solved for, chosen -> those of its part
    slack: what gives way to the friction brake while the car brakes; None where nothing but the brake acts on
    the wheels, or where it holds them (standing)
    freed: the one-way clutches that do not push; tied: whether the engine turns with the wheels
    converter: the torque converter that slips; at standstill its other shaft rests
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
    converter: TorqueConverter | None = None

    def joints(self, gear: NDArray[np.int64] | int) -> tuple[Joint, ...]:
        """The joints, with the gear that the cycle lists: one, or one per step."""
        return _joints(self.uses, gear)


@lru_cache(maxsize=4096)
def way(driveline: Driveline, state: State, phase: Phase) -> Way:
    """The way of a state in a phase; DataError, naming parts, where speeds or torques are not determined."""
    uses = _without_dead_ends(driveline, driveline.uses(state, phase))
    turning = _turning(driveline, uses, state)
    uses = tuple(use for use in uses if set(use.part.shafts) <= turning)
    shafts = tuple(shaft for shaft in driveline.shafts if shaft in turning)
    joints = _joints(uses)
    apart = any(map(_slips, uses))
    held, tied = _held(driveline, state, shafts, joints, "impeller" if apart else None)
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
        joints = _joints(uses)
        held = {shaft: how for shaft, how in held.items() if shaft not in rest}
    free, follows = "free" in held.values(), driveline.follows_load
    balance = Freedom(shafts, joints, active, standing=phase.standing)
    chosen, slack = balance.choices(free, follows=follows)
    while phase.standing and len(chosen) + free > CHOICES_MAX:
        # At standstill machines may push against each other and the brakes: the last of them does not.
        del active[[name for name in active if name != ENGINE][-1]]
        balance = Freedom(shafts, joints, active, standing=phase.standing)
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
    converter = driveline.slipping(state, phase)
    return Way(uses, shafts, held, active, chosen, closing, slack, freed, tied, converter)


def _joints(
    uses: Iterable[Use], listed: NDArray[np.int64] | int | None = None
) -> tuple[Joint, ...]:
    """What uses tie, in the gear listed or in any; a torque converter that slips ties nothing."""
    return tuple(
        _joint(use, _any_gear(use) if listed is None else listed) for use in uses if not _slips(use)
    )


def _slips(use: Use) -> bool:
    return isinstance(use.part, TorqueConverter) and use.state == "slipping"


def _joint(use: Use, listed: NDArray[np.int64] | int) -> Joint:
    part = use.part
    if isinstance(part, Gearbox):
        return part.joint(listed if use.gear is None else use.gear)
    if isinstance(part, Clutch):
        return part.slipping() if use.state == "slipping" else part.closed()
    if isinstance(part, TorqueConverter):
        return part.closed()
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
    driveline: Driveline,
    state: State,
    shafts: Sequence[str],
    joints: Sequence[Joint],
    by_converter: Held | None,
) -> tuple[dict[str, Held], bool]:
    """The shafts whose speed is held or chosen and how, and whether joints tie the engine to the wheels."""
    rows = [row(joint.speed, shafts) for joint in joints if joint.speed]
    names = [joint.name for joint in joints if joint.speed] + ["the wheels"]
    matrix = np.array([*rows, row({WHEEL: 1.0}, shafts)])
    if np.linalg.matrix_rank(matrix) < len(matrix):
        raise DataError(
            f"driveline: with {_words(state)}, speeds are locked by {dependent(matrix, names)}"
        )
    held: dict[str, Held] = {}
    tied, engine = True, driveline.engine
    if engine in shafts and engine in loose(matrix, shafts):
        tied = False
        held[engine] = "rest"
        if state.engine_on:
            slips = any(not joint.speed for joint in joints)
            own: Held = "free" if driveline.free_engine_speed else "idle"
            held[engine] = by_converter or ("launch" if slips else own)
        matrix = np.vstack([matrix, row({engine: 1.0}, shafts)])
    if unheld := loose(matrix, shafts):
        raise DataError(
            f"driveline: with {_words(state)}, nothing determines the speed of {', '.join(unheld)}; join it to "
            "another shaft, or hold it by a brake or clutch"
        )
    return held, tied


def _still(shafts: Sequence[str], joints: Sequence[Joint], held: Mapping[str, Held]) -> set[str]:
    """The shafts that do not turn while the wheels stand, whatever is held or chosen."""
    rows = [row(joint.speed, shafts) for joint in joints if joint.speed]
    rows += [row({WHEEL: 1.0}, shafts)]
    rows += [row({shaft: 1.0}, shafts) for shaft, how in held.items() if how == "rest"]
    return set(shafts) - set(loose(np.array(rows), shafts))
