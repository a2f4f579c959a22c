"""Drivelines by name: what the coupling of a short architecture file stands for, part by part.

kind             also    parts
none                     engine - clutch - gearbox - wheels; an alternator on the crankshaft, which follows the
                         load; a gearbox's torque converter takes the clutch's place, here and in the next three
belt             P0      the same, a machine on the crankshaft
crankshaft       P1      the same
gearbox_input    P2      the machine on the gearbox's input, the clutch between engine and machine
gearbox_output   P3      the machine on the wheels, through a gear of its own and the final drive
even_shaft               two gearboxes with a clutch each; the machine on the shaft of the even gears
power_split              engine on the carrier of a planetary set, machine on its sun, machine_2 on its ring and, by
                         the final drive, on the wheels
series                   machine on the engine's shaft; machine_2, by the final drive, on the wheels
series_parallel          the same, and a lock-up clutch that joins engine and wheels by a gear of its own
belt_and_axle    P0+P4   machine on the crankshaft, gearbox and clutch as above; machine_2 on the other axle
electric                 the machine, by the final drive, on the wheels; no engine
parts                    the parts as the file lists them
"""

from collections.abc import Callable
from dataclasses import replace
from math import inf
from typing import Literal, NamedTuple

from hevopt.car.driveline import Driveline
from hevopt.car.machine import Machine
from hevopt.car.parts import WHEEL, Clutch, Gear, Gearbox, Planetary, TorqueConverter
from hevopt.car.transmission import Gearbox as GearboxData

CouplingKind = Literal[
    "none", "belt", "crankshaft", "gearbox_input", "gearbox_output", "even_shaft", "belt_and_axle", "power_split",
    "series", "series_parallel", "electric", "parts",
]  # fmt: skip
_CRANK, _INPUT = "crankshaft", "gearbox input"


class Options(NamedTuple):
    """What a coupling's table may add to its kind."""

    second_clutch: bool = False
    machine_ratio: float = 1.0
    machine_efficiency: float = 1.0
    disconnects_above_speed_max: bool = False
    machine_shift_fuel_kg: float = 0.0
    planetary_ratio: float = 1.0
    planetary_efficiency: float = 1.0
    final_drive_ratio: float = 1.0
    final_drive_efficiency: float = 1.0
    lock_up_ratio: float = 1.0
    lock_up_efficiency: float = 1.0
    axle_ratio: float = 1.0
    axle_efficiency: float = 1.0


def crankshaft(kind: str, options: Options, gearbox: GearboxData, machine: Machine) -> Driveline:
    """A, B, C1: the machine turns with the engine."""
    converter = gearbox.torque_converter
    between = (
        Clutch("clutch", _CRANK, _INPUT, "driver")
        if converter is None
        else TorqueConverter("torque converter", _CRANK, _INPUT, converter)
    )
    parts = (between, _gearbox(gearbox))
    placed = (("machine", _CRANK),)
    return Driveline(kind, parts, _CRANK, placed, follows_load=kind == "none")


def gearbox_input(kind: str, options: Options, gearbox: GearboxData, machine: Machine) -> Driveline:
    """C2: the machine turns with the gearbox input; without the second clutch it cannot part from the engine."""
    if not options.second_clutch:
        return crankshaft(kind, options, gearbox, machine)
    parts = (Clutch("clutch", _CRANK, _INPUT, "driver"), _gearbox(gearbox))
    return Driveline(kind, parts, _CRANK, (("machine", _INPUT),))


def gearbox_output(
    kind: str, options: Options, gearbox: GearboxData, machine: Machine
) -> Driveline:
    """D: the machine turns with the wheels, through its own ratio and the final drive."""
    parts = (
        Clutch("clutch", _CRANK, _INPUT, "driver"),
        _gearbox(gearbox),
        Gear(
            "machine gear",
            "machine shaft",
            WHEEL,
            options.machine_ratio * float(gearbox.ratios[0]),
            options.machine_efficiency,
            machine.speed_max_radps if options.disconnects_above_speed_max else inf,
        ),
    )
    return Driveline(kind, parts, _CRANK, (("machine", "machine shaft"),))


def even_shaft(kind: str, options: Options, gearbox: GearboxData, machine: Machine) -> Driveline:
    """E: the machine in each even gear; with the engine in an even gear both share that gear."""
    numbers = range(1, len(gearbox.ratios))
    even = tuple(gear for gear in numbers if gear % 2 == 0)
    odd = tuple(gear for gear in numbers if gear % 2 == 1)
    own = replace(_gearbox(gearbox), name="odd gears", first="odd shaft", gears=odd)
    others = replace(
        own,
        name="even gears",
        first="even shaft",
        gears=even,
        choice="preselected",
        shift_fuel_kg=options.machine_shift_fuel_kg,
    )
    clutches = (
        Clutch("odd clutch", _CRANK, own.first, "driver"),
        Clutch("even clutch", _CRANK, others.first, "driver"),
    )
    return Driveline(kind, (*clutches, own, others), _CRANK, (("machine", others.first),))


def power_split(kind: str, options: Options) -> Driveline:
    """Input split: the carrier's speed is free, machine holds it; machine_2 and the ring's share drive."""
    parts = (
        Planetary(
            "planetary set",
            "sun",
            "ring",
            "carrier",
            options.planetary_ratio,
            options.planetary_efficiency,
        ),
        Gear(
            "final drive", "ring", WHEEL, options.final_drive_ratio, options.final_drive_efficiency
        ),
    )
    placed = (("machine", "sun"), ("machine_2", "ring"))
    return Driveline(kind, parts, "carrier", placed, free_engine_speed=True)


def series(kind: str, options: Options) -> Driveline:
    """Engine and generator on a shaft of their own, of free speed; the other machine alone drives."""
    parts = (
        Gear(
            "final drive", "motor", WHEEL, options.final_drive_ratio, options.final_drive_efficiency
        ),
    )
    placed = (("machine", _CRANK), ("machine_2", "motor"))
    return Driveline(kind, parts, _CRANK, placed, free_engine_speed=True)


def electric(kind: str, options: Options) -> Driveline:
    """The machine alone drives; there is no engine."""
    parts = (
        Gear(
            "final drive", "motor", WHEEL, options.final_drive_ratio, options.final_drive_efficiency
        ),
    )
    return Driveline(kind, parts, None, (("machine", "motor"),))


def series_parallel(kind: str, options: Options) -> Driveline:
    """A series car whose engine's shaft a clutch of the strategy joins to the wheels."""
    line = series(kind, options)
    lock_up = (
        Clutch("lock-up clutch", _CRANK, "lock-up shaft", "strategy"),
        Gear(
            "lock-up gear",
            "lock-up shaft",
            WHEEL,
            options.lock_up_ratio,
            options.lock_up_efficiency,
        ),
    )
    return replace(line, parts=(*line.parts, *lock_up))


def belt_and_axle(kind: str, options: Options, gearbox: GearboxData, machine: Machine) -> Driveline:
    """P0+P4: one machine turns with the engine, the other with the axle that the gearbox does not drive."""
    line = crankshaft(kind, options, gearbox, machine)
    axle = Gear("rear axle", "rear machine", WHEEL, options.axle_ratio, options.axle_efficiency)
    placed = (*line.machines, ("machine_2", "rear machine"))
    return replace(line, parts=(*line.parts, axle), machines=placed)


TEMPLATES: dict[str, Callable[[str, Options, GearboxData, Machine], Driveline]] = {
    "none": crankshaft,
    "belt": crankshaft,
    "crankshaft": crankshaft,
    "gearbox_input": gearbox_input,
    "gearbox_output": gearbox_output,
    "even_shaft": even_shaft,
    "belt_and_axle": belt_and_axle,
}
WITHOUT_GEARBOX: dict[str, Callable[[str, Options], Driveline]] = {
    "power_split": power_split,
    "series": series,
    "series_parallel": series_parallel,
    "electric": electric,
}
# The components that a kind has beside car and battery; those of "parts" follow from its shafts.
COMPONENTS_OF: dict[str, frozenset[str]] = {
    **dict.fromkeys(TEMPLATES, frozenset({"engine", "gearbox", "machine"})),
    "belt_and_axle": frozenset({"engine", "gearbox", "machine", "machine_2"}),
    **dict.fromkeys(WITHOUT_GEARBOX, frozenset({"engine", "machine", "machine_2"})),
    "electric": frozenset({"machine"}),
}


def _gearbox(data: GearboxData) -> Gearbox:
    numbers = tuple(range(1, len(data.ratios)))
    return Gearbox(
        "gearbox",
        _INPUT,
        WHEEL,
        tuple(map(float, data.ratios)),
        tuple(map(float, data.efficiency)),
        numbers,
        "listed",
        loss=data.loss,
    )
