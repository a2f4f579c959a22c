"""The plant's equations solved for a step: both speeds' changes, the clutch locked, slipping or open. Compiled.

See _plant_kernels for the equations; a row's columns are named in _rows_kernels.
"""

from typing import NamedTuple

import numpy as np

from hevopt._compile import compiled
from hevopt.forward import _rows_kernels as col
from hevopt.forward._rows_kernels import Array

# Power below which a direction is a matter of rounding.
_TINY_W = 1e-9
# Slip of a locked clutch, by rounding.
_NO_SLIP_RADPS = 1e-9
# Share of a slip that a governed engine keeps over a step while it launches a car.
_STILL_SLIPS = 0.5


class Sums(NamedTuple):
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


class Flow(NamedTuple):
    """What a torque converter takes and gives in a step, linear in the changes of wheels' and side's speed."""

    taken_nm: float
    taken_per_w: float
    taken_per_n: float
    given_nm: float
    given_per_w: float
    given_per_n: float


class Motion(NamedTuple):
    """The wheels' equation: own (w' - w) = rest + per_nm x torque."""

    rest: float
    own: float
    per_nm: float


class SolvedStep(NamedTuple):
    """Changes of both speeds, and the torques of engine and clutch."""

    wheel: float
    side: float
    engine_nm: float
    clutch_nm: float
    locked: bool


@compiled(bare=True)
def sums(
    row: Array, machine_nm: Array, brake_nm: float, slip: float, per_s: float, lost_nm: float, flow: Flow
) -> Sums:  # fmt: skip
    """lost_nm: in a gearbox with a map, at the clutch's output."""
    clutch = row[col.CLUTCH]
    known = -row[col.MOVED] * per_s - brake_nm - clutch * lost_nm + clutch * flow.given_nm
    side_known = -row[col.SIDE_MOVED] * per_s - flow.taken_nm
    for m in range(len(machine_nm)):
        at = col.MACHINES + col.PER_MACHINE * m
        known += row[at] * machine_nm[m]
        side_known += row[at + 1] * machine_nm[m]
    return Sums(
        row[col.RATIO], slip, row[col.ENGINE], clutch, row[col.PER_W] * per_s - clutch * flow.given_per_w,
        row[col.PER_N] * per_s - clutch * flow.given_per_n, known, row[col.SIDE_ENGINE],
        row[col.SIDE_PER_W] * per_s + flow.taken_per_w, row[col.SIDE_PER_N] * per_s + flow.taken_per_n,
        side_known,
    )  # fmt: skip


@compiled(bare=True)
def _free(s: Sums, motion: Motion, engine_nm: float, clutch_nm: float) -> SolvedStep:
    """Both changes for given torques."""
    own = motion.own + motion.per_nm * s.per_w
    across = motion.per_nm * s.per_n
    right = motion.rest + motion.per_nm * (s.known + s.engine * engine_nm + s.clutch * clutch_nm)
    below = s.side_known + s.side_engine * engine_nm - clutch_nm
    wheel = (right * s.side_per_n - across * below) / (own * s.side_per_n - across * s.side_per_w)
    return SolvedStep(
        wheel, (below - s.side_per_w * wheel) / s.side_per_n, engine_nm, clutch_nm, False
    )


@compiled(bare=True)
def _locked(s: Sums, motion: Motion, engine_nm: float) -> SolvedStep:
    """Both changes and the clutch's torque where no slip is left after the step."""
    inner = s.side_per_w + s.side_per_n * s.ratio
    through = s.side_known + s.side_engine * engine_nm + s.side_per_n * s.slip
    own = motion.own + motion.per_nm * (s.per_w + s.per_n * s.ratio + s.clutch * inner)
    right = motion.rest + motion.per_nm * (
        s.known + s.engine * engine_nm + s.per_n * s.slip + s.clutch * through
    )
    wheel = right / own
    return SolvedStep(wheel, s.ratio * wheel - s.slip, engine_nm, through - inner * wheel, True)


@compiled(bare=True)
def _governed(s: Sums, motion: Motion, side: float, clutch_nm: float) -> SolvedStep:
    """The wheels' change and the engine's torque for a given change of its side."""
    over = s.engine / s.side_engine
    given = s.side_per_n * side - s.side_known + clutch_nm
    own = motion.own + motion.per_nm * (s.per_w - over * s.side_per_w)
    right = motion.rest + motion.per_nm * (
        s.known - s.per_n * side + over * given + s.clutch * clutch_nm
    )
    wheel = right / own
    return SolvedStep(wheel, side, (s.side_per_w * wheel + given) / s.side_engine, clutch_nm, False)


@compiled(bare=True)
def reached(s: Sums, motion: Motion, solved: SolvedStep) -> float:
    """The right-hand side of the wheels' equation with the torques of a solution.

    A clutch that slips without the grip's limit and holds with it would leave less than the limit: between the two
    the car accelerates a little more than it could, for that step.
    """
    torque = s.known + s.engine * solved.engine_nm + s.clutch * solved.clutch_nm
    torque -= s.per_w * solved.wheel + s.per_n * solved.side
    return motion.rest + motion.per_nm * torque


@compiled(bare=True)
def solve(
    s: Sums,
    motion: Motion,
    governed: float,
    asked_nm: float,
    low_nm: float,
    high_nm: float,
    capacity_nm: float,
) -> SolvedStep:
    """Locked where the clutch can, else slipping at its capacity, the engine governed as far as its torque goes.

    governed: change of its side's speed, NaN for an engine that gives what is asked
    """
    clutch_nm = 0.0
    if capacity_nm > 0.0 and s.slip > _NO_SLIP_RADPS and not np.isnan(governed):
        # In a launch the governor keeps the engine above the gears until these have caught up.
        kept = _governed(s, motion, governed, capacity_nm)
        after = s.slip + kept.side - s.ratio * kept.wheel
        if low_nm <= kept.engine_nm <= high_nm and after > _STILL_SLIPS * s.slip:
            return kept
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


@compiled(bare=True)
def joint_torque_nm(
    row: Array, joint: int, machine_nm: Array, solved: SolvedStep, per_s: float, lost_nm: float
) -> float:
    """Torque that enters a lossy joint; lost_nm: at the clutch's output, less what a converter gives there."""
    at = (
        col.MACHINES
        + col.PER_MACHINE * len(machine_nm)
        + (col.JOINT_MACHINES + len(machine_nm)) * joint
    )
    torque = row[at + col.JOINT_ENGINE] * solved.engine_nm + row[at + col.JOINT_CLUTCH] * (
        solved.clutch_nm - lost_nm
    )
    torque -= per_s * (
        row[at + col.JOINT_W] * solved.wheel
        + row[at + col.JOINT_N] * solved.side
        + row[at + col.JOINT_MOVED]
    )
    for m in range(len(machine_nm)):
        torque += row[at + col.JOINT_MACHINES + m] * machine_nm[m]
    return torque


@compiled(bare=True)
def directions(
    row: Array,
    joints: int,
    variant: int,
    machine_nm: Array,
    solved: SolvedStep,
    mean_wheel: float,
    mean_side: float,
    per_s: float,
    lost_nm: float,
) -> int:
    """The variant of a solution that was made with one; where power is rounding, the one it was made with."""
    found = 0
    for j in range(joints):
        at = (
            col.MACHINES
            + col.PER_MACHINE * len(machine_nm)
            + (col.JOINT_MACHINES + len(machine_nm)) * j
        )
        through = row[at + col.SENSE_W] * mean_wheel + row[at + col.SENSE_N] * mean_side
        power = joint_torque_nm(row, j, machine_nm, solved, per_s, lost_nm) * through
        if power < -_TINY_W or (power <= _TINY_W and variant >> j & 1):
            found |= 1 << j
    return found
