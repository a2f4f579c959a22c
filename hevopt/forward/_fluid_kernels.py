"""Who gives what the driver asks for where a torque converter passes it: engine, machines, brakes. Compiled.

The turbine shall give what is asked for, and the converter's curves tell at which speed of the impeller it does:
to that the engine is governed, never below idle speed. What the turbine gives beyond what is asked for while the
engine idles, and while the car is braked, is the brakes': the car creeps against them.
"""

from hevopt._compile import compiled
from hevopt.car._converter_kernels import impeller_radps, passed
from hevopt.forward import _rows_kernels as col
from hevopt.forward._lever_kernels import Lever
from hevopt.forward._limits_kernels import Limits
from hevopt.forward._rows_kernels import Array, Fluid, Ways
from hevopt.forward._share_kernels import AskedStep, Shared, meets_of
from hevopt.forward._solve_kernels import SolvedStep, directions

_TRIES = 4
# Slip below which a lock-up clutch holds with all it has.
_NEARLY_RADPS = 1.0
_ROUNDING = 1e-9


@compiled(bare=True)
def may_lock(fluid: Fluid, lever: Lever, turbine: float) -> bool:
    """Whether the lock-up clutch is closed in a gear at a speed of the turbine, a change into it included."""
    return bool(len(fluid.locks) > 0 and fluid.locks[lever.way] and turbine >= fluid.lock_radps)


@compiled(bare=True)
def closing_nm(
    fluid: Fluid, need_nm: float, side: float, turbine: float, full_nm: float
) -> float:  # fmt: skip
    """Torque of a lock-up clutch that still slips: what the turbine leaves of what has to be passed."""
    if side - turbine <= _NEARLY_RADPS:
        return full_nm
    given = passed(fluid.pieces, side, turbine).given_nm
    return min(max(need_nm - given, 0.0), full_nm)


@compiled(bare=True)
def poured(
    ways: Ways, rows: Array, way: int, variant: int, asked: AskedStep, limits: Limits, side: float, turbine: float,
    rate: float, machine_nm: Array,
) -> Shared:  # fmt: skip
    """Torques of a step in which the converter slips; machine_nm: as of `shared`.

    side, turbine: speeds of the engine's side and, in the middle of the step, of the turbine; rate: share of the
    way to its speed that the engine goes in the step
    """
    pieces, joints = ways.fluid.pieces, ways.load.shape[2]
    for _ in range(_TRIES):
        row, machine = rows[way, variant], asked.set_nm
        meets = meets_of(row, asked.accel, asked.lost_nm, False, machine_nm)
        needed = (asked.wheel_nm - meets.c0 - meets.cm * machine) / row[col.CLUTCH]
        target = impeller_radps(pieces, needed, turbine)
        creeps = target <= limits.idle_radps
        target = min(max(target, limits.idle_radps), limits.engine_max_radps)
        taken = passed(pieces, target, turbine).taken_nm - meets.on_side
        side_m, side_e = row[col.MACHINES + 1], row[col.SIDE_ENGINE]
        wanted = (taken - side_m * machine) / side_e
        if wanted > asked.most_nm and limits.boosts and side_m > 0.0:
            swing = (taken - side_e * asked.most_nm) / side_m
            machine = min(max(swing, machine), max(asked.high_nm, machine))
        engine = (taken - side_m * machine) / side_e
        middle = side + 0.5 * rate * (target - side)
        given = passed(pieces, middle, turbine).given_nm
        machine_nm[0] = machine
        solved = SolvedStep(asked.accel, 0.0, engine, given, False)
        found = directions(row, joints, variant, machine_nm, solved, 1.0, 1.0, 1.0, asked.lost_nm)
        if found == variant:
            break
        variant = found
    over = meets.c0 + meets.cm * machine + row[col.CLUTCH] * given - asked.wheel_nm
    brake = max(over, 0.0) if asked.braking or creeps else 0.0
    full = engine > asked.most_nm * (1.0 + _ROUNDING) and not asked.braking and not creeps
    engine = min(max(engine, asked.least_nm), asked.most_nm)
    return Shared(engine, machine, 0.0, brake, full, wanted, target)
