"""Compiled step of the driven car: implicit, stable at any length, exact in energy.

With all inertias as torques  -J (speed after - speed before) / h  on their own units (_rows_kernels),
one step from wheels' speed w and engine side's speed n is

    w' = w + h (F_mean - F_road) / (R m)                                                           (5)
    F' = decay F + (1 - decay) T/R,   F_mean = w0 F + w1 T/R          the lag (2), exact over the step
    T = Σ a q (torque - inertia) - brake,   Σ b p (torque - inertia) - T_clutch = 0

linear in w', n' and the clutch's torque, which is what holds both sides together within ± its
capacity (16): Coulomb friction, implicit, without events. The brake is Coulomb friction as well.
Powers taken with the mean of the speeds before and after are exact differences of kinetic energy.
"""

from typing import NamedTuple

import numpy as np

from hevopt._compile import compiled
from hevopt.forward import _rows_kernels as col
from hevopt.forward._contact_kernels import grip_n, resistance
from hevopt.forward._rows_kernels import State, fill_row, turning

# Rounds of guessing the directions of power; each flips those that proved wrong.
_ROUNDS = 8
# Power below which a direction is a matter of rounding.
_TINY_W = 1e-9
# Share of a speed within which a moving ratio is settled.
_SETTLED = 1e-13
# Slip of a locked clutch, by rounding.
_NO_SLIP_RADPS = 1e-9


class Outputs(NamedTuple):
    """Means over a step. held_nm: torque at the wheels that keeps a standing car from rolling back."""

    engine_nm: float
    clutch_nm: float
    wheel_nm: float
    brake_nm: float
    held_nm: float
    force_n: float
    road_n: float
    locked: bool


class _Sums(NamedTuple):
    """What a row and the torques of machines and brake make of the two equations, per change of speed."""

    ratio: float
    slip: float
    engine: float
    clutch: float
    per_w: float
    per_n: float
    known: float
    side_engine: float
    side_per_w: float
    side_per_n: float
    side_known: float


class _Motion(NamedTuple):
    """The wheels' equation: own (w' - w) = rest + per_nm x torque."""

    rest: float
    own: float
    per_nm: float


class _Solved(NamedTuple):
    """Changes of both speeds, and the torques of engine and clutch."""

    wheel: float
    side: float
    engine_nm: float
    clutch_nm: float
    locked: bool


@compiled()
def _sums(row, machine_nm, brake_nm, slip, per_s):
    known, side_known = -row[col.MOVED] * per_s - brake_nm, -row[col.SIDE_MOVED] * per_s
    for m in range(len(machine_nm)):
        at = col.MACHINES + col.PER_MACHINE * m
        known += row[at] * machine_nm[m]
        side_known += row[at + 1] * machine_nm[m]
    return _Sums(
        row[col.RATIO], slip, row[col.ENGINE], row[col.CLUTCH], row[col.PER_W] * per_s, row[col.PER_N] * per_s,
        known, row[col.SIDE_ENGINE], row[col.SIDE_PER_W] * per_s, row[col.SIDE_PER_N] * per_s, side_known,
    )  # fmt: skip


@compiled()
def _free(s, motion, engine_nm, clutch_nm):
    """Both changes for given torques."""
    own = motion.own + motion.per_nm * s.per_w
    across = motion.per_nm * s.per_n
    right = motion.rest + motion.per_nm * (s.known + s.engine * engine_nm + s.clutch * clutch_nm)
    below = s.side_known + s.side_engine * engine_nm - clutch_nm
    wheel = (right * s.side_per_n - across * below) / (own * s.side_per_n - across * s.side_per_w)
    return _Solved(
        wheel, (below - s.side_per_w * wheel) / s.side_per_n, engine_nm, clutch_nm, False
    )


@compiled()
def _locked(s, motion, engine_nm):
    """Both changes and the clutch's torque where no slip is left after the step."""
    inner = s.side_per_w + s.side_per_n * s.ratio
    through = s.side_known + s.side_engine * engine_nm + s.side_per_n * s.slip
    own = motion.own + motion.per_nm * (s.per_w + s.per_n * s.ratio + s.clutch * inner)
    right = motion.rest + motion.per_nm * (
        s.known + s.engine * engine_nm + s.per_n * s.slip + s.clutch * through
    )
    wheel = right / own
    return _Solved(wheel, s.ratio * wheel - s.slip, engine_nm, through - inner * wheel, True)


@compiled()
def _governed(s, motion, side, clutch_nm):
    """The wheels' change and the engine's torque for a given change of its side."""
    over = s.engine / s.side_engine
    given = s.side_per_n * side - s.side_known + clutch_nm
    own = motion.own + motion.per_nm * (s.per_w - over * s.side_per_w)
    right = motion.rest + motion.per_nm * (
        s.known - s.per_n * side + over * given + s.clutch * clutch_nm
    )
    wheel = right / own
    return _Solved(wheel, side, (s.side_per_w * wheel + given) / s.side_engine, clutch_nm, False)


@compiled()
def _solve(s, motion, governed, asked_nm, low_nm, high_nm, capacity_nm):
    """Locked where the clutch can, else slipping at its capacity, the engine governed as far as its torque goes.

    governed: change of its side's speed, NaN for an engine that gives what is asked
    """
    clutch_nm = 0.0
    if capacity_nm > 0.0:
        solved = _locked(s, motion, min(max(asked_nm, low_nm), high_nm))
        # A slip that turns round within the step passes nothing: friction never gives energy.
        turns = abs(s.slip) > _NO_SLIP_RADPS and solved.clutch_nm * s.slip < 0.0
        if abs(solved.clutch_nm) <= capacity_nm and not turns:
            return solved
        if not turns:
            clutch_nm = capacity_nm if solved.clutch_nm > 0.0 else -capacity_nm
    if np.isnan(governed):
        return _free(s, motion, asked_nm, clutch_nm)
    solved = _governed(s, motion, governed, clutch_nm)
    if low_nm <= solved.engine_nm <= high_nm:
        return solved
    return _free(s, motion, min(max(solved.engine_nm, low_nm), high_nm), clutch_nm)


@compiled()
def joint_torque_nm(row, joint, machine_nm, solved, per_s):
    """Torque that enters a lossy joint."""
    at = (
        col.MACHINES
        + col.PER_MACHINE * len(machine_nm)
        + (col.JOINT_MACHINES + len(machine_nm)) * joint
    )
    torque = (
        row[at + col.JOINT_ENGINE] * solved.engine_nm
        + row[at + col.JOINT_CLUTCH] * solved.clutch_nm
    )
    torque -= per_s * (
        row[at + col.JOINT_W] * solved.wheel
        + row[at + col.JOINT_N] * solved.side
        + row[at + col.JOINT_MOVED]
    )
    for m in range(len(machine_nm)):
        torque += row[at + col.JOINT_MACHINES + m] * machine_nm[m]
    return torque


@compiled()
def _directions(row, joints, variant, machine_nm, solved, mean_wheel, mean_side, per_s):
    """The variant of a solution that was made with one; where power is rounding, the one it was made with."""
    found = 0
    for j in range(joints):
        at = (
            col.MACHINES
            + col.PER_MACHINE * len(machine_nm)
            + (col.JOINT_MACHINES + len(machine_nm)) * j
        )
        through = row[at + col.SENSE_W] * mean_wheel + row[at + col.SENSE_N] * mean_side
        power = joint_torque_nm(row, j, machine_nm, solved, per_s) * through
        if power < -_TINY_W or (power <= _TINY_W and variant >> j & 1):
            found |= 1 << j
    return found


@compiled()
def step(body, ways, rows, state, inputs, pace, row):
    """State after a step, and what acted in it; state and inputs are left as they are.

    rows: settled_rows(ways); pace: pace_of(step, lag of the tyre); row: as long as one of rows, for moving ratios
    """
    wheel, per_s = state.speed_mps / body.radius_m, 1.0 / pace.step_s
    passive, rise, along = resistance(state.speed_mps, inputs.slope_rad, body)
    per_n = pace.step_s / (body.radius_m * body.equivalent_kg)
    of_torque = 1.0 - pace.of_force
    own = 1.0 + 0.5 * pace.step_s / body.equivalent_kg * rise
    motion = _Motion(
        per_n * (pace.of_force * state.force_n - passive - along), own, per_n * of_torque / body.radius_m
    )  # fmt: skip
    grip = grip_n(passive + along, inputs.slope_rad, body)
    top = max((motion.rest + per_n * of_torque * grip) / own, -wheel)
    governed = np.nan if inputs.governed_radps < 0.0 else inputs.governed_radps - state.side_radps
    slip = state.side_radps - turning(
        ways.wheel, inputs.way, inputs.from_way, inputs.blend, len(ways.inertia_kgm2) - 1
    ) * wheel  # fmt: skip
    moving = state.blend > 0.0 or inputs.blend > 0.0 or state.way != inputs.way

    variant, joints = state.variant, ways.load.shape[2]
    guess_wheel, guess_side = 0.0, 0.0
    rest = motion
    for _ in range(_ROUNDS):
        if moving:
            fill_row(ways, state, inputs, variant, wheel, wheel + guess_wheel,
                     state.side_radps + guess_side, row)  # fmt: skip
        else:
            row = rows[inputs.way, variant]
        s = _sums(row, inputs.machine_nm, inputs.brake_nm, slip, per_s)
        solved = _solve(s, motion, governed, inputs.engine_nm, inputs.low_nm, inputs.high_nm,
                        inputs.capacity_nm)  # fmt: skip
        if solved.wheel > top or solved.wheel < -wheel:
            rest = _Motion(top if solved.wheel > top else -wheel, 1.0, 0.0)
            solved = _solve(s, rest, governed, inputs.engine_nm, inputs.low_nm, inputs.high_nm,
                            inputs.capacity_nm)  # fmt: skip
        found = _directions(
            row, joints, variant, inputs.machine_nm, solved, wheel + 0.5 * solved.wheel,
            state.side_radps + 0.5 * solved.side, per_s,
        )  # fmt: skip
        still = abs(solved.wheel - guess_wheel) <= _SETTLED * wheel
        still &= abs(solved.side - guess_side) <= _SETTLED * state.side_radps
        if found == variant and (still or not moving):
            break
        variant, guess_wheel, guess_side = found, solved.wheel, solved.side

    drive = (
        s.known + inputs.brake_nm + s.engine * solved.engine_nm + s.clutch * solved.clutch_nm
        - s.per_w * solved.wheel - s.per_n * solved.side
    )  # fmt: skip
    return _after(body, state, inputs, pace, solved, variant, drive, top, passive, rise, along)


@compiled()
def _after(body, state, inputs, pace, solved, variant, drive, top, passive, rise, along):
    """State and outputs; where the wheels' speed is a limit's, brakes or the road take what is over."""
    gained = solved.wheel * body.radius_m
    speed = state.speed_mps + gained
    road = passive + 0.5 * rise * gained
    of_torque = 1.0 - pace.of_force
    brake, held = inputs.brake_nm, 0.0
    needed_n = body.equivalent_kg * gained / pace.step_s + road + along
    stopped = solved.wheel == -state.speed_mps / body.radius_m
    if stopped:
        # Where the car comes to rest so does the tyre: no lag, and none of its braking force is left.
        over = drive - brake - needed_n * body.radius_m
        if over > 0.0:
            brake += over
        else:
            given = min(-over, max(road, 0.0) * body.radius_m)
            road -= given / body.radius_m
            released = min(-over - given, brake)
            brake -= released
            held = -over - given - released
        torque = drive - brake + held
        mean = torque / body.radius_m
        left = max(state.force_n, 0.0)
        force = pace.decay * left + (1.0 - pace.decay) * max(drive - brake, 0.0) / body.radius_m
        speed = 0.0
    else:
        if solved.wheel == top:
            needed_nm = (needed_n - pace.of_force * state.force_n) / of_torque * body.radius_m
            brake = max(drive - needed_nm, brake)
        torque = drive - brake
        force = pace.decay * state.force_n + (1.0 - pace.decay) * torque / body.radius_m
        mean = pace.of_force * state.force_n + of_torque * torque / body.radius_m
    after = State(
        speed,
        force,
        state.side_radps + solved.side,
        inputs.way,
        inputs.from_way,
        inputs.blend,
        variant,
    )
    outputs = Outputs(
        solved.engine_nm, solved.clutch_nm, torque, brake, held, mean, road + along, solved.locked
    )
    return after, outputs
