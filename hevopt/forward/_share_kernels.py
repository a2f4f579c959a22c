"""Who gives the torque that the driver asks for: engine, machine, then the brakes. Compiled.

What reaches the wheels is linear in both torques,  T = c0 + ce T_engine + cm T_machine,  with the row of the way
driven and the acceleration asked for. With the clutch closed the machine has its set-point and the engine the rest,
within its limits; what is beyond them falls to the machine, as far as the car's functions let it. With the clutch
open or the engine at rest the machine has it all. Machines beside the first have their torques before
(_beside_kernels).
"""

from typing import NamedTuple

from hevopt._compile import compiled
from hevopt.forward import _rows_kernels as col
from hevopt.forward._limits_kernels import Limits, at, smooth_at
from hevopt.forward._rows_kernels import Array
from hevopt.forward._solve_kernels import SolvedStep, directions

_TRIES = 4
# Share of its highest torque with which a rotor is brought along where machine and battery allow none.
_ROTOR_SHARE = 0.02


class Shared(NamedTuple):
    """Torques for a step; clutch_nm: what the clutch has to pass; full: whether all is given and is too little.

    wanted_nm: of the engine, more than it can give included; 0 with the clutch open
    target_radps: speed of the engine at which a torque converter's turbine gives what is asked for; else 0
    """

    engine_nm: float
    machine_nm: float
    clutch_nm: float
    brake_nm: float
    full: bool
    wanted_nm: float
    target_radps: float


class AskedStep(NamedTuple):
    """What a step shall do: torque at the wheels and acceleration of the wheels; and what limits it.

    set_nm, low_nm, high_nm: the machine's set-point and limits; least_nm, most_nm: the engine's
    braking: whether the driver brakes; lost_nm: in a gearbox with a map, as in the step before
    """

    wheel_nm: float
    accel: float
    set_nm: float
    low_nm: float
    high_nm: float
    least_nm: float
    most_nm: float
    braking: bool
    lost_nm: float


class Meets(NamedTuple):
    """T = c0 + ce T_engine + cm T_machine at the wheels; on_side: of machines beside the first, at the engine's."""

    c0: float
    ce: float
    cm: float
    on_side: float


@compiled(bare=True)
def _others(row: Array, machine_nm: Array) -> tuple[float, float]:
    """What machines beside the first bring to wheels and engine's side."""
    wheel, side = 0.0, 0.0
    for m in range(1, len(machine_nm)):
        wheel += row[col.MACHINES + col.PER_MACHINE * m] * machine_nm[m]
        side += row[col.MACHINES + col.PER_MACHINE * m + 1] * machine_nm[m]
    return wheel, side


@compiled(bare=True)
def meets_of(row: Array, accel: float, lost_nm: float, closed: bool, machine_nm: Array) -> Meets:
    """What reaches the wheels at an acceleration, with the torques of machines beside the first."""
    taken, (others, on_side) = row[col.CLUTCH] * lost_nm, _others(row, machine_nm)
    wheel_m, side_m = row[col.MACHINES], row[col.MACHINES + 1]
    if not closed:
        return Meets(-row[col.PER_W] * accel - taken + others, 0.0, wheel_m, on_side)
    side_accel, clutch = row[col.RATIO] * accel, row[col.CLUTCH]
    inertia = row[col.PER_W] * accel + row[col.PER_N] * side_accel
    inertia += clutch * (row[col.SIDE_PER_W] * accel + row[col.SIDE_PER_N] * side_accel)
    return Meets(
        -inertia - taken + (others + clutch * on_side),
        row[col.ENGINE] + clutch * row[col.SIDE_ENGINE], wheel_m + clutch * side_m, on_side,
    )  # fmt: skip


@compiled(bare=True)
def _clip(value: float, low: float, high: float) -> float:
    return min(max(value, low), high)


@compiled(bare=True)
def _closed(asked: AskedStep, meets: Meets, limits: Limits) -> tuple[float, float, float]:
    """Torques of engine and machine with the clutch closed, and the one wanted of the engine."""
    machine, need = asked.set_nm, asked.wheel_nm - meets.c0
    if asked.braking and limits.regenerates and meets.cm > 0.0:
        swing = (need - meets.ce * asked.least_nm) / meets.cm
        machine = _clip(swing, asked.low_nm, max(min(machine, 0.0), asked.low_nm))
    engine = (need - meets.cm * machine) / meets.ce
    wanted = engine
    if engine < asked.least_nm:
        engine = asked.least_nm
        if meets.cm > 0.0 and len(limits.load_nm) == 0:
            low = asked.low_nm if limits.regenerates else min(0.0, machine)
            machine = _clip((need - meets.ce * engine) / meets.cm, low, machine)
    elif engine > asked.most_nm:
        engine = asked.most_nm
        if meets.cm > 0.0 and limits.boosts:
            swing = (need - meets.ce * engine) / meets.cm
            machine = _clip(swing, machine, max(asked.high_nm, machine))
    return engine, machine, wanted


@compiled(bare=True)
def _open(asked: AskedStep, meets: Meets, limits: Limits) -> float:
    """The machine's torque with the clutch open."""
    if meets.cm <= 0.0:
        return asked.set_nm
    low = asked.low_nm if limits.regenerates else 0.0
    return _clip((asked.wheel_nm - meets.c0) / meets.cm, low, asked.high_nm)


@compiled(bare=True)
def shared(
    rows: Array, way: int, variant: int, joints: int, asked: AskedStep, limits: Limits, closed: bool,
    launching: bool, machine_nm: Array,
) -> Shared:  # fmt: skip
    """Torques of a step; machine_nm: room for the first machine's, and those of the others."""
    for _ in range(_TRIES):
        row = rows[way, variant]
        meets = meets_of(row, asked.accel, asked.lost_nm, closed, machine_nm)
        clutch, engine, wanted = 0.0, 0.0, 0.0
        if closed:
            engine, machine, wanted = _closed(asked, meets, limits)
            side_accel = row[col.RATIO] * asked.accel
            clutch = row[col.SIDE_ENGINE] * engine + row[col.MACHINES + 1] * machine
            clutch += meets.on_side
            clutch -= row[col.SIDE_PER_W] * asked.accel + row[col.SIDE_PER_N] * side_accel
        elif launching:
            machine = _clip(asked.set_nm, asked.low_nm, asked.high_nm)
            on_side = row[col.MACHINES + 1] * machine + meets.on_side
            most = row[col.SIDE_ENGINE] * asked.most_nm + on_side
            side_accel = 0.0
            clutch = (asked.wheel_nm - meets.c0 - meets.cm * machine) / row[col.CLUTCH]
            wanted = (clutch - on_side) / row[col.SIDE_ENGINE]
            if clutch > most and limits.boosts and meets.cm > 0.0:
                machine = _clip(
                    (asked.wheel_nm - meets.c0 - row[col.CLUTCH] * most) / meets.cm,
                    machine, asked.high_nm,
                )  # fmt: skip
            clutch = _clip(clutch, 0.0, max(most, 0.0))
            # Where the slip ends within the step, the engine turns with the gears.
            through = clutch + row[col.SIDE_PER_W] * asked.accel
            through += row[col.SIDE_PER_N] * row[col.RATIO] * asked.accel
            through -= row[col.MACHINES + 1] * machine + meets.on_side
            engine = _clip(through / row[col.SIDE_ENGINE], asked.least_nm, asked.most_nm)
        else:
            machine, side_accel = _open(asked, meets, limits), 0.0
        machine_nm[0] = machine
        solved = SolvedStep(asked.accel, side_accel, engine, clutch, closed)
        found = directions(row, joints, variant, machine_nm, solved, 1.0, 1.0, 1.0, asked.lost_nm)
        if found == variant:
            break
        variant = found
    given = meets.c0 + meets.ce * engine + meets.cm * machine
    if launching:
        given += row[col.CLUTCH] * clutch
    short = given < asked.wheel_nm - 1e-6 * abs(asked.wheel_nm) - 1e-9
    brake = max(given - asked.wheel_nm, 0.0) if asked.braking else 0.0
    full = short and not asked.braking and (closed or launching or meets.cm > 0.0)
    return Shared(engine, machine, clutch, brake, full, wanted, 0.0)


@compiled(inline="always")
def machine_range(speed: float, limits: Limits) -> tuple[float, float]:
    """Lowest and highest torque of the machine at a speed, beyond its own axis none."""
    low = at(limits.low_nm, limits.machine_step, abs(speed))
    return low, at(limits.high_nm, limits.machine_step, abs(speed))


@compiled(bare=True)
def following_nm(side_radps: float, load_w: float, limits: Limits) -> float:
    """Torque of an alternator that follows the electric load."""
    rows = len(limits.load_nm)
    if rows == 1:
        return smooth_at(limits.load_nm[0], limits.engine_step, side_radps)
    place = min(max((load_w - limits.load_from_w) / limits.load_step_w, 0.0), rows - 1.000001)
    i = int(place)
    low = smooth_at(limits.load_nm[i], limits.engine_step, side_radps)
    high = smooth_at(limits.load_nm[i + 1], limits.engine_step, side_radps)
    return low + (place - i) * (high - low)


@compiled(inline="always")
def pace_nm(speed: float, limits: Limits) -> float:
    """Torque of either sign by which a machine brings its rotor along; a little where it may give none."""
    low, high = machine_range(speed, limits)
    return max(min(-low, high), _ROTOR_SHARE * limits.torque_nm)
