"""A real car as a vehicle of FASTSim: engine, machine, battery and transmission by efficiencies over power."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from hevopt.car.architecture import Architecture
from hevopt.car.engine import Engine
from hevopt.car.machine import Machine
from hevopt.display.facts import Shown
from hevopt.problem.arrays import Array
from hevopt.problem.battery import energy_j
from hevopt.problem.problem import Trajectory
from hevopt.reproduction.cross_tool.tool import HYBRID, PLAIN, curve, powertrain, template
from hevopt.reproduction.cross_tool.wheels import road_of, tell
from hevopt.studies.case import Case

# Fractions of the highest power told. The engine is told twice its own highest, at the efficiency of that, so that
# no trace fails: our model counts the steps that it cannot follow.
_FRACTIONS: Array = np.append(0.0, np.geomspace(5e-4, 1.0, 160))
_BEYOND = 2.0
_SPEEDS = 201
_LEAST_EFFICIENCY = 1e-6
_NO_LIMIT_W = 1e6


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class ToldCar(Shown):
    """What FASTSim is given. grade: (step,) rise over run; fuel_w: the engine's fuel over its power"""

    vehicle: dict[str, Any]
    grade: Array
    fuel_w: Callable[[Array], Array]


def is_hybrid(car: Architecture) -> bool:
    """Whether a machine drives the car."""
    return "power_management" in car.functions


def tell_car(case: Case) -> ToldCar:
    """The car of a case; efficiencies that FASTSim has as one figure are means of the case's optimal plan."""
    car, signals = case.car, case.problem.table.signals
    assert signals is not None  # build_problem gives them
    vehicle = template(HYBRID if is_hybrid(car) else PLAIN)
    grade = tell(vehicle, car, road_of(car), signals.speed_mps)
    vehicle["chassis"]["wheel_fric_coef"] = 10.0
    vehicle["pwr_aux_base_watts"] = car.vehicle.auxiliary_power_w
    train = powertrain(vehicle)
    train["transmission"]["eff_interp"] = transmission_efficiency(car)
    most_w, fuel_w = power_law(car.engine)
    asked = _FRACTIONS * _BEYOND * most_w
    own = np.clip(asked, 1.0, most_w)
    efficiency = np.maximum(own / fuel_w(own), _LEAST_EFFICIENCY)
    efficiency[0] = _LEAST_EFFICIENCY
    train["fc"].update(
        eff_interp_from_pwr_out=curve(_FRACTIONS, efficiency),
        pwr_out_max_watts=float(asked[-1]), pwr_out_max_init_watts=float(asked[-1]),
        pwr_ramp_lag_seconds=1.0, pwr_idle_fuel_watts=float(fuel_w(np.zeros(1))[0]),
    )  # fmt: skip
    if is_hybrid(car):
        _electric(train, case)
    else:
        train["alt_eff"] = _alternator_efficiency(car)
    return ToldCar(vehicle, grade, fuel_w)


def power_law(engine: Engine) -> tuple[float, Callable[[Array], Array]]:
    """An engine's highest power, and its least fuel power over power, W, at whichever speed takes least."""
    speeds = np.linspace(engine.idle_radps, engine.speed_max_radps, _SPEEDS)
    most_nm = np.nan_to_num(engine.covered_nm(speeds))
    most_w = float(np.max(most_nm * speeds))
    powers = _FRACTIONS * most_w
    torques = powers[:, None] / speeds
    allowed = torques <= most_nm * (1 + 1e-12)
    fuel = engine.fuel_kgps(np.minimum(torques, most_nm), np.broadcast_to(speeds, torques.shape))
    least = np.nanmin(np.where(allowed, fuel, np.nan), axis=1) * engine.heating_value_jpkg
    return most_w, lambda power_w: np.interp(power_w, powers, least)


def transmission_efficiency(car: Architecture) -> float:
    """The one of a gearbox's gears, as their mean, or of the gears between ring or machine and wheels."""
    if car.gearbox is not None:
        return float(np.mean(car.gearbox.efficiency[1:]))
    coupling = car.contents["coupling"]
    found = [part["efficiency"] for part in coupling.get("parts", ()) if "efficiency" in part]
    return float(np.mean(found)) if found else float(coupling.get("final_drive_efficiency", 1.0))


def _alternator_efficiency(car: Architecture) -> float:
    (machine,), load_w = car.machines, car.vehicle.auxiliary_power_w
    speed = np.array([2 * car.engine.idle_radps])
    return float(load_w / -(machine.generating_nm(load_w, speed) * speed)[0])


def _electric(train: dict[str, Any], case: Case) -> None:
    car, trajectory = case.car, case.dp_trajectory
    motor = car.machines[-1]
    # FASTSim takes the efficiency at no power for generating, and gives up where one at another power is lower.
    generating = generating_efficiency(trajectory)
    efficiency = np.append(generating, np.maximum(_motoring(motor), generating))
    train["em"].update(
        eff_interp_achieved=curve(_FRACTIONS, efficiency), eff_interp_at_max_input=None,
        pwr_out_max_watts=motor.power_max_w,
    )  # fmt: skip
    battery = car.battery
    store_j = float(energy_j(battery, 1.0) - energy_j(battery, 0.0))
    train["res"].update(
        eff_interp={"Constant": battery_efficiency(trajectory)}, energy_capacity_joules=store_j,
        min_soc=battery.soc_min, max_soc=battery.soc_max, pwr_out_max_watts=_NO_LIMIT_W,
    )  # fmt: skip
    train["res"]["state"]["soc"] = case.problem.soc_start


def _motoring(motor: Machine) -> Array:
    """(fraction - 1,) mechanical over electric power, at the best speed of each power but none."""
    speeds = np.linspace(0.0, motor.speed_max_radps, _SPEEDS)[1:]
    powers = _FRACTIONS[1:] * motor.power_max_w
    torques = powers[:, None] / speeds
    loss = motor.loss_w(torques, np.broadcast_to(speeds, torques.shape))
    loss = np.where(torques <= motor.limit_nm(speeds) * (1 + 1e-9), loss, np.nan)
    best: Array = powers / (powers + np.nanmin(loss, axis=1))
    return best


def generating_efficiency(trajectory: Trajectory) -> float:
    """Electric over mechanical energy of all machines together while a plan brakes; 1 where it never does."""
    flows = trajectory.flows
    mechanical, electric = flows["machine_power_w"], flows["machine_electric_w"]
    here = (flows["wheel_power_w"] < 0) & (mechanical < 0) & (electric < 0)
    step = trajectory.problem.table.step_s[here]
    if not here.any():
        return 1.0
    return float(np.sum(electric[here] * step) / np.sum(mechanical[here] * step))


def battery_efficiency(trajectory: Trajectory) -> float:
    """Of one way, store to terminals or back: the root of a plan's round trip; 1 where it does not go both ways."""
    step, power = trajectory.problem.table.step_s, trajectory.battery_power_w
    stored = -np.diff(trajectory.energy_j)
    out, into = (power > 0) & (stored > 0), (power < 0) & (stored < 0)
    if not (out.any() and into.any()):
        return 1.0
    giving = np.sum((power * step)[out]) / np.sum(stored[out])
    taking = np.sum(stored[into]) / np.sum((power * step)[into])
    return float(np.sqrt(giving * taking))
