"""Machines beside the first of a car with clutch and gears: these keep set-points, that one has the rest. Compiled.

A set-point is kept while the engine drives through a closed or slipping clutch. While the car is braked with the
clutch closed such a machine brakes no more than is asked for, and with the clutch open one that reaches the wheels
neither drives nor brakes more. What all of them draw leaves the first machine the rest of what the battery gives
and takes.
"""

from typing import NamedTuple

from hevopt._compile import compiled
from hevopt.forward import _rows_kernels as col
from hevopt.forward._lever_kernels import Lever
from hevopt.forward._limits_kernels import Limits, at, drawn_w, electric_w, terminal_w
from hevopt.forward._rows_kernels import Array, Ways, turning

_HALVINGS = 40
_NOTHING = 1e-12


class Beside(NamedTuple):
    """Curves over even steps of speed of every machine but the first; none for a car of one.

    step_radps, most_nm: (machine,); low_nm, high_nm: (machine, speed) what machine and battery allow
    loss_w: (machine, speed, torque) from -most_nm to most_nm; least_w, most_w: at the battery's terminals
    """

    step_radps: Array
    low_nm: Array
    high_nm: Array
    loss_w: Array
    most_nm: Array
    least_w: float
    most_w: float


class Acts(NamedTuple):
    """What a step leaves to machines: torque at the wheels beside inertia, losses and an engine at its lowest.

    braking: the driver; closed, launches: the clutch; turns: the engine
    charges, discharges: whether the battery's window lets it be
    """

    left_nm: float
    braking: bool
    closed: bool
    launches: bool
    turns: bool
    charges: bool
    discharges: bool


@compiled(bare=True)
def unit_radps(ways: Ways, lever: Lever, unit: int, wheel: float, side: float) -> float:
    """Speed of a unit."""
    own = turning(ways.wheel, lever.way, lever.from_way, lever.blend, unit)
    return own * wheel + turning(ways.side, lever.way, lever.from_way, lever.blend, unit) * side


@compiled(bare=True)
def beside_w(
    beside: Beside, ways: Ways, lever: Lever, wheel: float, side: float, machine_nm: Array
) -> float:
    """Electric power of the machines beside the first."""
    total = 0.0
    for m in range(1, len(machine_nm)):
        speed = unit_radps(ways, lever, m + 1, wheel, side)
        total += drawn_w(machine_nm[m], speed, beside.loss_w[m - 1], beside.step_radps[m - 1],
                         beside.most_nm[m - 1])  # fmt: skip
    return total


@compiled(bare=True)
def set_beside(beside: Beside, row: Array, ways: Ways, lever: Lever, wheel: float, side: float, acts: Acts,
               machine_nm: Array) -> None:  # fmt: skip
    """Set-points of the machines beside the first, in place, as far as they and the step go."""
    left = acts.left_nm
    for m in range(1, len(machine_nm)):
        k, at_wheels = m - 1, row[col.MACHINES + col.PER_MACHINE * m]
        at_side = row[col.MACHINES + col.PER_MACHINE * m + 1]
        speed = unit_radps(ways, lever, m + 1, wheel, side)
        low = at(beside.low_nm[k], beside.step_radps[k], abs(speed)) if acts.charges else 0.0
        high = at(beside.high_nm[k], beside.step_radps[k], abs(speed)) if acts.discharges else 0.0
        torque = min(max(machine_nm[m], low), high)
        if not acts.turns and at_side != 0.0:
            torque = 0.0
        per = at_wheels + (row[col.CLUTCH] * at_side if acts.closed else 0.0)
        bound = acts.braking if acts.closed else not acts.launches
        if bound and per > _NOTHING:
            torque = min(max(torque, min(left / per, 0.0)), max(left / per, 0.0))
        machine_nm[m] = torque
        left -= per * torque


@compiled(bare=True)
def _within(
    torque: float, speed: float, rest_w: float, end_w: float, sign: float, limits: Limits
) -> float:
    """The largest share of a torque with which no more than an end of the battery's power is used."""
    drawn = rest_w + electric_w(torque, speed, limits)
    if sign * terminal_w(drawn, limits) <= sign * end_w:
        return torque
    low, high = 0.0, 1.0
    for _ in range(_HALVINGS):
        share = 0.5 * (low + high)
        drawn = rest_w + electric_w(share * torque, speed, limits)
        if sign * terminal_w(drawn, limits) <= sign * end_w:
            low = share
        else:
            high = share
    return low * torque


@compiled(bare=True)
def first_range(
    beside: Beside, low: float, high: float, speed: float, rest_w: float, limits: Limits
) -> tuple[float, float]:  # fmt: skip
    """What is left of the first machine's lowest and highest torque where the others and the load draw a power."""
    if high * speed > 0.0:
        high = _within(high, speed, rest_w, beside.most_w, 1.0, limits)
    if low * speed < 0.0:
        low = _within(low, speed, rest_w, beside.least_w, -1.0, limits)
    return low, high


@compiled(bare=True)
def floor_beside(
    beside: Beside, ways: Ways, lever: Lever, wheel: float, side: float, limits: Limits, helps: bool,
    machine_nm: Array,
) -> None:  # fmt: skip
    """At full pedal: one machine after another has all that it and the battery have left, or nothing."""
    first = unit_radps(ways, lever, 1, wheel, side)
    drawn = electric_w(machine_nm[0], first, limits) + limits.auxiliary_w
    for m in range(1, len(machine_nm)):
        k, speed = m - 1, unit_radps(ways, lever, m + 1, wheel, side)
        step, losses, most = beside.step_radps[k], beside.loss_w[k], beside.most_nm[k]
        torque, share = at(beside.high_nm[k], step, abs(speed)) if helps else 0.0, 1.0
        own = drawn_w(torque, speed, losses, step, most)
        if terminal_w(drawn + own, limits) > beside.most_w:
            low, high = 0.0, 1.0
            for _ in range(_HALVINGS):
                share = 0.5 * (low + high)
                own = drawn_w(share * torque, speed, losses, step, most)
                if terminal_w(drawn + own, limits) <= beside.most_w:
                    low = share
                else:
                    high = share
            share = low
            own = drawn_w(share * torque, speed, losses, step, most)
        machine_nm[m] = share * torque
        drawn += own
