"""Full pedal of a car whose engine has a speed of its own: where it turns, and how fast the car gets.

At every speed of the car the engine turns where the force at the tyres is highest at steady speed, machines and
battery within their limits; the loop of `hevopt drive` takes it there and gives what it then can.
"""

from typing import NamedTuple

import numpy as np

from hevopt.car.architecture import Architecture
from hevopt.car.handling import DriverGains
from hevopt.errors import DataError
from hevopt.forward import _drive_kernels as drive
from hevopt.forward import _free_loop_kernels as free
from hevopt.forward import _pull_kernels as pull
from hevopt.forward import _rows_kernels as col
from hevopt.forward._acting_kernels import LoopCar, LoopTask
from hevopt.forward._free_kernels import FreeCar, FreeCourse
from hevopt.forward._limits_kernels import Motors
from hevopt.forward._pedal_kernels import PedalState
from hevopt.forward.breathing import EngineModel, breathing_of
from hevopt.forward.forces import Curves, resistance_n, tabulated
from hevopt.forward.lines import Line
from hevopt.forward.loads import own_loads_w
from hevopt.forward.loops import free_car
from hevopt.problem.arrays import Array, Flags
from hevopt.units import STANDARD_GRAVITY_MPS2

# Shares of full load, and speeds of the engine and of the car, among which the highest force is looked for.
_SHARES = np.linspace(1.0, 0.0, 11)
_ENGINE_SPEEDS, _SPEEDS = 61, 240
_LOWEST_MPS, _HIGHEST_MPS = 0.1, 300 / 3.6
_HALVINGS = 20
# Forces that are the same within this share.
_SAME = 1e-6
# How much more than at steady speed is asked for, and for how many steps.
_ASKED, _PIECE = 1.05, 5
# Share of the battery's power that is asked for: what the wheels accelerate otherwise than asked is the governor's
# to take up within a step, out of the rest [E].
_RESERVED = 0.95
# What losses take from the battery beside what it gives, at most: as much again.
_SPARE = 2.0
_FOR_EVER_S = 1e9


class Fullest(NamedTuple):
    """(speed,) highest force at the tyres; speed and torque of the engine for it; whether the lock-up is closed."""

    force_n: Array
    engine_radps: Array
    engine_nm: Array
    closed: Flags


class FreePull:
    """A car at full pedal; with the battery's help or without, when what the generator gives is all there is.

    engine_model: with the mean-value engine it is taken where the force is highest by the steady map
    """

    def __init__(
        self,
        car: Architecture,
        line: Line,
        driven: LoopCar,
        helped: bool,
        engine_model: EngineModel,
    ) -> None:
        self._of_car, self._engine_model = car, engine_model
        still = DriverGains(*[0.0] * len(DriverGains._fields))._replace(
            governor_s=driven.driver.governor_s, start_s=driven.driver.start_s
        )
        whole = free_car(car, line, driven._replace(driver=still))
        motors = whole.motors._replace(most_w=_RESERVED * whole.motors.most_w)
        self._car = whole._replace(motors=motors)
        self._loads_w = own_loads_w(car)
        self._work = drive.work_of(driven.ways)
        self.speed_mps = np.linspace(_LOWEST_MPS, _HIGHEST_MPS, _SPEEDS)
        self.alone = _fullest(car, self._car, self.speed_mps, 0.0)
        self.helped = (
            _fullest(car, self._car, self.speed_mps, self._car.motors.most_w) if helped else None
        )
        self._between_mps = float(self.speed_mps[1] - self.speed_mps[0])
        tyre = driven.body.tyre
        self._grip_n = tyre.friction * driven.body.mass_kg * STANDARD_GRAVITY_MPS2
        self._axle_n = self._grip_n * tyre.driven_share
        self._resistance_n = resistance_n(driven, self.speed_mps)

    def curves(self, helped: bool) -> Curves:
        """Forces at the tyres over speed."""
        best = self.helped if helped and self.helped is not None else self.alone
        return Curves(self.speed_mps, best.force_n[None, :], self._resistance_n, self._axle_n)

    def pulled(
        self, speed_mps: float, start_j: float, until: tuple[float, float], step_s: float, steps: int
    ) -> Array:  # fmt: skip
        """The record of `pull` from a speed, engine idling before; until: speed and distance, else all steps."""
        wheel = speed_mps / self._car.loop.body.radius_m
        task = _task(self._loads_w, speed_mps)
        course = FreeCourse(np.array([self._slowest(wheel)]), np.zeros(1),
                            np.zeros((1, len(self._work.machine_nm))), np.zeros(1, dtype=bool))  # fmt: skip
        loop = free.begun(self._car, task, course, start_j)
        breathing = breathing_of(self._of_car, self._engine_model, loop.state.side_radps)
        advance = free.advance if breathing is None else breathing.advance_free
        task = _task(self._loads_w, 1.0)
        rows = np.zeros((steps, drive.COLUMNS + len(self._work.machine_nm) - 1))
        done = 0
        for first in range(0, steps, _PIECE):
            part, car, best = rows[first : first + _PIECE], self._car, self.helped
            # What a piece may take is left above the window's lower end.
            left_j = loop.energy_j - car.loop.window_j[0]
            if best is None or left_j <= _SPARE * step_s * _PIECE * car.motors.most_w:
                best, car = self.alone, car._replace(motors=car.motors._replace(most_w=0.0))
            loop = self._ordered(loop, course, best)
            loop = advance(car, task, course, self._work, loop, first, part, step_s)
            done = first + len(part)
            moved_m = step_s * float(np.sum(rows[:done, drive.SPEED]))
            if loop.state.speed_mps >= until[0] and moved_m >= until[1]:
                break
        return _as_pulled(rows[:done], speed_mps, step_s)

    def _slowest(self, wheel: float) -> float:
        """Slowest speed of the engine at which the governor is not too fast."""
        g, ways, idle = (
            self._car.governor + 1,
            self._car.loop.ways,
            self._car.loop.limits.idle_radps,
        )
        own, per = ways.wheel[0, g] * wheel, ways.side[0, g]
        top = self._car.motors.top_radps[self._car.governor]
        return float(max(idle, min((-top - own) / per, (top - own) / per)))

    def _ordered(self, loop: free.FreeLoop, course: FreeCourse, best: Fullest) -> free.FreeLoop:
        """The loop with the pedal floored; course: filled for the speed that it has."""
        place = (loop.state.speed_mps - _LOWEST_MPS) / self._between_mps
        k = min(max(round(place), 0), _SPEEDS - 1)
        course.engine_radps[0], course.engine_nm[0] = best.engine_radps[k], best.engine_nm[k]
        course.closed[0] = best.closed[k]
        force = min(_ASKED * float(best.force_n[k]), self._grip_n)
        return loop._replace(pedal=PedalState(force, 0.0, 0.0, 0.0, False), ahead_mps=1.0)


def check_free_pull(car: Architecture, fills: bool, boost_lag_s: float) -> None:
    """DataError for a lag of the map's boost, or its filling, of an engine that has a speed of its own."""
    if not car.driveline.free_engine_speed:
        return
    if boost_lag_s > 0:
        raise DataError(
            f"{car.name}: boost lag {boost_lag_s:g} s, but the steady map of an engine that has a speed of its own "
            "has no lag; leave --boost-lag out (with --engine-model mean_value the turbocharger has its own)"
        )
    if fills:
        raise DataError(
            f"{car.name}: no machine turns with an engine that has a speed of its own, to fill what its "
            "turbocharger lacks; leave fills out"
        )


def _task(loads_w: Array, speed_mps: float) -> LoopTask:
    """For ever at a speed on a level road, the engine on; who is at the pedal does not look at it."""
    ever, zero = np.array([0.0, _FOR_EVER_S]), np.zeros(1)
    return LoopTask(
        ever, np.full(2, float(speed_mps)), zero, loads_w, ever, np.zeros(1, dtype=np.int64),
        np.ones(1, dtype=bool), np.zeros(1, dtype=np.int64), zero, np.zeros(2),
        np.zeros((1, 0)),
    )  # fmt: skip


def _as_pulled(rows: Array, speed_mps: float, step_s: float) -> Array:
    """What a loop recorded, in the columns of `pull`."""
    found: Array = np.zeros((len(rows), pull.COLUMNS))
    before = np.append(speed_mps, rows[:-1, drive.SPEED])
    found[:, pull.SPEED] = rows[:, drive.SPEED]
    found[:, pull.DISTANCE] = np.cumsum(0.5 * step_s * (before + rows[:, drive.SPEED]))
    found[:, pull.ENERGY], found[:, pull.SIDE] = rows[:, drive.ENERGY], rows[:, drive.SIDE]
    found[:, pull.FORCE], found[:, pull.MACHINE] = rows[:, drive.TYRE], rows[:, drive.MACHINE]
    return found


def _fullest(car: Architecture, driven: FreeCar, speed_mps: Array, most_w: float) -> Fullest:
    """The highest force at every speed with a power from the battery's terminals."""
    limits, ways = driven.loop.limits, driven.loop.ways
    wheel = speed_mps[:, None, None] / driven.loop.body.radius_m
    turning = np.unique(np.linspace(limits.idle_radps, limits.engine_max_radps, _ENGINE_SPEEDS))
    sides = [np.broadcast_to(turning[None, :, None], (len(speed_mps), len(turning), 1))]
    if (ratio := ways.wheel[0, -1]) != 0.0:
        sides.append(ratio * wheel)
    forces, speeds, torques = [], [], []
    for joined, side in enumerate(sides):
        full = np.maximum(tabulated(limits.full_nm, limits.engine_step, side), 0.0)
        torque = full * _SHARES
        force = np.min(
            [_force_n(car, driven, row, (wheel, side, torque), most_w, bool(joined))
             for row in col.settled_rows(ways)[0]], axis=0,
        )  # fmt: skip
        turns = (side >= limits.idle_radps) & (side <= limits.engine_max_radps)
        forces.append(np.where(turns, force, -np.inf).reshape(len(speed_mps), -1))
        speeds.append(np.broadcast_to(side, force.shape).reshape(len(speed_mps), -1))
        torques.append(np.broadcast_to(torque, force.shape).reshape(len(speed_mps), -1))
    force, side, torque = (np.concatenate(each, axis=1) for each in (forces, speeds, torques))
    best = np.max(force, axis=1, keepdims=True)
    among = force >= best - _SAME * np.abs(best)
    # Of the same force that with more power, as the next speed may need it.
    chosen = np.argmax(np.where(among, side * torque, -1.0), axis=1)
    at = np.arange(len(speed_mps)), chosen
    closed = chosen >= forces[0].shape[1]
    return Fullest(np.maximum(force[at], 0.0), side[at], torque[at], closed)


def _force_n(
    car: Architecture, driven: FreeCar, row: Array, state: tuple[Array, Array, Array], most_w: float, joined: bool
) -> Array:  # fmt: skip
    """(speed, engine speed, share) force at the tyres at steady speed; -inf where a limit is exceeded.

    row: of one choice of directions; state: speeds of wheels and engine's side, and the engine's torque
    """
    wheel, side, engine_nm = state
    g, d, ways = driven.governor, driven.driving, driven.loop.ways
    speeds = [ways.wheel[0, m + 1] * wheel + ways.side[0, m + 1] * side for m in (g, d)]
    shape = np.broadcast_shapes(wheel.shape, side.shape, engine_nm.shape)
    radps_g, radps_d = (np.broadcast_to(speed, shape) for speed in speeds)
    at_wheels, at_side = (
        row[[col.MACHINES + col.PER_MACHINE * m + n for m in (g, d)]] for n in (0, 1)
    )
    most_d = _most_nm(driven.motors, d, radps_d)

    def governor_nm(driving_nm: Array) -> Array:
        if joined:
            return np.zeros(shape)
        left = row[col.SIDE_ENGINE] * engine_nm + at_side[1] * driving_nm
        held: Array = -left / at_side[0]
        return held

    def drawn_w(driving_nm: Array) -> Array:
        given = zip((g, d), (governor_nm(driving_nm), driving_nm), (radps_g, radps_d), strict=True)
        bus = own_loads_w(car)[1, 0]
        for m, torque, radps in given:
            bus = (
                bus + torque * radps + car.machines[m].loss_w(np.broadcast_to(torque, shape), radps)
            )
        return car.terminal_w(bus)

    low, high = np.zeros(shape), most_d.copy()
    for halving in range(_HALVINGS + 1):
        tried = high if halving == 0 else 0.5 * (low + high)
        held = np.abs(governor_nm(tried)) <= _most_nm(driven.motors, g, radps_g) * (1 + _SAME)
        fits = held & (drawn_w(tried) <= most_w)
        low, high = np.where(fits, tried, low), np.where(fits, high, tried)
    drawn = drawn_w(low)
    held = np.abs(governor_nm(low)) <= _most_nm(driven.motors, g, radps_g) * (1 + _SAME)
    fits = held & (drawn <= most_w) & (drawn >= driven.motors.least_w)
    through = row[col.SIDE_ENGINE] * engine_nm + at_side[1] * low if joined else 0.0
    total = row[col.ENGINE] * engine_nm + at_wheels[0] * governor_nm(low) + at_wheels[1] * low
    total = total + row[col.CLUTCH] * through
    return np.where(fits, total / driven.loop.body.radius_m, -np.inf)


def _most_nm(motors: Motors, m: int, radps: Array) -> Array:
    """Highest torque of a machine, 0 beyond its highest speed."""
    most = tabulated(motors.limit_nm[m], motors.step_radps[m], np.abs(radps))
    return np.where(np.abs(radps) <= motors.top_radps[m], most, 0.0)
