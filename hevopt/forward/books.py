"""What a driven car burnt, drew and lost: powers of every step from what acted in it, and what does not add up.

With mean speeds of a step all changes of kinetic energy are exact, so that every component balances to rounding.
Fuel, NOx, the machine's loss and the battery are the car's own, worked out on what the loop returns.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from hevopt.car.architecture import Architecture
from hevopt.car.machine import Machine
from hevopt.display.facts import Shown
from hevopt.forward import _books_kernels as book
from hevopt.forward import _breathing_kernels as gas
from hevopt.forward import _drive_kernels as col
from hevopt.forward import _motor_kernels as motor
from hevopt.forward.burning import breathed
from hevopt.forward.converting import converting
from hevopt.forward.lines import Line
from hevopt.forward.map_ends import within_map
from hevopt.forward.slipping import slipping
from hevopt.problem._battery_kernels import followed
from hevopt.problem.arrays import Array, Flags, Indices
from hevopt.problem.late import Late

# Steps for which a component is asked at once: what memory close by holds.
_TOGETHER = 16384
_FLOWS = {
    "speed_mps": book.SPEED, "engine_torque_nm": book.ENGINE_NM, "engine_speed_radps": book.ENGINE_RADPS,
    "start_w": book.START, "stop_w": book.STOP, "engine_inertia_w": book.ENGINE_INERTIA,
    "machine_power_w": book.MACHINE, "machine_inertia_w": book.MACHINE_INERTIA,
    "clutch_torque_nm": book.CLUTCH_NM, "clutch_loss_w": book.CLUTCH_LOSS, "brake_power_w": book.BRAKE,
    "held_w": book.HELD, "wheel_power_w": book.WHEEL, "tyre_lag_w": book.LAG, "road_w": book.ROAD,
    "kinetic_w": book.KINETIC,
}  # fmt: skip
_CAUSES = {
    "clutch_launch_w": book.LAUNCH,
    "clutch_change_w": book.CHANGE,
    "clutch_start_w": book.STARTED,
    "clutch_other_w": book.OTHER,
}
_JOINTS = {"gearbox_loss_w": book.GEARBOX_LOSS, "gear_loss_w": book.GEAR_LOSS}


class Recorded(NamedTuple):
    """What the record says of every step: speed after it, the engine's phase, the way of a Line, all is given."""

    speed_mps: Array
    engine: Indices
    way: Indices
    full: Flags


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Books(Shown):
    """Powers, speeds and torques of every step, W, rad/s, Nm, (step,) by the names of the backward flows and more.

    residuals: component -> (step,) power in less power out less loss, worked out where they are first asked for
    energy_j, soc: (step + 1,) stored energy and state of charge
    off_map: (step,) where a measured map of the engine or machine ends
    """

    flows: Mapping[str, Array]
    residuals: Mapping[str, Array]
    energy_j: Array
    soc: Array
    off_map: Flags
    recorded: Recorded


def books_of(
    car: Architecture, line: Line, record: Array, start: tuple[float, float, float], step_s: float,
    load_w: Array, breath: Array | None = None, before: Array | None = None, slips: bool = False,
) -> Books:  # fmt: skip
    """The books of a run; start: the car's speed, the engine side's and stored energy before the first step.

    load_w: (2, step) or (2, 1) electric load, engine at rest and not
    breath: (step, column) of a mean-value engine, see _breathing_kernels, whose fuel counts
    before: (column,) what the step before the first recorded; None where the car begins in its gear
    slips: whether the tyres' force came by slip
    """
    begin = _begin(record, start, before)
    rows = _booked(car, line, record, begin, step_s)
    flows = _mechanical(car, line, record, begin, rows)
    if slips:
        flows |= slipping(car, record, begin, flows["kinetic_w"], step_s)
    engine, way = rows[[book.PHASE, book.WAY]].astype(np.int64)
    recorded = Recorded(rows[book.REACHED], engine, way, rows[book.FULL] > 0)
    flows["auxiliary_power_w"] = np.where(engine == motor.REST, load_w[0], load_w[1])
    flows |= {name: rows[row] for name, row in _JOINTS.items()}
    turns = engine == motor.TURNING
    own = None if breath is None else breath[:, gas.FUEL] / step_s
    side_radps = np.append(begin.side_radps, record[:, col.SIDE])
    flows |= _burnt(car, flows, turns, side_radps, own)
    off_map = _drawn(car, flows)
    if breath is not None:
        flows |= breathed(flows, breath)
    spin = max(machine.spin_efficiency for machine in car.machines)
    flows["starter_electric_w"] = starter = np.maximum(flows["start_w"], 0.0) / spin
    electric = flows["machine_electric_w"] + flows["auxiliary_power_w"] + starter
    terminal = car.terminal_w(electric)
    if car.converter is not None:
        flows["converter_loss_w"] = car.converter.loss_w(electric)
    energy_j, soc, chemical, loss = followed(start[2], terminal, step_s, car.battery.arrays)
    flows["battery_power_w"] = terminal
    flows["battery_chemical_w"], flows["battery_loss_w"] = chemical[:-1], loss[:-1]
    off_map |= np.isnan(flows["fuel_power_w"])
    if line.mapped:
        off_map |= _off_gearbox(car, line, way, rows)
    return Books(flows, Late(lambda: _residuals(flows)), energy_j, soc, off_map, recorded)


def _begin(record: Array, start: tuple[float, float, float], before: Array | None) -> book.Begin:
    """The car before the first step."""
    if before is None:
        way = int(record[0, col.WAY])
        return book.Begin(float(start[0]), float(start[1]), 0.0, way, way, 0.0)
    ways = int(before[col.WAY]), int(before[col.FROM_WAY])
    return book.Begin(
        float(start[0]), float(start[1]), float(before[col.SPIN]), *ways, float(before[col.BLEND])
    )


def _booked(
    car: Architecture, line: Line, record: Array, begin: book.Begin, step_s: float
) -> Array:
    """(row, step) of _books_kernels."""
    units, vehicle = len(line.ways.inertia_kgm2), car.vehicle
    rows = np.empty((book.ROWS + 2 * len(car.machines), len(record)))
    kinds = book.Kinds(np.array([name == "gearbox" for name in line.losses]), line.free is None)
    body = float(vehicle.tyre_radius_m), float(vehicle.equivalent_mass_kg)
    book.fill(
        line.ways, book.shares_of(line.ways), kinds, body, record, begin, float(step_s),
        np.zeros((2, 2, units)), np.zeros((2, units)), rows,
    )  # fmt: skip
    return rows


def _mechanical(
    car: Architecture, line: Line, record: Array, begin: book.Begin, rows: Array
) -> dict[str, Array]:
    """Mechanical flows but for those of the joints."""
    flows = {name: rows[row] for name, row in _FLOWS.items()}
    for place, (machine, _) in enumerate(car.driveline.machines):
        first = book.ROWS + 2 * line.order.index(place)
        flows[f"{machine}_torque_nm"], flows[f"{machine}_speed_radps"] = rows[first : first + 2]
    if car.driveline.converter is not None:
        before_mps = np.append(begin.speed_mps, record[:-1, col.SPEED])
        side, turbine = flows["engine_speed_radps"], rows[book.OUTPUT]
        flows |= converting(record, before_mps, side, turbine, car.engine.idle_radps)
    return flows | {name: rows[row] for name, row in _CAUSES.items()}


def _off_gearbox(car: Architecture, line: Line, way: Indices, rows: Array) -> Flags:
    """(step,) where a gearbox with a map has no data for what enters it."""
    assert car.gearbox is not None and car.gearbox.loss is not None  # as the line is mapped
    unknown = car.gearbox.loss.unknown(
        line.gears[way], rows[book.OUTPUT], rows[book.ENTERING][:, None]
    )
    return unknown[:, 0]


def _burnt(
    car: Architecture, flows: Mapping[str, Array], turns: Flags, side_radps: Array, own_kgps: Array | None
) -> dict[str, Array]:  # fmt: skip
    """Fuel and NOx by the car's own engine; own_kgps: fuel not by the map."""
    torque = flows["engine_torque_nm"]
    by_map, nox, work_w = np.zeros((3, len(torque)))
    turning = np.flatnonzero(turns)
    for first in range(0, len(turning), _TOGETHER):
        some = turning[first : first + _TOGETHER]
        read = within_map(car.engine, torque[some], side_radps[some], side_radps[some + 1])
        by_map[some], nox[some] = read.fuel_kgps, read.nox_kgps
        work_w[some] = read.torque_nm * read.speed_radps
    fuel = by_map if own_kgps is None else own_kgps
    if own_kgps is not None:
        nox = np.where(own_kgps == 0, 0.0, nox)
    power = fuel * car.engine.heating_value_jpkg
    return ({} if own_kgps is None else {"map_fuel_kgps": by_map}) | {
        "fuel_kgps": fuel,
        "nox_kgps": nox,
        "fuel_power_w": power,
        "engine_loss_w": power - work_w,
    }


def _drawn(car: Architecture, flows: dict[str, Array]) -> Flags:
    """Loss and electric power of all machines, put among the flows; (step,) where data of one of them end."""
    steps = len(flows["machine_power_w"])
    loss, off_map = np.zeros(steps), np.zeros(steps, dtype=bool)
    for (name, _), machine in zip(car.driveline.machines, car.machines, strict=True):
        torque, speed = flows[f"{name}_torque_nm"], flows[f"{name}_speed_radps"]
        for first in range(0, steps, _TOGETHER):
            some = slice(first, first + _TOGETHER)
            within = within_top(machine, speed[some])
            loss[some] += machine.loss_w(torque[some], within)
            off_map[some] |= within != speed[some]
    flows["machine_loss_w"], flows["machine_electric_w"] = loss, flows["machine_power_w"] + loss
    off_map |= np.isnan(loss)
    return off_map


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
