"""What a driven car burnt, drew and lost: powers of every step from what acted in it, and what does not add up.

With mean speeds of a step all changes of kinetic energy are exact, so that every component balances to rounding.
Fuel, NOx, the machine's loss and the battery are the car's own, worked out on what the loop returns.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from hevopt.car.architecture import Architecture
from hevopt.car.machine import Machine
from hevopt.display.facts import Shown
from hevopt.forward import _breathing_kernels as gas
from hevopt.forward import _drive_kernels as col
from hevopt.forward import _motor_kernels as motor
from hevopt.forward.burning import breathed, burnt_kgps
from hevopt.forward.converting import converting
from hevopt.forward.lines import Line
from hevopt.forward.map_ends import within_map
from hevopt.forward.slipping import slipping
from hevopt.problem._battery_kernels import trace
from hevopt.problem.arrays import Array, Flags
from hevopt.problem.battery import step_flows

CAUSES = {motor.LAUNCH: "launch", motor.CHANGE: "change", motor.START: "start", motor.NONE: "other"}


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Books(Shown):
    """Powers, speeds and torques of every step, W, rad/s, Nm, (step,) by the names of the backward flows and more.

    residuals: component -> (step,) power in less power out less loss
    energy_j: (step + 1,) stored energy; off_map: (step,) where a measured map of the engine or machine ends
    """

    flows: Mapping[str, Array]
    residuals: Mapping[str, Array]
    energy_j: Array
    off_map: Flags


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Turning(Shown):
    """Speeds around every step. wheel, side: (step + 1,); units: (unit, step + 1); all rad/s.

    by_wheel: of `units` the part that the wheels turn; spin: (step + 1,) of the wheels beyond rolling
    """

    wheel: Array
    side: Array
    units: Array
    by_wheel: Array
    spin: Array

    @staticmethod
    def mean(values: Array) -> Array:
        """Of a step, (..., step)."""
        return (values[..., 1:] + values[..., :-1]) / 2


def turning_of(
    line: Line, record: Array, start: tuple[float, float], radius_m: float, before: Array | None
) -> Turning:
    """Speeds of wheels, engine's side and all units; start: speed of the car and of the engine's side.

    before: as of books_of
    """
    spin = np.append(0.0 if before is None else before[col.SPIN], record[:, col.SPIN])
    wheel = np.append(start[0], record[:, col.SPEED]) / radius_m + spin
    side = np.append(start[1], record[:, col.SIDE])
    at_start = record[:1, [col.WAY, col.WAY, col.BLEND]] * [1, 1, 0]
    if before is not None:
        at_start = before[None, [col.WAY, col.FROM_WAY, col.BLEND]]
    moved = np.vstack([at_start, record[:, [col.WAY, col.FROM_WAY, col.BLEND]]])
    way, from_way, blend = moved[:, 0].astype(int), moved[:, 1].astype(int), moved[:, 2:]
    by_wheel, by_side = (
        (rate[way] + blend * (rate[from_way] - rate[way])).T
        for rate in (line.ways.wheel, line.ways.side)
    )
    return Turning(wheel, side, by_wheel * wheel + by_side * side, by_wheel * wheel, spin)


def books_of(
    car: Architecture, line: Line, record: Array, start: tuple[float, float, float], step_s: float,
    load_w: Array, breath: Array | None = None, before: Array | None = None, slips: bool = False,
) -> Books:  # fmt: skip
    """The books of a run; start: the car's speed, the engine side's and stored energy before the first step.

    load_w: (step,) electric load
    breath: (step, column) of a mean-value engine, see _breathing_kernels, whose fuel counts
    before: (column,) what the step before the first recorded; None where the car begins in its gear
    slips: whether the tyres' force came by slip
    """
    turning = turning_of(line, record, start[:2], car.vehicle.tyre_radius_m, before)
    mean = turning.mean
    w, n, units = mean(turning.wheel), mean(turning.side), mean(turning.units)
    inertia = line.ways.inertia_kgm2[:, None] * np.diff(turning.units**2, axis=1) / (2 * step_s)
    rolls = w - mean(turning.spin)
    flows = _driven(car, line, record, rolls, n, units, inertia, step_s)
    if slips:
        flows |= slipping(car, record, turning.wheel, turning.spin, flows["kinetic_w"], step_s)
    flows["auxiliary_power_w"] = load_w
    flows |= _joints(line, record, turning, step_s)
    turns = record[:, col.PHASE] == motor.TURNING
    own = None if breath is None else breath[:, gas.FUEL] / step_s
    flows |= _burnt(car, flows, turns, turning.side, own)
    if breath is not None:
        flows |= breathed(flows, breath)
    spin = max(machine.spin_efficiency for machine in car.machines)
    flows["starter_electric_w"] = starter = np.maximum(flows["start_w"], 0.0) / spin
    electric = flows["machine_electric_w"] + flows["auxiliary_power_w"] + starter
    terminal = car.terminal_w(electric)
    if car.converter is not None:
        flows["converter_loss_w"] = car.converter.loss_w(electric)
    energy_j = trace(
        start[2], np.zeros(len(record)), terminal, np.full(len(record), step_s), car.battery.arrays
    )
    flows["battery_power_w"] = terminal
    losses = step_flows(car.battery, energy_j[:-1], energy_j[1:], terminal, step_s)
    flows |= {name: losses[name] for name in ("battery_chemical_w", "battery_loss_w")}
    off_map = np.isnan(flows["fuel_power_w"]) | np.isnan(flows["machine_loss_w"])
    off_map |= _off_gearbox(car, line, record, turning, step_s)
    for (name, _), machine in zip(car.driveline.machines, car.machines, strict=True):
        speed = flows[f"{name}_speed_radps"]
        off_map |= within_top(machine, speed) != speed
    return Books(flows, _residuals(flows), energy_j, off_map)


def _driven(
    car: Architecture,
    line: Line,
    record: Array,
    w: Array,
    n: Array,
    units: Array,
    inertia: Array,
    step_s: float,
) -> dict[str, Array]:
    """Mechanical powers but for those of the joints."""
    radius, phase = car.vehicle.tyre_radius_m, record[:, col.PHASE].astype(int)
    torque, given = record[:, col.ENGINE], machines_nm(record)
    turns = phase == motor.TURNING
    clutch = record[:, col.CLUTCH] * (n - units[-1])
    cause = record[:, col.CAUSE].astype(int)
    speed = w * radius
    before = np.append(2 * speed[0] - record[0, col.SPEED], record[:-1, col.SPEED])
    fluid = converting(record, before, n, units[-1], car.engine.idle_radps)
    flows = {
        "speed_mps": speed,
        "engine_torque_nm": np.where(turns, torque, 0.0),
        "engine_speed_radps": n,
        "start_w": np.where(phase == motor.STARTING, torque * n, 0.0),
        "stop_w": np.where(turns | (phase == motor.STARTING), 0.0, torque * n),
        "engine_inertia_w": inertia[0],
        "machine_power_w": np.sum(given * units[1:-1], axis=0),
        "machine_inertia_w": np.sum(inertia[1:-1], axis=0),
        "clutch_torque_nm": record[:, col.CLUTCH],
        "clutch_loss_w": clutch + fluid["torque_converter_loss_w"],
        "brake_power_w": record[:, col.BRAKE] * w,
        "held_w": record[:, col.HELD] * w,
        "wheel_power_w": record[:, col.WHEEL] * w,
        "tyre_lag_w": record[:, col.WHEEL] * w - record[:, col.TYRE] * speed,
        "road_w": record[:, col.ROAD] * speed,
        "kinetic_w": car.vehicle.equivalent_mass_kg
        * (record[:, col.SPEED] ** 2 - before**2)
        / (2 * step_s),
    }
    for place, (machine, _) in enumerate(car.driveline.machines):
        unit = line.order.index(place)
        flows[f"{machine}_torque_nm"] = given[unit]
        flows[f"{machine}_speed_radps"] = units[1 + unit]
    if car.driveline.converter is not None:
        flows |= fluid
    for number, name in CAUSES.items():
        flows[f"clutch_{name}_w"] = np.where(cause == number, clutch, 0.0)
    return flows


def machines_nm(record: Array) -> Array:
    """(machine, step) torques of all machines, in the order of a Line."""
    return np.vstack([record[:, col.MACHINE], record[:, col.COLUMNS :].T])


def _joints(line: Line, record: Array, turning: Turning, step_s: float) -> dict[str, Array]:
    """Losses of gearbox and gears: what enters each joint, less what it passes on.

    A torque enters with the speed of its unit, which while a ratio moves is not yet that of its gear. No ratio
    moves where the engine has a speed of its own; a joint may turn by both speeds there.
    """
    ways, way = line.ways, record[:, col.WAY].astype(np.int64)
    variant = record[:, col.VARIANT].astype(np.int64)
    applied = _applied(line, record, turning, step_s)
    applied[-1] -= record[:, col.LOST]
    power = applied * turning.mean(turning.by_wheel)
    wheel, side = turning.mean(turning.wheel), turning.mean(turning.side)
    settled = ways.wheel
    per_wheel = np.divide(1.0, settled, out=np.zeros_like(settled), where=settled != 0)
    result = {"gearbox_loss_w": np.zeros(len(way)), "gear_loss_w": np.zeros(len(way))}
    for j, name in enumerate(line.losses):
        sense, eta = ways.sense[way, j], ways.efficiency[way, j]
        if line.free is None:
            share = ways.load[:, :, j] * ways.sense[:, None, j, :1] * per_wheel[:, None]
            entering = np.einsum("nu,un->n", share[way, variant], power)
        else:
            through = np.einsum("nu,un->n", ways.load[way, variant, j], applied)
            entering = through * (sense[:, 0] * wheel + sense[:, 1] * side)
        backward = (variant >> j & 1).astype(bool)
        result[f"{name}_loss_w"] += entering * np.where(backward, 1 - 1 / eta, 1 - eta)
    result["gearbox_loss_w"] += record[:, col.LOST] * turning.mean(turning.by_wheel[-1])
    return result


def _applied(line: Line, record: Array, turning: Turning, step_s: float) -> Array:
    """(unit, step) torques on the units, less what their own inertia takes."""
    passed = record[:, col.CLUTCH] + record[:, col.TURBINE]
    applied = np.vstack([record[:, col.ENGINE], machines_nm(record), passed])
    inertia = line.ways.inertia_kgm2[:, None]
    less: Array = applied - inertia * np.diff(turning.units, axis=1) / step_s
    return less


def _off_gearbox(
    car: Architecture, line: Line, record: Array, turning: Turning, step_s: float
) -> Flags:
    """(step,) where a gearbox with a map has no data for what enters it."""
    loss, ways = None if car.gearbox is None else car.gearbox.loss, line.ways
    if loss is None:
        return np.zeros(len(record), dtype=bool)
    way, variant = (record[:, c].astype(np.int64) for c in (col.WAY, col.VARIANT))
    per_unit = ways.load[way, variant, ways.lost.joint]
    entering = np.einsum("nu,un->n", per_unit, _applied(line, record, turning, step_s))
    speed = turning.mean(turning.by_wheel[-1])
    return loss.unknown(line.gears[way], speed, entering[:, None])[:, 0]


def _burnt(
    car: Architecture, flows: Mapping[str, Array], turns: Flags, side_radps: Array, own_kgps: Array | None
) -> dict[str, Array]:  # fmt: skip
    """Fuel, NOx and the machine's electric power, by the car's own components; own_kgps: fuel not by the map."""
    torque, speed = within_map(car.engine, flows["engine_torque_nm"], side_radps, turns)
    mapped, nox = burnt_kgps(car.engine, torque, np.where(turns, speed, 1.0))
    fuel = np.where(turns, mapped, 0.0)
    by_map = {} if own_kgps is None else {"map_fuel_kgps": fuel}
    fuel = fuel if own_kgps is None else own_kgps
    nox = np.where(fuel == 0, 0.0, nox)
    power = fuel * car.engine.heating_value_jpkg
    loss = np.zeros(len(torque))
    for (name, _), machine in zip(car.driveline.machines, car.machines, strict=True):
        loss = loss + machine.loss_w(
            flows[f"{name}_torque_nm"], within_top(machine, flows[f"{name}_speed_radps"])
        )
    return by_map | {
        "fuel_kgps": fuel,
        "nox_kgps": nox,
        "fuel_power_w": power,
        "engine_loss_w": power - torque * speed,
        "machine_loss_w": loss,
        "machine_electric_w": flows["machine_power_w"] + loss,
    }


def within_top(machine: Machine, speed_radps: Array) -> Array:
    """A machine's speeds, its highest where they are beyond that."""
    return np.clip(speed_radps, -machine.speed_max_radps, machine.speed_max_radps)


def _residuals(f: Mapping[str, Array]) -> dict[str, Array]:
    engine_w = f["engine_torque_nm"] * f["engine_speed_radps"] + f["start_w"] + f["stop_w"]
    inertia_w = f["engine_inertia_w"] + f["machine_inertia_w"]
    lost_w = f["clutch_loss_w"] + f["gearbox_loss_w"] + f["gear_loss_w"] + f["brake_power_w"]
    return {
        "driveline": engine_w + f["machine_power_w"] + f["held_w"] - inertia_w - lost_w
        - f["wheel_power_w"],
        "road": f["wheel_power_w"] - f["tyre_lag_w"] - f.get("tyre_slip_w", 0.0) - f.get("tyre_spring_w", 0.0)
        - f["road_w"] - f["kinetic_w"],
        "machines": f["machine_electric_w"] - f["machine_power_w"] - f["machine_loss_w"],
        "electric bus": f["battery_power_w"] - f["machine_electric_w"] - f["auxiliary_power_w"]
        - f["starter_electric_w"] - f.get("converter_loss_w", 0.0),
        "battery": f["battery_chemical_w"] - f["battery_power_w"] - f["battery_loss_w"],
    }  # fmt: skip
