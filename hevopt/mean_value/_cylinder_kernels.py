"""Compiled cylinders: filling, combustion, friction and the heat of the exhaust.

    (13) W = eta_v p3 V_d w / (4 pi R T3),  eta_v = eta_v0(n) (r_c - (p4/p3)^(1/1.35)) / (r_c - 1)
    (14) lambda = W (1 - x3) / (AF_s W_f)
    (15) eta_i = eta_0 e(c_m) (1 - k exp(-(lambda - 1) / s)), and lambda times that below 1, where the rest stays
         unburnt;  e(c_m) = 1 - ((c_m - c_0) / c_1)²: slow, walls take heat; fast, combustion is late
    (16) pmep = p4 - p3 + c_v (n / 2000)²,  fmep = f0 + f2 c_m²  (mean piston speed c_m)
    (17) T = (eta_i W_f q - (pmep + fmep) V_d w / 4 pi) / w
    (18) Q_wall = (k0 + k1 1000 / n) q W_f
    (19) enthalpy of the exhaust = W h3 + q W_f + pumping work - indicated work - Q_wall

(13), (16): Eriksson, Nielsen 2014; e(c_m): the published fuel law of the engines' files, whose indicated efficiency
is a parabola of mean piston speed; (15) to (18) else: fitted, see there. (19) closes the energy.
Burnt mass: W_f of fuel makes (1 + AF_s) W_f of products, as far as there is air.
"""

from math import exp, pi, pow
from typing import NamedTuple

from hevopt._compile import compiled
from hevopt.mean_value._gas_kernels import State
from hevopt.mean_value.parameters import Cylinders

_FOUR_PI = 4.0 * pi
_RESIDUAL_EXPONENT = 1.0 / 1.35
_RADPS_1000RPM = 2000.0 * pi / 60.0
_LAMBDA_MOST = 1e3
# Share of the best efficiency below which it does not fall with speed, far beyond any engine's.
_LEAST_SHARE = 0.1
# Newton's steps to the fuel of a torque, and the share of its work that may be left.
_FUEL_STEPS, _FUEL_SHARE = 12, 1e-13


class Combustion(NamedTuple):
    """Flow in, air in it, fuel, lambda; brake torque; heat released, piston work and wall heat; products made."""

    flow: float
    air: float
    fuel: float
    excess_air: float
    torque: float
    released: float
    piston_power: float
    wall_power: float
    burnt_made: float


@compiled()
def filling(speed: float, inlet: State, outlet: State, cylinders: Cylinders) -> float:
    """Mass flow into the cylinders, equation (13)."""
    off = (speed - cylinders.filling_speed_radps) / cylinders.filling_speed_radps
    most = cylinders.filling_max - cylinders.filling_fall * off * off
    r = cylinders.compression_ratio
    share = (r - pow(outlet.pressure / inlet.pressure, _RESIDUAL_EXPONENT)) / (r - 1.0)
    filled = max(most, 0.0) * max(share, 0.0)
    return filled * inlet.density * cylinders.displacement_m3 * speed / _FOUR_PI


@compiled(inline="always")
def work_per_fuel(speed: float, cylinders: Cylinders) -> float:
    """Indicated work of a mass of fuel with much air at an engine speed, equation (15)."""
    off = cylinders.stroke_m * speed / pi - cylinders.efficiency_best_mps
    off /= cylinders.efficiency_width_mps
    share = max(1.0 - off * off, _LEAST_SHARE)
    return cylinders.efficiency * share * cylinders.heating_value_jpkg


@compiled(inline="always")
def friction_pa(speed: float, cylinders: Cylinders) -> float:
    """Mean pressure of friction, equation (16)."""
    piston = cylinders.stroke_m * speed / pi
    return cylinders.friction_pa + cylinders.friction_pa_s2pm2 * piston * piston


@compiled(inline="always")
def _lost_nm(speed: float, inlet: State, outlet: State, cylinders: Cylinders) -> float:
    """Torque of pumping and friction."""
    # Per rad of crank: mean pressure times displacement over 4 pi is a torque.
    per_pa = cylinders.displacement_m3 / _FOUR_PI
    turns = speed / (2.0 * _RADPS_1000RPM)
    pumping = outlet.pressure - inlet.pressure + cylinders.gas_exchange_pa * turns * turns
    return pumping * per_pa + friction_pa(speed, cylinders) * per_pa


@compiled()
def fuel_of(
    torque: float, speed: float, flow: float, inlet: State, outlet: State, cylinders: Cylinders
) -> float:
    """The flow of fuel that gives a torque: `combustion` turned round, by Newton; no more than the air burns.

    Torque grows ever less with fuel, so that steps from below, the fuel that would lose nothing, never pass it.
    """
    work = (torque + _lost_nm(speed, inlet, outlet, cylinders)) * max(speed, 1.0)
    most = max(flow * (1.0 - inlet.burnt), 0.0) / cylinders.stoichiometric_air
    if work <= 0.0 or most <= 0.0:
        return 0.0
    per_fuel = work_per_fuel(speed, cylinders)
    fuel = min(work / per_fuel, most)
    for _ in range(_FUEL_STEPS):
        excess = most / fuel
        lost = cylinders.rich_loss * exp(-(excess - 1.0) / cylinders.rich_width)
        lacking = work - per_fuel * fuel * (1.0 - lost)
        slope = per_fuel * (1.0 - lost * (1.0 + excess / cylinders.rich_width))
        if lacking <= _FUEL_SHARE * work or slope <= 0.0:
            break
        fuel = min(fuel + lacking / slope, most)
    return fuel


@compiled()
def combustion(
    speed: float, flow: float, fuel: float, inlet: State, outlet: State, cylinders: Cylinders
) -> Combustion:
    """What the cylinders make of a flow of gas and one of fuel."""
    air = flow * (1.0 - inlet.burnt)
    needed = fuel * cylinders.stoichiometric_air
    excess = min(air / needed, _LAMBDA_MOST) if needed > 0.0 else _LAMBDA_MOST
    burning = min(excess, 1.0)
    lost = exp(-(max(excess, 1.0) - 1.0) / cylinders.rich_width)
    released = burning * fuel * cylinders.heating_value_jpkg
    working = work_per_fuel(speed, cylinders) * burning * fuel
    indicated = working * (1.0 - cylinders.rich_loss * lost)
    # Per rad of crank: mean pressure times displacement over 4 pi is a torque.
    per_pa = cylinders.displacement_m3 / _FOUR_PI
    turns = speed / (2.0 * _RADPS_1000RPM)
    pumping = outlet.pressure - inlet.pressure + cylinders.gas_exchange_pa * turns * turns
    work = indicated / max(speed, 1.0) - pumping * per_pa
    torque = work - friction_pa(speed, cylinders) * per_pa
    wall = cylinders.wall_share + cylinders.wall_share_1000rpm * _RADPS_1000RPM / max(speed, 1.0)
    made = min(fuel + needed, fuel + max(air, 0.0))
    return Combustion(
        flow, air, fuel, excess, torque, released, work * speed, wall * released, made
    )
