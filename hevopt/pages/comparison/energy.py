"""Where the energy of a cycle goes, from fuel and battery to the wheels, each loss by its name.

Over a cycle energy goes both ways: the car's motion gives back in braking what traction put in, and the battery
gives out what it stored. So that the picture has a direction, places through which energy passes both ways are
split by the direction of the step: traction and braking, motor and generator, battery giving and taking.
A loss has one name, in the picture and in the table of the balance.
"""

from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hevopt.pages.comparison.results import Energy, Item, Link
from hevopt.problem.problem import Trajectory

Array = NDArray[np.float64]

FUEL, STARTS, ENGINE = "Fuel", "Starts and shifts", "Engine"
ENGINE_LOSS, DRAG = "Engine heat", "Engine drag"
DRIVING, BRAKING = "Driveline, traction", "Driveline, braking"
WHEELS, ROAD, DOWNHILL = "Wheels", "Road load", "Downhill"
MOTOR, GENERATOR = "Motor", "Generator"
DRAWN, STORED = "Battery, drawn", "Battery, stored"
CLUTCH, GEARBOX, MACHINE_GEAR = "Clutch or converter slip", "Gearbox losses", "Machine gear losses"
MACHINE_LOSS = "Machine losses"
BATTERY_LOSS, AUXILIARIES, BRAKES = "Battery losses", "Auxiliaries", "Friction brakes"
SHAFTS, UNREGAINED = "Spinning shafts", "Spin-up not regained"
NET_DRAWN = "stored energy drawn, net"
BURNT, OF_STARTS = "fuel burnt", "fuel of starts and shifts"
TAKEN_IN_BRAKING = "braking at the wheels"
LEFT_OUT = "rises of free engine speeds, in no book"
SPUN_BEFORE, SPUN_AFTER = "Shafts at the start", "Shafts at the end"
# A share of all energy below which a link is rounding.
_TINY = 1e-9


def energy_of(trajectory: Trajectory, step_s: Array, heating_value_jpkg: float) -> Energy:
    """The energy flows of a trajectory over its cycle."""
    shafts = _shafts(trajectory)
    starts_j = float(np.sum(trajectory.switch_fuel_kg)) * heating_value_jpkg
    links = _links(trajectory, step_s, shafts)
    links[FUEL, STARTS] = starts_j - shafts.fuel_j
    total = _total(trajectory, step_s)
    enough = _TINY * sum(abs(energy) for energy in links.values())
    wheel, battery = trajectory.flows["wheel_power_w"], trajectory.battery_power_w
    heat_j = links[ENGINE, ENGINE_LOSS]
    return Energy(
        links=[
            Link(source=source, target=target, energy_j=energy)
            for (source, target), energy in links.items()
            if energy > enough
        ],
        taken=[
            Item(name=BURNT, energy_j=total["fuel_power_w"]),
            Item(name=OF_STARTS, energy_j=starts_j),
            Item(name=NET_DRAWN, energy_j=total["battery_chemical_w"] + shafts.stored_j),
            Item(name=SPUN_BEFORE, energy_j=shafts.before_j),
        ],
        spent=[
            Item(name=ROAD, energy_j=total["wheel_power_w"]),
            Item(name=AUXILIARIES, energy_j=total["auxiliary_power_w"]),
            Item(name=BRAKES, energy_j=total["brake_power_w"]),
            Item(name=ENGINE_LOSS, energy_j=heat_j),
            Item(name=DRAG, energy_j=total["engine_loss_w"] - heat_j),
            Item(name=STARTS, energy_j=starts_j - shafts.fuel_j),
            Item(name=CLUTCH, energy_j=total["clutch_loss_w"]),
            Item(name=GEARBOX, energy_j=total["gearbox_loss_w"]),
            Item(name=MACHINE_GEAR, energy_j=total["gear_loss_w"]),
            Item(name=MACHINE_LOSS, energy_j=total["machine_loss_w"]),
            Item(name=BATTERY_LOSS, energy_j=total["battery_loss_w"]),
            Item(name=UNREGAINED, energy_j=shafts.lost_j),
            Item(name=SPUN_AFTER, energy_j=shafts.after_j),
        ],
        residual_j=float(np.sum(trajectory.residuals["whole car"] * step_s)),
        of_which=[
            Item(name=name, energy_j=float(np.sum(np.maximum(power_w, 0) * step_s)))
            for name, power_w in (
                ("traction at the wheels", wheel),
                (TAKEN_IN_BRAKING, -wheel),
                ("into the battery, at its terminals", -battery),
                ("out of the battery, at its terminals", battery),
            )
        ]
        + _left_out(trajectory),
    )


def _left_out(trajectory: Trajectory) -> list[Item]:
    """Kinetic energy that shafts of free speed take up on the way, all rises together, which no plan pays for."""
    held_j = trajectory.flows.get("shafts_left_out_j")
    if held_j is None:
        return []
    rises = np.maximum(np.diff(held_j, prepend=0.0, append=0.0), 0.0)
    return [Item(name=LEFT_OUT, energy_j=float(np.sum(rises)))]


class _Shafts(NamedTuple):
    """Kinetic energy of the shafts before and after the cycle, and what their jumps take and lose, J."""

    before_j: float
    after_j: float
    fuel_j: float
    stored_j: float
    lost_j: float


def _shafts(trajectory: Trajectory) -> _Shafts:
    f = trajectory.flows
    return _Shafts(
        float(f["shafts_before_j"][0]),
        float(f["shafts_end_j"][-1]),
        float(np.sum(f["spin_fuel_j"])),
        float(np.sum(trajectory.switch_energy_j)),
        float(np.sum(f["spin_loss_j"])),
    )


def _links(trajectory: Trajectory, step_s: Array, shafts: _Shafts) -> dict[tuple[str, str], float]:
    """(from, to) -> energy over the cycle."""
    f, links = trajectory.flows, {}

    def add(source: str, target: str, power_w: Array) -> None:
        links[source, target] = links.get((source, target), 0.0) + float(np.sum(power_w * step_s))

    engine = f["engine_torque_nm"] * f["engine_speed_radps"]
    add(FUEL, ENGINE, f["fuel_power_w"])
    add(ENGINE, ENGINE_LOSS, f["fuel_power_w"] - np.maximum(engine, 0))
    _electric_links(add, trajectory)
    wheel, spinning = f["wheel_power_w"], f["engine_inertia_w"] + f["machine_inertia_w"]
    for line, here in ((DRIVING, wheel >= 0), (BRAKING, wheel < 0)):
        _driveline_links(add, f, engine, line, here)
        net_j = float(np.sum(np.where(here, spinning, 0) * step_s))
        links[line, SHAFTS], links[SHAFTS, line] = max(net_j, 0.0), max(-net_j, 0.0)
    traction_j = float(np.sum(np.maximum(wheel, 0) * step_s))
    braking_j = float(np.sum(np.maximum(-wheel, 0) * step_s))
    links[DRIVING, WHEELS] = traction_j
    links[WHEELS, BRAKING] = min(traction_j, braking_j)
    links[WHEELS, ROAD] = max(traction_j - braking_j, 0.0)
    links[DOWNHILL, BRAKING] = max(braking_j - traction_j, 0.0)
    links[SPUN_BEFORE, SHAFTS], links[SHAFTS, SPUN_AFTER] = shafts.before_j, shafts.after_j
    links[FUEL, SHAFTS], links[SHAFTS, UNREGAINED] = shafts.fuel_j, shafts.lost_j
    links[DRAWN, SHAFTS] = max(shafts.stored_j, 0.0)
    links[SHAFTS, STORED] = max(-shafts.stored_j, 0.0)
    return links


def _total(trajectory: Trajectory, step_s: Array) -> dict[str, float]:
    """Flow -> its energy over the cycle; what a converter loses is part of the battery's losses."""
    total = {name: float(np.sum(flow * step_s)) for name, flow in trajectory.flows.items()}
    return total | {"battery_loss_w": total["battery_loss_w"] + total.get("converter_loss_w", 0.0)}


def _electric_links(add: Callable[[str, str, Array], None], trajectory: Trajectory) -> None:
    f, power = trajectory.flows, trajectory.battery_power_w
    electric, auxiliary = f["machine_electric_w"], f["auxiliary_power_w"]
    motoring, giving, taking = electric > 0, power > 0, power < 0
    lost = f["battery_loss_w"] + f.get("converter_loss_w", np.zeros_like(power))
    covered = np.clip(-electric, 0, auxiliary)
    add(DRAWN, BATTERY_LOSS, np.where(giving, lost, 0))
    add(DRAWN, AUXILIARIES, np.where(giving, auxiliary - covered, 0))
    add(DRAWN, MOTOR, np.where(motoring, electric, 0))
    # A motor at nearly no torque can take power from both sides; what the shaft gives is lost there as well.
    dragged = np.maximum(-f["machine_power_w"], 0)
    add(MOTOR, MACHINE_LOSS, np.where(motoring, f["machine_loss_w"] - dragged, 0))
    add(GENERATOR, MACHINE_LOSS, np.where(motoring, 0, f["machine_loss_w"]))
    add(GENERATOR, AUXILIARIES, covered)
    add(GENERATOR, BATTERY_LOSS, np.where(taking, lost, 0))
    add(GENERATOR, STORED, np.where(taking, -f["battery_chemical_w"], 0))


def _driveline_links(
    add: Callable[[str, str, Array], None],
    f: Mapping[str, Array],
    engine: Array,
    line: str,
    here: NDArray[np.bool_],
) -> None:
    """Links of the steps whose wheels drive, or brake."""
    machine = f["machine_power_w"]
    motoring = f["machine_electric_w"] > 0
    add(ENGINE, line, np.where(here, np.maximum(engine, 0), 0))
    add(line, DRAG, np.where(here, np.maximum(-engine, 0), 0))
    add(MOTOR, line, np.where(here & motoring, np.maximum(machine, 0), 0))
    add(line, MACHINE_LOSS, np.where(here & motoring, np.maximum(-machine, 0), 0))
    add(line, GENERATOR, np.where(here & ~motoring, -machine, 0))
    add(line, CLUTCH, np.where(here, f["clutch_loss_w"], 0))
    add(line, GEARBOX, np.where(here, f["gearbox_loss_w"], 0))
    add(line, MACHINE_GEAR, np.where(here, f["gear_loss_w"], 0))
    add(line, BRAKES, np.where(here, f["brake_power_w"], 0))
