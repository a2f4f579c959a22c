"""A driveline from the parts that an architecture's file lists, each state of it tried."""

from collections.abc import Mapping

from hevopt.car.driveline import Driveline, Phase
from hevopt.car.parts import (
    WHEEL,
    Clutch,
    Gear,
    Gearbox,
    OneWayClutch,
    Part,
    Planetary,
    ShaftBrake,
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
    driven = any(isinstance(part, Clutch) and part.operation == "driver" for part in parts)
    engine = shafts.get("engine")
    line = Driveline("parts", parts, engine, machines, engine is not None and not driven)
    _check_joined(parts, shafts)
    if engine is None and (chosen := [part.name for part in parts if _is_chosen(part)]):
        raise DataError(
            f"driveline: without an engine gears may not be chosen: {', '.join(chosen)}; the objective, "
            "electricity, does not count their changes; take one pair of gears instead"
        )
    for state in line.states():
        for phase in _phases(line):
            way(line, state, phase)
    return line


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


def _phases(line: Driveline) -> list[Phase]:
    boxes = [box.name for box in line.boxes if box.choice != "free"]
    driving = [
        Phase(False, clutch, box) for box in boxes for clutch in ("closed", "slipping", "open")
    ]
    return [Phase(True), Phase(False), *driving]


def _part(data: PartFile, gearbox: GearboxData | None) -> Part:
    first, second = data.first or "", data.second or ""
    if data.kind == "gear":
        return Gear(data.name, first, second, data.ratio or 1.0, data.efficiency)
    if data.kind == "planetary":
        sun, ring, carrier = data.sun or "", data.ring or "", data.carrier or ""
        return Planetary(data.name, sun, ring, carrier, data.ratio or 1.0, data.efficiency)
    if data.kind == "clutch":
        return Clutch(data.name, first, second, data.operation or "strategy")
    if data.kind == "one_way_clutch":
        return OneWayClutch(data.name, first, data.second)
    if data.kind == "shaft_brake":
        return ShaftBrake(data.name, first)
    return _gearbox(data, gearbox)


def _gearbox(data: PartFile, gearbox: GearboxData | None) -> Gearbox:
    """With ratios of its own, gears that the strategy chooses; else the architecture's gearbox, as listed."""
    first, second = data.first or "", data.second or ""
    if data.ratios is None:
        if gearbox is None:
            raise DataError(f"{data.name}: give its ratios, or the architecture a gearbox")
        numbers = tuple(range(1, len(gearbox.ratios)))
        ratios, efficiency = (tuple(map(float, v)) for v in (gearbox.ratios, gearbox.efficiency))
        return Gearbox(
            data.name, first, second, ratios, efficiency, numbers, "listed", loss=gearbox.loss
        )
    numbers = tuple(range(1, len(data.ratios) + 1))
    return Gearbox(
        data.name,
        first,
        second,
        (1.0, *data.ratios),
        (1.0,) + (data.efficiency,) * len(data.ratios),
        numbers,
        "free",
        data.shift_fuel_g * TO_SI["_g"][1],
    )
