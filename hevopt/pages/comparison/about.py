"""What a car is, from its files: what a page says of it before the first figure."""

from math import isfinite

import numpy as np

from hevopt.car.architecture import Architecture
from hevopt.car.parts import (
    Clutch,
    Gear,
    Gearbox,
    OneWayClutch,
    Part,
    Planetary,
    ShaftBrake,
    TorqueConverter,
)
from hevopt.driving.cycle import Cycle
from hevopt.pages.comparison.saved_car import (
    CarAbout,
    GearSource,
    MachineAbout,
    PartAbout,
    PartKind,
)
from hevopt.problem.battery import energy_j

_KINDS: dict[type[Part], PartKind] = {
    Gear: "gear",
    Gearbox: "gearbox",
    Clutch: "clutch",
    OneWayClutch: "one-way clutch",
    Planetary: "planetary set",
    ShaftBrake: "shaft brake",
    TorqueConverter: "torque converter",
}
_CHOICES = {"listed": "", "free": ", chosen", "preselected": ""}


def about_car(car: Architecture, cycle: Cycle) -> CarAbout:
    """What a car is, and where its gears on a cycle come from."""
    engine, battery, braking = car.engine, car.battery, car.vehicle.braking
    power_w = engine.full_load_speed_radps * engine.full_load_torque_nm
    ends = np.array([battery.soc[0], battery.soc[-1], battery.soc_min, battery.soc_max])
    first_j, last_j, least_j, most_j = energy_j(battery, ends).tolist()
    return CarAbout(
        description=car.description,
        mass_kg=car.vehicle.mass_kg,
        engine=engine.name,
        engine_w=float(np.max(power_w)),
        engine_shaft=car.driveline.engine,
        start_fuel_kg=engine.start_fuel_kg,
        machines=[
            MachineAbout(
                name=name.replace("_", " "),
                component=machine.name,
                shaft=shaft,
                power_w=machine.power_max_w if isfinite(machine.power_max_w) else None,
            )
            for (name, shaft), machine in zip(car.driveline.machines, car.machines, strict=True)
        ],
        parts=[_part(part) for part in car.driveline.parts],
        battery_j=last_j - first_j,
        window_j=most_j - least_j,
        battery_soc=battery.soc.tolist(),
        battery_v=battery.open_circuit_v.tolist(),
        capacity_as=battery.capacity_as,
        functions=[name.replace("_", " ") for name in car.contents.get("functions", [])],
        gears=_gears(car, cycle),
        shift_gap_s=None if car.gearbox is None else car.gearbox.shift_gap_s,
        braking_mps=[] if braking is None else braking.speed_mps.tolist(),
        braking_share=[] if braking is None else braking.machine_share.tolist(),
    )


def _part(part: Part) -> PartAbout:
    return PartAbout(
        kind=_KINDS[type(part)], name=part.name, shafts=list(part.shafts), note=_note(part)
    )


def _note(part: Part) -> str:
    if isinstance(part, Gearbox):
        return f"{len(part.gears)} gears{_CHOICES[part.choice]}"
    if isinstance(part, Gear):
        return f"{part.ratio:.3g} : 1"
    if isinstance(part, Planetary):
        return f"ring/sun {part.ratio:.3g}"
    if isinstance(part, TorqueConverter):
        return "locks" if np.isfinite(part.data.lock_up_radps) else "never locks"
    if isinstance(part, Clutch):
        return "driver's" if part.operation == "driver" else "chosen"
    return "to the case" if isinstance(part, OneWayClutch) and part.second is None else ""


def _gears(car: Architecture, cycle: Cycle) -> GearSource:
    if car.gear == "free":
        return "plan"
    if car.gearbox is None:
        return "none"
    return "shift speeds" if cycle.gear is None else "cycle"
