"""The driveline as data, and the sums over its units that a step reads: compiled.

Two speeds are free, the wheels' w and the engine side's n; every other shaft turns with them. A unit
(the engine, a machine, the clutch's output) turns at  a w + b n,  and a torque on it acts as  a q  at
the wheels and as  b p  on the engine's side, q and p depending on the direction in which power passes
the lossy joints; one choice of directions is a `variant`.

The sums make a *row* of coefficients, the same in every step but while a ratio moves.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hevopt._compile import compiled
from hevopt.car._converter_kernels import NO_PIECES, Pieces

Array = NDArray[np.float64]

# Columns of a row: the clutch's ratio; yields of engine and clutch at the wheels; inertia that changes
# of the wheels' and the side's speed meet at the wheels, what a moving ratio adds; the same for the
# engine's side; then per machine its two yields, and per lossy joint the columns named JOINT and SENSE.
RATIO, ENGINE, CLUTCH, PER_W, PER_N, MOVED = 0, 1, 2, 3, 4, 5
SIDE_ENGINE, SIDE_PER_W, SIDE_PER_N, SIDE_MOVED = 6, 7, 8, 9
MACHINES, PER_MACHINE = 10, 2
JOINT_ENGINE, JOINT_CLUTCH, JOINT_W, JOINT_N, JOINT_MOVED, SENSE_W, SENSE_N = range(7)
JOINT_MACHINES = 7


class Lost(NamedTuple):
    """Torque that a gearbox behind the driver's clutch loses at its input, over gear, speed and torque there.

    joint: which of the lossy joints it is; gear: (way,) place of the gear
    speed_radps: (gear, speed), torque_nm: (gear, torque), rising; loss_nm: (gear, speed, torque), or none
    """

    joint: int
    gear: NDArray[np.int64]
    speed_radps: Array
    torque_nm: Array
    loss_nm: Array


class Fluid(NamedTuple):
    """A torque converter in the clutch's place: its curves, and when its lock-up clutch is closed.

    locks: (way,) whether it may be in a way; lock_radps: lowest speed of the turbine for it
    in_gear_at_rest: whether the turbine is joined to the wheels of a car that is held
    """

    pieces: Pieces
    locks: NDArray[np.bool_]
    lock_radps: float
    in_gear_at_rest: bool


NO_FLUID = Fluid(NO_PIECES, np.zeros(0, np.bool_), np.inf, False)
NO_LOSS = Lost(0, np.zeros(0, np.int64), np.zeros((0, 0)), np.zeros((0, 0)), np.zeros((0, 0, 0)))


class Ways(NamedTuple):
    """The driveline as data; units are the engine, the machines, and last the clutch's output.

    wheel, side: (way, unit) speed per speed of the wheels, and of the engine's side
    wheel_yield, side_yield: (way, variant, unit) q and p
    load: (way, variant, joint, unit) torque that enters a lossy joint per torque on a unit
    sense: (way, joint, 2) speed that times this torque is the power that enters, per speed of wheels and side
    efficiency: (way, joint)
    inertia_kgm2: (unit,)
    lost: of a gearbox with a map, whose joint itself loses nothing; fluid: of a torque converter, or none
    """

    wheel: Array
    side: Array
    wheel_yield: Array
    side_yield: Array
    load: Array
    sense: Array
    efficiency: Array
    inertia_kgm2: Array
    lost: Lost = NO_LOSS
    fluid: Fluid = NO_FLUID


class State(NamedTuple):
    """The car at an instant. Units turn as in `way`, and by the share `blend` still as in `from_way`.

    lost_nm: what a gearbox with a map has lost in the step before, at its input
    spin_radps: of the wheels, beyond that of rolling; slip: by which the tyres' force comes, where it does
    """

    speed_mps: float
    force_n: float
    side_radps: float
    way: int
    from_way: int
    blend: float
    variant: int
    lost_nm: float = 0.0
    spin_radps: float = 0.0
    slip: float = 0.0


class Inputs(NamedTuple):
    """What acts over a step; way, from_way and blend are those at its end.

    machine_nm: (machine,); engine_nm: asked for, given as it is where governed_radps < 0 or the clutch holds
    governed_radps: speed to which the engine keeps its side, with a torque from low_nm to high_nm
    capacity_nm: of the clutch; flows: whether a torque converter passes torque beside it
    brake_nm: of the brakes, at the wheels; slope_rad: of the road
    """

    machine_nm: Array
    engine_nm: float
    governed_radps: float
    low_nm: float
    high_nm: float
    capacity_nm: float
    brake_nm: float
    slope_rad: float
    way: int
    from_way: int
    blend: float
    flows: bool = False


class Outputs(NamedTuple):
    """Means over a step. held_nm: torque at the wheels that keeps a standing car from rolling back.

    impeller_nm, turbine_nm: what a torque converter takes and gives
    """

    engine_nm: float
    clutch_nm: float
    wheel_nm: float
    brake_nm: float
    held_nm: float
    force_n: float
    road_n: float
    locked: bool
    impeller_nm: float
    turbine_nm: float


@compiled(bare=True)
def _place(axis: Array, at: float) -> tuple[int, float]:
    """Where a value lies on an axis, held at its ends."""
    i = min(max(int(np.searchsorted(axis, at, "right")) - 1, 0), len(axis) - 2)
    return i, min(max((at - axis[i]) / (axis[i + 1] - axis[i]), 0.0), 1.0)


@compiled(bare=True)
def lost_nm(lost: Lost, way: int, speed_radps: float, torque_nm: float) -> float:
    """Torque lost at the input of a gearbox with a map; 0 without one."""
    if lost.loss_nm.size == 0:
        return 0.0
    gear = lost.gear[way]
    i, x = _place(lost.speed_radps[gear], speed_radps)
    j, y = _place(lost.torque_nm[gear], torque_nm)
    table = lost.loss_nm[gear]
    low = table[i, j] * (1.0 - x) + table[i + 1, j] * x
    high = table[i, j + 1] * (1.0 - x) + table[i + 1, j + 1] * x
    return float(low + y * (high - low))


@compiled(bare=True)
def turning(rates: Array, way: int, from_way: int, blend: float, unit: int) -> float:
    """Speed of a unit per speed of the wheels, or of the engine's side, between one gear and another."""
    end = rates[way, unit]
    return end + blend * (rates[from_way, unit] - end) if blend > 0.0 else end


@compiled(bare=True)
def _mean_rate(rate_before: float, rate_after: float, before: float, after: float) -> float:
    """What a unit's mean speed is to the mean speed that it turns with: so that no power is lost in between."""
    total = before + after
    return (rate_before * before + rate_after * after) / total if total > 0.0 else rate_after


@compiled(bare=True)
def fill_row(
    ways: Ways, state: State, inputs: Inputs, variant: int, wheel: float, wheel_after: float,
    side_after: float, row: Array,
) -> None:  # fmt: skip
    """A row's columns. wheel: speed before the step; after: speeds behind it, as far as known."""
    row[:] = 0.0
    units, joints = len(ways.inertia_kgm2) - 1, ways.load.shape[2]
    way = inputs.way
    first = MACHINES + PER_MACHINE * (units - 1)
    stride = JOINT_MACHINES + units - 1
    row[RATIO] = turning(ways.wheel, way, inputs.from_way, inputs.blend, units)
    for u in range(units + 1):
        a0 = turning(ways.wheel, state.way, state.from_way, state.blend, u)
        b0 = turning(ways.side, state.way, state.from_way, state.blend, u)
        a1 = turning(ways.wheel, way, inputs.from_way, inputs.blend, u)
        b1 = turning(ways.side, way, inputs.from_way, inputs.blend, u)
        g = _mean_rate(a0, a1, wheel, wheel_after) * ways.wheel_yield[way, variant, u]
        s = _mean_rate(b0, b1, state.side_radps, side_after) * ways.side_yield[way, variant, u]
        inertia = ways.inertia_kgm2[u]
        moved = inertia * ((a1 - a0) * wheel + (b1 - b0) * state.side_radps)
        row[PER_W] += g * inertia * a1
        row[PER_N] += g * inertia * b1
        row[MOVED] += g * moved
        row[SIDE_PER_W] += s * inertia * a1
        row[SIDE_PER_N] += s * inertia * b1
        row[SIDE_MOVED] += s * moved
        if u == 0:
            row[ENGINE], row[SIDE_ENGINE] = g, s
        elif u == units:
            row[CLUTCH] = g
        else:
            at = MACHINES + PER_MACHINE * (u - 1)
            row[at], row[at + 1] = g, s
        for j in range(joints):
            at, load = first + stride * j, ways.load[way, variant, j, u]
            row[at + JOINT_W] += load * inertia * a1
            row[at + JOINT_N] += load * inertia * b1
            row[at + JOINT_MOVED] += load * moved
            row[at + SENSE_W], row[at + SENSE_N] = ways.sense[way, j, 0], ways.sense[way, j, 1]
            if u == 0:
                row[at + JOINT_ENGINE] = load
            elif u == units:
                row[at + JOINT_CLUTCH] = load
            else:
                row[at + JOINT_MACHINES + u - 1] = load


@compiled(bare=True)
def row_length(ways: Ways) -> int:
    """Columns of a row."""
    machines = len(ways.inertia_kgm2) - 2
    joints = ways.load.shape[2]
    return MACHINES + PER_MACHINE * machines + (JOINT_MACHINES + machines) * joints


@compiled()
def settled_rows(ways: Ways) -> Array:
    """(way, variant, column) rows of all ways while no ratio moves."""
    count, variants = ways.wheel_yield.shape[:2]
    rows = np.empty((count, variants, row_length(ways)))
    for way in range(count):
        state = State(0.0, 0.0, 0.0, way, way, 0.0, 0, 0.0, 0.0, 0.0)
        inputs = Inputs(rows[0, 0], 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, way, way, 0.0, False)
        for variant in range(variants):
            fill_row(ways, state, inputs, variant, 0.0, 0.0, 0.0, rows[way, variant])
    return rows
