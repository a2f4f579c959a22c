"""What engine, machine and battery can give at a speed, tabulated over even steps of speed."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hevopt._compile import compiled

Array = NDArray[np.float64]

# Of a share of a torque, or of an acceleration, as far as the battery has power for it.
HALVINGS = 30


class Limits(NamedTuple):
    """Curves over speed, tabulated from the car's own components; what is burnt is judged by these, not here.

    engine_step, machine_step: rad/s from one value to the next
    full_nm, least_nm: (engine speed,) highest torque, and lowest: drag
    load_nm: (load, engine speed) torque of an alternator that follows the electric load, from load_from_w on in
    steps of load_step_w; one row where the load is always the same, empty where no alternator follows it
    low_nm, high_nm: (machine speed,) what machine and battery together allow
    loss_w: (machine speed, torque) from -torque_nm to torque_nm
    braking_share: (speed of the car, braking force over weight) share of the braking that may pass the machine's
    axle, over steps of braking_mps and braking_rate; empty where all may
    converter_w, converter_share: (point,) of a converter between battery and bus; empty where they are one
    boosts, regenerates: whether the car's functions let the machine help at full load, and charge while braking
    """

    engine_step: float
    full_nm: Array
    least_nm: Array
    load_nm: Array
    load_from_w: float
    load_step_w: float
    machine_step: float
    low_nm: Array
    high_nm: Array
    loss_w: Array
    torque_nm: float
    idle_radps: float
    engine_max_radps: float
    auxiliary_w: float
    spin_efficiency: float
    braking_share: Array
    braking_mps: float
    braking_rate: float
    converter_w: Array
    converter_share: Array
    boosts: bool
    regenerates: bool


class Motors(NamedTuple):
    """Curves of every machine over even steps of its speed, and what the battery gives and takes at its terminals.

    step_radps, most_nm, top_radps: (machine,); limit_nm: (machine, speed)
    loss_w: (machine, speed, torque) from -most_nm to most_nm
    """

    step_radps: Array
    limit_nm: Array
    loss_w: Array
    most_nm: Array
    top_radps: Array
    least_w: float
    most_w: float


class Gives(NamedTuple):
    """Lowest and highest torque of the engine in a step."""

    least_nm: float
    most_nm: float


@compiled(bare=True)
def at(values: Array, step: float, x: float) -> float:
    """A curve's value: linear, beyond its ends the last."""
    place = min(max(x, 0.0) / step, len(values) - 1.000001)
    i = int(place)
    return values[i] + (place - i) * (values[i + 1] - values[i])


@compiled(bare=True)
def smooth_at(values: Array, step: float, x: float) -> float:
    """A smooth curve's value, by the cubic through four neighbours."""
    place = min(max(x, 0.0) / step, len(values) - 1.000001)
    i = min(max(int(place), 1), len(values) - 3)
    t = place - i
    a, b, c, d = values[i - 1], values[i], values[i + 1], values[i + 2]
    return (
        -t * (t - 1) * (t - 2) / 6 * a
        + (t + 1) * (t - 1) * (t - 2) / 2 * b
        - (t + 1) * t * (t - 2) / 2 * c
        + (t + 1) * t * (t - 1) / 6 * d
    )


@compiled(inline="always")
def by_map(side_radps: float, limits: Limits) -> Gives:
    """What the steady map gives at a speed, at once."""
    step = limits.engine_step
    return Gives(at(limits.least_nm, step, side_radps), at(limits.full_nm, step, side_radps))


@compiled(inline="always")
def share_of_braking(speed_mps: float, rate: float, limits: Limits) -> float:
    """Share of the wheels' braking that may pass the machine's axle."""
    table = limits.braking_share
    if table.size == 0:
        return 1.0
    x = min(speed_mps / limits.braking_mps, table.shape[0] - 1.000001)
    y = min(rate / limits.braking_rate, table.shape[1] - 1.000001)
    i, j = int(x), int(y)
    x, y = x - i, y - j
    low = table[i, j] + y * (table[i, j + 1] - table[i, j])
    high = table[i + 1, j] + y * (table[i + 1, j + 1] - table[i + 1, j])
    return float(low + x * (high - low))


@compiled(inline="always")
def drawn_w(torque: float, speed: float, loss_w: Array, step: float, most_nm: float) -> float:
    """Electric power of a machine whose loss is tabulated: (speed, torque) from -most_nm to most_nm.

    Turning backwards it is the mirrored one.
    """
    rows, columns = loss_w.shape
    if speed == 0.0 and torque == 0.0:
        return 0.0
    x = min(abs(speed) / step, rows - 1.000001)
    forwards = torque if speed >= 0.0 else -torque
    y = (forwards / most_nm + 1.0) / 2.0 * (columns - 1)
    y = min(max(y, 0.0), columns - 1.000001)
    i, j = int(x), int(y)
    x, y = x - i, y - j
    low = loss_w[i, j] + y * (loss_w[i, j + 1] - loss_w[i, j])
    high = loss_w[i + 1, j] + y * (loss_w[i + 1, j + 1] - loss_w[i + 1, j])
    return torque * speed + low + x * (high - low)


@compiled(inline="always")
def electric_w(torque: float, speed: float, limits: Limits) -> float:
    """Electric power of the machine, by its tabulated loss."""
    return drawn_w(torque, speed, limits.loss_w, limits.machine_step, limits.torque_nm)


@compiled(bare=True)
def limit_nm(motors: Motors, m: int, speed: float) -> float:
    """Highest torque of a machine at a speed, of either sign."""
    return at(motors.limit_nm[m], motors.step_radps[m], abs(speed))


@compiled(bare=True)
def electric_of(motors: Motors, m: int, torque: float, speed: float) -> float:
    """Electric power of a machine, by its tabulated loss."""
    return drawn_w(torque, speed, motors.loss_w[m], motors.step_radps[m], motors.most_nm[m])


@compiled(bare=True)
def _between(points: Array, values: Array, x: float) -> float:
    """As np.interp, of one value."""
    last = len(points) - 1
    if x >= points[last]:
        return float(values[last])
    if x <= points[0]:
        return float(values[0])
    i = 0
    while x >= points[i + 1]:
        i += 1
    slope = (values[i + 1] - values[i]) / (points[i + 1] - points[i])
    return float(slope * (x - points[i]) + values[i])


@compiled(inline="always")
def terminal_w(bus_w: float, limits: Limits) -> float:
    """Power at the battery's terminals for one at the bus, as of `Converter.terminal_w`."""
    if len(limits.converter_w) == 0:
        return bus_w
    share = _between(limits.converter_w, limits.converter_share, abs(bus_w))
    return bus_w / share if bus_w > 0.0 else bus_w * share


@compiled(bare=True)
def lowered(
    motors: Motors, limits: Limits, m: int, torque: float, speed: float, rest_w: float, sign: float, end_w: float
) -> float:  # fmt: skip
    """A machine's torque with which an end of the battery's power is kept beside what the rest draws."""
    low, high = 0.0, 1.0
    for _ in range(HALVINGS):
        share = 0.5 * (low + high)
        drawn = rest_w + electric_of(motors, m, share * torque, speed)
        if sign * terminal_w(drawn, limits) <= end_w:
            low = share
        else:
            high = share
    return low * torque


@compiled(bare=True)
def launch_radps(need_nm: float, limits: Limits) -> float:
    """Engine speed of a launch: idle, or the lowest above it at which full load is a tenth more than needed."""
    speed = limits.idle_radps
    if 1.1 * need_nm <= at(limits.full_nm, limits.engine_step, speed):
        return speed
    best = speed
    while speed < limits.engine_max_radps:
        full = at(limits.full_nm, limits.engine_step, speed)
        if full >= 1.1 * need_nm:
            return speed
        if full > at(limits.full_nm, limits.engine_step, best):
            best = speed
        speed += 2.0
    return best
