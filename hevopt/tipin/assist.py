"""A machine that fills what the engine lacks: how much it can, and what it takes from the battery.

The control unit of the hybrid knows what the driver asks for, the steady map's torque, and what the engine gives;
the machine adds the difference at once, as far as its torque, its power and the battery let it. Its path to the
wheels is its own: crankshaft or gearbox input, gearbox output, or even shaft.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hevopt.car.architecture import Architecture
from hevopt.display.facts import Shown
from hevopt.errors import DataError
from hevopt.mean_value import states as s
from hevopt.mean_value.parameters import ASSIST, Model, with_curve
from hevopt.mean_value.paths import Paths, strongest
from hevopt.mean_value.run import SAMPLE_S, Run
from hevopt.problem._battery_kernels import trace
from hevopt.problem.battery import energy_j, power_limits_w, soc

Array = NDArray[np.float64]

_SPEEDS, _TORQUES = 400, 500
_FASTEST_RADPS = 1e4


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Helper(Shown):
    """A machine of a car, by its place, as the wheels see it.

    limit_nm, by_machine_nm: (speed,) most torque by machine and battery, and by the machine alone, over its speed
    """

    machine: int
    ratio_radpm: float
    efficiency: float
    speed_radps: Array
    limit_nm: Array
    by_machine_nm: Array


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Assist(Shown):
    """What a machine did in the first 5 s, or until it was needed no more.

    filled: share of the torque hole of this very run that it filled, at the wheels
    limited_by: what kept it from filling the rest: "nothing", "machine", "battery"
    """

    machine: str
    torque_nm: Array
    electric_w: Array
    soc: Array
    work_j: float
    electric_j: float
    chemical_j: float
    peak_w: float
    filled: float
    limited_by: str


def help_of(architecture: Architecture, found: Paths, speed_mps: float) -> Helper:
    """What the car's machine, of several the one that adds most at a speed, can add by its path.

    DataError where none may boost.
    """
    n = strongest(architecture, found, speed_mps)
    path = None if n is None else found.machines[n]
    if "e_boost" not in architecture.functions or path is None or n is None:
        why = "no machine is joined to the wheels in this gear"
        if "e_boost" not in architecture.functions:
            why = "e_boost is none of this car's functions"
        elif any(found.machines):
            why = "in this gear and at this speed its machine would turn faster than it may"
        raise DataError(
            f"{architecture.name}: {why}; choose a car whose machine may help, such as C2, or leave --e-boost out"
        )
    machine, radius = architecture.machines[n], architecture.vehicle.tyre_radius_m
    top = machine.speed_max_radps if np.isfinite(machine.speed_max_radps) else _FASTEST_RADPS
    speed = np.linspace(0.0, top, _SPEEDS)
    by_machine = np.minimum(machine.limit_nm(speed), machine.limit_nm(speed[1:]).max())
    torque = np.linspace(0.0, 1.0, _TORQUES)[:, None] * by_machine
    taken = torque * speed + machine.loss_w(torque, np.broadcast_to(speed, torque.shape))
    most = power_limits_w(architecture.battery)[1] - architecture.vehicle.auxiliary_power_w
    possible = np.where(taken <= most, torque, 0.0).max(axis=0)
    # Between its points a curve of constant power runs above it.
    middle = machine.limit_nm((speed[1:] + speed[:-1]) / 2)
    chord = (by_machine[1:] + by_machine[:-1]) / 2
    possible *= np.min(middle / chord, initial=1.0, where=chord > middle)
    # Beyond its highest speed the machine gives nothing.
    ends = np.append(speed, top * (1 + 1e-6))
    return Helper(
        n,
        path.ratio / radius,
        path.efficiency,
        ends,
        np.append(possible, 0.0),
        np.append(by_machine, 0.0),
    )


def assisted(model: Model, helper: Helper) -> Model:
    """The model with the machine at hand."""
    car = model.car._replace(
        assist_ratio_radpm=helper.ratio_radpm, assist_efficiency=helper.efficiency
    )
    curves = with_curve(model.curves, ASSIST, helper.speed_radps, helper.limit_nm)
    return model._replace(car=car, curves=curves)


def helping(architecture: Architecture, helper: Helper, run: Run) -> Assist:
    """What the machine did in a run, with the true battery; DataError where its charge leaves the window."""
    machine, battery = architecture.machines[helper.machine], architecture.battery
    speed = helper.ratio_radpm * run.states[:, s.ROAD]
    torque = run["assist_nm"]
    mechanical = torque * speed
    electric = mechanical + np.where(torque > 0, machine.loss_w(torque, speed), 0.0)
    electric = electric + architecture.vehicle.auxiliary_power_w
    start = float(energy_j(battery, architecture.soc_start))
    count = len(electric) - 1
    stored = trace(start, np.zeros(count), electric[:-1], np.full(count, SAMPLE_S), battery.arrays)
    if not np.isfinite(stored).all() or stored[-1] < battery.granted_window_j[0]:
        raise DataError(
            f"{architecture.source}: the battery is at the lower end of its window before the tip-in is over; "
            "start with more charge (battery.soc.start)"
        )
    car = run.model.car
    wanted = np.maximum(run["full_load_nm"] * run["pedal"] - run["torque_nm"], 0.0)
    wanted *= car.ratio_radpm * car.efficiency / (helper.ratio_radpm * helper.efficiency)
    short = wanted - torque > 1e-6 * np.maximum(wanted, 1.0)
    by_machine = np.interp(speed, helper.speed_radps, helper.by_machine_nm)
    limited = "nothing"
    if short.any():
        limited = "machine" if (torque[short] >= 0.999 * by_machine[short]).all() else "battery"
    return Assist(
        machine=machine.name,
        torque_nm=torque,
        electric_w=electric,
        soc=soc(battery, stored),
        work_j=float(np.sum(mechanical) * SAMPLE_S),
        electric_j=float(np.sum(electric) * SAMPLE_S),
        chemical_j=float(stored[0] - stored[-1]),
        peak_w=float(mechanical.max()),
        filled=float(torque.sum() / wanted.sum()) if wanted.sum() > 0 else 1.0,
        limited_by=limited,
    )
