"""The driver at the pedals: a force at the tyres from the speed wanted, by feed-forward and a PID. Compiled."""

from typing import NamedTuple

from hevopt._compile import compiled
from hevopt.car.handling import DriverGains
from hevopt.forward._contact_kernels import Body, resistance
from hevopt.forward._rows_kernels import Array


class PedalState(NamedTuple):
    """What the driver remembers, the integral as a force, and asks for: force at the tyres, acceleration, rest."""

    integral_n: float
    error_mps: float
    force_n: float
    accel_mps2: float
    holds: bool


_STANDSTILL_MPS = 0.02
_HOLD_MPS2 = 3.0


@compiled(bare=True)
def wanted_at(time_s: Array, speed_mps: Array, at_s: float, k: int) -> float:
    """The trace's speed at a time in its step k or a later one."""
    last = len(time_s) - 1
    while k < last - 1 and at_s >= time_s[k + 1]:
        k += 1
    share = min(max((at_s - time_s[k]) / (time_s[k + 1] - time_s[k]), 0.0), 1.0)
    return speed_mps[k] + share * (speed_mps[k + 1] - speed_mps[k])


@compiled(bare=True)
def pressed(
    pedal: PedalState,
    now: float,
    ahead: float,
    speed: float,
    slope_rad: float,
    body: Body,
    driver: DriverGains,
    step_s: float,
) -> PedalState:
    """The pedal for a step: now and ahead are the trace's speeds at its ends."""
    error = now - speed
    if ahead <= _STANDSTILL_MPS and now <= _STANDSTILL_MPS and speed < driver.hold_mps:
        return PedalState(0.0, error, -_HOLD_MPS2 * body.mass_kg, 0.0, True)
    accel = (ahead - now) / step_s
    passive, _, along = resistance(0.5 * (now + ahead), slope_rad, body)
    force = driver.feed_forward * (body.equivalent_kg * accel + passive + along) + pedal.integral_n
    force += body.mass_kg * (
        driver.proportional * error + driver.derivative * (error - pedal.error_mps) / step_s
    )
    most = body.tyre.friction * body.mass_kg * 9.80665
    force = min(max(force, -most), most)
    passive, _, along = resistance(speed, slope_rad, body)
    return PedalState(
        pedal.integral_n, error, force, (force - passive - along) / body.equivalent_kg, False
    )


@compiled(bare=True)
def remembered(
    pedal: PedalState, frozen: bool, body: Body, driver: DriverGains, step_s: float
) -> PedalState:
    """The integral after a step, as it was where the car could not follow in its sense."""
    if frozen or pedal.holds:
        return pedal
    grown = pedal.integral_n + step_s * body.mass_kg * driver.integral * pedal.error_mps
    return PedalState(grown, pedal.error_mps, pedal.force_n, pedal.accel_mps2, pedal.holds)
