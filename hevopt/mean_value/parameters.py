"""A mean-value engine, its control unit, a car and a manoeuvre: named tuples, which compiled loops take whole.

The five volumes, as in Millo, Rolando, Andreata 2011, section 4.1:

    1 intake system          filter to compressor
    2 charge pipe            compressor to intercooler
    3 intake manifold        intercooler and recirculation to cylinders
    4 exhaust manifold       cylinders to turbine and recirculation
    5 exhaust system         turbine to the open

Curves are linear between their points and hold beyond them; those over speed are in rad/s. All of a model's stand
in one array, as loops pay for every array that they are handed.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

VOLUMES = (
    "intake system",
    "charge pipe",
    "intake manifold",
    "exhaust manifold",
    "exhaust system",
)


class Gas(NamedTuple):
    """cp = A + B T of air and of products of stoichiometric combustion, mixed by the burnt mass fraction; one R.

    Fitted to 1005 and 1149 J/kgK (air), 1072 and 1275 J/kgK (products) at 300 and 1000 K.
    """

    constant_jpkgk: float = 287.0
    air_a_jpkgk: float = 943.0
    air_b_jpkgk2: float = 0.206
    burnt_a_jpkgk: float = 985.0
    burnt_b_jpkgk2: float = 0.290


class Ambient(NamedTuple):
    """The air around: standard pressure, 25 °C."""

    pressure_pa: float = 101_325.0
    temperature_k: float = 298.15


class Volumes(NamedTuple):
    """Content of the five volumes."""

    intake_system_m3: float
    charge_pipe_m3: float
    intake_manifold_m3: float
    exhaust_manifold_m3: float
    exhaust_system_m3: float


class Restrictions(NamedTuple):
    """Turbulent pressure losses, dp = H W² / density, linear in the flow below `linear_below_pa`."""

    filter_h: float
    intercooler_h: float
    exhaust_h: float
    linear_below_pa: float


class Cooler(NamedTuple):
    """T_out = T_in - effectiveness (T_in - coolant), for forward flow."""

    effectiveness: float
    coolant_k: float


class Compressor(NamedTuple):
    """Compact map, equations (8) to (11) of _turbo_kernels."""

    wheel_diameter_m: float
    head_max: float
    head_exponent: float
    surge_flow: float
    surge_flow_per_mach: float
    choke_flow: float
    choke_flow_fall_per_mach: float
    work: float
    work_fall_with_flow: float
    disc_friction: float


class Turbine(NamedTuple):
    """Compact map, equations (21) and (22): effective area at open vanes, and efficiency over blade speed ratio."""

    wheel_radius_m: float
    area_m2: float
    flow_exponent: float
    efficiency_max: float
    blade_speed_ratio: float


class Rotor(NamedTuple):
    """The turbocharger's shaft."""

    inertia_kgm2: float
    bearing_nms: float


class Cylinders(NamedTuple):
    """Filling, combustion, friction and wall heat, equations (13) to (19) of _cylinder_kernels."""

    displacement_m3: float
    stroke_m: float
    compression_ratio: float
    filling_max: float
    filling_fall: float
    filling_speed_radps: float
    heating_value_jpkg: float
    stoichiometric_air: float
    efficiency: float
    efficiency_best_mps: float
    efficiency_width_mps: float
    rich_loss: float
    rich_width: float
    friction_pa: float
    friction_pa_s2pm2: float
    gas_exchange_pa: float
    wall_share: float
    wall_share_1000rpm: float


class Recirculation(NamedTuple):
    """Exhaust recirculation: valve with its least pressure ratio, equation (20), and cooler."""

    area_m2: float
    least_pressure_ratio: float
    cooler: Cooler


class Wall(NamedTuple):
    """Exhaust manifold's wall: gas to wall, its heat capacity, wall to the air around."""

    gas_wpk: float
    capacity_jpk: float
    ambient_wpk: float


class Engine(NamedTuple):
    """The engine without its control unit."""

    volumes: Volumes
    restrictions: Restrictions
    intercooler: Cooler
    compressor: Compressor
    turbine: Turbine
    rotor: Rotor
    cylinders: Cylinders
    recirculation: Recirculation
    wall: Wall


class Control(NamedTuple):
    """The control unit but for its curves; see _control_kernels.

    air_meter: 1 where the smoke limit sees the meter's flow, 0 where it sees that of the cylinders (speed density)
    vanes_growth: what the vanes' opening grows by towards no load; egr_*: speeds between which the valve closes
    """

    pumping_pa: float
    pumping_pa_1000rpm: float
    efficiency_fall: float
    efficiency_fall_with_load: float
    air_meter: float
    meter_lag_s: float
    charge_k: float
    vanes_growth: float
    vanes_least: float
    vanes_lag_s: float
    boost_gain_ppa: float
    boost_integral_ppas: float
    boost_from_load: float
    exhaust_pressure_max_pa: float
    exhaust_temperature_max_k: float
    egr_fades_radps: float
    egr_closed_radps: float
    egr_lag_s: float


# Curves of a model. Over speed: torque that full pedal asks for, least lambda of the smoke limit, lambda that sets
# the boost of full load, opening of the vanes there. Over load: lambda at part load, opening of the recirculation
# valve. Over its own speed: highest torque of an assisting machine.
CURVES = ("full_load", "smoke", "full_lambda", "vanes", "part_lambda", "egr", "assist")
FULL_LOAD, SMOKE, FULL_LAMBDA, VANES, PART_LAMBDA, EGR, ASSIST = range(len(CURVES))

Points = Sequence[float] | Array
NO_ASSIST = (np.array([0.0]), np.array([0.0]))


def packed_curves(curves: Mapping[str, tuple[Points, Points]]) -> Array:
    """(curve, 2, point) all curves of a model, their last point going on. curves: name -> points, values"""
    longest = max(len(points) for points, _ in curves.values())
    found = np.empty((len(CURVES), 2, longest + 1))
    for n, name in enumerate(CURVES):
        points, values = curves[name]
        found[n, 0], found[n, 1] = np.inf, values[-1]
        found[n, :, : len(points)] = points, values
    return found


def curve_of(curves: Array, which: int) -> tuple[Array, Array]:
    """Points and values of one of packed curves."""
    known = np.isfinite(curves[which, 0])
    return curves[which, 0, known], curves[which, 1, known]


def with_curve(curves: Array, which: int, points: Points, values: Points) -> Array:
    """Packed curves with another one in a place."""
    found = {name: curve_of(curves, n) for n, name in enumerate(CURVES)}
    return packed_curves({**found, CURVES[which]: (points, values)})


class Car(NamedTuple):
    """A car in one gear: driveline and engine turn on their own, joined by the clutch.

    resistance_n: road load over the powers of speed, N and m/s; mass with wheels and rotors behind the clutch
    ratio_radpm: engine speed over road speed with the clutch closed
    clutch_nm, clutch_slip_radps: torque is clutch_nm tanh(slip / clutch_slip_radps)
    assist_*: of a machine behind the clutch that fills what the engine lacks of its full load: speed over road
    speed (0: none) and efficiency to the wheels
    """

    engine_inertia_kgm2: float
    mass_kg: float
    resistance_n: tuple[float, float, float, float]
    ratio_radpm: float
    efficiency: float
    clutch_nm: float
    clutch_slip_radps: float
    tyre_lag_s: float
    assist_ratio_radpm: float
    assist_efficiency: float


class Drive(NamedTuple):
    """What is done with the car.

    held: 1 keeps engine and road speed as they are, as a dynamometer does
    engine_radps2: how fast the engine's speed changes there, where somebody else turns it
    seek_nm: pedal moves until the engine gives this torque; NaN: it does not
    pedal_rate_ps: pedal moved from time 0 on, up to 1
    from_map: 1 drives with the torque that a steady map gives at once, pedal times full load; the gas rests
    torque_nm: fuel is what gives this torque, as far as the limits of smoke and exhaust let it; NaN: by the pedal
    """

    held: float = 0.0
    seek_nm: float = np.nan
    pedal_rate_ps: float = 0.0
    from_map: float = 0.0
    torque_nm: float = np.nan
    engine_radps2: float = 0.0


class Diesel(NamedTuple):
    """An engine with its control unit."""

    engine: Engine
    control: Control
    curves: Array


class Model(NamedTuple):
    """All that the equations need."""

    engine: Engine
    control: Control
    curves: Array
    car: Car
    drive: Drive
    ambient: Ambient
    gas: Gas
