"""The loop: driver, lever, clutch and sharing of torques around the plant's step, from first to last. Compiled.

Nothing but charge feeds back, so the loop keeps no books: it returns what acted in every step, and the books
(books.py) are made of that with the car's own components.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hevopt._compile import compiled
from hevopt.car.handling import Shifting
from hevopt.forward import _motor_kernels as motor
from hevopt.forward import _rows_kernels as col
from hevopt.forward._contact_kernels import Body, pace_of
from hevopt.forward._lever_kernels import (
    Lever,
    changed,
    keeping_pace_nm,
    moves_machine,
    resting_lever,
)
from hevopt.forward._limits_kernels import Limits, at, electric_w, share_of_braking
from hevopt.forward._pedal_kernels import DriverGains, PedalState, pressed, remembered, wanted_at
from hevopt.forward._plant_kernels import step
from hevopt.forward._rows_kernels import Inputs, State, Ways, row_length, settled_rows, turning
from hevopt.forward._share_kernels import (
    AskedStep,
    Shared,
    following_nm,
    machine_range,
    pace_nm,
    shared,
)
from hevopt.problem._battery_kernels import BatteryArrays, chemical_power_at
from hevopt.units import STANDARD_GRAVITY_MPS2

Array = NDArray[np.float64]

# Columns of what is recorded: after the step
SPEED, FORCE, SIDE, WAY, FROM_WAY, BLEND, ENERGY = range(7)
# in the step, the car
ENGINE, MACHINE, CLUTCH, WHEEL, BRAKE, HELD, TYRE, ROAD = range(7, 15)
# and its driver: force asked for, as numbers of _motor_kernels the engine's phase and why the clutch slips; whether
# all is given and too little; and the directions in which power passed the joints
ASKED, PHASE, CAUSE, FULL, VARIANT = range(15, 20)
COLUMNS = 20
_FEEDBACK_SPEED_RADPS = 50.0


class LoopCar(NamedTuple):
    """All that the loop knows of a car."""

    body: Body
    ways: Ways
    fast_way: NDArray[np.int64]
    fast_radps: Array
    limits: Limits
    battery: BatteryArrays
    window_j: tuple[float, float]
    shifting: Shifting
    driver: DriverGains


class LoopTask(NamedTuple):
    """A trace and a plan for it, which holds from each of the trace's times to the next.

    time_s, speed_mps, energy_j: (time + 1,); slope_rad, way, engine_on, apart, machine_nm: (time,)
    energy_j: what the plan has stored; apart: the clutch is open while the car is braked, or no gear is in
    """

    time_s: Array
    speed_mps: Array
    slope_rad: Array
    way: NDArray[np.int64]
    engine_on: NDArray[np.bool_]
    apart: NDArray[np.int64]
    machine_nm: Array
    energy_j: Array


class Now(NamedTuple):
    """What a step begins with, beside the car's state."""

    k: int
    at_s: float
    energy_j: float
    side_radps: float


@compiled()
def _set_nm(car: LoopCar, task: LoopTask, now: Now, state: State, machine_radps: float) -> float:
    """The machine's set-point: the plan's torque, and what keeps the plan's stored energy."""
    if len(car.limits.load_nm) > 0:
        turns = state.side_radps > 0.3 * car.limits.idle_radps
        return following_nm(state.side_radps, car.limits) if turns else 0.0
    k, time = now.k, task.time_s
    share = (now.at_s - time[k]) / (time[k + 1] - time[k])
    planned = task.energy_j[k] + share * (task.energy_j[k + 1] - task.energy_j[k])
    power = car.driver.charge_per_s * (now.energy_j - planned)
    return task.machine_nm[k] + power / max(abs(machine_radps), _FEEDBACK_SPEED_RADPS)


@compiled()
def _called(task: LoopTask, now: Now, state: State, driver: DriverGains) -> bool:
    """Whether an engine that the car will move off with is started: so early that it turns by then."""
    k = now.k + 1
    if state.speed_mps > 0.0 or k >= len(task.engine_on) or not task.engine_on[k]:
        return False
    return task.speed_mps[k] == 0.0 and now.at_s + driver.start_s >= task.time_s[k] - 1e-9


@compiled()
def _asked(
    car: LoopCar,
    task: LoopTask,
    now: Now,
    state: State,
    pedal: PedalState,
    lever: Lever,
    machine_radps: float,
) -> AskedStep:
    """What the driver and the plan ask of engine and machine."""
    limits, radius = car.limits, car.body.radius_m
    low, high = machine_range(machine_radps, limits)
    if now.energy_j <= car.window_j[0]:
        high = min(high, 0.0)
    if now.energy_j >= car.window_j[1]:
        low = max(low, 0.0)
    set_nm = _set_nm(car, task, now, state, machine_radps)
    if len(limits.load_nm) == 0:
        set_nm = min(max(set_nm, low), high)
    least = at(limits.least_nm, limits.engine_step, state.side_radps)
    most = at(limits.full_nm, limits.engine_step, state.side_radps)
    braking = pedal.force_n < 0.0
    accel = 0.0 if pedal.holds else pedal.accel_mps2 / radius
    wheel_nm = 0.0 if pedal.holds else pedal.force_n * radius
    return AskedStep(wheel_nm, accel, set_nm, low, high, least, most, braking)


@compiled()
def _acting(
    car: LoopCar,
    state: State,
    pedal: PedalState,
    joint: motor.Joined,
    lever: Lever,
    split: Shared,
    slope_rad: float,
    machine_nm: Array,
    step_s: float,
) -> Inputs:
    """The plant's inputs: how the engine is kept, what the clutch and the brakes hold."""
    limits, driver = car.limits, car.driver
    way, output = lever.way, len(car.ways.inertia_kgm2) - 1
    wheel, n = state.speed_mps / car.body.radius_m, state.side_radps
    ratio = turning(car.ways.wheel, way, lever.from_way, lever.blend, output)
    low = at(limits.least_nm, limits.engine_step, n)
    high = at(limits.full_nm, limits.engine_step, n)
    rate, capacity, engine = 1.0 - np.exp(-step_s / driver.governor_s), 0.0, split.engine_nm
    if joint.phase == motor.TURNING:
        target = limits.idle_radps
        if joint.launches:
            target = joint.launch_radps
        elif joint.closing > 0.0 or joint.cause == motor.CHANGE:
            target = max(ratio * (wheel + pedal.accel_mps2 / car.body.radius_m * step_s), target)
            rate = 1.0 if joint.closing > 0.0 else rate
        governed = n + rate * (target - n)
        capacity = motor.capacity_nm(joint, split.clutch_nm, n - ratio * wheel, car.body.clutch)
    else:
        low, high, engine = -np.inf, np.inf, 0.0
        if joint.phase == motor.STARTING:
            governed = min(n + limits.idle_radps / driver.start_s * step_s, limits.idle_radps)
            governed = max(governed, min(n, limits.idle_radps))
        else:
            governed = max(n - limits.idle_radps / driver.stop_s * step_s, 0.0)
    brake = split.brake_nm
    if pedal.holds:
        brake = -pedal.force_n * car.body.radius_m
    return Inputs(machine_nm, engine, governed, low, high, capacity, brake, slope_rad, way,
                  lever.from_way, lever.blend)  # fmt: skip


@compiled()
def _friction_nm(car: LoopCar, asked: AskedStep, speed_mps: float) -> float:
    """What the friction brakes take at least while the machine may brake as well, at the wheels."""
    if not asked.braking or asked.wheel_nm >= 0.0:
        return 0.0
    weight_n = car.body.mass_kg * STANDARD_GRAVITY_MPS2
    rate = -asked.wheel_nm / (car.body.radius_m * weight_n)
    return -asked.wheel_nm * (1.0 - share_of_braking(speed_mps, rate, car.limits))


@compiled()
def _split(
    car: LoopCar,
    rows: Array,
    state: State,
    asked: AskedStep,
    joint: motor.Joined,
    lever: Lever,
    machine_nm: Array,
    step_s: float,
) -> Shared:
    """Torques of engine, machine and brakes, and what the clutch has to pass.

    A machine whose gear changes brings its own rotor along; between gears it does nothing else, while a ratio that
    moves under load passes the rest as well.
    """
    joints, moves, pace = car.ways.load.shape[2], moves_machine(car.ways, lever), 0.0
    cut = moves and lever.gap_s > 0.0
    if moves:
        pace = keeping_pace_nm(car.ways, state, lever, state.speed_mps / car.body.radius_m, step_s)
        per_nm = rows[lever.way, state.variant, col.MACHINES]
        low, high = (0.0, 0.0) if cut else (asked.low_nm, asked.high_nm)
        set_nm = 0.0 if cut else min(max(asked.set_nm + pace, low), high)
        wheel_nm = asked.wheel_nm + (0.0 if cut else per_nm * pace)
        asked = AskedStep(wheel_nm, asked.accel, set_nm, low, high, asked.least_nm, asked.most_nm,
                      asked.braking)  # fmt: skip
    friction = _friction_nm(car, asked, state.speed_mps)
    asked = AskedStep(asked.wheel_nm + friction, asked.accel, asked.set_nm, asked.low_nm, asked.high_nm,
                  asked.least_nm, asked.most_nm, asked.braking)  # fmt: skip
    closed = joint.closing > 0.0
    split = shared(rows, lever.way, state.variant, joints, asked, car.limits, closed,
                   joint.launches, machine_nm)  # fmt: skip
    given = pace if cut else split.machine_nm
    if joint.phase != motor.TURNING and car.ways.side[lever.way, 1] != 0.0:
        given = 0.0
    brake = split.brake_nm + friction
    return Shared(split.engine_nm, given, split.clutch_nm, brake, split.full and not cut)


@compiled(nogil=True)
def drive(car: LoopCar, task: LoopTask, start_j: float, step_s: float, record: Array) -> None:
    """Drive a trace; record: (step, column), filled."""
    pace, rows = pace_of(step_s, car.body.tyre.lag_s), settled_rows(car.ways)
    scratch, machine_nm = np.empty(row_length(car.ways)), np.zeros(1)
    output, start = len(car.ways.inertia_kgm2) - 1, task.time_s[0]
    on = task.engine_on[0]
    turns = car.ways.wheel[task.way[0], output] * task.speed_mps[0] / car.body.radius_m
    side = max(car.limits.idle_radps, turns) if on else 0.0
    state = State(task.speed_mps[0], 0.0, side, task.way[0], task.way[0], 0.0, 0)
    lever, pedal = resting_lever(task.way[0]), PedalState(0.0, 0.0, 0.0, 0.0, True)
    joint = motor.Joined(motor.TURNING if on else motor.REST, 1.0 if side == turns else 0.0, False, 0,
                         car.limits.idle_radps)  # fmt: skip
    energy, k = start_j, 0
    ahead = task.speed_mps[0]
    for i in range(len(record)):
        at_s = start + i * step_s
        while k < len(task.slope_rad) - 1 and at_s >= task.time_s[k + 1] - 1e-9:
            k += 1
        wanted, ahead = (
            ahead,
            wanted_at(task.time_s, task.speed_mps, at_s + step_s + car.driver.preview_s, k),
        )
        wheel, slope = state.speed_mps / car.body.radius_m, task.slope_rad[k]
        pedal = pressed(pedal, wanted, ahead, state.speed_mps, slope, car.body, car.driver, step_s)
        machine = turning(car.ways.wheel, lever.way, lever.from_way, lever.blend, 1) * wheel
        keeps_nm = pace_nm(machine, car.limits)
        lever = changed(lever, task.way[k], wheel, car.ways, car.fast_way, car.fast_radps,
                        car.shifting, step_s, keeps_nm)  # fmt: skip
        machine = turning(car.ways.wheel, lever.way, lever.from_way, lever.blend, 1) * wheel
        machine += car.ways.side[lever.way, 1] * state.side_radps
        now = Now(k, at_s, energy, state.side_radps)
        asked = _asked(car, task, now, state, pedal, lever, machine)
        on = task.engine_on[k] or _called(task, now, state, car.driver)
        phase = motor.phase_after(joint.phase, on, state.side_radps, car.limits.idle_radps)
        ratio = car.ways.wheel[lever.way, output]
        begins = lever.since_s == 0.0 and lever.blend > 0.0
        neutral = task.apart[k] == 2 or (task.apart[k] == 1 and asked.braking) or pedal.holds
        need = asked.wheel_nm / max(rows[lever.way, 0, col.CLUTCH], 1e-9)
        joint = motor.joined(joint, phase, lever.gap_s > 0.0 or begins, neutral, asked.braking,
                             ratio * wheel, need, car.limits, car.body.clutch, step_s)  # fmt: skip
        split = _split(car, rows, state, asked, joint, lever, machine_nm, step_s)
        machine_nm[0] = split.machine_nm
        inputs = _acting(car, state, pedal, joint, lever, split, slope, machine_nm, step_s)
        state, out = step(car.body, car.ways, rows, state, inputs, pace, scratch)
        mean = 0.5 * (machine + turning(car.ways.wheel, state.way, state.from_way, state.blend, 1)
                      * state.speed_mps / car.body.radius_m
                      + car.ways.side[state.way, 1] * state.side_radps)  # fmt: skip
        power = electric_w(split.machine_nm, mean, car.limits) + car.limits.auxiliary_w
        if phase == motor.STARTING:
            mean_n = 0.5 * (now.side_radps + state.side_radps)
            power += max(out.engine_nm * mean_n, 0.0) / car.limits.spin_efficiency
        energy -= step_s * chemical_power_at(power, energy, car.battery)
        stuck = phase == motor.TURNING and joint.closing == 0.0 and not joint.launches
        stuck = stuck or lever.gap_s > 0.0
        pedal = remembered(pedal, (stuck and not asked.braking) or (split.full and
                           pedal.error_mps > 0.0), car.body, car.driver, step_s)  # fmt: skip
        row = record[i]
        row[SPEED], row[FORCE], row[SIDE] = state.speed_mps, state.force_n, state.side_radps
        row[WAY], row[FROM_WAY], row[BLEND] = state.way, state.from_way, state.blend
        row[ENERGY], row[ENGINE], row[MACHINE] = energy, out.engine_nm, split.machine_nm
        row[CLUTCH], row[WHEEL], row[BRAKE] = out.clutch_nm, out.wheel_nm, out.brake_nm
        row[HELD], row[TYRE], row[ROAD] = out.held_nm, out.force_n, out.road_n
        row[ASKED], row[PHASE], row[CAUSE] = pedal.force_n, phase, joint.cause
        row[FULL], row[VARIANT] = 1.0 if split.full else 0.0, state.variant
