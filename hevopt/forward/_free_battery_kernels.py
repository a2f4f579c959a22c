"""What the battery gives where the engine has a speed of its own: torques are of a step's beginning, power is not.

Compiled.
"""

from hevopt._compile import compiled
from hevopt.forward import _rows_kernels as col
from hevopt.forward._free_kernels import FreeCar, FreeWish, bus_w
from hevopt.forward._limits_kernels import HALVINGS, electric_of, lowered, terminal_w
from hevopt.forward._rows_kernels import Array

# Share of its highest power by which a battery is asked for more.
_OVER = 1e-6


@compiled(bare=True)
def held_back(
    car: FreeCar, wish: FreeWish, speeds: Array, machine_nm: Array, load_w: float
) -> bool:
    """Whether machines and load draw more than the battery gives; the driving machine's torque is less by then.

    speeds: mean ones of a step, rad/s; load_w: with what a starter has drawn in it
    """
    d, motors, limits = car.driving, car.motors, car.loop.limits
    most_w, wanted = wish.most_w + _OVER * motors.most_w, machine_nm[d]
    drawn = bus_w(car, machine_nm, speeds) + load_w
    if wanted * speeds[d] <= 0.0 or terminal_w(drawn, limits) <= most_w:
        return False
    rest = drawn - electric_of(motors, d, wanted, speeds[d])
    machine_nm[d] = lowered(motors, limits, d, wanted, speeds[d], rest, 1.0, wish.most_w)
    return True


@compiled(bare=True)
def started(
    car: FreeCar, row: Array, side: float, accel: float, side_accel: float, load_w: float, step_s: float
) -> tuple[float, float]:  # fmt: skip
    """Acceleration of an engine that is started, as far as the battery has power for it, and the load with that.

    side, accel, side_accel: speed of the engine's side, rad/s, and accelerations of wheels and side that are asked
    """
    limits = car.loop.limits
    low, high, share, load = 0.0, 1.0, 1.0, load_w
    for _ in range(HALVINGS):
        reached = share * side_accel
        spun_nm = (row[col.SIDE_PER_N] * reached + row[col.SIDE_PER_W] * accel) / row[
            col.SIDE_ENGINE
        ]
        spun_w = max(spun_nm * (side + 0.5 * step_s * reached), 0.0) / limits.spin_efficiency
        if terminal_w(load_w + spun_w, limits) <= car.motors.most_w:
            low, load = share, load_w + spun_w
            if share == 1.0:
                break
        else:
            high = share
        share = 0.5 * (low + high)
    return low * side_accel, load
