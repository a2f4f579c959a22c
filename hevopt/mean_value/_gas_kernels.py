"""Compiled gas and flow laws of the mean-value engine.

    (1) cp = A + B T, mixed by burnt mass fraction x;  h = A T + B T²/2,  u = h - R T
    (2) T = 2 u / (A - R + sqrt((A - R)² + 2 B u)): closed form, so that energy is conserved to rounding
    (6) W = sign(dp) sqrt(rho / H) f(|dp|),  f = sqrt(dp) above dp_lin and sqrt(dp_lin) (1.25 r - 0.25 r³) below,
        r = dp / dp_lin: turbulent, and smooth to the first derivative through no flow in both directions

L. Eriksson, L. Nielsen, Modeling and Control of Engines and Drivelines, Wiley 2014: restriction and volumes.
"""

from math import sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hevopt._compile import compiled
from hevopt.mean_value.parameters import Gas


class State(NamedTuple):
    """Gas of a volume: pressure, temperature, burnt mass fraction, density, enthalpy and heat capacity per mass."""

    pressure: float
    temperature: float
    burnt: float
    density: float
    enthalpy: float
    cp: float


@compiled(inline="always")
def coefficients(burnt: float, gas: Gas) -> tuple[float, float]:
    """A and B of cp = A + B T."""
    a = gas.air_a_jpkgk + burnt * (gas.burnt_a_jpkgk - gas.air_a_jpkgk)
    b = gas.air_b_jpkgk2 + burnt * (gas.burnt_b_jpkgk2 - gas.air_b_jpkgk2)
    return a, b


@compiled(inline="always")
def enthalpy(temperature: float, burnt: float, gas: Gas) -> float:
    """Enthalpy per mass, 0 at 0 K."""
    a, b = coefficients(burnt, gas)
    return temperature * (a + 0.5 * b * temperature)


@compiled(inline="always")
def temperature_of_energy(energy: float, burnt: float, gas: Gas) -> float:
    """Temperature at an internal energy per mass."""
    a, b = coefficients(burnt, gas)
    a -= gas.constant_jpkgk
    return 2.0 * energy / (a + sqrt(max(a * a + 2.0 * b * energy, 0.0)))


@compiled()
def state_of(y: NDArray[np.float64], first: int, volume: float, gas: Gas) -> State:
    """The gas of the volume whose mass, burnt mass and energy stand at y[first:first + 3]."""
    mass = y[first]
    burnt = min(max(y[first + 1] / mass, 0.0), 1.0)
    temperature = temperature_of_energy(y[first + 2] / mass, burnt, gas)
    a, b = coefficients(burnt, gas)
    pressure = mass * gas.constant_jpkgk * temperature / volume
    h = temperature * (a + 0.5 * b * temperature)
    return State(pressure, temperature, burnt, mass / volume, h, a + b * temperature)


@compiled(inline="always")
def root(value: float, linear_below: float) -> float:
    """Square root of a value >= 0, near 0 a cubic with the same value and slope where they meet."""
    if value >= linear_below:
        return sqrt(value)
    r = value / linear_below
    return sqrt(linear_below) * r * (1.25 - 0.25 * r * r)


@compiled()
def restriction(ahead: State, behind: State, h: float, linear_below: float) -> float:
    """Mass flow from `ahead` to `behind`, equation (6)."""
    dp = ahead.pressure - behind.pressure
    if dp >= 0.0:
        return sqrt(ahead.density / h) * root(dp, linear_below)
    return -sqrt(behind.density / h) * root(-dp, linear_below)


@compiled()
def valve(ahead: State, behind: State, area: float, least_ratio: float, gas: Gas) -> float:
    """Mass flow through the recirculation valve, equation (20), either direction.

    W = A p / sqrt(R T) (1 - ((1 - Pi) / (1 - Pi_o) - 1)²), Pi = max(p_low / p_high, Pi_o)
    (J. Wahlström, L. Eriksson, Proc. IMechE D 225(7), 2011, 960-986).
    """
    if ahead.pressure >= behind.pressure:
        high, low, sign = ahead, behind, 1.0
    else:
        high, low, sign = behind, ahead, -1.0
    ratio = max(low.pressure / high.pressure, least_ratio)
    bend = (1.0 - ratio) / (1.0 - least_ratio) - 1.0
    flow = area * high.pressure / sqrt(gas.constant_jpkgk * high.temperature)
    return sign * flow * (1.0 - bend * bend)


@compiled(inline="always")
def carried(flow: float, ahead: float, behind: float) -> float:
    """What a flow carries of a quantity per mass: that of the volume it comes from."""
    return flow * (ahead if flow >= 0.0 else behind)


@compiled()
def curve(x: float, which: int, curves: NDArray[np.float64]) -> float:
    """One of a model's curves at x; see parameters.packed_curves."""
    if x <= curves[which, 0, 0]:
        return float(curves[which, 1, 0])
    i = 0
    while x > curves[which, 0, i + 1]:
        i += 1
    low, value = curves[which, 0, i], curves[which, 1, i]
    share = (x - low) / (curves[which, 0, i + 1] - low)
    return float(value + share * (curves[which, 1, i + 1] - value))
