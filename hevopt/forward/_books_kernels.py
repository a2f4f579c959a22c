"""The books of a driven car in one pass over what its loop has recorded: speeds, torques and powers. Compiled.

Two instants make a step. Powers are torques at the mean of the speeds at both, so that changes of kinetic energy
are exact.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hevopt._compile import compiled
from hevopt.forward import _drive_kernels as col
from hevopt.forward import _motor_kernels as motor
from hevopt.forward._rows_kernels import Ways, turning

Array = NDArray[np.float64]

# Rows of the books: speeds, torques, powers and losses. OUTPUT is the speed of the clutch's output, ENTERING the
# torque that enters a gearbox with a map, not filled without one; REACHED, the speed after a step, and what follows
# it are the record's. Then torque and speed of every machine, in the order of a Line's.
(SPEED, ENGINE_NM, ENGINE_RADPS, CLUTCH_NM, START, STOP, ENGINE_INERTIA, MACHINE, MACHINE_INERTIA, CLUTCH_LOSS,
 LAUNCH, CHANGE, STARTED, OTHER, GEARBOX_LOSS, GEAR_LOSS, BRAKE, HELD, WHEEL, LAG, ROAD, KINETIC, OUTPUT,
 ENTERING, REACHED, PHASE, WAY, FULL) = range(28)  # fmt: skip
ROWS = 28


class Begin(NamedTuple):
    """The car before the first step of a record; numbers and shares as of its columns."""

    speed_mps: float
    side_radps: float
    spin_radps: float
    way: int
    from_way: int
    blend: float


class Shares(NamedTuple):
    """What a joint loses, tabulated from the ways.

    entering: (way, variant, joint, unit) power that enters a joint per power of a unit at the wheels' part of its
    speed; lost: (way, joint, 2) share of it that is lost, passing forward and backward
    """

    entering: Array
    lost: Array


class Kinds(NamedTuple):
    """What the joints are: in_gearbox: (joint,); moves: whether a ratio may, of an engine without a free speed."""

    in_gearbox: NDArray[np.bool_]
    moves: bool


@compiled()
def shares_of(ways: Ways) -> Shares:
    """The shares of all ways."""
    entering, lost = np.zeros(ways.load.shape), np.zeros((*ways.efficiency.shape, 2))
    count, variants, joints, units = ways.load.shape
    for w in range(count):
        for j in range(joints):
            lost[w, j, 0] = 1 - ways.efficiency[w, j]
            lost[w, j, 1] = 1 - 1 / ways.efficiency[w, j]
            for v in range(variants):
                for u in range(units):
                    per_wheel = 1.0 / ways.wheel[w, u] if ways.wheel[w, u] != 0 else 0.0
                    entering[w, v, j, u] = ways.load[w, v, j, u] * ways.sense[w, j, 0] * per_wheel
    return Shares(entering, lost)


@compiled(bare=True)
def _turn(
    ways: Ways, way: int, from_way: int, blend: float, wheel: float, side: float, speeds: Array
) -> None:
    """Speed of every unit, and of it the part that the wheels turn: (2, unit), filled."""
    for u in range(len(ways.inertia_kgm2)):
        speeds[1, u] = turning(ways.wheel, way, from_way, blend, u) * wheel
        speeds[0, u] = speeds[1, u] + turning(ways.side, way, from_way, blend, u) * side


@compiled(bare=True)
def _torques_of(row: Array, torques: Array) -> None:
    """What acted on every unit in a step: (unit,), filled."""
    last = len(torques) - 1
    torques[0], torques[1] = row[col.ENGINE], row[col.MACHINE]
    for u in range(2, last):
        torques[u] = row[col.COLUMNS + u - 2]
    torques[last] = row[col.CLUTCH] + row[col.TURBINE]


@compiled(bare=True)
def _unit_rows(
    ways: Ways, before: Array, after: Array, step_s: float, torques: Array, books: Array, k: int
) -> None:
    """Powers of engine's and machines' inertia and of the machines; torques[1]: filled, less what inertia takes."""
    last = len(ways.inertia_kgm2) - 1
    power = spun = 0.0
    for u in range(last + 1):
        inertia, was, now = ways.inertia_kgm2[u], before[0, u], after[0, u]
        torques[1, u] = torques[0, u] - inertia * (now - was) / step_s
        if u == last:
            break
        changed, mean = inertia * (now * now - was * was) / (2 * step_s), (now + was) / 2
        if u == 0:
            books[ENGINE_INERTIA, k] = changed
        else:
            power += torques[0, u] * mean
            spun += changed
            books[ROWS + 2 * u - 2, k], books[ROWS + 2 * u - 1, k] = torques[0, u], mean
    books[MACHINE, k], books[MACHINE_INERTIA, k] = power, spun


@compiled(bare=True)
def _clutch_rows(row: Array, n: float, output: float, books: Array, k: int) -> None:
    """Engine's and clutch's rows; n, output: mean speeds at the clutch."""
    phase, cause, engine = int(row[col.PHASE]), int(row[col.CAUSE]), row[col.ENGINE]
    turns, starts = phase == motor.TURNING, phase == motor.STARTING
    clutch = row[col.CLUTCH] * (n - output)
    books[ENGINE_NM, k] = engine if turns else 0.0
    books[ENGINE_RADPS, k], books[CLUTCH_NM, k], books[OUTPUT, k] = n, row[col.CLUTCH], output
    books[START, k] = engine * n if starts else 0.0
    books[STOP, k] = 0.0 if turns or starts else engine * n
    books[CLUTCH_LOSS, k] = clutch + (row[col.IMPELLER] * n - row[col.TURBINE] * output)
    books[LAUNCH, k] = clutch if cause == motor.LAUNCH else 0.0
    books[CHANGE, k] = clutch if cause == motor.CHANGE else 0.0
    books[STARTED, k] = clutch if cause == motor.START else 0.0
    books[OTHER, k] = clutch if cause == motor.NONE else 0.0


@compiled(bare=True)
def _wheel_rows(row: Array, rolls: float, radius_m: float, books: Array, k: int) -> None:
    """Rows of wheels, tyres, brakes and road; rolls: mean speed of wheels that roll."""
    speed, passed = rolls * radius_m, row[col.WHEEL] * rolls
    books[SPEED, k], books[WHEEL, k], books[LAG, k] = speed, passed, passed - row[col.TYRE] * speed
    books[BRAKE, k], books[HELD, k] = row[col.BRAKE] * rolls, row[col.HELD] * rolls
    books[ROAD, k] = row[col.ROAD] * speed


@compiled(bare=True)
def _joint_rows(
    ways: Ways, shares: Shares, kinds: Kinds, row: Array, before: Array, after: Array, means: tuple[float, float],
    torques: Array, books: Array, k: int,
) -> None:  # fmt: skip
    """Rows of the lossy joints: what enters each, less what it passes on; means: speeds of wheels and side.

    A torque enters with the speed of its unit, which while a ratio moves is not yet that of its gear. No ratio
    moves where the engine has a speed of its own; a joint may turn by both speeds there.
    """
    units, way, variant = len(ways.inertia_kgm2), int(row[col.WAY]), int(row[col.VARIANT])
    if ways.lost.loss_nm.size > 0:
        through = 0.0
        for u in range(units):
            through += ways.load[way, variant, ways.lost.joint, u] * torques[1, u]
        books[ENTERING, k] = through
    torques[1, units - 1] -= row[col.LOST]
    by_wheel = (after[1, units - 1] + before[1, units - 1]) / 2
    books[GEARBOX_LOSS, k] = books[GEAR_LOSS, k] = 0.0
    for j in range(len(kinds.in_gearbox)):
        entering = 0.0
        for u in range(units):
            if kinds.moves:
                power = torques[1, u] * ((after[1, u] + before[1, u]) / 2)
                entering += shares.entering[way, variant, j, u] * power
            else:
                entering += ways.load[way, variant, j, u] * torques[1, u]
        if not kinds.moves:
            entering *= ways.sense[way, j, 0] * means[0] + ways.sense[way, j, 1] * means[1]
        place = GEARBOX_LOSS if kinds.in_gearbox[j] else GEAR_LOSS
        books[place, k] += entering * shares.lost[way, j, variant >> j & 1]
    books[GEARBOX_LOSS, k] += row[col.LOST] * by_wheel


@compiled(bare=True)
def fill(
    ways: Ways, shares: Shares, kinds: Kinds, body: tuple[float, float], record: Array, begin: Begin, step_s: float,
    speeds: Array, torques: Array, books: Array,
) -> None:  # fmt: skip
    """Fill the books, (row, step), of a record, (step, column).

    body: radius of the tyres, and mass with the wheels' inertia; speeds: (2, 2, unit), torques: (2, unit) room
    """
    radius_m, mass_kg = body
    speed, side, spin, way, from_way, blend = begin
    wheel, last = speed / radius_m + spin, len(ways.inertia_kgm2) - 1
    _turn(ways, way, from_way, blend, wheel, side, speeds[0])
    for k in range(len(record)):
        row, before, after = record[k], speeds[k % 2], speeds[(k + 1) % 2]
        was_mps, was_wheel, was_side, was_spin = speed, wheel, side, spin
        speed, side, spin = row[col.SPEED], row[col.SIDE], row[col.SPIN]
        wheel = speed / radius_m + spin
        _turn(ways, int(row[col.WAY]), int(row[col.FROM_WAY]), row[col.BLEND], wheel, side, after)
        w, n = (wheel + was_wheel) / 2, (side + was_side) / 2
        _torques_of(row, torques[0])
        _unit_rows(ways, before, after, step_s, torques, books, k)
        _clutch_rows(row, n, (after[0, last] + before[0, last]) / 2, books, k)
        _wheel_rows(row, w - (spin + was_spin) / 2, radius_m, books, k)
        books[REACHED, k], books[PHASE, k] = speed, row[col.PHASE]
        books[WAY, k], books[FULL, k] = row[col.WAY], row[col.FULL]
        books[KINETIC, k] = mass_kg * (speed * speed - was_mps * was_mps) / (2 * step_s)
        _joint_rows(ways, shares, kinds, row, before, after, (w, n), torques, books, k)
