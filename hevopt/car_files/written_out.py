"""A driveline of a kind as the table of parts that says the same in a file."""

from math import isfinite
from typing import Any

from hevopt.car.driveline import Driveline
from hevopt.car.parts import (
    Clutch,
    Gear,
    Gearbox,
    OneWayClutch,
    Part,
    Planetary,
    TorqueConverter,
)
from hevopt.errors import DataError
from hevopt.units import TO_SI


def written_out(line: Driveline) -> dict[str, Any]:
    """The `coupling` of kind "parts" that a driveline stands for; DataError where parts in a file cannot say it."""
    if line.follows_load:
        raise DataError(
            f"coupling kind {line.kind!r}: its machine follows the electric load, which parts cannot say; leave "
            "--parts out"
        )
    table: dict[str, Any] = {"kind": "parts"}
    if line.engine is not None:
        table["engine_shaft"] = line.engine
    table |= {f"{name}_shaft": shaft for name, shaft in line.machines}
    return table | {"parts": [_part(part, line.kind) for part in line.parts]}


def _part(part: Part, kind: str) -> dict[str, Any]:
    table: dict[str, Any] = {"name": part.name}
    if isinstance(part, Planetary):
        shafts = {"sun": part.sun, "ring": part.ring, "carrier": part.carrier}
        return {"kind": "planetary", **table, **shafts, "ratio": part.ratio, **_lossy(part)}
    table |= dict(zip(("first", "second"), part.shafts, strict=False))
    if isinstance(part, Gear):
        if isfinite(part.speed_max_radps):
            raise _unsaid(part, kind, "is uncoupled above a speed")
        return {"kind": "gear", **table, "ratio": part.ratio, **_lossy(part)}
    if isinstance(part, Gearbox):
        return {"kind": "gearbox", **table, **_gears(part, kind)}
    if isinstance(part, Clutch):
        return {"kind": "clutch", **table, "operation": part.operation}
    if isinstance(part, TorqueConverter):
        return {"kind": "torque_converter", **table}
    return {"kind": "one_way_clutch" if isinstance(part, OneWayClutch) else "shaft_brake", **table}


def _gears(box: Gearbox, kind: str) -> dict[str, Any]:
    """What a gearbox says beside its shafts: nothing where it is the architecture's, in the gear listed."""
    if box.gears != tuple(range(1, len(box.ratios))):
        raise _unsaid(box, kind, "has some of the gears only")
    if box.choice == "listed":
        return {}
    efficiency = {} if box.efficiencies[1] == 1 else {"efficiency": box.efficiencies[1]}
    shift_g = box.shift_fuel_kg / TO_SI["_g"][1]
    return {"ratios": list(box.ratios[1:]), **efficiency, "shift_fuel_g": shift_g}


def _lossy(part: Gear | Planetary) -> dict[str, float]:
    return {} if part.efficiency == 1 else {"efficiency": part.efficiency}


def _unsaid(part: Part, kind: str, what: str) -> DataError:
    return DataError(
        f"coupling kind {kind!r}: {part.name} {what}, which parts cannot say; leave --parts out"
    )
