"""Other assumptions: a figure of the cars, the cycle's gears or what a rule may do changed, all else the same."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hevopt.car.architecture import Architecture
from hevopt.car.machine_laws import LossByEfficiency
from hevopt.car_files.load import load_architecture
from hevopt.driving.cycle import Cycle
from hevopt.powertrain.powertrain import build_problem
from hevopt.problem.problem import Problem
from hevopt.problem.reject import Reject
from hevopt.problem.table import Signals
from hevopt.units import KMH_PER_MPS

LOSS_FACTOR, LESS_LOSS_FACTOR, RESISTANCE_FACTOR, HYBRID_MASS_FACTOR = 1.5, 0.5, 2.0, 2.0
DRIVELINE_LOSS_ADDED = 0.03
AUXILIARIES_W = 400.0
START_FUEL_G = 1.0
RESISTANCE_SHARE = 0.1
BRAKING_SHARES = (0.6, 0.4)
CELLS_EFFICIENCY, EACH_WAY_EFFICIENCY = 0.99, 0.838
ELECTRIC_KMH = (20, 30, 40, 50)
_LOSSES = ("loss_c0_w", "loss_c1_ws", "loss_c2_ws2", "loss_c3_wpnm2")


@dataclass(frozen=True, slots=True)
class Variation:
    """One other assumption, or several.

    changes: a car as shipped -> key path and value of what is another in it
    cycle, problem: what is another in the cycle, and in the problem of a car on it
    """

    name: str
    changes: Callable[[Architecture], Mapping[str, Any]] = lambda car: {}
    cycle: Callable[[Cycle], Cycle] = lambda cycle: cycle
    problem: Callable[[Problem], Problem] = lambda problem: problem

    def and_(self, other: "Variation", name: str) -> "Variation":
        """Both at once; where they change the same key, the other's value."""
        return Variation(
            name,
            lambda car: {**self.changes(car), **other.changes(car)},
            lambda cycle: other.cycle(self.cycle(cycle)),
            lambda problem: other.problem(self.problem(problem)),
        )


class Varied(NamedTuple):
    """A car, a cycle and their problem under a variation; touched: whether any of them is another by it."""

    car: Architecture
    cycle: Cycle
    problem: Problem
    touched: bool


def varied(architecture: str, cycle: Cycle, variation: Variation) -> Varied:
    """A shipped architecture, a cycle and their problem under a variation."""
    shipped = load_architecture(architecture)
    car = load_architecture(architecture, dict(variation.changes(shipped)))
    changed = variation.cycle(cycle)
    built = build_problem(car, changed)
    problem = variation.problem(built)
    touched = (
        car.contents != shipped.contents
        or not np.array_equal(listed_gear(changed), listed_gear(cycle))
        or not np.array_equal(problem.table.reject, built.table.reject)
    )
    return Varied(car, changed, problem, touched)


def listed_gear(cycle: Cycle) -> NDArray[np.int64]:
    """The gears of a cycle that lists them, as the study's does."""
    assert cycle.gear is not None
    return cycle.gear


def signals_of(problem: Problem) -> Signals:
    """What the cycle asks at each step; a problem of a car has it."""
    assert problem.table.signals is not None
    return problem.table.signals


def neutral_at_standstill(cycle: Cycle) -> Cycle:
    """The cycle with no gear engaged while the car stands: the engine may rest until it moves off."""
    standing = np.append(cycle.speed_mps[1:] + cycle.speed_mps[:-1] == 0, False)
    return replace(cycle, gear=np.where(standing, 0, listed_gear(cycle)))


def electric_up_to(limit_kmh: float) -> Callable[[Problem], Problem]:
    """Leaves no driving without fuel above a speed."""

    def limited(problem: Problem) -> Problem:
        signals = signals_of(problem)
        fast = (signals.speed_mps * KMH_PER_MPS > limit_kmh) & (signals.wheel_power_w > 0)
        return without(problem, fast[:, None] & (problem.table.fuel_kg == 0))

    return limited


def braking_share(share: float) -> Callable[[Problem], Problem]:
    """Leaves the machine no more than a share of the wheels' braking power; the brakes take the rest."""

    def limited(problem: Problem) -> Problem:
        flows, wheel_w = problem.table.flows, signals_of(problem).wheel_power_w[:, None]
        taken_w = -flows["machine_power_w"]
        return without(problem, (wheel_w < 0) & (taken_w > np.maximum(-share * wheel_w, 0)))

    return limited


def without(problem: Problem, unwanted: NDArray[np.bool_]) -> Problem:
    """The problem with (time, control) controls taken away, but at steps where none would be left."""
    table = problem.table
    left = np.any(table.feasible & ~unwanted, axis=1)
    bits = np.where(unwanted & left[:, None], np.uint16(Reject.FUNCTION), np.uint16(0))
    return replace(problem, table=replace(table, reject=table.reject | bits))


def _times(
    car: Architecture, component: str, keys: tuple[str, ...], factor: float
) -> dict[str, float]:
    table = car.contents[component]
    return {f"{component}.{key}": factor * table[key] for key in keys if key in table}


def _machine_loss(factor: float) -> Callable[[Architecture], dict[str, float]]:
    """The machine's loss times a factor; A's alternator is left to ALTERNATOR."""

    def changes(car: Architecture) -> dict[str, float]:
        efficiency = car.contents["machine"].get("efficiency")
        if efficiency is None:
            return _times(car, "machine", _LOSSES, factor)
        if car.driveline.kind == "none":
            return {}
        return {"machine.efficiency": less_loss(efficiency, factor)}

    return changes


def _charging_loss(factor: float) -> Callable[[Architecture], dict[str, float]]:
    return lambda car: {
        "battery.coulombic_efficiency": less_loss(
            car.contents["battery"]["coulombic_efficiency"], factor
        )
    }


def _traction_battery(efficiency: float) -> Callable[[Architecture], dict[str, float]]:
    """The coulombic efficiency of a battery that drives the car."""

    def changes(car: Architecture) -> dict[str, float]:
        drives = car.functions - {"start_stop"}
        return {"battery.coulombic_efficiency": efficiency} if drives else {}

    return changes


def _all_braking(car: Architecture) -> dict[str, list[float]]:
    curve = car.contents["car"]["braking"]["machine_share"]
    return {"car.braking.machine_share": [1.0] * len(curve)}


def machine_efficiency(car: Architecture) -> float:
    """That of a car whose machine's file gives one efficiency."""
    loss = car.machines[0].loss
    assert isinstance(loss, LossByEfficiency)
    return loss.efficiency


def less_loss(efficiency: float, factor: float) -> float:
    """The efficiency whose distance from 1 is `factor` times as large."""
    return 1 - factor * (1 - efficiency)


def _driveline(car: Architecture) -> dict[str, float]:
    changes = {"gearbox.efficiency": car.contents["gearbox"]["efficiency"] - DRIVELINE_LOSS_ADDED}
    own = car.contents["coupling"].get("machine_efficiency")
    if own is not None:
        changes["coupling.machine_efficiency"] = own - DRIVELINE_LOSS_ADDED
    return changes


def _alternator_as_belt(car: Architecture) -> dict[str, float]:
    if car.driveline.kind != "none":
        return {}
    return {"machine.efficiency": machine_efficiency(load_architecture("B"))}


def _road(car: Architecture) -> dict[str, float]:
    load, factor = car.contents["car"]["road_load"], 1 + RESISTANCE_SHARE
    keys = ("rolling_c0", "rolling_c1_spm", "drag_area_m2")
    return {f"car.road_load.{key}": factor * load[key] for key in keys}


def _no_recovery(car: Architecture) -> dict[str, list[str]]:
    if "regenerative_braking" not in car.functions:
        return {}
    return {"functions": sorted(car.functions - {"regenerative_braking"})}


AS_SHIPPED = Variation("as shipped")
K_PHASES = Variation("engine rests in the K phases", cycle=neutral_at_standstill)
FREE_STARTS = Variation("a start costs no fuel", lambda car: {"engine.start_fuel_g": 0.0})
DEAR_STARTS = Variation(
    f"a start costs {START_FUEL_G:g} g", lambda car: {"engine.start_fuel_g": START_FUEL_G}
)
NO_INERTIA = Variation(
    "no inertia of engine and machine",
    lambda car: {"engine.inertia_kgm2": 0.0, **_times(car, "machine", ("inertia_kgm2",), 0.0)},
)
NO_GAP = Variation(
    "changes of gear interrupt nothing",
    lambda car: {"gearbox.shift_gap_s": 0.0} if car.contents["gearbox"]["shift_gap_s"] else {},
)
DRIVELINE = Variation(f"driveline efficiency less {DRIVELINE_LOSS_ADDED:g}", _driveline)
MACHINE_LOSS, LESS_MACHINE_LOSS = (
    Variation(f"machine loss x {factor:g}", _machine_loss(factor))
    for factor in (LOSS_FACTOR, LESS_LOSS_FACTOR)
)
CHARGING_LOSS, LESS_CHARGING_LOSS = (
    Variation(f"coulombic loss x {factor:g}", _charging_loss(factor))
    for factor in (LOSS_FACTOR, LESS_LOSS_FACTOR)
)
CELLS, EACH_WAY = (
    Variation(name, _traction_battery(efficiency))
    for name, efficiency in (
        (f"coulombic efficiency of the cells, {CELLS_EFFICIENCY:g}", CELLS_EFFICIENCY),
        ("battery 0.9 each way", EACH_WAY_EFFICIENCY),
    )
)
RESISTANCE = Variation(
    f"battery resistance x {RESISTANCE_FACTOR:g}",
    lambda car: _times(car, "battery", ("resistance_ohm",), RESISTANCE_FACTOR),
)
HYBRID_MASS = Variation(
    f"hybrid parts weigh {HYBRID_MASS_FACTOR:g} times as much",
    lambda car: {"hybrid_mass_kg": HYBRID_MASS_FACTOR * car.contents["hybrid_mass_kg"]},
)
AUXILIARIES = Variation(
    f"auxiliaries {AUXILIARIES_W:g} W", lambda car: {"car.auxiliary_power_w": AUXILIARIES_W}
)
ALTERNATOR = Variation("A's alternator as efficient as B's machine", _alternator_as_belt)
ROAD = Variation(f"rolling and air resistance +{100 * RESISTANCE_SHARE:g} %", _road)
STEEP_NOX = Variation("steep NOx map", lambda car: {"engine": "engine_diesel_1600_steep_nox"})
ALL_BRAKING = Variation("machine takes all the braking it can", _all_braking)
NO_RECOVERY = Variation("no regenerative braking", _no_recovery)
BRAKING = tuple(
    Variation(
        f"machine takes at most {100 * share:g} % of the braking", problem=braking_share(share)
    )
    for share in BRAKING_SHARES
)
ELECTRIC = tuple(
    Variation(f"electric driving up to {kmh} km/h only", problem=electric_up_to(kmh))
    for kmh in ELECTRIC_KMH
)
