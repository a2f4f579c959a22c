"""Compiled right-hand side: five volumes, turbocharger, wall, actuators, and the car.

    (3) dm/dt = sum W   (4) d(m x)/dt = sum W x_from   (5) dU/dt = sum W h_from + shaft power - heat,  p = m R T / V
    (7) intercooler T = T_2 - eps (T_2 - T_cool)       (23) J dw/dt = T_t - T_c - c_f w
    (24) Q_4 = UA (T_4 - T_w),  C dT_w/dt = Q_4 - UA_o (T_w - T_amb)
    (31) tau dF/dt = (efficiency (T_clutch k) + assist) - F,  k = i / R_wheel
    (32) m dv/dt = F - resistance(v),  J_e dw/dt = T_brake - T_clutch,  T_clutch = T_max tanh(slip / slip_0)

Numbers as in the source study (31, 32) and in L. Eriksson, L. Nielsen 2014.
"""

from math import isnan, tanh
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hevopt._compile import compiled
from hevopt.mean_value import states as s
from hevopt.mean_value._control_kernels import Command, command
from hevopt.mean_value._cylinder_kernels import Combustion, combustion, filling, fuel_of
from hevopt.mean_value._gas_kernels import (
    State,
    carried,
    coefficients,
    curve,
    enthalpy,
    restriction,
    state_of,
    valve,
)
from hevopt.mean_value._turbo_kernels import Compression, Expansion, compressor, turbine
from hevopt.mean_value.parameters import ASSIST, FULL_LOAD, Ambient, Car, Cooler, Drive, Gas, Model

Vector = NDArray[np.float64]

# Time in which a dynamometer's pedal finds its torque.
_SEEKING_S = 0.3


class Flows(NamedTuple):
    """Everything between the volumes at one moment."""

    one: State
    two: State
    three: State
    four: State
    five: State
    air: State
    filter: float
    compression: Compression
    charge: float
    egr: float
    combustion: Combustion
    expansion: Expansion
    exhaust: float
    command: Command
    pedal: float
    brake: float
    clutch: float
    assist: float


@compiled(inline="always")
def _ambient(around: Ambient, gas: Gas) -> State:
    density = around.pressure_pa / (gas.constant_jpkgk * around.temperature_k)
    a, b = coefficients(0.0, gas)
    t = around.temperature_k
    return State(around.pressure_pa, t, 0.0, density, enthalpy(t, 0.0, gas), a + b * t)


@compiled(inline="always")
def _cooled(ahead: State, cooler: Cooler, gas: Gas) -> float:
    """Enthalpy per mass behind a cooler."""
    t = ahead.temperature - cooler.effectiveness * (ahead.temperature - cooler.coolant_k)
    return enthalpy(t, ahead.burnt, gas)


@compiled(inline="always")
def _pedal(t: float, y: Vector, drive: Drive) -> float:
    return min(max(float(y[s.PEDAL]) + drive.pedal_rate_ps * t, 0.0), 1.0)


@compiled(inline="always")
def _clutch(y: Vector, car: Car) -> float:
    slip = y[s.ENGINE] - car.ratio_radpm * y[s.ROAD]
    return car.clutch_nm * tanh(slip / car.clutch_slip_radps)


@compiled()
def _assist(y: Vector, brake: float, full: float, pedal: float, model: Model) -> float:
    """Torque of the machine that fills what the engine lacks of its full load, as far as it can."""
    car = model.car
    if car.assist_ratio_radpm <= 0.0 or model.drive.held > 0.0:
        return 0.0
    lacking = max(pedal * full - brake, 0.0) * car.ratio_radpm * car.efficiency
    torque = lacking / (car.assist_ratio_radpm * car.assist_efficiency)
    most = curve(car.assist_ratio_radpm * y[s.ROAD], ASSIST, model.curves)
    return min(torque, most)


@compiled(inline="always")
def _fuel(
    asked: Command, speed: float, into: float, three: State, four: State, model: Model
) -> float:
    """Flow of fuel: what the pedal asks, or what gives the torque of somebody else's wish."""
    if isnan(model.drive.torque_nm):
        return asked.fuel
    wanted = fuel_of(model.drive.torque_nm, speed, into, three, four, model.engine.cylinders)
    return min(wanted, max(asked.most, 0.0))


@compiled()
def combustion_now(y: Vector, model: Model) -> Combustion:
    """What burns at a state whose pedal rests."""
    engine, gas = model.engine, model.gas
    three = state_of(y, 6, engine.volumes.intake_manifold_m3, gas)
    four = state_of(y, 9, engine.volumes.exhaust_manifold_m3, gas)
    speed = max(y[s.ENGINE], 0.0)
    into = filling(speed, three, four, engine.cylinders)
    asked = command(
        speed, _pedal(0.0, y, model.drive), into, y[s.METER], y[s.BOOST], three, four,
        model.curves, model.control, engine.cylinders, gas,
    )  # fmt: skip
    fuel = _fuel(asked, speed, into, three, four, model)
    return combustion(speed, into, fuel, three, four, engine.cylinders)


@compiled(inline="always")
def flows(t: float, y: Vector, model: Model) -> Flows:
    """All flows, torques and commands at time t and state y."""
    engine, gas = model.engine, model.gas
    volumes, losses = engine.volumes, engine.restrictions
    one = state_of(y, 0, volumes.intake_system_m3, gas)
    two = state_of(y, 3, volumes.charge_pipe_m3, gas)
    three = state_of(y, 6, volumes.intake_manifold_m3, gas)
    four = state_of(y, 9, volumes.exhaust_manifold_m3, gas)
    five = state_of(y, 12, volumes.exhaust_system_m3, gas)
    air = _ambient(model.ambient, gas)
    cylinders, valves = engine.cylinders, engine.recirculation
    speed, turbo = max(y[s.ENGINE], 0.0), max(y[s.TURBO], 0.0)
    into = filling(speed, three, four, cylinders)
    pedal = _pedal(t, y, model.drive)
    asked = command(
        speed, pedal, into, y[s.METER], y[s.BOOST], three, four,
        model.curves, model.control, cylinders, gas,
    )  # fmt: skip
    fuel = _fuel(asked, speed, into, three, four, model)
    burning = combustion(speed, into, fuel, three, four, cylinders)
    brake = pedal * asked.full_load if model.drive.from_map > 0.0 else burning.torque
    clutch = _clutch(y, model.car)
    return Flows(
        one, two, three, four, five, air,
        restriction(air, one, losses.filter_h, losses.linear_below_pa),
        compressor(turbo, one, two, engine.compressor, gas),
        restriction(two, three, losses.intercooler_h, losses.linear_below_pa),
        valve(four, three, valves.area_m2 * y[s.EGR], valves.least_pressure_ratio, gas),
        burning,
        turbine(turbo, y[s.VANES], four, five, engine.turbine, gas),
        restriction(five, air, losses.exhaust_h, losses.linear_below_pa),
        asked, pedal, brake, clutch, _assist(y, brake, asked.full_load, pedal, model),
    )  # fmt: skip


@compiled(inline="always")
def _mass_rates(f: Flows, dy: Vector) -> None:
    """Equations (3) and (4), and what the balances of mass and burnt mass count."""
    burning, compressed, expanded = f.combustion, f.compression.flow, f.expansion.flow
    dy[0] = f.filter - compressed
    dy[3] = compressed - f.charge
    dy[6] = f.charge + f.egr - burning.flow
    dy[9] = burning.flow + burning.fuel - expanded - f.egr
    dy[12] = expanded - f.exhaust
    fresh = carried(f.filter, 0.0, f.one.burnt)
    through = carried(compressed, f.one.burnt, f.two.burnt)
    charge = carried(f.charge, f.two.burnt, f.three.burnt)
    egr = carried(f.egr, f.four.burnt, f.three.burnt)
    drawn = burning.flow * f.three.burnt
    turned = carried(expanded, f.four.burnt, f.five.burnt)
    leaving = carried(f.exhaust, f.five.burnt, 0.0)
    dy[1] = fresh - through
    dy[4] = through - charge
    dy[7] = charge + egr - drawn
    dy[10] = drawn + burning.burnt_made - turned - egr
    dy[13] = turned - leaving
    dy[s.AIR_IN], dy[s.EXHAUST_OUT], dy[s.FUEL] = f.filter, f.exhaust, burning.fuel
    dy[s.BURNT_MADE], dy[s.BURNT_OUT] = burning.burnt_made, leaving - fresh


@compiled(inline="always")
def _energy_rates(f: Flows, y: Vector, dy: Vector, model: Model) -> None:
    """Equations (5), (7), (23) and (24), and what the balances of energy and of the rotor count."""
    engine, burning, turbo = model.engine, f.combustion, max(y[s.TURBO], 0.0)
    entering = carried(f.filter, f.air.enthalpy, f.one.enthalpy)
    through = carried(f.compression.flow, f.one.enthalpy, f.two.enthalpy)
    hot = carried(f.charge, f.two.enthalpy, f.three.enthalpy)
    charge = f.charge * _cooled(f.two, engine.intercooler, model.gas) if f.charge > 0.0 else hot
    exhaust = carried(f.egr, f.four.enthalpy, f.three.enthalpy)
    cooler = engine.recirculation.cooler
    egr = f.egr * _cooled(f.four, cooler, model.gas) if f.egr > 0.0 else exhaust
    drawn = burning.flow * f.three.enthalpy
    turned = carried(f.expansion.flow, f.four.enthalpy, f.five.enthalpy)
    leaving = carried(f.exhaust, f.five.enthalpy, f.air.enthalpy)
    compressor_w, turbine_w = f.compression.torque * turbo, f.expansion.torque * turbo
    bearing = engine.rotor.bearing_nms * y[s.TURBO]
    wall, around = engine.wall, model.ambient.temperature_k
    wall_w = wall.gas_wpk * (f.four.temperature - y[s.WALL])
    burnt = burning.released - burning.piston_power - burning.wall_power
    dy[2] = entering - through
    dy[5] = through + compressor_w - hot
    dy[8] = charge + egr - drawn
    dy[11] = drawn + burnt - turned - exhaust - wall_w
    dy[14] = turned - turbine_w - leaving
    dy[s.TURBO] = (f.expansion.torque - f.compression.torque - bearing) / engine.rotor.inertia_kgm2
    dy[s.WALL] = (wall_w - wall.ambient_wpk * (y[s.WALL] - around)) / wall.capacity_jpk
    dy[s.ENTHALPY_IN], dy[s.ENTHALPY_OUT] = entering, leaving
    dy[s.RELEASED], dy[s.PISTON_WORK] = burning.released, burning.piston_power
    dy[s.CYLINDER_HEAT], dy[s.MANIFOLD_HEAT] = burning.wall_power, wall_w
    dy[s.INTERCOOLER_HEAT], dy[s.EGR_HEAT] = hot - charge, exhaust - egr
    dy[s.TURBINE_WORK], dy[s.COMPRESSOR_WORK] = turbine_w, compressor_w
    dy[s.BEARING_WORK] = bearing * y[s.TURBO]


@compiled(inline="always")
def acceleration(y: Vector, car: Car) -> float:
    """Acceleration of the car, equation (32)."""
    v, r = y[s.ROAD], car.resistance_n
    return float(y[s.TYRE] - (r[0] + v * (r[1] + v * (r[2] + v * r[3])))) / car.mass_kg


@compiled(inline="always")
def _car_rates(f: Flows, y: Vector, dy: Vector, model: Model) -> None:
    """Equations (31) and (32); pedal and speeds of a dynamometer."""
    car, drive = model.car, model.drive
    dy[s.PEDAL] = dy[s.ENGINE] = dy[s.ROAD] = dy[s.TYRE] = 0.0
    dy[s.ASSIST_WORK] = f.assist * car.assist_ratio_radpm * y[s.ROAD]
    if not isnan(drive.seek_nm):
        dy[s.PEDAL] = (drive.seek_nm - f.combustion.torque) / (_SEEKING_S * f.command.full_load)
    if drive.held > 0.0:
        dy[s.ENGINE] = drive.engine_radps2
        return
    wheels = f.clutch * car.ratio_radpm * car.efficiency
    wheels += f.assist * car.assist_ratio_radpm * car.assist_efficiency
    dy[s.ENGINE] = (f.brake - f.clutch) / car.engine_inertia_kgm2
    dy[s.TYRE] = (wheels - y[s.TYRE]) / car.tyre_lag_s
    dy[s.ROAD] = acceleration(y, car)


@compiled()
def _map_rates(t: float, y: Vector, dy: Vector, model: Model) -> None:
    """Equations (31) and (32) by the steady map; the gas rests, as the car asks nothing of it."""
    for i in range(s.SIZE):
        dy[i] = 0.0
    car, clutch = model.car, _clutch(y, model.car)
    brake = _pedal(t, y, model.drive) * curve(max(y[s.ENGINE], 0.0), FULL_LOAD, model.curves)
    dy[s.ENGINE] = (brake - clutch) / car.engine_inertia_kgm2
    dy[s.TYRE] = (clutch * car.ratio_radpm * car.efficiency - y[s.TYRE]) / car.tyre_lag_s
    dy[s.ROAD] = acceleration(y, car)


@compiled()
def derivative(t: float, y: Vector, model: Model, dy: Vector) -> None:
    """Rates of all states at time t and state y, written to dy."""
    if model.drive.from_map > 0.0:
        _map_rates(t, y, dy, model)
        return
    f = flows(t, y, model)
    _mass_rates(f, dy)
    _energy_rates(f, y, dy, model)
    _car_rates(f, y, dy, model)
    control = model.control
    dy[s.VANES] = (f.command.vanes - y[s.VANES]) / control.vanes_lag_s
    dy[s.EGR] = (f.command.egr - y[s.EGR]) / control.egr_lag_s
    dy[s.METER] = (f.filter - y[s.METER]) / control.meter_lag_s
    dy[s.BOOST] = f.command.integral_rate
