"""What the keys of an engine's `mean_value` part mean, and their units; see meanings.py.

Equation numbers are those of the docstrings in hevopt/mean_value/.
"""

_LOSS = "pressure loss H = density x loss / (mass flow)²"
_MAP = "flow number mass flow / (density, disc area, rim speed)"

MEAN_VALUE_MEANINGS: dict[str, dict[str, tuple[str, str]]] = {
    "MeanValueFile": {
        "compression_ratio": ("-", "volume of a cylinder at the bottom over that at the top"),
        "volumes": ("", "content of the five volumes of the gas path"),
        "restrictions": ("", "pressure losses of filter, intercooler and exhaust"),
        "intercooler": ("", "cooler between compressor and intake manifold"),
        "compressor": ("", "compact compressor map, equations (8) to (11)"),
        "turbine": ("", "compact turbine map, equations (21) and (22)"),
        "rotor": ("", "shaft of the turbocharger"),
        "cylinders": ("", "filling, combustion, friction and wall heat, equations (13) to (19)"),
        "recirculation": ("", "exhaust recirculation: valve and cooler, equation (20)"),
        "exhaust_wall": ("", "heat of the exhaust manifold, equation (24)"),
        "control": ("", "control unit, equations (26) to (30)"),
    },
    "VolumesFile": {
        "intake_system_l": ("l", "from the filter to the compressor"),
        "charge_pipe_l": ("l", "from the compressor to the intercooler"),
        "intake_manifold_l": ("l", "from the intercooler and the recirculation to the cylinders"),
        "exhaust_manifold_l": ("l", "from the cylinders to the turbine and the recirculation"),
        "exhaust_system_l": ("l", "from the turbine to the open"),
    },
    "RestrictionsFile": {
        "filter_pm4": ("1/m⁴", f"air filter and its pipe; {_LOSS}"),
        "intercooler_pm4": ("1/m⁴", f"intercooler and pipes; {_LOSS}"),
        "exhaust_pm4": ("1/m⁴", f"catalyst, filter and silencers; {_LOSS}"),
        "linear_below_pa": ("Pa", "pressure difference below which flow grows linearly; less of it makes the "
                            "equations stiffer"),
    },
    "CoolerFile": {
        "effectiveness": ("-", "share of the way down to the coolant's temperature"),
        "coolant_k": ("K", "temperature of what cools"),
    },
    "CompressorFile": {
        "wheel_diameter_mm": ("mm", "outer diameter of the compressor's wheel"),
        "head_max": ("-", "isentropic work over the square of rim speed at no flow above surge, Psi_max"),
        "head_exponent": ("-", "N of Psi = Psi_max (1 - x^N)"),
        "surge_flow": ("-", f"{_MAP} at surge, at no speed"),
        "surge_flow_per_mach": ("-", "its rise with rim speed over the speed of sound"),
        "choke_flow": ("-", f"{_MAP} where no pressure is left, at no speed"),
        "choke_flow_fall_per_mach": ("-", "its fall with rim speed over the speed of sound"),
        "work": ("-", "shaft work over the square of rim speed at no flow, L0"),
        "work_fall_with_flow": ("-", "its fall with the flow number, L1"),
        "disc_friction": ("-", "power of disc friction over density, disc area and the cube of rim speed"),
    },
    "TurbineFile": {
        "wheel_diameter_mm": ("mm", "outer diameter of the turbine's wheel"),
        "area_cm2": ("cm²", "effective area A with open vanes"),
        "flow_exponent": ("-", "K of the flow A p / sqrt(R T) sqrt(1 - Pi^K)"),
        "efficiency_max": ("-", "highest efficiency, bearing apart"),
        "blade_speed_ratio": ("-", "rim speed over spouting speed where it is reached"),
    },
    "RotorFile": {
        "inertia_kgm2": ("kg m²", "moment of inertia of wheels and shaft; without it scaled with the fifth power "
                         "of the compressor's diameter from known ones"),
        "bearing_nms": ("N m s", "friction torque of the bearing over speed"),
    },
    "CylindersFile": {
        "filling_max": ("-", "highest volumetric efficiency, at equal pressures before and behind"),
        "filling_fall": ("-", "its fall with the square of (n / filling_speed_rpm - 1)"),
        "filling_speed_rpm": ("1/min", "speed of the highest"),
        "stoichiometric_air": ("kg/kg", "mass of air that burns one of fuel"),
        "efficiency": ("-", "indicated efficiency with much air at the best mean piston speed"),
        "efficiency_best_mps": ("m/s", "that mean piston speed"),
        "efficiency_width_mps": ("m/s", "how far from there its parabola is at 0; 1e6: as high at all speeds"),
        "rich_loss": ("-", "share of it lost at lambda 1"),
        "rich_width": ("-", "lambda over which that share falls by e"),
        "friction_bar": ("bar", "friction mean pressure at rest"),
        "friction_bar_s2pm2": ("bar s²/m²", "its rise with the square of mean piston speed"),
        "gas_exchange_bar": ("bar", "mean pressure lost in the valves at 2000/min, as the square of speed"),
        "wall_share": ("-", "share of the fuel's heat to the cylinders' walls at high speed"),
        "wall_share_1000rpm": ("-", "what comes on top at 1000/min, falling with speed"),
    },
    "RecirculationFile": {
        "area_mm2": ("mm²", "area of the open valve; 0: no recirculation"),
        "least_pressure_ratio": ("-", "pressure ratio below which the flow grows no more"),
        "effectiveness": ("-", "of its cooler, share of the way down to the coolant's temperature"),
        "coolant_k": ("K", "temperature of what cools"),
    },
    "WallFile": {
        "gas_wpk": ("W/K", "heat flow from gas to wall per difference of temperature"),
        "capacity_jpk": ("J/K", "heat capacity of the wall"),
        "ambient_wpk": ("W/K", "heat flow from wall to the air around per difference of temperature"),
    },
    "ControlFile": {
        "pumping_bar": ("bar", "mean pressure of gas exchange that the control unit assumes"),
        "pumping_bar_1000rpm": ("bar", "what comes on top at 1000/min, rising with the square of speed"),
        "efficiency_fall": ("-", "factor of cylinders.efficiency that the control unit assumes at no load"),
        "efficiency_fall_with_load": ("-", "its fall up to full load"),
        "smoke_limit_from": ("", "whether the smoke limit sees the air in the cylinders, by pressure and speed "
                             "(speed_density), or the flow at the filter (air_meter)"),
        "smoke_rpm": ("1/min", "speeds of smoke_lambda, increasing"),
        "smoke_lambda": ("-", "least air over that which the fuel needs"),
        "meter_lag_s": ("s", "time constant of the air meter"),
        "lambda_rpm": ("1/min", "speeds of lambda_full_load, increasing"),
        "lambda_full_load": ("-", "air ratio that sets the boost of full load"),
        "lambda_load": ("-", "loads of lambda_part_load, increasing, below 1"),
        "lambda_part_load": ("-", "air ratio that sets the boost of part load"),
        "charge_k": ("K", "temperature of the charge that the control unit assumes"),
        "vanes_rpm": ("1/min", "speeds of vanes, increasing"),
        "vanes": ("-", "opening of the turbine's vanes at full load, share of area_cm2"),
        "vanes_growth": ("-", "share by which they open more at no load"),
        "vanes_least": ("-", "least opening"),
        "vanes_lag_s": ("s", "time constant of the vanes' actuator"),
        "boost_gain_pbar": ("1/bar", "proportional gain from missing boost to vane opening"),
        "boost_integral_pbars": ("1/(bar s)", "integral gain"),
        "boost_from_load": ("-", "load above which boost is controlled"),
        "exhaust_pressure_max_bar": ("bar", "pressure before the turbine above which the vanes open"),
        "exhaust_temperature_max_k": ("K", "temperature before the turbine above which fuel is taken away"),
        "egr_load": ("-", "loads of egr_opening, increasing"),
        "egr_opening": ("-", "opening of the recirculation valve"),
        "egr_fades_rpm": ("1/min", "speed above which the valve closes"),
        "egr_closed_rpm": ("1/min", "speed at which it is closed"),
        "egr_lag_s": ("s", "time constant of the valve's actuator"),
    },
}  # fmt: skip
