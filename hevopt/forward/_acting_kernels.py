"""What acts in a step: what driver and plan ask for, who gives it, how engine and clutch are kept. Compiled."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hevopt._compile import compiled
from hevopt.car.handling import DriverGains, Shifting
from hevopt.forward import _motor_kernels as motor
from hevopt.forward import _rows_kernels as col
from hevopt.forward._asks_kernels import NOBODY, Asks
from hevopt.forward._beside_kernels import (
    Acts,
    Beside,
    beside_w,
    first_range,
    set_beside,
    unit_radps,
)
from hevopt.forward._contact_kernels import Body, wheel_radps
from hevopt.forward._fluid_kernels import closing_nm, poured
from hevopt.forward._lever_kernels import (
    Lever,
    keeping_pace_nm,
    moves_machine,
)
from hevopt.forward._limits_kernels import Gives, Limits, share_of_braking
from hevopt.forward._pedal_kernels import PedalState, wanted_at
from hevopt.forward._rows_kernels import Inputs, State, Ways, turning
from hevopt.forward._share_kernels import (
    AskedStep,
    Shared,
    following_nm,
    machine_range,
    meets_of,
    shared,
)
from hevopt.problem._battery_kernels import BatteryArrays
from hevopt.units import STANDARD_GRAVITY_MPS2

Array = NDArray[np.float64]

_FEEDBACK_SPEED_RADPS = 50.0


class LoopCar(NamedTuple):
    """All that the loop knows of a car; limits: of its first machine, beside: of the others."""

    body: Body
    ways: Ways
    fast_way: NDArray[np.int64]
    fast_radps: Array
    limits: Limits
    beside: Beside
    battery: BatteryArrays
    window_j: tuple[float, float]
    shifting: Shifting
    driver: DriverGains


class LoopTask(NamedTuple):
    """A trace, and a plan for it of which every step holds from one of its times to the next.

    time_s, speed_mps: (time + 1,); slope_rad: (time,); load_w: (2, time) electric load, engine at rest and not
    from_s, energy_j: (step + 1,); way, engine_on, apart, machine_nm: (step,); others_nm: (step, machine - 1)
    energy_j: what the plan has stored; apart: `open_while` of a ForwardPlan
    machine_nm, others_nm: of the first machine of a Line, and of those beside it; asks: who fills them on the way
    """

    time_s: Array
    speed_mps: Array
    slope_rad: Array
    load_w: Array
    from_s: Array
    way: NDArray[np.int64]
    engine_on: NDArray[np.bool_]
    apart: NDArray[np.int64]
    machine_nm: Array
    energy_j: Array
    others_nm: Array
    asks: Asks = NOBODY


class Now(NamedTuple):
    """What a step begins with, beside the car's state; step, k: of the plan and of the trace."""

    step: int
    k: int
    at_s: float
    energy_j: float
    side_radps: float


@compiled(inline="always")
def _set_nm(car: LoopCar, task: LoopTask, now: Now, state: State, machine_radps: float) -> float:
    """The machine's set-point: the plan's torque, and what keeps the plan's stored energy."""
    if len(car.limits.load_nm) > 0:
        turns = state.side_radps > 0.3 * car.limits.idle_radps
        load_w = task.load_w[1, now.k]
        return following_nm(state.side_radps, load_w, car.limits) if turns else 0.0
    d, time = now.step, task.from_s
    share = (now.at_s - time[d]) / (time[d + 1] - time[d])
    planned = task.energy_j[d] + share * (task.energy_j[d + 1] - task.energy_j[d])
    power = car.driver.charge_per_s * (now.energy_j - planned)
    return task.machine_nm[d] + power / max(abs(machine_radps), _FEEDBACK_SPEED_RADPS)


@compiled(inline="always")
def is_called(task: LoopTask, now: Now, state: State, driver: DriverGains) -> bool:
    """Whether an engine that the car will move off with is started: so early that it turns by then."""
    d = now.step + 1
    if state.speed_mps > 0.0 or d >= len(task.engine_on) or not task.engine_on[d]:
        return False
    if wanted_at(task.time_s, task.speed_mps, task.from_s[d], now.k) != 0.0:
        return False
    return now.at_s + driver.start_s >= task.from_s[d] - 1e-9


@compiled(inline="always")
def asked_of(
    car: LoopCar,
    task: LoopTask,
    now: Now,
    state: State,
    pedal: PedalState,
    lever: Lever,
    machine_radps: float,
    gives: Gives,
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
    braking = pedal.force_n < 0.0
    accel = 0.0 if pedal.holds else pedal.accel_mps2 / radius
    wheel_nm = 0.0 if pedal.holds else pedal.force_n * radius
    return AskedStep(wheel_nm, accel, set_nm, low, high, gives.least_nm, gives.most_nm, braking,
                     state.lost_nm)  # fmt: skip


@compiled(inline="always")
def _left_nm(high_nm: float, behind_radps: float, car: LoopCar) -> float:
    """What a hard launch, above idle speed, leaves to the clutch of an engine that speeds up to it."""
    speeds_up = car.ways.inertia_kgm2[0] * max(behind_radps, 0.0) / car.driver.governor_s
    return float(max(high_nm - speeds_up, 0.0))


@compiled(inline="always")
def inputs_of(
    car: LoopCar,
    state: State,
    pedal: PedalState,
    joint: motor.Joined,
    lever: Lever,
    split: Shared,
    gives: Gives,
    slope_rad: float,
    machine_nm: Array,
    step_s: float,
) -> Inputs:
    """The plant's inputs: how the engine is kept, what the clutch and the brakes hold."""
    limits, driver = car.limits, car.driver
    way, output = lever.way, len(car.ways.inertia_kgm2) - 1
    wheel, n = wheel_radps(state.speed_mps, state.spin_radps, car.body), state.side_radps
    ratio = turning(car.ways.wheel, way, lever.from_way, lever.blend, output)
    low, high = gives
    capacity, engine = 0.0, split.engine_nm
    if joint.phase == motor.TURNING:
        target = limits.idle_radps
        rate = 1.0 if joint.closing > 0.0 else 1.0 - np.exp(-step_s / driver.governor_s)
        if joint.launches:
            target = joint.launch_radps
        elif joint.flows and joint.closing == 0.0:
            target = split.target_radps
        elif joint.closing > 0.0 or joint.cause == motor.CHANGE:
            target = max(ratio * (wheel + pedal.accel_mps2 / car.body.radius_m * step_s), target)
        governed = n + rate * (target - n)
        capacity = motor.capacity_nm(joint, split.clutch_nm, n - ratio * wheel, car.body.clutch)
        if joint.launches and target > limits.idle_radps:
            capacity = min(capacity, _left_nm(high, target - n, car))
        if joint.flows and capacity > 0.0:
            full = capacity
            capacity = closing_nm(car.ways.fluid, split.clutch_nm, n, ratio * wheel, full)
            if capacity < full:
                governed = n + (1.0 - np.exp(-step_s / driver.governor_s)) * (target - n)
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
                  lever.from_way, lever.blend, joint.flows)  # fmt: skip


@compiled(inline="always")
def friction_nm(car: LoopCar, wheel_nm: float, speed_mps: float) -> float:
    """What the friction brakes take at least while a machine may brake as well, at the wheels; 0 while driving."""
    if wheel_nm >= 0.0:
        return 0.0
    weight_n = car.body.mass_kg * STANDARD_GRAVITY_MPS2
    rate = -wheel_nm / (car.body.radius_m * weight_n)
    return -wheel_nm * (1.0 - share_of_braking(speed_mps, rate, car.limits))


@compiled(bare=True)
def _beside_set(
    car: LoopCar, row: Array, now: Now, state: State, asked: AskedStep, joint: motor.Joined, lever: Lever,
    load_w: float, machine_nm: Array,
) -> AskedStep:  # fmt: skip
    """What is asked, the first machine's limits as the others leave them; machine_nm: theirs, set."""
    closed = joint.closing > 0.0
    bare = meets_of(row, asked.accel, asked.lost_nm, closed, machine_nm[:1])
    left = asked.wheel_nm - bare.c0 - bare.ce * asked.least_nm
    acts = Acts(left, asked.braking, closed, joint.launches, joint.phase == motor.TURNING,
                now.energy_j < car.window_j[1], now.energy_j > car.window_j[0])  # fmt: skip
    wheel, side = wheel_radps(state.speed_mps, state.spin_radps, car.body), state.side_radps
    set_beside(car.beside, row, car.ways, lever, wheel, side, acts, machine_nm)
    others = beside_w(car.beside, car.ways, lever, wheel, side, machine_nm) + load_w
    speed = unit_radps(car.ways, lever, 1, wheel, side)
    low, high = first_range(car.beside, asked.low_nm, asked.high_nm, speed, others, car.limits)
    return AskedStep(asked.wheel_nm, asked.accel, min(max(asked.set_nm, low), high), low, high, asked.least_nm,
                     asked.most_nm, asked.braking, asked.lost_nm)  # fmt: skip


@compiled(bare=True)
def _poured_of(
    car: LoopCar, rows: Array, state: State, asked: AskedStep, lever: Lever, machine_nm: Array, step_s: float
) -> Shared:  # fmt: skip
    """Torques while a torque converter passes them."""
    wheel = wheel_radps(state.speed_mps, state.spin_radps, car.body)
    ratio = turning(car.ways.wheel, lever.way, lever.from_way, lever.blend, len(machine_nm) + 1)
    turbine = max(ratio * (wheel + 0.5 * step_s * asked.accel), 0.0)
    rate = 1.0 - np.exp(-step_s / car.driver.governor_s)
    return poured(car.ways, rows, lever.way, state.variant, asked, car.limits, state.side_radps, turbine, rate,
                  machine_nm)  # fmt: skip


@compiled(inline="always")
def split_of(
    car: LoopCar,
    rows: Array,
    now: Now,
    state: State,
    asked: AskedStep,
    joint: motor.Joined,
    lever: Lever,
    load_w: float,
    machine_nm: Array,
    step_s: float,
) -> Shared:
    """Torques of engine, machine and brakes, and what the clutch has to pass.

    machine_nm: of machines beside the first the set-points, of which the torques are made
    A machine whose gear changes brings its own rotor along; between gears it does nothing else, while a ratio that
    moves under load passes the rest as well.
    """
    joints, moves, pace = car.ways.load.shape[2], moves_machine(car.ways, lever), 0.0
    cut = moves and lever.gap_s > 0.0
    if moves:
        wheel = wheel_radps(state.speed_mps, state.spin_radps, car.body)
        pace = keeping_pace_nm(car.ways, state, lever, wheel, step_s)
        per_nm = rows[lever.way, state.variant, col.MACHINES]
        low, high = (0.0, 0.0) if cut else (asked.low_nm, asked.high_nm)
        set_nm = 0.0 if cut else min(max(asked.set_nm + pace, low), high)
        wheel_nm = asked.wheel_nm + (0.0 if cut else per_nm * pace)
        asked = AskedStep(wheel_nm, asked.accel, set_nm, low, high, asked.least_nm, asked.most_nm,
                      asked.braking, asked.lost_nm)  # fmt: skip
    friction = friction_nm(car, asked.wheel_nm if asked.braking else 0.0, state.speed_mps)
    asked = AskedStep(asked.wheel_nm + friction, asked.accel, asked.set_nm, asked.low_nm, asked.high_nm,
                  asked.least_nm, asked.most_nm, asked.braking, asked.lost_nm)  # fmt: skip
    closed = joint.closing > 0.0
    if len(machine_nm) > 1:
        asked = _beside_set(
            car, rows[lever.way, state.variant], now, state, asked, joint, lever, load_w, machine_nm
        )
    if joint.flows and not closed:
        split = _poured_of(car, rows, state, asked, lever, machine_nm, step_s)
    else:
        split = shared(rows, lever.way, state.variant, joints, asked, car.limits, closed,
                       joint.launches, machine_nm)  # fmt: skip
    given = pace if cut else split.machine_nm
    if joint.phase != motor.TURNING and car.ways.side[lever.way, 1] != 0.0:
        given = 0.0
    brake = split.brake_nm + friction
    return Shared(split.engine_nm, given, split.clutch_nm, brake, split.full and not cut,
                  split.wanted_nm, split.target_radps)  # fmt: skip
