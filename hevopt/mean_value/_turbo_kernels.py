"""Compiled compressor and turbine, both in torque form: nothing is divided by flow or speed.

Compressor, dimensionless (Eriksson, Nielsen 2014; X. Llamas, L. Eriksson, J. Eng. Gas Turbines Power 139(1) 012601,
2017). U = w D/2, M = U / sqrt(1.4 R T1), Phi = W / (rho1 pi/4 D² U), head
Psi = cp T1 (Pi^(R/cp) - 1) / U², and

    (8)  Psi = Psi_max (1 - x^N),  x = (Phi - Phi_surge) / (Phi_choke - Phi_surge)
    (9)  Phi_surge = a0 + a1 M,  Phi_choke = b0 - b1 M
    (11) P = U² (max(W, 0) (L0 - L1 Phi) + k rho1 pi/4 D² U): Euler work falls with flow, friction grows with U³

so that efficiency is a result. Equation (8) is solved for x: with s = 1 - Psi / Psi_max

    0.02 < s < 1   x = s^(1/N)
    s > 1          x = sqrt(1 + 2 (s - 1) / N): beyond Pi = 1 a restriction, whatever the speed
    s < 0.02       the tangent, down to x = 0; below a restriction as well, as large as the forward one

with equal values and slopes where they meet. As the speed goes to 0, (8) goes over into a restriction in both
directions: Psi U² stays, and no map has to be known there. A standing wheel is neither a hole nor a wall.

Turbine (Wahlström, Eriksson 2011; P. Moraal, I. Kolmanovsky, SAE 1999-01-0908):

    (21) W = A u p4 / sqrt(R T4) sqrt(1 - Pi^K)
    (22) efficiency = eta z (2 - z),  z = w R_t / sqrt(2 dh_is) / BSR_opt, at most 2.5
"""

from math import pi, pow, sqrt
from typing import NamedTuple

from hevopt._compile import compiled
from hevopt.mean_value._gas_kernels import State, root
from hevopt.mean_value.parameters import Compressor, Gas, Turbine

# Share of Psi_max from the top below which equation (8) is continued by its tangent.
TANGENT = 0.02
# Rim speed that a slower wheel counts as having, m/s: about 500 rpm, a fan of less than a pascal; without it the
# equations become ever stiffer. And share of the turbine's (1 - Pi^K) below which its root is smooth.
_REST_MPS = 1.0
_LINEAR = 1e-3
_FREE_RUNNING = 2.5
_AIR_GAMMA = 1.4


class Compression(NamedTuple):
    """Flow, torque on the shaft, place on the map: flow number, those of surge and choke, head over its most."""

    flow: float
    torque: float
    phi: float
    surge: float
    choke: float
    head: float


class Expansion(NamedTuple):
    """Flow, torque on the shaft, and efficiency."""

    flow: float
    torque: float
    efficiency: float


@compiled()
def place_on_line(s: float, n: float) -> float:
    """x of equation (8) and its continuations at s = 1 - Psi / Psi_max."""
    if s >= 1.0:
        return sqrt(1.0 + 2.0 * (s - 1.0) / n)
    value = pow(TANGENT, 1.0 / n)
    if s >= TANGENT:
        return pow(s, 1.0 / n)
    slope = value / (n * TANGENT)
    below = value - slope * (TANGENT - s)
    if below >= 0.0:
        return below
    # As much flow backwards as a standing wheel lets through forwards: 2 slope sqrt(bend) = sqrt(2 / n).
    bend = 1.0 / (2.0 * n * slope * slope)
    return -2.0 * bend * slope * (sqrt(1.0 - below / (slope * bend)) - 1.0)


@compiled()
def compressor(
    speed: float, ahead: State, behind: State, wheel: Compressor, gas: Gas
) -> Compression:
    """What the compressor does at a shaft speed between two volumes."""
    own = 0.5 * wheel.wheel_diameter_m * speed
    rim = max(own, _REST_MPS)
    mach = rim / sqrt(_AIR_GAMMA * gas.constant_jpkgk * ahead.temperature)
    swept = ahead.density * 0.25 * pi * wheel.wheel_diameter_m**2 * rim
    ratio = behind.pressure / ahead.pressure
    work = ahead.cp * ahead.temperature * (pow(ratio, gas.constant_jpkgk / ahead.cp) - 1.0)
    head = work / (rim * rim * wheel.head_max)
    surge = wheel.surge_flow + wheel.surge_flow_per_mach * mach
    choke = wheel.choke_flow - wheel.choke_flow_fall_per_mach * mach
    choke = max(choke, surge + 0.03)
    place = place_on_line(1.0 - head, wheel.head_exponent)
    # Without a pressure difference the flow is that at choke of its own speed, none at rest.
    phi = choke * (own / rim) + (choke - surge) * (place - 1.0)
    flow = phi * swept
    euler = max(flow, 0.0) * (wheel.work * own - wheel.work_fall_with_flow * phi * rim)
    friction = wheel.disc_friction * swept * own * own / rim
    torque = 0.5 * wheel.wheel_diameter_m * (euler + friction)
    return Compression(flow, torque, phi, surge, choke, head)


@compiled()
def turbine(
    speed: float, opening: float, ahead: State, behind: State, wheel: Turbine, gas: Gas
) -> Expansion:
    """What the turbine does at a shaft speed and vane opening between two volumes; no torque of reverse flow."""
    if ahead.pressure >= behind.pressure:
        high, low, sign = ahead, behind, 1.0
    else:
        high, low, sign = behind, ahead, -1.0
    ratio = low.pressure / high.pressure
    passing = root(1.0 - pow(ratio, wheel.flow_exponent), _LINEAR)
    flow = wheel.area_m2 * opening * high.pressure * passing
    flow *= sign / sqrt(gas.constant_jpkgk * high.temperature)
    if sign < 0.0:
        return Expansion(flow, 0.0, 0.0)
    work = high.cp * high.temperature * (1.0 - pow(ratio, gas.constant_jpkgk / high.cp))
    spouting = sqrt(max(2.0 * work, 0.0))
    # z sqrt(2 dh) is known without a division, z itself only where there is a flow.
    blade = speed * wheel.wheel_radius_m / wheel.blade_speed_ratio
    z = min(blade / spouting, _FREE_RUNNING) if spouting > 0.0 else _FREE_RUNNING
    torque = 0.5 * flow * wheel.efficiency_max * (2.0 - z) * spouting
    torque *= wheel.wheel_radius_m / wheel.blade_speed_ratio
    return Expansion(flow, torque, wheel.efficiency_max * z * (2.0 - z))
