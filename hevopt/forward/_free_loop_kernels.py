"""The loop of a car whose engine has a speed of its own: driver, engine, machines, brakes around the plant's step.

The engine's speed comes to the planned one by a first-order lag, no faster than the machine that holds the engine
lets it. A lock-up clutch closes once the speeds are the same, above idle speed.
"""

from typing import NamedTuple

import numpy as np

from hevopt._compile import compiled
from hevopt.forward import _motor_kernels as motor
from hevopt.forward import _rows_kernels as col
from hevopt.forward._acting_kernels import LoopTask, Now, friction_nm, is_called
from hevopt.forward._contact_kernels import Pace, clutch_capacity_nm, pace_of
from hevopt.forward._drive_kernels import (
    Place,
    Work,
    energy_after,
    is_answered,
    place_of,
    record_step,
)
from hevopt.forward._free_battery_kernels import held_back, started
from hevopt.forward._free_kernels import (
    Allotted,
    FreeCar,
    FreeCourse,
    FreeWish,
    allotted,
    begins_radps,
    bus_w,
    may_not_rest,
    side_after,
)
from hevopt.forward._limits_kernels import Gives, by_map, limit_nm
from hevopt.forward._pedal_kernels import PedalState, pressed, remembered, wanted_at
from hevopt.forward._plant_kernels import step
from hevopt.forward._rows_kernels import Array, Inputs, Outputs, State

_CLOSED_SLIP_RADPS = 1.0
_FEEDBACK_SPEED_RADPS = 50.0
# How much faster than planned the engine turns at most for charge that lacks, and above which share of idle speed
# it is not stopped yet.
_FASTER, _STOPS_BELOW = 1.1, 1.05
# Rounds in which the governor takes over what the engine's torque is off, and the share of it that is rounding.
_ROUNDS, _SAME = 4, 1e-12


class FreeLoop(NamedTuple):
    """The loop between two steps; closing: of the lock-up clutch, from 0 to 1."""

    state: State
    pedal: PedalState
    phase: int
    closing: float
    energy_j: float
    ahead_mps: float


@compiled(bare=True)
def begun(car: FreeCar, task: LoopTask, course: FreeCourse, start_j: float) -> FreeLoop:
    """The loop before its first step."""
    on = task.engine_on[0]
    side = begins_radps(car, course, task.speed_mps[0]) if on else 0.0
    state = State(task.speed_mps[0], 0.0, side, task.way[0], task.way[0], 0.0, 0, 0.0, 0.0, 0.0)
    closing = 1.0 if on and course.closed[0] else 0.0
    return FreeLoop(state, PedalState(0.0, 0.0, 0.0, 0.0, True), motor.TURNING if on else motor.REST,
                    closing, start_j, task.speed_mps[0])  # fmt: skip


@compiled(bare=True)
def _planned_nm(car: FreeCar, task: LoopTask, course: FreeCourse, now: Now) -> float:
    """The engine's torque: the plan's, less what keeps the plan's stored energy."""
    d, time = now.step, task.from_s
    torque = course.engine_nm[d]
    if torque <= 0.0:
        return float(torque)
    share = (now.at_s - time[d]) / (time[d + 1] - time[d])
    planned = task.energy_j[d] + share * (task.energy_j[d + 1] - task.energy_j[d])
    power = car.loop.driver.charge_per_s * (now.energy_j - planned)
    lowered = torque - power / max(now.side_radps, _FEEDBACK_SPEED_RADPS)
    return float(max(lowered, car.fuelled_nm))


@compiled(bare=True)
def _speeds(car: FreeCar, way: int, wheel: float, side: float, speeds: Array) -> None:
    ways = car.loop.ways
    for m in range(len(speeds)):
        speeds[m] = ways.wheel[way, m + 1] * wheel + ways.side[way, m + 1] * side


@compiled(bare=True)
def _clutch_closing(
    car: FreeCar, loop: FreeLoop, wanted: bool, turns: bool, step_s: float
) -> float:
    """How far the lock-up clutch is closed: it begins where the speeds meet, and opens below idle speed."""
    limits, state = car.loop.limits, loop.state
    wheel = state.speed_mps / car.loop.body.radius_m
    output = car.loop.ways.wheel[state.way, len(car.loop.ways.inertia_kgm2) - 1] * wheel
    if not (wanted and turns) or output < limits.idle_radps:
        return 0.0
    if loop.closing == 0.0 and abs(state.side_radps - output) > _CLOSED_SLIP_RADPS:
        return 0.0
    closing_s = car.loop.body.clutch.closing_s
    return 1.0 if closing_s <= 0.0 else min(loop.closing + step_s / closing_s, 1.0)


@compiled(bare=True)
def _wish(
    car: FreeCar, task: LoopTask, course: FreeCourse, row: Array, now: Now, loop: FreeLoop, pedal: PedalState,
    phase: int, closing: float, planned: float, gives: Gives, step_s: float,
) -> FreeWish:  # fmt: skip
    """What driver and plan ask for; limits are those at both ends of the step; a starter's work counts as load.

    planned: torque of the engine; gives: what this can at the step's beginning, at its end by the map's slope
    """
    body, limits, state = car.loop.body, car.loop.limits, loop.state
    wheel = state.speed_mps / body.radius_m
    turns, braking = phase == motor.TURNING, pedal.force_n < 0.0 and not pedal.holds
    accel = 0.0 if pedal.holds else pedal.accel_mps2 / body.radius_m
    ahead = max(wheel + step_s * accel, 0.0)
    # What full load cannot give of the charge that lacks a higher speed gives.
    beyond = max(planned - max(gives.most_nm, course.engine_nm[now.step]), 0.0)
    more = min(1.0 + beyond / max(gives.most_nm, 1.0), _FASTER)
    side_accel = side_after(car, course, now, phase, wheel, ahead, step_s, more) - now.side_radps
    side_accel /= step_s
    load_w = task.load_w[0 if phase == motor.REST else 1, now.k]
    if phase == motor.STARTING:
        side_accel, load_w = started(car, row, now.side_radps, accel, side_accel, load_w, step_s)
    before = by_map(now.side_radps, limits)
    after = by_map(now.side_radps + step_s * side_accel, limits)
    least = gives.least_nm + min(after.least_nm - before.least_nm, 0.0)
    most = gives.most_nm + min(after.most_nm - before.most_nm, 0.0)
    engine = least
    if planned > 0.5 * least or least == 0.0:
        least, most = car.fuelled_nm, max(most, car.fuelled_nm)
        engine = min(max(planned, least), most)
    elif turns:
        most = least
    empty = now.energy_j <= car.loop.window_j[0] and phase != motor.STARTING
    most_w = 0.0 if empty else car.motors.most_w
    wheel_nm = 0.0 if pedal.holds else pedal.force_n * body.radius_m
    wheel_nm += friction_nm(car.loop, wheel_nm, state.speed_mps)
    least_w = car.motors.least_w
    if now.energy_j >= car.loop.window_j[1] or (braking and not limits.regenerates):
        least_w = 0.0
    if not turns:
        engine = gives.least_nm if side_accel < 0.0 else 0.0
    return FreeWish(wheel_nm, accel, side_accel, engine, least, most, turns, closing > 0.0,
                pedal.holds, braking, least_w, most_w, load_w)  # fmt: skip


@compiled(inline="always")
def _inputs(
    car: FreeCar, loop: FreeLoop, pedal: PedalState, wish: FreeWish, given: Allotted, closing: float,
    slope_rad: float, machine_nm: Array, step_s: float,
) -> Inputs:  # fmt: skip
    """The plant's inputs: the engine governed to where its speed shall be, or with its torque behind the clutch."""
    state, body = loop.state, car.loop.body
    governed = max(state.side_radps + given.side_accel * step_s, 0.0)
    low, high, capacity = -np.inf, np.inf, 0.0
    if wish.turns:
        low, high = wish.least_nm, wish.most_nm
    if wish.joined:
        ways = car.loop.ways
        ratio = ways.wheel[state.way, len(ways.inertia_kgm2) - 1]
        slip = state.side_radps - ratio * state.speed_mps / body.radius_m
        capacity, governed = closing * clutch_capacity_nm(slip, body.clutch), -1.0
    brake = given.brake_nm
    if pedal.holds:
        brake = -pedal.force_n * body.radius_m
    elif pedal.force_n < 0.0:
        brake += friction_nm(car.loop, pedal.force_n * body.radius_m, state.speed_mps)
    return Inputs(machine_nm, given.engine_nm, governed, low, high, capacity, brake, slope_rad, state.way,
                  state.way, 0.0, False)  # fmt: skip


@compiled(bare=True)
def _stepped(
    car: FreeCar,
    work: Work,
    state: State,
    inputs: Inputs,
    wish: FreeWish,
    speeds: Array,
    pace: Pace,
) -> tuple[State, Outputs]:
    """The plant's step.

    What the wheels accelerate otherwise than asked is the governor's to make up, found by a secant as all is linear
    but for directions of power, and at its limit the engine's.
    """
    g, ways, body, row = (
        car.governor,
        car.loop.ways,
        car.loop.body,
        work.rows[state.way, state.variant],
    )
    per_nm = row[col.SIDE_ENGINE] / row[col.MACHINES + col.PER_MACHINE * g + 1]
    most = limit_nm(car.motors, g, speeds[g])
    if wish.turns and not wish.joined:
        probe = Inputs(inputs.machine_nm, inputs.engine_nm, inputs.governed_radps, -np.inf, np.inf, 0.0,
                       inputs.brake_nm, inputs.slope_rad, inputs.way, inputs.from_way, 0.0, False)  # fmt: skip
        before, left = 0.0, 1.0
        for _ in range(_ROUNDS):
            after, out = step(body, ways, work.rows, state, probe, pace, work.moving)
            off = out.engine_nm - inputs.engine_nm
            if abs(off) <= _SAME * max(abs(out.engine_nm), 1.0):
                return after, out
            if before != 0.0 and off != before:
                left = before / (before - off)
            torque = inputs.machine_nm[g] + off * per_nm * left
            inputs.machine_nm[g], before = min(max(torque, -most), most), off
    return step(body, ways, work.rows, state, inputs, pace, work.moving)


@compiled(bare=True)
def after_step(
    car: FreeCar, task: LoopTask, course: FreeCourse, work: Work, loop: FreeLoop, place: Place, gives: Gives,
    pace: Pace, row: Array,
) -> tuple[FreeLoop, float]:  # fmt: skip
    """The loop after one step, and the torque wanted of the engine; gives: what this can give; row: filled."""
    body, limits, driver, step_s = car.loop.body, car.loop.limits, car.loop.driver, pace.step_s
    machine_nm, speeds = work.machine_nm, work.machine_radps
    state, pedal, phase, closing, energy, wanted = loop
    at_s, k, d = place
    ahead = wanted_at(task.time_s, task.speed_mps, at_s + step_s + driver.preview_s, k)
    slope, wheel = task.slope_rad[k], state.speed_mps / body.radius_m
    pedal = pressed(pedal, wanted, ahead, state.speed_mps, slope, body, driver, step_s)
    now = Now(d, k, at_s, energy, state.side_radps)
    on = task.engine_on[d] or is_called(task, now, state, driver) or may_not_rest(car, wheel)
    # An engine that shall stop is brought to idle speed first, by which its governor has its momentum.
    on = on or (phase == motor.TURNING and state.side_radps > _STOPS_BELOW * limits.idle_radps)
    phase = motor.phase_after(phase, on, state.side_radps, limits.idle_radps)
    turns = phase == motor.TURNING
    closing = _clutch_closing(car, loop, course.closed[d], turns, step_s)
    planned = _planned_nm(car, task, course, now)
    wish = _wish(car, task, course, work.rows[state.way, state.variant], now, loop, pedal, phase,
                 closing, planned, gives, step_s)  # fmt: skip
    for m in range(len(machine_nm)):
        machine_nm[m] = course.machine_nm[d, m] if turns else 0.0
    _speeds(car, state.way, wheel, state.side_radps, speeds)
    given = allotted(car, work.rows, state.way, state.variant, wish, wheel, state.side_radps,
                     speeds, machine_nm)  # fmt: skip
    inputs = _inputs(car, loop, pedal, wish, given, closing, slope, machine_nm, step_s)
    began, load_w, full = state, task.load_w[0 if phase == motor.REST else 1, k], given.full
    for n in range(_ROUNDS):
        state, out = _stepped(car, work, began, inputs, wish, speeds, pace)
        mean_side = 0.5 * (began.side_radps + state.side_radps)
        _speeds(car, state.way, 0.5 * (wheel + state.speed_mps / body.radius_m), mean_side, speeds)
        starts_w = max(out.engine_nm * mean_side, 0.0) / limits.spin_efficiency
        drawn_w = load_w + (starts_w if phase == motor.STARTING else 0.0)
        if n == _ROUNDS - 1 or not held_back(car, wish, speeds, machine_nm, drawn_w):
            break
        full = not wish.braking
    power = bus_w(car, machine_nm, speeds) + load_w
    energy = energy_after(car.loop, energy, power, phase, out, mean_side, step_s)
    pedal = remembered(pedal, full and pedal.error_mps > 0.0, body, driver, step_s)
    cause = motor.CHANGE if closing > 0.0 else motor.NONE
    record_step(row, state, pedal, energy, phase, cause, full, out, machine_nm)
    return FreeLoop(state, pedal, phase, closing, energy, ahead), planned


@compiled(bare=True, nogil=True)
def advance(
    car: FreeCar, task: LoopTask, course: FreeCourse, work: Work, loop: FreeLoop, first: int, record: Array,
    step_s: float,
) -> FreeLoop:  # fmt: skip
    """The loop after some more steps, `first` of them being the first; record: (step, column), filled.

    The engine is that of the steady map.
    """
    pace, start = pace_of(step_s, car.loop.body.tyre.lag_s), task.time_s[0]
    place = Place(start, 0, 0)
    for i in range(len(record)):
        place = place_of(task, place, start + (first + i) * step_s)
        if not is_answered(car.loop, task, loop, place.d, step_s):
            break
        gives = by_map(loop.state.side_radps, car.loop.limits)
        loop, _ = after_step(car, task, course, work, loop, place, gives, pace, record[i])
    return loop
