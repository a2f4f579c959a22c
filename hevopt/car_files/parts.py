"""A driveline from the parts that an architecture's file lists, each state of it tried."""

from collections.abc import Mapping
from dataclasses import replace
from math import inf

from hevopt.car.driveline import Driveline, Phase, Together, is_switched
from hevopt.car.parts import (
    WHEEL,
    Clutch,
    Gear,
    Gearbox,
    GearChoice,
    OneWayClutch,
    Part,
    Planetary,
    ShaftBrake,
    TorqueConverter,
)
from hevopt.car.transmission import Gearbox as GearboxData
from hevopt.car.ways import joined, way
from hevopt.car_files.driveline import CouplingFile, PartFile
from hevopt.errors import DataError
from hevopt.units import TO_SI


def driveline_of(data: CouplingFile, gearbox: GearboxData | None) -> Driveline:
    """The driveline of a coupling of kind "parts"; DataError, naming parts, where it cannot be driven.

    An engine whose speed no driver's clutch ties to a gearbox has a speed to choose.
    """
    parts = tuple(_part(part, gearbox) for part in data.parts or ())
    shafts = data.shafts
    machines = tuple((name, shaft) for name, shaft in shafts.items() if name != "engine")
    engine = shafts.get("engine")
    line = Driveline("parts", parts, engine, machines)
    driven = bool(line.driver_clutches) or line.converter is not None
    line = replace(
        line,
        free_engine_speed=engine is not None and not driven,
        follows_load=data.follows_load,
        together=_together(data, parts, engine),
    )
    _check_joined(parts, shafts)
    _check_gears(line, gearbox)
    check_converter(line, gearbox)
    if engine is None and (chosen := [part.name for part in parts if _is_chosen(part)]):
        raise DataError(
            f"driveline: without an engine gears may not be chosen: {', '.join(chosen)}; the objective, "
            "electricity, does not count their changes; take one pair of gears instead"
        )
    for state in line.states():
        for phase in _phases(line):
            try:
                way(line, state, phase)
            except DataError as error:
                raise DataError(f"{error}{_left_out(line)}") from None
    return line


def _left_out(line: Driveline) -> str:
    """What a message on a state that cannot be driven adds where a file may leave the state out."""
    if not any(map(is_switched, line.parts)):
        return ""
    return "; or leave the state out: list those that the car uses in coupling.states"


def _together(
    data: CouplingFile, parts: tuple[Part, ...], engine: str | None
) -> tuple[Together, ...]:
    """What may be closed together; DataError for names of no such part, and an engine that never turns."""
    names = [part.name for part in parts if is_switched(part)]
    for state in data.states or ():
        if unknown := sorted(set(state.closed) - set(names)):
            raise DataError(
                f"driveline: states: {', '.join(unknown)} is nothing that the strategy closes; allowed: "
                f"{', '.join(names) or 'none, as there is no such part'}"
            )
    turning = {"on": True, "off": False}
    found = tuple(
        Together(frozenset(state.closed), turning.get(state.engine or ""))
        for state in data.states or ()
    )
    wanted = engine is not None
    if found and not any(one.engine_on in (None, wanted) for one in found):
        raise DataError(
            f"driveline: states: the engine is {'off' if wanted else 'on'} in all of them"
            f"{'' if wanted else ', and there is none'}; list one with engine = {'on' if wanted else 'off'!r}"
        )
    return found


def _check_gears(line: Driveline, gearbox: GearboxData | None) -> None:
    """DataError where a listed gear is in two gearboxes or in none, or an alternator is not alone."""
    boxes = [box for box in line.boxes if box.choice != "free"]
    if boxes and gearbox is not None:
        for gear in range(1, len(gearbox.ratios)):
            holding = [box.name for box in boxes if gear in box.gears]
            if len(holding) != 1:
                where = f"in both {' and '.join(holding)}" if holding else "in no gearbox"
                raise DataError(
                    f"driveline: gear {gear} of {gearbox.name!r} is {where}; say in `gears` which gears each has"
                )
        if beyond := sorted(
            {g for box in boxes for g in box.gears} - set(range(len(gearbox.ratios)))
        ):
            raise DataError(
                f"driveline: gear {beyond[0]}: {gearbox.name!r} has {len(gearbox.ratios) - 1} gears"
            )
    if line.follows_load and (len(line.machines) != 1 or line.machines[0][1] != line.engine):
        raise DataError(
            "driveline: follows_load is of a car whose only machine is an alternator on the engine's shaft; leave "
            "it out, or put the machine there"
        )


def check_converter(line: Driveline, gearbox: GearboxData | None) -> None:
    """DataError where a torque converter stands elsewhere than between an engine and a gearbox's input.

    All that its turbine drives follows from what the wheels ask for, so that no choice lies behind it.
    """
    part = line.converter
    if part is None:
        if gearbox is not None and gearbox.torque_converter is not None:
            raise DataError(
                f"driveline: gearbox {gearbox.name!r} has a torque_converter, and no part of the driveline is one; "
                "make it one in place of the driver's clutch, or take the table out of the gearbox"
            )
        return
    before = joined([other for other in line.parts if other != part], part.first)
    behind = joined([other for other in line.parts if other != part], part.second)
    wrong = None
    if part.first != line.engine:
        wrong = f"its first shaft is {part.first!r}, the engine's {line.engine!r}"
    elif before & behind or WHEEL not in behind:
        wrong = f"its second shaft, {part.second!r}, does not lead to the wheels, or its first does as well"
    elif others := [name for name, shaft in line.machines if shaft not in before]:
        wrong = f"{', '.join(others)} turns behind it or apart from it"
    elif others := [
        other.name for other in line.parts if other != part and _is_chosen_or_slips(other)
    ]:
        wrong = f"{', '.join(others)} would be chosen or slip beside it"
    elif sum(isinstance(other, Gearbox) for other in line.parts) != 1:
        wrong = "it needs one gearbox, and no other"
    if wrong:
        raise DataError(
            f"driveline: torque converter {part.name!r} stands where none can be solved: {wrong}; allowed: engine, "
            "and machines on its shaft, then the torque converter, then the gearbox and gears to the wheels"
        )


def _is_chosen_or_slips(part: Part) -> bool:
    free = isinstance(part, Gearbox) and part.choice != "listed"
    return free or isinstance(part, Clutch | OneWayClutch | ShaftBrake | TorqueConverter)


def _is_chosen(part: Part) -> bool:
    return isinstance(part, Gearbox | Clutch | OneWayClutch | ShaftBrake)


def _check_joined(parts: tuple[Part, ...], placed: Mapping[str, str]) -> None:
    """DataError for an engine or a machine that turns neither the wheels nor another of them."""
    for name, shaft in placed.items():
        ends = {WHEEL, *(other for key, other in placed.items() if key != name)}
        if not joined(parts, shaft) & ends:
            raise DataError(
                f"driveline: no part joins {name} on {shaft!r} to the wheels or to another of "
                f"{', '.join(placed)}; add one, or correct a shaft's name"
            )
    if WHEEL not in {shaft for part in parts for shaft in part.shafts}:
        raise DataError(f"driveline: no part ends at {WHEEL!r}, the wheels; add a final drive")
    reached = joined(parts, WHEEL).union(*(joined(parts, shaft) for shaft in placed.values()))
    for part in parts:
        if not reached.intersection(part.shafts):
            raise DataError(
                f"driveline: {part.name} turns nothing, as no part joins it to the wheels, "
                f"{', '.join(placed)}; take it out, or correct a shaft's name"
            )
    named = [shaft for part in parts for shaft in part.shafts]
    for part in parts:
        for shaft in part.shafts:
            if named.count(shaft) == 1 and shaft not in {WHEEL, *placed.values()}:
                raise DataError(
                    f"driveline: {part.name} ends at {shaft!r}, on which nothing else is; correct the "
                    "shaft's name, or take the part out"
                )


def _phases(line: Driveline) -> list[Phase]:
    boxes = [box.name for box in line.boxes if box.choice != "free"]
    driving = [
        Phase(False, clutch, box) for box in boxes for clutch in ("closed", "slipping", "open")
    ]
    return [Phase(True), Phase(False), *driving]


def _part(data: PartFile, gearbox: GearboxData | None) -> Part:
    first, second = data.first or "", data.second or ""
    if data.kind == "gear":
        limit = inf if data.speed_max_rpm is None else data.speed_max_rpm * TO_SI["_rpm"][1]
        return Gear(data.name, first, second, data.ratio or 1.0, data.efficiencies[0], limit)
    if data.kind == "planetary":
        sun, ring, carrier = data.sun or "", data.ring or "", data.carrier or ""
        return Planetary(data.name, sun, ring, carrier, data.ratio or 1.0, data.efficiencies[0])
    if data.kind == "clutch":
        return Clutch(data.name, first, second, data.operation or "strategy")
    if data.kind == "one_way_clutch":
        return OneWayClutch(data.name, first, data.second)
    if data.kind == "shaft_brake":
        return ShaftBrake(data.name, first)
    if data.kind == "torque_converter":
        if gearbox is None or gearbox.torque_converter is None:
            raise DataError(
                f"{data.name}: the architecture's gearbox has no table torque_converter with its curves; add it"
            )
        return TorqueConverter(data.name, first, second, gearbox.torque_converter)
    return _gearbox(data, gearbox)


def _gearbox(data: PartFile, gearbox: GearboxData | None) -> Gearbox:
    """With ratios of its own, gears that the strategy chooses; else the architecture's gearbox, as listed."""
    ends, shift_kg = (
        (data.name, data.first or "", data.second or ""),
        data.shift_fuel_g * TO_SI["_g"][1],
    )
    if data.ratios is None:
        if gearbox is None:
            raise DataError(f"{data.name}: give its ratios, or the architecture a gearbox")
        numbers = tuple(sorted(set(data.gears or range(1, len(gearbox.ratios)))))
        ratios, efficiency = (tuple(map(float, v)) for v in (gearbox.ratios, gearbox.efficiency))
        choice: GearChoice = "preselected" if data.preselected else "listed"
        return Gearbox(*ends, ratios, efficiency, numbers, choice, shift_kg, gearbox.loss)
    numbers = tuple(range(1, len(data.ratios) + 1))
    each = data.efficiencies * (len(data.ratios) // len(data.efficiencies))
    return Gearbox(*ends, (1.0, *data.ratios), (1.0, *each), numbers, "free", shift_kg)
