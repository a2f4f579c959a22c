"""Who gives what where the engine has a speed of its own: engine, the machine that keeps it, the one that drives.

With the row of the way driven, what reaches wheels and engine's side is linear in all torques,

    wheels   W = e T_engine + Σ g T_machine + c T_clutch - inertia of both accelerations
    side     0 = p T_engine + Σ s T_machine -   T_clutch - inertia of both accelerations

The engine has its planned torque. While nothing joins it to the wheels, one machine, the governor, has the torque
that brings its speed to the planned one, and the other the one that the driver asks for: two equations. To let the
engine turn faster the governor lets go of it, and hardly pushes; to have it slower it charges the battery, and what
this does not take the engine gives way by, as where it is too strong. Joined to the wheels by a lock-up clutch one
equation is left, for the machine that drives. What this one may not give is the brakes', or lacks.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hevopt._compile import compiled
from hevopt.forward import _motor_kernels as motor
from hevopt.forward import _rows_kernels as col
from hevopt.forward._acting_kernels import LoopCar, Now
from hevopt.forward._limits_kernels import Motors, electric_of, limit_nm, lowered, terminal_w
from hevopt.forward._rows_kernels import Array
from hevopt.forward._solve_kernels import SolvedStep, directions

_TRIES = 4
_NOTHING = 1e-12
# Share of its highest torque by which a governor pushes the engine faster or slower beyond holding it.
_PUSH = 0.1
# Share of the governor's highest speed up to which the engine turns it, and of its own; beyond it has no torque.
_NEARLY = 0.999


class FreeCar(NamedTuple):
    """A car whose engine has a speed of its own.

    governor, driving: numbers of its machines; fuelled_nm: lowest torque of a fuelled engine
    """

    loop: LoopCar
    motors: Motors
    governor: int
    driving: int
    fuelled_nm: float


class FreeCourse(NamedTuple):
    """What the engine and what joins it shall do in each step of a plan.

    engine_radps, engine_nm: (step,); machine_nm: (step, machine); closed: (step,) whether the lock-up clutch is
    """

    engine_radps: Array
    engine_nm: Array
    machine_nm: Array
    closed: NDArray[np.bool_]


class FreeWish(NamedTuple):
    """What a step shall do: torque at the wheels, accelerations of wheels and engine's side; what limits it.

    engine_nm: planned, between least_nm and most_nm, or an engine's drag that is stopped; turns: whether it runs
    joined: to the wheels
    holds: the car is held at rest; least_w, most_w: at the battery's terminals; load_w: electric load
    """

    wheel_nm: float
    accel: float
    side_accel: float
    engine_nm: float
    least_nm: float
    most_nm: float
    turns: bool
    joined: bool
    holds: bool
    braking: bool
    least_w: float
    most_w: float
    load_w: float


class Allotted(NamedTuple):
    """Torques of a step but the machines'; side_accel: as limits leave it; full: all is given, and too little."""

    engine_nm: float
    side_accel: float
    clutch_nm: float
    brake_nm: float
    full: bool


@compiled(bare=True)
def _clip(value: float, low: float, high: float) -> float:
    return min(max(value, low), high)


@compiled(bare=True)
def governed(car: FreeCar, wheel: float) -> tuple[float, float]:
    """Lowest and highest speed of the engine at which its governor may turn with it, at a speed of the wheels."""
    unit, top = car.governor + 1, _NEARLY * car.motors.top_radps[car.governor]
    own, per = car.loop.ways.wheel[0, unit] * wheel, car.loop.ways.side[0, unit]
    ends = (-top - own) / per, (top - own) / per
    return min(ends), max(ends)


@compiled(bare=True)
def begins_radps(car: FreeCar, course: FreeCourse, speed_mps: float) -> float:
    """Speed at which the engine turns as a car begins: no faster than its governor may turn with it."""
    low, high = governed(car, speed_mps / car.loop.body.radius_m)
    return float(max(min(max(course.engine_radps[0], low), high), car.loop.limits.idle_radps))


@compiled(bare=True)
def side_after(
    car: FreeCar, course: FreeCourse, now: Now, phase: int, wheel: float, ahead: float, step_s: float, more: float
) -> float:  # fmt: skip
    """The engine's speed after a step; wheel, ahead: speed of the wheels now, and as asked for at its end.

    A first-order lag behind the planned one, times `more`, or the clutch's, within its own highest speed and the
    governor's, whether the wheels get as fast as asked or not; or as it is started or stopped.
    """
    limits, driver, n, ways = car.loop.limits, car.loop.driver, now.side_radps, car.loop.ways
    idle = limits.idle_radps
    if phase == motor.TURNING:
        target = more * course.engine_radps[now.step]
        if course.closed[now.step]:
            target = ways.wheel[0, len(ways.inertia_kgm2) - 1] * ahead
        target = min(max(target, idle), _NEARLY * limits.engine_max_radps)
        after = n + (1.0 - np.exp(-step_s / driver.governor_s)) * (target - n)
        (low, high), (low_ahead, high_ahead) = governed(car, wheel), governed(car, ahead)
        return float(max(min(max(after, low, low_ahead), high, high_ahead), idle))
    if phase == motor.STARTING:
        return max(min(n + idle / driver.start_s * step_s, idle), min(n, idle))
    return max(n - idle / driver.stop_s * step_s, 0.0)


@compiled(bare=True)
def may_not_rest(car: FreeCar, wheel: float) -> bool:
    """Whether the governor would turn too fast beside an engine at rest."""
    own = car.loop.ways.wheel[0, car.governor + 1] * wheel
    return bool(abs(own) > _NEARLY * car.motors.top_radps[car.governor])


@compiled(bare=True)
def bus_w(car: FreeCar, machine_nm: Array, speeds: Array) -> float:
    """Electric power of all machines."""
    total = 0.0
    for m in range(len(machine_nm)):
        total += electric_of(car.motors, m, machine_nm[m], speeds[m])
    return total


@compiled(bare=True)
def _within(car: FreeCar, wish: FreeWish, speeds: Array, machine_nm: Array) -> None:
    """The driving machine's torque within its own limit and the battery's."""
    d, motors, limits = car.driving, car.motors, car.loop.limits
    most = limit_nm(motors, d, speeds[d])
    wanted = _clip(machine_nm[d], -most, most)
    machine_nm[d] = 0.0
    rest = bus_w(car, machine_nm, speeds) + wish.load_w
    rest -= electric_of(motors, d, 0.0, speeds[d])
    machine_nm[d] = wanted
    for sign, end_w in ((1.0, wish.most_w), (-1.0, -wish.least_w)):
        # At rest it draws what it loses.
        if sign * wanted * speeds[d] < 0.0 or (sign < 0.0 and wanted * speeds[d] == 0.0):
            continue
        drawn = rest + electric_of(motors, d, wanted, speeds[d])
        if sign * terminal_w(drawn, limits) <= end_w:
            continue
        machine_nm[d] = lowered(motors, limits, d, wanted, speeds[d], rest, sign, end_w)


@compiled(bare=True)
def _others(row: Array, car: FreeCar, machine_nm: Array) -> tuple[float, float]:
    """What machines beside governor and driving one bring to wheels and side."""
    wheel, side = 0.0, 0.0
    for m in range(len(machine_nm)):
        if m not in (car.governor, car.driving):
            wheel += row[col.MACHINES + col.PER_MACHINE * m] * machine_nm[m]
            side += row[col.MACHINES + col.PER_MACHINE * m + 1] * machine_nm[m]
    return wheel, side


@compiled(bare=True)
def _apart(
    row: Array, car: FreeCar, wish: FreeWish, speeds: Array, machine_nm: Array
) -> tuple[float, float]:
    """Torques of both machines while nothing joins engine and wheels; the engine's, and its side's acceleration."""
    g, d, engine, side_accel = car.governor, car.driving, wish.engine_nm, wish.side_accel
    of_g, of_d = col.MACHINES + col.PER_MACHINE * g, col.MACHINES + col.PER_MACHINE * d
    gw, gs, dw, ds = row[of_g], row[of_g + 1], row[of_d], row[of_d + 1]
    wheel, side = _others(row, car, machine_nm)
    wheel = wish.wheel_nm + row[col.PER_W] * wish.accel - wheel
    side = row[col.SIDE_PER_W] * wish.accel - side
    a, b = wheel - row[col.ENGINE] * engine, side - row[col.SIDE_ENGINE] * engine
    per_nm = 1.0 / (gw * ds - dw * gs)
    still = (a * ds - dw * b) * per_nm
    needed = still + (row[col.PER_N] * ds - dw * row[col.SIDE_PER_N]) * per_nm * side_accel
    most = limit_nm(car.motors, g, speeds[g])
    if not wish.turns:
        # A starter brings the engine up; to have it rest the governor takes its momentum as far as it may.
        slows = most if side_accel < 0.0 else 0.0
        if gs * speeds[g] > 0.0:
            slows = min(slows, -wish.least_w / max(abs(speeds[g]), 1.0))
        held = -slows if gs > 0.0 else slows
        machine_nm[g] = _clip(needed, min(held, 0.0), max(held, 0.0))
        wheel -= gw * machine_nm[g] + row[col.ENGINE] * engine
        machine_nm[d] = (wheel + row[col.PER_N] * side_accel) / dw
        return engine, side_accel
    low, high = min(still, 0.0) - _PUSH * most, max(still, 0.0) + _PUSH * most
    if gs * speeds[g] > 0.0:
        # What slows the engine charges the battery, as far as that takes it.
        slows = min(most, -wish.least_w / max(abs(speeds[g]), 1.0))
        low, high = (min(low, -slows), high) if gs > 0.0 else (low, max(high, slows))
    machine_nm[g] = _clip(needed, max(low, -most), min(high, most))
    wheel -= gw * machine_nm[g]
    side -= gs * machine_nm[g]
    no_inertia = row[col.SIDE_PER_N] * dw - row[col.PER_N] * ds
    if machine_nm[g] != needed:
        if gs * (machine_nm[g] - needed) > 0.0 or abs(no_inertia) < _NOTHING:
            # The engine is too strong for what holds it: it gives way.
            a = wheel + row[col.PER_N] * side_accel
            b = side + row[col.SIDE_PER_N] * side_accel
            own = (dw * b - ds * a) / (dw * row[col.SIDE_ENGINE] - row[col.ENGINE] * ds)
            engine = _clip(own, wish.least_nm, max(engine, wish.least_nm))
        if abs(no_inertia) >= _NOTHING:
            a = wheel - row[col.ENGINE] * engine
            b = side - row[col.SIDE_ENGINE] * engine
            side_accel = (ds * a - dw * b) / no_inertia
    machine_nm[d] = (wheel + row[col.PER_N] * side_accel - row[col.ENGINE] * engine) / dw
    return engine, side_accel


@compiled(bare=True)
def _joined(
    row: Array, car: FreeCar, wish: FreeWish, speeds: Array, machine_nm: Array
) -> tuple[float, float, float]:
    """Torques while engine and wheels turn as one; the engine's, its acceleration, and the clutch's."""
    d, side_accel = car.driving, row[col.RATIO] * wish.accel
    dw = (
        row[col.MACHINES + col.PER_MACHINE * d]
        + row[col.CLUTCH] * row[col.MACHINES + col.PER_MACHINE * d + 1]
    )
    ew = row[col.ENGINE] + row[col.CLUTCH] * row[col.SIDE_ENGINE]
    taken = row[col.SIDE_PER_W] * wish.accel + row[col.SIDE_PER_N] * side_accel
    need = wish.wheel_nm + row[col.PER_W] * wish.accel + row[col.PER_N] * side_accel
    need += row[col.CLUTCH] * taken
    through = -taken
    for m in range(len(machine_nm)):
        if m != d:
            on = row[col.MACHINES + col.PER_MACHINE * m + 1] * machine_nm[m]
            need -= row[col.MACHINES + col.PER_MACHINE * m] * machine_nm[m] + row[col.CLUTCH] * on
            through += on
    engine = wish.engine_nm
    machine_nm[d] = (need - ew * engine) / dw
    wanted = machine_nm[d]
    _within(car, wish, speeds, machine_nm)
    if machine_nm[d] != wanted:
        engine = _clip((need - dw * machine_nm[d]) / ew, wish.least_nm, wish.most_nm)
    through += row[col.SIDE_ENGINE] * engine
    through += row[col.MACHINES + col.PER_MACHINE * d + 1] * machine_nm[d]
    return engine, side_accel, through


@compiled(bare=True)
def allotted(
    car: FreeCar, rows: Array, way: int, variant: int, wish: FreeWish, wheel: float, side: float,
    speeds: Array, machine_nm: Array,
) -> Allotted:  # fmt: skip
    """Torques of a step; machine_nm: filled, of all but governor and driving one the planned ones.

    wheel, side, speeds: of wheels, engine's side and machines, rad/s
    """
    joints, planned = car.loop.ways.load.shape[2], machine_nm[car.governor]
    engine, side_accel, clutch = wish.engine_nm, wish.side_accel, 0.0
    for _ in range(_TRIES):
        row = rows[way, variant]
        machine_nm[car.governor] = planned
        if wish.joined:
            engine, side_accel, clutch = _joined(row, car, wish, speeds, machine_nm)
        else:
            engine, side_accel = _apart(row, car, wish, speeds, machine_nm)
            if wish.holds:
                machine_nm[car.driving] = 0.0
            _within(car, wish, speeds, machine_nm)
        solved = SolvedStep(wish.accel, side_accel, engine, clutch, wish.joined)
        found = directions(row, joints, variant, machine_nm, solved, wheel, side, 1.0, 0.0)
        if found == variant:
            break
        variant = found
    over = row[col.ENGINE] * engine + row[col.CLUTCH] * clutch - wish.wheel_nm
    over -= row[col.PER_W] * wish.accel + row[col.PER_N] * side_accel
    for m in range(len(machine_nm)):
        over += row[col.MACHINES + col.PER_MACHINE * m] * machine_nm[m]
    slack = 1e-6 * abs(wish.wheel_nm) + 1e-9
    full = over < -slack and not wish.braking and not wish.holds
    return Allotted(engine, side_accel, clutch, max(over, 0.0) if wish.braking else 0.0, full)
