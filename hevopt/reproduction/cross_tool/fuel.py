"""Fuel of a real car in FASTSim beside ours, and the difference in parts that add up to it.

FASTSim's engine has an efficiency over its power alone. Ours is told to it at the best speed of each power, so that
what it leaves out, that wheels and gears ask for a speed, is one part of the difference; the others are the
engine's work, the powers at which that is done, and what is not running fuel.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from hevopt.bounds.certificate import certify
from hevopt.car.architecture import Architecture
from hevopt.display.facts import Shown
from hevopt.driving.cycle import Cycle
from hevopt.powertrain.powertrain import build_problem
from hevopt.problem.arrays import Array
from hevopt.problem.battery import energy_j
from hevopt.problem.simulation import simulate
from hevopt.reproduction.cross_tool.told import is_hybrid, tell_car
from hevopt.reproduction.cross_tool.tool import (
    HYBRID,
    PLAIN,
    OtherDrive,
    curve,
    drive,
    powertrain,
    template,
)
from hevopt.strategies import strategy_named
from hevopt.studies.case import Case, litres
from hevopt.studies.rows import row_of


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class FuelHeld(Shown):
    """Fuel of a car on a cycle, l/100 km, charge-corrected: ours a plan of least fuel, theirs by FASTSim's control.

    work_mjpkm: the engine's, ours and theirs
    speed, work, powers, other: parts of theirs less ours; they add up to it
    load, engine: by how much theirs rises with the electric load, and the engine's efficiencies, of its own file
    """

    ours: float
    theirs: float
    work_mjpkm: tuple[float, float]
    speed: float
    work: float
    powers: float
    other: float
    load: float
    engine: float


def planned(car: Architecture, cycle: Cycle) -> Case:
    """A car on a cycle with a plan of least fuel: by `ecms`, or by `dp` where only gears are to be chosen."""
    problem = build_problem(car, cycle, allow_shortfall=True)
    plan = strategy_named("ecms" if "start_stop" in car.functions else "dp").solve(problem)
    trajectory = simulate(problem, plan.control)
    return Case(car, cycle, problem, certify(problem, trajectory), plan, trajectory, 0.0)


def hold_fuel(case: Case) -> FuelHeld:
    """Both tools on the car and cycle of a case."""
    told, flows, step = tell_car(case), case.dp_trajectory.flows, case.problem.table.step_s
    metres = case.cycle.distance_m

    def volume(fuel_w: Array) -> float:
        return litres(
            case.car, case.cycle, _joules(fuel_w, step) / case.car.engine.heating_value_jpkg
        )

    there = drive(told.vehicle, case.cycle, told.grade)
    ours = row_of(case, "plan", case.dp_trajectory, case.dp_s).fuel_corrected_l_per_100km
    assert ours is not None
    burns = flows["fuel_power_w"] > 0
    shaft_w = np.where(
        burns, np.maximum(flows["engine_torque_nm"] * flows["engine_speed_radps"], 0), 0
    )
    own_j, their_j = _joules(shaft_w, step), _joules(there.engine_w, step)
    running, by_power = (
        volume(flows["fuel_power_w"]),
        volume(np.where(burns, told.fuel_w(shaft_w), 0)),
    )
    at_same = by_power * their_j / own_j
    theirs = volume(there.fuel_w) + _charge(case, there)
    return FuelHeld(
        ours,
        theirs,
        (own_j / metres / 1e3, their_j / metres / 1e3),
        by_power - running,
        at_same - by_power,
        volume(there.fuel_w) - at_same,
        _charge(case, there) - (ours - running),
        _moved(case, told.vehicle, told.grade, theirs, load=True),
        _moved(case, told.vehicle, told.grade, theirs, load=False),
    )


def _joules(power_w: Array, step_s: Array) -> float:
    return float(np.sum(power_w * step_s))


def _charge(case: Case, there: OtherDrive) -> float:
    """What is stored at the end less than at the start is worth so much fuel, l/100 km."""
    if not is_hybrid(case.car):
        return 0.0
    battery = case.car.battery
    store_j = float(energy_j(battery, 1.0) - energy_j(battery, 0.0))
    kilograms = -there.soc_change * store_j * case.certificate.price_kgpj
    return litres(case.car, case.cycle, kilograms)


def _moved(
    case: Case, vehicle: dict[str, Any], grade: Array, theirs: float, *, load: bool
) -> float:
    """By how much theirs rises where the electric load, or else the engine, is that of its own file."""
    own = template(HYBRID if is_hybrid(case.car) else PLAIN)
    other, train = dict(vehicle), dict(powertrain(vehicle))
    if load:
        other["pwr_aux_base_watts"] = own["pwr_aux_base_watts"]
    else:
        engine = dict(powertrain(own)["fc"])
        for key in ("pwr_out_max_watts", "pwr_out_max_init_watts"):
            engine[key] = train["fc"][key]
        # Of its own highest power, which is half of what ours is told.
        grid = engine["eff_interp_from_pwr_out"]["data"]
        x, y = (np.array(part["data"]) for part in (grid["grid"][0], grid["values"]))
        engine["eff_interp_from_pwr_out"] = curve(np.append(x / 2, 1.0), np.append(y, y[-1]))
        other["pt_type"] = {next(iter(vehicle["pt_type"])): train | {"fc": train["fc"] | engine}}
    there = drive(other, case.cycle, grade)
    fuel = _joules(there.fuel_w, case.problem.table.step_s) / case.car.engine.heating_value_jpkg
    return litres(case.car, case.cycle, fuel) + _charge(case, there) - theirs
