"""The driven car with the mean-value engine: its gas marches along, and limits what the engine gives. Compiled.

One step of the car, of a length h, with the gas in steps of a whole part of it:

    1. the torque of full pedal and that of no fuel, by the gas as it is at the step's beginning: what it can give
    2. the step of the car, as with the steady map, which takes a torque T between them and moves the engine's speed
    3. the gas over h: speed from its value before to the one behind, fuel so that the cylinders give T, and the
       control unit at the pedal that the driver has, what cannot be given included

So the car sees air that is h old at most. Where smoke limits the fuel below T while the gas moves, torque
lacks, and GIVEN says how much.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hevopt._compile import compiled
from hevopt.forward import _drive_kernels as drive
from hevopt.forward import _free_loop_kernels as free
from hevopt.forward import _motor_kernels as motor
from hevopt.forward import _pull_kernels as pulling
from hevopt.forward._acting_kernels import LoopCar, LoopTask
from hevopt.forward._contact_kernels import pace_of
from hevopt.forward._free_kernels import FreeCar, FreeCourse
from hevopt.forward._limits_kernels import Gives, Limits, by_map
from hevopt.mean_value import states as s
from hevopt.mean_value._gas_kernels import curve, state_of
from hevopt.mean_value._model_kernels import combustion_now
from hevopt.mean_value._run_kernels import march
from hevopt.mean_value.parameters import FULL_LOAD, Drive, Model

Array = NDArray[np.float64]

# Columns of what the gas leaves behind: fuel of a step; after it turbocharger's speed, intake pressure and excess
# air; highest torque at its beginning, and the torque that the cylinders give at its end.
FUEL, TURBO, BOOST, EXCESS, AVAILABLE, GIVEN = range(6)
COLUMNS = 6


class Air(NamedTuple):
    """The engine, and how its gas is marched: `parts` steps in one of the car; stages, weights as of TABLEAUX."""

    model: Model
    stages: Array
    weights: Array
    parts: int


@compiled()
def _at(model: Model, torque_nm: float, engine_radps2: float) -> Model:
    """The model turned by the car."""
    drive_ = Drive(1.0, np.nan, 0.0, 0.0, torque_nm, engine_radps2)
    return Model(
        model.engine, model.control, model.curves, model.car, drive_, model.ambient, model.gas
    )


@compiled()
def gives_now(gas: Array, side_radps: float, limits: Limits, model: Model) -> Gives:
    """What the engine can give with the air it has; gas: (state,), of which pedal and engine speed change."""
    gas[s.ENGINE], gas[s.PEDAL] = side_radps, 1.0
    most = combustion_now(gas, _at(model, np.nan, 0.0)).torque
    least = combustion_now(gas, _at(model, -np.inf, 0.0)).torque
    if side_radps > limits.engine_max_radps:
        most = by_map(side_radps, limits).most_nm
    return Gives(least, max(most, least))


@compiled()
def breathed(
    gas: Array, torque_nm: float, wanted_nm: float, after_radps: float, step_s: float, air: Air, row: Array
) -> None:  # fmt: skip
    """The gas after a step of the car, in place; torque_nm: -inf where no fuel is burnt; row: filled."""
    model, before = air.model, gas[s.ENGINE]
    full = curve(before, FULL_LOAD, model.curves)
    gas[s.PEDAL] = min(max(wanted_nm / full, 0.0), 1.0)
    turned = _at(model, torque_nm, (after_radps - before) / step_s)
    fuel = gas[s.FUEL]
    part_s = step_s / air.parts
    gas[:] = march(0.0, gas, part_s, 1, air.parts, air.stages, air.weights, turned)[1]
    gas[s.ENGINE] = after_radps
    burning = combustion_now(gas, turned)
    row[FUEL], row[TURBO] = gas[s.FUEL] - fuel, gas[s.TURBO]
    row[BOOST] = state_of(gas, 6, model.engine.volumes.intake_manifold_m3, model.gas).pressure
    row[EXCESS], row[GIVEN] = burning.excess_air, burning.torque


@compiled(nogil=True)
def advance_breathing(
    car: LoopCar, task: LoopTask, work: drive.Work, loop: drive.Loop, first: int, record: Array, step_s: float,
    air: Air, gas: Array, breath: Array,
) -> drive.Loop:  # fmt: skip
    """`advance` with the mean-value engine; gas: (state,), in place; breath: (step, column), filled."""
    pace, start = pace_of(step_s, car.body.tyre.lag_s), task.time_s[0]
    place = drive.Place(start, 0, 0)
    for i in range(len(record)):
        place = drive.place_of(task, place, start + (first + i) * step_s)
        if not drive.is_answered(car, task, loop, place.d, step_s):
            break
        gives = gives_now(gas, loop.state.side_radps, car.limits, air.model)
        loop, wanted = drive.after_step(car, task, work, loop, place, gives, pace, record[i])
        burns = loop.joint.phase == motor.TURNING
        given = record[i, drive.ENGINE] if burns else -np.inf
        breath[i, AVAILABLE] = gives.most_nm
        breathed(gas, given, max(wanted, given), loop.state.side_radps, step_s, air, breath[i])
    return loop


@compiled(nogil=True)
def advance_free_breathing(
    car: FreeCar, task: LoopTask, course: FreeCourse, work: drive.Work, loop: free.FreeLoop, first: int,
    record: Array, step_s: float, air: Air, gas: Array, breath: Array,
) -> free.FreeLoop:  # fmt: skip
    """`advance_breathing` where the engine has a speed of its own; the pedal is that of the torque planned."""
    pace, start = pace_of(step_s, car.loop.body.tyre.lag_s), task.time_s[0]
    place = drive.Place(start, 0, 0)
    for i in range(len(record)):
        place = drive.place_of(task, place, start + (first + i) * step_s)
        if not drive.is_answered(car.loop, task, loop, place.d, step_s):
            break
        gives = gives_now(gas, loop.state.side_radps, car.loop.limits, air.model)
        loop, wanted = free.after_step(car, task, course, work, loop, place, gives, pace, record[i])
        given = record[i, drive.ENGINE] if loop.phase == motor.TURNING else -np.inf
        breath[i, AVAILABLE] = gives.most_nm
        breathed(gas, given, max(wanted, given), loop.state.side_radps, step_s, air, breath[i])
    return loop


@compiled(nogil=True)
def pull_breathing(
    car: LoopCar, by_gear: NDArray[np.int64], foot: pulling.Foot, work: pulling.PullWork,
    moved: pulling.Pull, step_s: float, record: Array, air: Air, gas: Array, breath: Array,
) -> pulling.Pull:  # fmt: skip
    """Some more steps of `pull` with the mean-value engine; gas and breath as of advance_breathing."""
    pace = pace_of(step_s, car.body.tyre.lag_s)
    for i in range(len(record)):
        gives = gives_now(gas, moved.state.side_radps, car.limits, air.model)
        moved, given = pulling.after_pull(car, by_gear, foot, work, moved, gives, max(gives.most_nm, 0.0),
                                          pace, record[i])  # fmt: skip
        # Between gears the driver's foot is off the pedal.
        wanted = given if moved.lever.gap_s > 0.0 else np.inf
        breath[i, AVAILABLE] = gives.most_nm
        breathed(gas, given, wanted, moved.state.side_radps, step_s, air, breath[i])
    return moved
