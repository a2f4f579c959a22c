"""What a unit takes and tells: names, units of FMI, start values and meanings."""

from collections.abc import Callable, Sequence
from typing import Literal, NamedTuple

import numpy as np

from hevopt.car.architecture import Architecture
from hevopt.car.source import SourceLaw
from hevopt.forward import _drive_kernels as col
from hevopt.forward.commanded import CommandedCar, CommandedSteps
from hevopt.forward.run import STEP_RANGE_S

# Unit of FMI -> exponents of the base units of the SI, as the standard wants them told.
UNITS: dict[str, dict[str, int]] = {
    "1": {},
    "s": {"s": 1},
    "m": {"m": 1},
    "kg": {"kg": 1},
    "m/s": {"m": 1, "s": -1},
    "m/s2": {"m": 1, "s": -2},
    "rad/s": {"rad": 1, "s": -1},
    "kg/s": {"kg": 1, "s": -1},
    "N": {"kg": 1, "m": 1, "s": -2},
    "N.m": {"kg": 1, "m": 2, "s": -2},
    "W": {"kg": 1, "m": 2, "s": -3},
    "J": {"kg": 1, "m": 2, "s": -2},
}
Kind = Literal["real", "integer", "boolean"]


class Given(NamedTuple):
    """A parameter or an input; start: without it; low, high: what it may be."""

    name: str
    kind: Kind
    unit: str
    start: float | int | bool
    low: float | None
    high: float | None
    meaning: str


class UnitOutput(NamedTuple):
    """An output: of the car after the steps, and of what they did, which is None before the first."""

    name: str
    kind: Kind
    unit: str
    meaning: str
    value: Callable[[CommandedCar, CommandedSteps | None], float]


def parameters_of(car: Architecture, step_s: float) -> list[Given]:
    """What is fixed before the first step."""
    pack = car.battery
    return [
        Given("step_s", "real", "s", step_s, *STEP_RANGE_S,
              "the unit's own step; a communication step is a whole number of them"),
        Given("soc_start", "real", "1", car.soc_start, pack.soc_min, pack.soc_max,
              "state of charge at the start"),
        Given("speed_start_mps", "real", "m/s", 0.0, 0.0, 100.0, "speed at the start"),
    ]  # fmt: skip


def gear_names(one: CommandedCar) -> dict[str, str]:
    """Input -> gearbox whose gear is chosen beside the listed one."""
    return {f"{box.replace(' ', '_')}_gear_asked": box for box, _ in one.line.keys[0][1]}


def inputs_of(one: CommandedCar) -> list[Given]:
    """What may change from step to step; of a car without an engine, or whose machine obeys nobody, less."""
    car, gears = one.car, sorted(set(one.line.gears.tolist()))
    found = [
        Given("force_asked_n", "real", "N", 0.0, None, None,
              "force at the driven tyres that the driver asks for; below 0 braking"),
        Given("hold", "boolean", "", False, None, None,
              "brakes hold the car where it stands, and the clutch is open"),
        Given("grade", "real", "1", 0.0, None, None, "slope of the road, rise over run"),
    ]  # fmt: skip
    if len(gears) > 1:
        found.append(Given("gear_asked", "integer", "", gears[0], gears[0], gears[-1],
                           "gear that is asked for"))  # fmt: skip
    for name, box in gear_names(one).items():
        of_box = sorted({gear for _, chosen, _ in one.line.keys for b, gear in chosen if b == box})
        found.append(Given(name, "integer", "", of_box[0], of_box[0], of_box[-1],
                           f"gear of the {box}, chosen beside the listed one"))  # fmt: skip
    if not car.electric:
        found.append(Given("engine_on", "boolean", "", True, None, None,
                           "the engine is to turn; it is started and stopped by the unit"))  # fmt: skip
        found += _own_speed(one) if one.line.free is not None else _joined(one)
    return found + [
        Given(f"{name}_asked_nm", "real", "N.m", 0.0, None, None,
              f"torque of {_called(one, name)} {_while(one, name)}")
        for name in one.asked_machines
    ]  # fmt: skip


def _joined(one: CommandedCar) -> list[Given]:
    """Of an engine behind a clutch or torque converter."""
    if one.car.driveline.converter is None:
        return [Given("clutch_open", "boolean", "", False, None, None, "the driver's clutch is open")]  # fmt: skip
    return [
        Given("clutch_open", "boolean", "", False, None, None, "the gearbox is in neutral"),
        Given("lock_up_open", "boolean", "", False, None, None,
              "the lock-up clutch stays open where it would close"),
    ]  # fmt: skip


def _own_speed(one: CommandedCar) -> list[Given]:
    """Of an engine that has a speed of its own, or of what gives electricity without a shaft."""
    engine = one.car.engine
    if isinstance(engine.law, SourceLaw):
        return [Given("source_power_asked_w", "real", "W", 0.0, 0.0, float(engine.law.power_w[-1]),
                      "power that the source is to give, before its converter")]  # fmt: skip
    idle, top = engine.idle_radps, engine.speed_max_radps
    found = [
        Given("engine_speed_asked_radps", "real", "rad/s", idle, None, None,
              f"speed that the turning engine is to have, kept from {idle:.1f} to {top:.1f} rad/s"),
        Given("engine_torque_asked_nm", "real", "N.m", 0.0, None, None,
              "torque of the turning engine, kept within what it gives; below 0 its drag without fuel"),
    ]  # fmt: skip
    if one.has_lock_up:
        found.append(Given("clutch_closed", "boolean", "", False, None, None,
                           "the clutch between engine and wheels is to be closed, which it is once the speeds "
                           "meet, above idle speed"))  # fmt: skip
    return found


def _called(one: CommandedCar, name: str) -> str:
    """A machine in a sentence."""
    number = name.partition("_")[2]
    if len(one.car.machines) == 1:
        return "the machine"
    return f"machine {number or 1}"


def _while(one: CommandedCar, name: str) -> str:
    """When a machine has the torque that it is asked for, and who gives the rest."""
    if one.line.free is not None:
        return "while the clutch between engine and wheels is closed; else it follows from all else"
    if one.car.electric:
        return "within the force asked for; the first of the machines gives the rest"
    names = [machine for machine, _ in one.car.driveline.machines]
    if names.index(name) == one.line.order[0]:
        return "while the engine drives, which gives the rest of the force; else it gives what is left of it"
    return "within the force asked for while the engine does not drive; none where its engine is at rest"


def _mean(flow: str) -> Callable[[CommandedCar, CommandedSteps | None], float]:
    def value(one: CommandedCar, moved: CommandedSteps | None) -> float:
        return 0.0 if moved is None else float(np.mean(moved.books.flows[flow]))

    return value


def _mean_column(column: int) -> Callable[[CommandedCar, CommandedSteps | None], float]:
    def value(one: CommandedCar, moved: CommandedSteps | None) -> float:
        return 0.0 if moved is None else float(np.mean(moved.record[:, column]))

    return value


def _acceleration(one: CommandedCar, moved: CommandedSteps | None) -> float:
    if moved is None:
        return 0.0
    gained = 2 * (moved.record[:, col.SPEED] - moved.books.flows["speed_mps"])
    return float(np.mean(gained)) / one.step_s


def _unbalanced(one: CommandedCar, moved: CommandedSteps | None) -> float:
    return (
        0.0
        if moved is None
        else sum(float(np.mean(np.abs(r))) for r in moved.books.residuals.values())
    )


_OUTPUTS: Sequence[UnitOutput] = (
    UnitOutput("speed_mps", "real", "m/s", "speed of the car", lambda one, _: one.speed_mps),
    UnitOutput("acceleration_mps2", "real", "m/s2", "acceleration of the car, mean of the step", _acceleration),
    UnitOutput("distance_m", "real", "m", "distance driven", lambda one, _: one.standing.distance_m),
    UnitOutput("soc", "real", "1", "state of charge", lambda one, _: one.soc),
    UnitOutput("stored_j", "real", "J", "energy stored in the battery", lambda one, _: one.standing.stored_j),
    UnitOutput("fuel_kg", "real", "kg", "fuel burnt, starts included", lambda one, _: one.standing.fuel_kg),
    UnitOutput("nox_kg", "real", "kg", "NOx emitted", lambda one, _: one.standing.nox_kg),
    UnitOutput("fuel_kgps", "real", "kg/s", "fuel rate, without that of starts", _mean("fuel_kgps")),
    UnitOutput("nox_kgps", "real", "kg/s", "NOx rate", _mean("nox_kgps")),
    UnitOutput("engine_side_radps", "real", "rad/s", "speed of the engine", lambda one, _: one.side_radps),
    UnitOutput("engine_torque_nm", "real", "N.m", "torque of the engine", _mean("engine_torque_nm")),
    UnitOutput("clutch_torque_nm", "real", "N.m", "torque through the clutch", _mean("clutch_torque_nm")),
    UnitOutput("clutch_loss_w", "real", "W", "power lost in the clutch", _mean("clutch_loss_w")),
    UnitOutput("brake_power_w", "real", "W", "power of the brakes", _mean("brake_power_w")),
    UnitOutput("wheel_power_w", "real", "W", "power of the driveline at the wheels, brakes deducted",
         _mean("wheel_power_w")),
    UnitOutput("road_w", "real", "W", "power of rolling, air and slope", _mean("road_w")),
    UnitOutput("machine_electric_w", "real", "W", "electric power of all machines", _mean("machine_electric_w")),
    UnitOutput("battery_power_w", "real", "W", "power at the battery's terminals, > 0 out of it",
         _mean("battery_power_w")),
    UnitOutput("unbalanced_w", "real", "W", "power that does not add up, of all components: rounding",
               _unbalanced),
    UnitOutput("tyre_force_n", "real", "N", "force of the driven tyres", _mean_column(col.TYRE)),
    UnitOutput("tyre_slip", "real", "1", "slip of the driven tyres, 0 where they roll", _mean_column(col.SLIP)),
    UnitOutput("gear", "integer", "", "gear that is in, or being changed to; 0 before the first step",
         lambda one, moved: 0 if moved is None else moved.gear),
    UnitOutput("engine_phase", "integer", "", "0 at rest, 1 started, 2 turning, 3 stopped",
         lambda one, moved: 0 if moved is None else moved.engine),
    UnitOutput("full", "boolean", "", "engine and machine give all they may, and it is less than asked",
         lambda one, moved: moved is not None and moved.full),
    UnitOutput("off_map", "boolean", "",
         "a machine turns faster than it may, or a gearbox's map has ended: told as at that end",
         lambda one, moved: moved is not None and bool(moved.books.off_map.any())),
)  # fmt: skip


def outputs_of(one: CommandedCar) -> list[UnitOutput]:
    """What a car tells; NOx where there are data on it, and speed and torque of each machine."""
    car = one.car
    told = [each for each in _OUTPUTS if car.engine.nox_known or not each.name.startswith("nox_")]
    for name, _ in car.driveline.machines:
        called = _called(one, name)
        speed, torque = f"{name}_speed_radps", f"{name}_torque_nm"
        told += [
            UnitOutput(speed, "real", "rad/s", f"speed of {called}", _mean(speed)),
            UnitOutput(
                torque, "real", "N.m", f"torque of {called}, braking below 0", _mean(torque)
            ),
        ]
    return told
