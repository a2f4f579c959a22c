"""A driveline of a kind as the table of parts that says the same in a file."""

from math import isfinite
from typing import Any

from hevopt.car.driveline import Driveline, Together
from hevopt.car.parts import (
    Clutch,
    Gear,
    Gearbox,
    OneWayClutch,
    Part,
    Planetary,
    TorqueConverter,
)
from hevopt.units import TO_SI


def written_out(line: Driveline) -> dict[str, Any]:
    """The `coupling` of kind "parts" that a driveline stands for."""
    table: dict[str, Any] = {"kind": "parts"}
    if line.engine is not None:
        table["engine_shaft"] = line.engine
    table |= {f"{name}_shaft": shaft for name, shaft in line.machines}
    if line.follows_load:
        table["follows_load"] = True
    table["parts"] = [_part(part) for part in line.parts]
    if line.together:
        table["states"] = [_state(one) for one in line.together]
    return table


def _state(one: Together) -> dict[str, Any]:
    engine = {} if one.engine_on is None else {"engine": "on" if one.engine_on else "off"}
    return {"closed": sorted(one.closed), **engine}


def _part(part: Part) -> dict[str, Any]:
    table: dict[str, Any] = {"name": part.name}
    if isinstance(part, Planetary):
        shafts = {"sun": part.sun, "ring": part.ring, "carrier": part.carrier}
        return {"kind": "planetary", **table, **shafts, "ratio": part.ratio, **_lossy(part)}
    table |= dict(zip(("first", "second"), part.shafts, strict=False))
    if isinstance(part, Gear):
        limit = part.speed_max_radps / TO_SI["_rpm"][1]
        opens = {"speed_max_rpm": limit} if isfinite(limit) else {}
        return {"kind": "gear", **table, "ratio": part.ratio, **_lossy(part), **opens}
    if isinstance(part, Gearbox):
        return {"kind": "gearbox", **table, **_gears(part)}
    if isinstance(part, Clutch):
        return {"kind": "clutch", **table, "operation": part.operation}
    if isinstance(part, TorqueConverter):
        return {"kind": "torque_converter", **table}
    return {"kind": "one_way_clutch" if isinstance(part, OneWayClutch) else "shaft_brake", **table}


def _gears(box: Gearbox) -> dict[str, Any]:
    """What a gearbox says beside its shafts: nothing where it is the architecture's, in the gear listed."""
    shift = {"shift_fuel_g": box.shift_fuel_kg / TO_SI["_g"][1]} if box.choice != "listed" else {}
    if box.choice != "free":
        some = box.gears != tuple(range(1, len(box.ratios)))
        chosen = {"preselected": True} if box.choice == "preselected" else {}
        return {**({"gears": list(box.gears)} if some or chosen else {}), **chosen, **shift}
    each = list(box.efficiencies[1:])
    efficiency = (
        {} if set(each) == {1.0} else {"efficiency": each if len(set(each)) > 1 else each[0]}
    )
    return {"ratios": list(box.ratios[1:]), **efficiency, **shift}


def _lossy(part: Gear | Planetary) -> dict[str, float]:
    return {} if part.efficiency == 1 else {"efficiency": part.efficiency}
