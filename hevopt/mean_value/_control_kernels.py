"""Compiled control unit: pedal to fuel, vanes and recirculation.

    (26) q_demand = (4 pi T / V_d + fmep + pm0 + pm2 (n/1000)²) V_d / (eta_0 e(c_m) (e0 - e1 load) q),
         T = pedal x full load(n), efficiency over speed e(c_m) as in (15)
    (27) q <= m_air / (AF_s lambda_smoke(n)), m_air of a cycle from the flow into the cylinders (speed density)
         or from the air meter, which lags and knows neither what recirculates nor what the pipes take up
    (28) vanes = map(n, load) - kp e - ki int e,  e = p_target - p3, from a load on; opened above the limit of p4;
         the integral stops where the vanes are at either end
         p_target = q_demand AF_s lambda(n, load) R T / (eta_v0 V_d)
    (29) recirculation = map(load), fading with speed, and closed where the smoke limit nears
    (30) first-order actuators

q: fuel of a cycle of all cylinders. Pressure sets the target and the driver the load, so that full load is an input
here and how the engine gets there is a result.
"""

from math import inf, pi
from typing import NamedTuple

from hevopt._compile import compiled
from hevopt.mean_value._cylinder_kernels import friction_pa, work_per_fuel
from hevopt.mean_value._gas_kernels import State, curve
from hevopt.mean_value.parameters import (
    EGR,
    FULL_LAMBDA,
    FULL_LOAD,
    PART_LAMBDA,
    SMOKE,
    VANES,
    Array,
    Control,
    Cylinders,
    Gas,
)

_FOUR_PI = 4.0 * pi
_RADPS_1000RPM = 2000.0 * pi / 60.0
# Speed below which a flow is not told per cycle, rad/s: no engine idles there.
_LEAST_RADPS = 5.0
# The valve closes over the last tenth before the smoke limit, fuel goes over so many K above the exhaust's limit.
_NEAR_SMOKE = 0.1
_DERATED_OVER_K = 50.0
_INTEGRAL_FADES_S = 1.0
# Load over which the boost loop closes, and opening over which its integral stops before either end: without a
# width, solutions would slide along a switch.
_LOOP_CLOSES_OVER, _SATURATES_OVER = 0.05, 0.02


class Command(NamedTuple):
    """What the control unit asks for: fuel flow, vane and valve opening, rate of the boost integral; and what is
    behind it: full-load torque, fuel demanded and allowed by the smoke limit per cycle, boost target; and the
    most fuel flow that smoke limit and exhaust leave."""

    fuel: float
    vanes: float
    egr: float
    integral_rate: float
    full_load: float
    demanded: float
    allowed: float
    target: float
    most: float


@compiled(inline="always")
def demanded_fuel(
    speed: float, torque: float, pedal: float, control: Control, cylinders: Cylinders
) -> float:
    """Fuel of a cycle for a torque, equation (26)."""
    thousands = speed / _RADPS_1000RPM
    pumping = control.pumping_pa + control.pumping_pa_1000rpm * thousands * thousands
    pressure = _FOUR_PI * torque / cylinders.displacement_m3 + pumping
    pressure += friction_pa(speed, cylinders)
    fall = control.efficiency_fall - control.efficiency_fall_with_load * pedal
    return pressure * cylinders.displacement_m3 / (work_per_fuel(speed, cylinders) * fall)


@compiled()
def boost_target(
    speed: float, pedal: float, fuel: float, curves: Array, control: Control, cylinders: Cylinders, gas: Gas
) -> float:  # fmt: skip
    """Pressure of the intake manifold that carries a cycle's fuel with the air it is given."""
    excess = curve(pedal, PART_LAMBDA, curves)
    n = 0
    while curves[PART_LAMBDA, 0, n + 1] < inf:
        n += 1
    last = curves[PART_LAMBDA, 0, n]
    if pedal > last:
        share = (pedal - last) / (1.0 - last)
        excess += share * (curve(speed, FULL_LAMBDA, curves) - excess)
    off = (speed - cylinders.filling_speed_radps) / cylinders.filling_speed_radps
    filled = max(cylinders.filling_max - cylinders.filling_fall * off * off, 0.1)
    air = fuel * cylinders.stoichiometric_air * excess
    return air * gas.constant_jpkgk * control.charge_k / (filled * cylinders.displacement_m3)


@compiled()
def command(
    speed: float, pedal: float, flow: float, meter: float, integral: float, inlet: State, outlet: State,
    curves: Array, control: Control, cylinders: Cylinders, gas: Gas,
) -> Command:  # fmt: skip
    """What the control unit asks for with `flow` into the cylinders and `meter` at the air meter."""
    full_load = curve(speed, FULL_LOAD, curves)
    demanded = demanded_fuel(speed, pedal * full_load, pedal, control, cylinders)
    seen = meter if control.air_meter > 0.0 else flow * (1.0 - inlet.burnt)
    per_cycle = _FOUR_PI / max(speed, _LEAST_RADPS)
    smoke = curve(speed, SMOKE, curves)
    allowed = max(seen, 0.0) * per_cycle / (cylinders.stoichiometric_air * smoke)
    hot = (outlet.temperature - control.exhaust_temperature_max_k) / _DERATED_OVER_K
    cooled = min(max(1.0 - hot, 0.0), 1.0)
    fuel = max(min(demanded, allowed), 0.0) * cooled
    target = boost_target(speed, pedal, demanded, curves, control, cylinders, gas)
    error = target - inlet.pressure
    base = curve(speed, VANES, curves)
    base *= 1.0 + control.vanes_growth * (1.0 - pedal)
    asked = base + max(outlet.pressure - control.exhaust_pressure_max_pa, 0.0) * 1e-5
    closed = min(max((pedal - control.boost_from_load) / _LOOP_CLOSES_OVER, 0.0), 1.0)
    asked -= closed * (control.boost_gain_ppa * error + integral)
    room = asked - control.vanes_least if error > 0.0 else 1.0 - asked
    growing = control.boost_integral_ppas * error * min(max(room / _SATURATES_OVER, 0.0), 1.0)
    rate = closed * growing - (1.0 - closed) * integral / _INTEGRAL_FADES_S
    vanes = min(max(asked, control.vanes_least), 1.0)
    egr = curve(pedal, EGR, curves)
    fading = control.egr_closed_radps - control.egr_fades_radps
    egr *= min(max((control.egr_closed_radps - speed) / fading, 0.0), 1.0)
    egr *= min(max((allowed / max(demanded, 1e-12) - 1.0) / _NEAR_SMOKE, 0.0), 1.0)
    most = allowed * cooled / per_cycle
    return Command(fuel / per_cycle, vanes, egr, rate, full_load, demanded, allowed, target, most)
