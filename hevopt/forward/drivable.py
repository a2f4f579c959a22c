"""Which drivelines the plant knows, and what lacks of the others."""

import numpy as np

from hevopt.car.architecture import Architecture
from hevopt.car.driveline import Driveline
from hevopt.car.parts import Clutch, Gear, Gearbox, Part, Planetary, TorqueConverter
from hevopt.errors import DataError


def check_drivable(car: Architecture) -> None:
    """DataError, saying what lacks, for a car whose driveline the plant does not know."""
    line, lacking = car.driveline, ""
    known = Gear | Gearbox | Clutch | TorqueConverter
    odd = [part.name for part in line.parts if not isinstance(part, known)]
    moved = [p.name for p in line.parts if isinstance(p, Clutch) and p.operation != "driver"]
    between: list[Clutch | TorqueConverter] = [*line.driver_clutches]
    between += [] if line.converter is None else [line.converter]
    if line.free_engine_speed:
        odd = [name for name in odd if not isinstance(_part(line, name), Planetary)]
        if odd or len(moved) > 1 or line.boxes:
            beside = ", ".join([*odd, *moved, *(box.name for box in line.boxes)])
            lacking = f"the strategy moves {beside} beside the engine's own speed"
        elif len(line.machines) < 2:
            lacking = "its engine has a speed of its own and no second machine"
    elif line.engine is not None and not (line.boxes and between):
        lacking = "its engine is behind no driver's clutch, or torque converter, and gears"
    elif odd or moved:
        lacking = f"the strategy moves {', '.join([*odd, *moved])}"
    elif (mapped := mapped_boxes(line)) and (
        len(line.boxes) > 1 or mapped[0].first not in {s for c in between for s in c.shafts}
    ):
        lacking = "a loss_map is of more than one gearbox, or of one that is not behind the driver's clutch"
    own = any(box.choice == "free" for box in line.boxes)
    if not lacking and (own or len(limited_gears(line)) > (not line.free_engine_speed)):
        lacking = "more than one part follows a choice of its own"
    if lacking:
        raise DataError(
            f"{car.name}: driveline {line.kind!r} cannot be driven forward yet, as {lacking}; those without an "
            "engine can, with one behind a driver's clutch and gears, and with two machines and an engine that has "
            "a speed of its own; `hevopt run` solves it backward"
        )


def _part(line: Driveline, name: str) -> Part:
    return next(part for part in line.parts if part.name == name)


def mapped_boxes(line: Driveline) -> list[Gearbox]:
    """Gearboxes whose losses are a map."""
    return [box for box in line.boxes if box.loss is not None]


def limited_gears(line: Driveline) -> list[Gear]:
    """Gears that a coupling of their own opens above a speed."""
    return [p for p in line.parts if isinstance(p, Gear) and np.isfinite(p.speed_max_radps)]
