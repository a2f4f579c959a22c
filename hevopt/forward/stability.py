"""Whether a driver's gains let the car follow a trace at all: eigenvalues of the sampled loop."""

import numpy as np

from hevopt.car.handling import DriverGains, Tyre
from hevopt.errors import DataError
from hevopt.forward._contact_kernels import pace_of


def spectral_radius(driver: DriverGains, tyre: Tyre, step_s: float) -> float:
    """Largest eigenvalue of a step of driver, tyre and car, per mass; the loop is unstable above 1.

    States are speed, force, integral and the speed before:  f = -Kp v - Kd (v - v_before)/h + I,  then the tyre's
    lag and the car of the plant's step; tyres that slip build up their force in a travel, without lag here.
    """
    pace = pace_of(step_s, 0.0 if tyre.slips else tyre.lag_s)
    given = np.array(
        [-driver.proportional - driver.derivative / step_s, 0.0, 1.0, driver.derivative / step_s]
    )
    force = np.array([0.0, pace.decay, 0.0, 0.0]) + (1 - pace.decay) * given
    mean = np.array([0.0, pace.of_force, 0.0, 0.0]) + (1 - pace.of_force) * given
    speed = np.array([1.0, 0.0, 0.0, 0.0])
    moved = speed + step_s * mean
    integral = np.array([-step_s * driver.integral, 0.0, 1.0, 0.0])
    return float(np.abs(np.linalg.eigvals(np.stack([moved, force, integral, speed]))).max())


def check_gains(driver: DriverGains, tyre: Tyre, step_s: float) -> None:
    """DataError for gains out of range, or with which the speed would swing ever more."""
    for name, value in driver._asdict().items():
        if not 0 <= value <= 1000:  # nor NaN
            raise DataError(f"driver: {name} {value:g}; allowed: 0 to 1000")
    if driver.governor_s <= 0 or driver.start_s <= 0 or driver.stop_s <= 0:
        raise DataError("driver: governor_s, start_s and stop_s must be above 0")
    if (radius := spectral_radius(driver, tyre, step_s)) > 1 + 1e-9:
        raise DataError(
            f"driver: with gains {driver.proportional:g} 1/s, {driver.integral:g} 1/s² and {driver.derivative:g} "
            f"the speed swings ever more, by {radius:.4g} per step of {step_s:g} s (tyre's lag {tyre.lag_s:g} s); "
            "lower proportional and derivative gain, or shorten the step"
        )
