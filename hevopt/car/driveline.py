"""A driveline as data: the parts, where engine and machines sit, and the states that a strategy can choose.

A state says what the strategy has chosen: engine turning or at rest, gears, clutches and brakes. A phase says what
the step makes of the rest: the car stands or moves, the driver's clutch is closed, slips or is open, the cycle
lists a gear. State and phase together are a way to drive (ways.py).
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Literal, NamedTuple

from hevopt.car.parts import (
    WHEEL,
    Clutch,
    Gear,
    Gearbox,
    OneWayClutch,
    Part,
    Planetary,
    ShaftBrake,
    TorqueConverter,
)

ENGINE, BRAKE = "engine", "brake"


class State(NamedTuple):
    """What the strategy has chosen.

    gears: (gearbox, gear) of those whose gear it chooses; closed: its clutches, shaft brakes and one-way clutches
    that hold; listed: the gear chosen in place of the one that the cycle lists, 0 where the cycle's is driven
    """

    engine_on: bool
    gears: tuple[tuple[str, int], ...] = ()
    closed: frozenset[str] = frozenset()
    listed: int = 0

    def gear(self, gearbox: str) -> int:
        """The gear chosen of a gearbox, 0 where there is no choice."""
        return dict(self.gears).get(gearbox, 0)


class Phase(NamedTuple):
    """What the step makes of the parts that the strategy does not choose.

    clutch: the driver's; box: the gearbox that has the listed gear, None in neutral
    opened: gears that their own coupling opens at this speed
    """

    standing: bool
    clutch: Literal["closed", "slipping", "open"] = "open"
    box: str | None = None
    opened: frozenset[str] = frozenset()


class Together(NamedTuple):
    """Clutches, brakes and one-way clutches that hold together, every other being open.

    engine_on: with the engine turning or at rest; None for both
    """

    closed: frozenset[str]
    engine_on: bool | None = None


class Use(NamedTuple):
    """A part in a state; gear: its number, or None for the one that the cycle lists."""

    part: Part
    state: Literal["mesh", "closed", "slipping", "locked", "gear"]
    gear: int | None = 0


@dataclass(frozen=True, slots=True)
class Driveline:
    """Parts that join shafts, the road's being "wheel".

    engine: its shaft, None where there is none; machines: (name, shaft) of each, in the order of the car's
    free_engine_speed: whether an engine that turns apart from the wheels has a speed to choose, not idle speed
    follows_load: whether the machine is an alternator that does nothing but supply the electric load
    together: what the strategy may close together, whatever it likes where nothing is listed
    """

    kind: str
    parts: tuple[Part, ...]
    engine: str | None
    machines: tuple[tuple[str, str], ...]
    free_engine_speed: bool = False
    follows_load: bool = False
    together: tuple[Together, ...] = ()

    @property
    def shafts(self) -> tuple[str, ...]:
        """All shafts, in the order in which parts name them."""
        own = (shaft for part in self.parts for shaft in part.shafts)
        placed = (shaft for _, shaft in self.machines)
        return tuple(dict.fromkeys((WHEEL, *own, *placed, *([self.engine] if self.engine else []))))

    @property
    def engine_apart(self) -> bool:
        """Whether an engine is joined to the wheels by clutches alone, if at all."""
        fixed = [part for part in self.parts if not isinstance(part, Clutch | TorqueConverter)]
        return self.engine is not None and WHEEL not in _joined(self.engine, fixed)

    @property
    def engine_reaches_wheels(self) -> bool:
        """Whether parts, clutches among them, join an engine and the wheels."""
        return self.engine is not None and WHEEL in _joined(self.engine, self.parts)

    @property
    def boxes(self) -> tuple[Gearbox, ...]:
        """Its gearboxes."""
        return tuple(part for part in self.parts if isinstance(part, Gearbox))

    @property
    def driver_clutches(self) -> tuple[Clutch, ...]:
        """The clutches that follow the step."""
        clutches = (part for part in self.parts if isinstance(part, Clutch))
        return tuple(part for part in clutches if part.operation == "driver")

    @property
    def converter(self) -> TorqueConverter | None:
        """The torque converter in the place of a driver's clutch; None without one."""
        return next((part for part in self.parts if isinstance(part, TorqueConverter)), None)

    def slipping(self, state: State, phase: Phase) -> TorqueConverter | None:
        """The torque converter where it slips: driving, or at standstill with a gear engaged; None elsewhere."""
        part = self.converter
        if part is None or not state.engine_on:
            return None
        if phase.standing:
            return part if part.data.in_gear_at_rest else None
        return part if phase.clutch == "slipping" and phase.box == self.served(part) else None

    def served(self, clutch: Clutch | TorqueConverter) -> str | None:
        """The gearbox that a driver's clutch belongs to: one of its shafts is the input; None without gearboxes."""
        of_cycle = [box for box in self.boxes if box.choice != "free"]
        beside = [box.name for box in of_cycle if box.first in clutch.shafts]
        return next(iter(beside or [box.name for box in of_cycle]), None)

    def states(self, listed: int = 0) -> Iterator[State]:
        """Every state: engine turning first. listed: a gear in place of the cycle's."""
        chosen = [box for box in self.boxes if box.choice != "listed"]
        choices = [[(box.name, gear) for gear in box.gears] for box in chosen]
        switched = [part.name for part in self.parts if is_switched(part)]
        for engine_on in (True, False) if self.engine else (False,):
            for gears in product(*choices):
                for closed in product((False, True), repeat=len(switched)):
                    names = frozenset(n for n, shut in zip(switched, closed, strict=True) if shut)
                    if self._may(engine_on, names):
                        yield State(engine_on, gears, names, listed)

    def _may(self, engine_on: bool, closed: frozenset[str]) -> bool:
        return not self.together or any(
            closed == one.closed and one.engine_on in (None, engine_on) for one in self.together
        )

    def uses(self, state: State, phase: Phase) -> tuple[Use, ...]:
        """The parts that join shafts in a state and phase."""
        found = (self._use(part, state, phase) for part in self.parts)
        return tuple(use for use in found if use is not None)

    def _use(self, part: Part, state: State, phase: Phase) -> Use | None:
        if isinstance(part, Gear):
            return None if part.name in phase.opened else Use(part, "mesh")
        if isinstance(part, Planetary):
            return Use(part, "mesh")
        if isinstance(part, Gearbox):
            return _geared(part, state, phase)
        if isinstance(part, TorqueConverter):
            shut = phase.clutch
            joins = state.engine_on and not phase.standing and phase.box == self.served(part)
            return Use(part, shut) if joins and shut != "open" else None
        if isinstance(part, Clutch) and part.operation == "driver":
            served = self.served(part)
            if not state.engine_on or not (phase.standing or phase.box == served):
                return None
            shut = "closed" if phase.standing else phase.clutch
            return None if shut == "open" else Use(part, shut)
        return Use(part, "locked" if isinstance(part, OneWayClutch) else "closed") if (
            part.name in state.closed
        ) else None  # fmt: skip


def _joined(shaft: str, parts: Sequence[Part]) -> set[str]:
    """The shafts that parts join to a shaft, itself among them."""
    reached = {shaft}
    for _ in parts:
        reached |= {end for part in parts if reached & set(part.shafts) for end in part.shafts}
    return reached


def _geared(box: Gearbox, state: State, phase: Phase) -> Use | None:
    if box.choice == "free":
        return Use(box, "gear", state.gear(box.name)) if state.gear(box.name) else None
    if phase.standing:
        return None
    if box.choice == "preselected":
        return Use(box, "gear", state.gear(box.name))
    return Use(box, "gear", None) if phase.box == box.name else None


def is_switched(part: Part) -> bool:
    """Whether the strategy opens and closes a part."""
    of_strategy = isinstance(part, Clutch) and part.operation == "strategy"
    return of_strategy or isinstance(part, ShaftBrake | OneWayClutch)
