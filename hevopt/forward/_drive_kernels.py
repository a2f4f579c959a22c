"""The loop: driver, lever, clutch and sharing of torques around the plant's step, from first to last. Compiled.

Nothing but charge feeds back, so the loop keeps no books: it returns what acted in every step, and the books
(books.py) are made of that with the car's own components.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hevopt._compile import compiled
from hevopt.forward import _motor_kernels as motor
from hevopt.forward import _rows_kernels as col
from hevopt.forward._acting_kernels import (
    LoopCar,
    LoopTask,
    Now,
    asked_of,
    inputs_of,
    is_called,
    split_of,
)
from hevopt.forward._asks_kernels import answered
from hevopt.forward._beside_kernels import beside_w
from hevopt.forward._contact_kernels import Pace, pace_of, wheel_radps
from hevopt.forward._fluid_kernels import may_lock
from hevopt.forward._lever_kernels import Lever, changed, resting_lever
from hevopt.forward._limits_kernels import Gives, by_map, electric_w, terminal_w
from hevopt.forward._pedal_kernels import PedalState, pressed, remembered, wanted_at
from hevopt.forward._plant_kernels import step
from hevopt.forward._rows_kernels import Outputs, State, Ways, row_length, settled_rows, turning
from hevopt.forward._share_kernels import pace_nm
from hevopt.problem._battery_kernels import chemical_power_at

Array = NDArray[np.float64]

# Columns of what is recorded: after the step
SPEED, FORCE, SIDE, WAY, FROM_WAY, BLEND, ENERGY = range(7)
# in the step, the car
ENGINE, MACHINE, CLUTCH, WHEEL, BRAKE, HELD, TYRE, ROAD = range(7, 15)
# and its driver: force asked for, as numbers of _motor_kernels the engine's phase and why the clutch slips; whether
# all is given and too little; and the directions in which power passed the joints
ASKED, PHASE, CAUSE, FULL, VARIANT = range(15, 20)
# Torque lost in a gearbox with a map, at its input; what the wheels turn beyond rolling, and the tyres' slip; what
# a torque converter takes and gives beside its lock-up clutch. Behind them torques of machines beyond the first.
LOST, SPIN, SLIP, IMPELLER, TURBINE = range(20, 25)
COLUMNS = 25


class Work(NamedTuple):
    """What a loop works with: settled_rows of the ways, room for a row of a moving one, and (machine,) for more."""

    rows: Array
    moving: Array
    machine_nm: Array
    machine_radps: Array


class Loop(NamedTuple):
    """The loop between two steps: the car, its driver and lever, clutch and charge, and the trace's speed."""

    state: State
    pedal: PedalState
    lever: Lever
    joint: motor.Joined
    energy_j: float
    ahead_mps: float


class Place(NamedTuple):
    """A time, the step of the trace in which it lies, and that of the plan."""

    at_s: float
    k: int
    d: int


class Look(NamedTuple):
    """What a decision sees: speed, and torque at the wheels that the driver asks for, 0 where the car is held."""

    speed_mps: float
    wheel_nm: float


@compiled()
def work_of(ways: Ways) -> Work:
    """Room for the loop's work."""
    machines = len(ways.inertia_kgm2) - 2
    moving = np.empty(row_length(ways))
    return Work(settled_rows(ways), moving, np.zeros(machines), np.zeros(machines))


@compiled(bare=True)
def begun(car: LoopCar, task: LoopTask, start_j: float) -> Loop:
    """The loop before its first step."""
    output = len(car.ways.inertia_kgm2) - 1
    on = task.engine_on[0]
    turns = car.ways.wheel[task.way[0], output] * task.speed_mps[0] / car.body.radius_m
    side = max(car.limits.idle_radps, turns) if on else 0.0
    state = State(task.speed_mps[0], 0.0, side, task.way[0], task.way[0], 0.0, 0, 0.0, 0.0, 0.0)
    lever, pedal = resting_lever(task.way[0]), PedalState(0.0, 0.0, 0.0, 0.0, True)
    fluid = car.ways.fluid
    flows = on and len(fluid.locks) > 0
    shut = side == turns and (not flows or may_lock(fluid, resting_lever(task.way[0]), turns))
    joint = motor.Joined(motor.TURNING if on else motor.REST, 1.0 if shut else 0.0, False, 0,
                         car.limits.idle_radps, flows)  # fmt: skip
    return Loop(state, pedal, lever, joint, start_j, task.speed_mps[0])


@compiled(bare=True)
def seen(
    car: LoopCar, task: LoopTask, loop: Loop, at_s: float, for_s: float, step_s: float
) -> Look:
    """What a decision sees that holds for a time: the middle of what the driver asks for at its start."""
    k = step_at(task.time_s, at_s, 0)
    ahead = wanted_at(task.time_s, task.speed_mps, at_s + step_s + car.driver.preview_s, k)
    pedal = pressed(loop.pedal, loop.ahead_mps, ahead, loop.state.speed_mps, task.slope_rad[k], car.body,
                    car.driver, step_s)  # fmt: skip
    if pedal.holds:
        return Look(0.0, 0.0)
    middle = loop.state.speed_mps + 0.5 * for_s * pedal.accel_mps2
    return Look(max(middle, 0.0), pedal.force_n * car.body.radius_m)


@compiled(bare=True)
def step_at(time_s: Array, at_s: float, k: int) -> int:
    """The step of some times, k or a later one, in which a time lies; the last one beyond the end."""
    while k < len(time_s) - 2 and at_s >= time_s[k + 1] - 1e-9:
        k += 1
    return k


@compiled(bare=True)
def energy_after(
    car: LoopCar, energy_j: float, power_w: float, phase: int, out: Outputs, mean_side: float, step_s: float
) -> float:  # fmt: skip
    """Stored energy after a step with a power of machines and loads, and of a starter that turns the engine."""
    if phase == motor.STARTING:
        power_w += max(out.engine_nm * mean_side, 0.0) / car.limits.spin_efficiency
    terminal = terminal_w(power_w, car.limits)
    return float(energy_j - step_s * chemical_power_at(terminal, energy_j, car.battery))


@compiled(bare=True)
def record_step(
    row: Array, state: State, pedal: PedalState, energy_j: float, phase: int, cause: int, full: bool,
    out: Outputs, machine_nm: Array,
) -> None:  # fmt: skip
    """A step's columns: the car after it, and what acted in it."""
    row[SPEED], row[FORCE], row[SIDE] = state.speed_mps, state.force_n, state.side_radps
    row[WAY], row[FROM_WAY], row[BLEND] = state.way, state.from_way, state.blend
    row[ENERGY], row[ENGINE], row[MACHINE] = energy_j, out.engine_nm, machine_nm[0]
    row[CLUTCH], row[WHEEL], row[BRAKE] = out.clutch_nm, out.wheel_nm, out.brake_nm
    row[HELD], row[TYRE], row[ROAD] = out.held_nm, out.force_n, out.road_n
    row[ASKED], row[PHASE], row[CAUSE] = pedal.force_n, phase, cause
    row[FULL], row[VARIANT] = 1.0 if full else 0.0, state.variant
    row[LOST], row[SPIN], row[SLIP] = state.lost_nm, state.spin_radps, state.slip
    row[IMPELLER], row[TURBINE] = out.impeller_nm, out.turbine_nm
    for m in range(1, len(machine_nm)):
        row[COLUMNS + m - 1] = machine_nm[m]


@compiled(bare=True)
def way_asked(
    car: LoopCar, asked: int, lever: Lever, joint: motor.Joined, pedal: PedalState, rolling_radps: float
) -> int:  # fmt: skip
    """The way that the driver takes of one asked for: none with a higher gear that the engine would idle in.

    A car left behind by its trace has not the speed of which the plan's gear is: it keeps the gear that is in, or
    has the one before again.
    """
    output = len(car.ways.inertia_kgm2) - 1
    ratio = car.ways.wheel[asked, output]
    slow = 0.0 < ratio * rolling_radps < car.limits.idle_radps and len(car.ways.fluid.locks) == 0
    if not slow or joint.phase != motor.TURNING or pedal.force_n < 0.0:
        return asked
    before = lever.back if lever.way == asked and lever.back >= 0 else lever.way
    return before if ratio < car.ways.wheel[before, output] else asked


@compiled(inline="always")
def after_step(
    car: LoopCar, task: LoopTask, work: Work, loop: Loop, place: Place, gives: Gives, pace: Pace, row: Array
) -> tuple[Loop, float]:  # fmt: skip
    """The loop after one step, and the torque wanted of the engine; gives: what this can give; row: filled."""
    rows, machine_nm, step_s = work.rows, work.machine_nm, pace.step_s
    output = len(car.ways.inertia_kgm2) - 1
    state, pedal, lever, joint, energy, wanted = loop
    at_s, k, d = place
    ahead = wanted_at(task.time_s, task.speed_mps, at_s + step_s + car.driver.preview_s, k)
    wheel = wheel_radps(state.speed_mps, state.spin_radps, car.body)
    rolling, slope = state.speed_mps / car.body.radius_m, task.slope_rad[k]
    pedal = pressed(pedal, wanted, ahead, state.speed_mps, slope, car.body, car.driver, step_s)
    machine = turning(car.ways.wheel, lever.way, lever.from_way, lever.blend, 1) * wheel
    keeps_nm = pace_nm(machine, car.limits)
    way = way_asked(car, task.way[d], lever, joint, pedal, rolling)
    lever = changed(lever, way, rolling, car.ways, car.fast_way, car.fast_radps,
                    car.shifting, step_s, keeps_nm)  # fmt: skip
    machine = turning(car.ways.wheel, lever.way, lever.from_way, lever.blend, 1) * wheel
    machine += car.ways.side[lever.way, 1] * state.side_radps
    now = Now(d, k, at_s, energy, state.side_radps)
    wish = asked_of(car, task, now, state, pedal, lever, machine, gives)
    on = task.engine_on[d] or is_called(task, now, state, car.driver)
    phase = motor.phase_after(joint.phase, on, state.side_radps, car.limits.idle_radps)
    ratio = car.ways.wheel[lever.way, output]
    begins = lever.since_s == 0.0 and lever.blend > 0.0
    fluid = car.ways.fluid
    if len(fluid.locks) > 0:
        neutral = task.apart[d] == 2 or (pedal.holds and not fluid.in_gear_at_rest)
        locks = task.apart[d] != 3 and may_lock(fluid, lever, ratio * wheel)
        joint = motor.locked_up(joint, phase, lever.gap_s > 0.0, neutral, locks, car.limits, car.body.clutch,
                                step_s)  # fmt: skip
    else:
        neutral = task.apart[d] == 2 or (task.apart[d] == 1 and wish.braking) or pedal.holds
        need = wish.wheel_nm / max(rows[lever.way, 0, col.CLUTCH], 1e-9) + state.lost_nm
        joint = motor.joined(joint, phase, lever.gap_s > 0.0 or begins, neutral, wish.braking,
                             ratio * wheel, need, car.limits, car.body.clutch, step_s)  # fmt: skip
    load_w = task.load_w[0 if phase == motor.REST else 1, k]
    for m in range(1, len(machine_nm)):
        machine_nm[m] = task.others_nm[d, m - 1]
    given = split_of(car, rows, now, state, wish, joint, lever, load_w, machine_nm, step_s)
    machine_nm[0] = given.machine_nm
    inputs = inputs_of(car, state, pedal, joint, lever, given, gives, slope, machine_nm, step_s)
    state, out = step(car.body, car.ways, rows, state, inputs, pace, work.moving)
    rate = turning(car.ways.wheel, state.way, state.from_way, state.blend, 1)
    mean = 0.5 * (machine + rate * state.speed_mps / car.body.radius_m + rate * state.spin_radps
                  + car.ways.side[state.way, 1] * state.side_radps)  # fmt: skip
    power = electric_w(given.machine_nm, mean, car.limits)
    mean_n = 0.5 * (now.side_radps + state.side_radps)
    if len(machine_nm) > 1:
        mean_w = 0.5 * (wheel + wheel_radps(state.speed_mps, state.spin_radps, car.body))
        power += beside_w(car.beside, car.ways, lever, mean_w, mean_n, machine_nm)
    energy = energy_after(car, energy, power + load_w, phase, out, mean_n, step_s)
    passes = joint.closing > 0.0 or joint.launches or joint.flows
    stuck = phase == motor.TURNING and not passes
    stuck = stuck or lever.gap_s > 0.0
    pedal = remembered(pedal, (stuck and not wish.braking) or (given.full and
                       pedal.error_mps > 0.0), car.body, car.driver, step_s)  # fmt: skip
    record_step(row, state, pedal, energy, phase, joint.cause, given.full, out, machine_nm)
    return Loop(state, pedal, lever, joint, energy, ahead), given.wanted_nm


@compiled(inline="always")
def place_of(task: LoopTask, before: Place, at_s: float) -> Place:
    """Where a time lies in trace and plan, at an earlier place or behind it."""
    return Place(at_s, step_at(task.time_s, at_s, before.k), step_at(task.from_s, at_s, before.d))


@compiled(bare=True)
def is_answered(car: LoopCar, task: LoopTask, loop: Any, d: int, step_s: float) -> bool:
    """Whether the plan has a step d; whoever decides is asked for it as it begins. loop: a Loop, or a FreeLoop."""
    asks = task.asks
    if asks.address == 0 or d <= asks.last[0]:
        return True
    look = seen(car, task, loop, task.from_s[d], asks.for_s, step_s)
    asks.told[0], asks.told[1], asks.told[2] = look.speed_mps, look.wheel_nm, loop.energy_j
    asks.last[0] = d
    return answered(asks.address, d) == 0


@compiled(bare=True, nogil=True)
def advance(
    car: LoopCar, task: LoopTask, work: Work, loop: Loop, first: int, record: Array, step_s: float
) -> Loop:  # fmt: skip
    """The loop after some more steps, `first` of them being the first; record: (step, column), filled.

    The engine is that of the steady map.
    """
    pace, start = pace_of(step_s, car.body.tyre.lag_s), task.time_s[0]
    place = Place(start, 0, 0)
    for i in range(len(record)):
        place = place_of(task, place, start + (first + i) * step_s)
        if not is_answered(car, task, loop, place.d, step_s):
            break
        gives = by_map(loop.state.side_radps, car.limits)
        loop, _ = after_step(car, task, work, loop, place, gives, pace, record[i])
    return loop
