"""What every key of architecture and component files means, and its unit; "" where it has none.

Model of a file or table -> key -> (unit, meaning). A test keeps it complete.
"""

from hevopt.car_files.gearbox_meanings import GEARBOX_MEANINGS
from hevopt.car_files.handling_meanings import HANDLING_MEANINGS
from hevopt.car_files.mean_value_meanings import MEAN_VALUE_MEANINGS

_NAME = ("", "name shown in tables and messages")
_CELLS_NAN = "rows are speeds, columns torques, nan where not measured"
_ONE_FACTOR = "the factor k; give only one of its names, speeds unchanged they are the same"

MEANINGS: dict[str, dict[str, tuple[str, str]]] = {
    "ArchitectureFile": {
        "name": _NAME,
        "description": ("", "one line about the architecture, shown in the list"),
        "car": ("", "car without powertrain"),
        "engine": ("", "combustion engine"),
        "source": ("", "source of electricity in its place, such as a fuel cell; kind series"),
        "gearbox": ("", "gearbox with final drive and shift speeds"),
        "machine": ("", "electric machine with its inverter"),
        "machine_2": ("", "another one"),
        "machine_3": ("", "a third one"),
        "battery": ("", "battery"),
        "hybrid_mass_kg": ("kg", "mass that the architecture adds to the car's"),
        "functions": ("", "what the hybrid may do; what is left out is forbidden to every strategy"),
        "gear": ("", 'who chooses the engine\'s gear: the cycle (or shift speeds), or "free": the strategy'),
        "rules": ("", "thresholds of the rules; what is left out is calibrated on the cycle"),
        "converter": ("", "DC converter between battery and bus; without it they are one"),
        "tyre": ("", "driven tyres, where the car is driven forward"),
        "clutch": ("", "the driver's clutch, where the car is driven forward"),
        "shifting": ("", "how a gear is changed, where the car is driven forward"),
        "driver": ("", "who is at the pedals, where the car is driven forward"),
        "coupling": ("", "how engine and machines join the wheels"),
    },
    "ConverterFile": {
        "efficiency": ("-", "share of what it takes in, from either side; one value or a list over power_w"),
        "power_w": ("W", "powers at the bus, of either sign, that efficiencies are given at"),
    },
    **HANDLING_MEANINGS,
    "RulesFile": {
        "electric_soc": ("-", "state of charge above which the car drives electrically"),
        "electric_power_w": ("W", "up to this power at the wheels; above it the engine is on"),
        "electric_speed_kmh": ("km/h", "and up to this speed"),
        "engine_on_power_w": ("W", "power_follower: asked power, at the wheels and of missing charge, that starts "
                              "the engine"),
        "engine_off_power_w": ("W", "and that below which it stops"),
        "charge_power_w": ("W", "power_follower: power asked for half a window of missing charge"),
        "reference_soc": ("-", "power_follower: state of charge at which none is missing"),
        "thermostat_on_soc": ("-", "thermostat: state of charge below which the engine starts to charge"),
        "thermostat_off_soc": ("-", "and at which it stops"),
    },
    "CouplingFile": {
        "kind": ("", "where the machine sits: none (alternator), belt (on the engine), crankshaft, gearbox "
                 "input, gearbox output, the even shaft of a dual clutch gearbox; or power_split (machine on the "
                 "sun, machine_2 on the ring, engine on the carrier), series (machine on the engine's shaft, "
                 "machine_2 drives), series_parallel (and a lock-up clutch), belt_and_axle (machine on the "
                 "engine, machine_2 on the other axle), electric (the machine alone, no engine); "
                 "or parts, listed one by one"),
        "second_clutch": ("", "a clutch between engine and machine, so that electric driving does not drag "
                          "the engine; kind gearbox_input only"),
        "machine_ratio": ("-", "machine speed over gearbox output speed; kind gearbox_output only"),
        "machine_efficiency": ("-", "efficiency of the machine's own gear; kind gearbox_output only"),
        "disconnects_above_speed_max": ("", "the machine is uncoupled above its highest speed instead of "
                                        "limiting the car; kind gearbox_output only"),
        "machine_shift_fuel_g": ("g", "fuel that a change of the machine's gear counts; kind even_shaft only"),
        "planetary_ratio": ("-", "teeth of the ring over teeth of the sun; kind power_split"),
        "planetary_efficiency": ("-", "efficiency of the rolling power; kind power_split"),
        "final_drive_ratio": ("-", "speed of machine_2 over that of the wheels; kinds power_split, series and "
                              "series_parallel"),
        "final_drive_efficiency": ("-", "efficiency of the final drive; the same kinds"),
        "lock_up_ratio": ("-", "speed of the engine over that of the wheels, lock-up clutch closed; kind "
                          "series_parallel"),
        "lock_up_efficiency": ("-", "efficiency of that gear; kind series_parallel"),
        "axle_ratio": ("-", "speed of machine_2 over that of its wheels; kind belt_and_axle"),
        "axle_efficiency": ("-", "efficiency of that axle; kind belt_and_axle"),
        "engine_shaft": ("", "name of the shaft that the engine turns; kind parts only"),
        "machine_shaft": ("", "name of the shaft of the machine; kind parts only"),
        "machine_2_shaft": ("", "the same of machine_2"),
        "machine_3_shaft": ("", "the same of machine_3"),
        "parts": ("", "what joins the shafts; a shaft is a name, and the wheels' is wheel; kind parts only"),
        "states": ("", "what the strategy may close together; left out: any of its clutches and brakes; kind "
                   "parts only"),
        "follows_load": ("", "the machine supplies the electric load and does nothing else; kind parts only"),
    },
    "PartFile": {
        "kind": ("", "gear (a pair of gears, a final drive, an axle), gearbox, clutch, one_way_clutch, planetary, "
                 "shaft_brake, torque_converter (with the curves of the architecture's gearbox)"),
        "name": ("", "name shown in messages"),
        "first": ("", "the shaft on its input side; of a shaft brake the one that it holds"),
        "second": ("", "the other shaft; a one_way_clutch without it keeps first from turning backwards"),
        "sun": ("", "shaft of the sun; planetary only"),
        "ring": ("", "shaft of the ring; planetary only"),
        "carrier": ("", "shaft of the carrier; planetary only"),
        "ratio": ("-", "speed of first over that of second; of a planetary set teeth of the ring over the sun's"),
        "ratios": ("-", "of a gearbox whose gear the strategy chooses, or neutral; without them it is the "
                   "architecture's gearbox, in the gear that the cycle lists"),
        "efficiency": ("-", "share of the power that it passes on; of a planetary set, of the rolling power; of a "
                       "gearbox with ratios also one per gear"),
        "speed_max_rpm": ("1/min", "speed of first above which a coupling of its own opens; gear only"),
        "gears": ("", "numbers of the architecture's gearbox that are in this one, as in a dual clutch gearbox; "
                  "gearbox without ratios only"),
        "preselected": ("", "the strategy chooses among gears until the cycle lists one of them"),
        "operation": ("", "whose a clutch is: driver's (slips at launches, open in neutral), or strategy's"),
        "shift_fuel_g": ("g", "fuel that a change of gear counts; gearbox with ratios, or preselected"),
    },
    "StateFile": {
        "closed": ("", "names of the strategy's clutches, brakes and one-way clutches that hold; others are open"),
        "engine": ("", "on or off; left out: both"),
    },
    "CarFile": {
        "name": _NAME,
        "mass_kg": ("kg", "mass as driven, without the parts that an architecture adds"),
        "tyre_radius_m": ("m", "rolling radius of the driven wheels"),
        "wheel_inertia_kgm2": ("kg m²", "moment of inertia of all wheels together"),
        "auxiliary_power_w": ("W", "electric load of the on-board network, constant; that of a cycle that lists "
                              "one, auxiliary_power_w, goes before"),
        "auxiliary_off_power_w": ("W", "the same while the engine is at rest; without it as while it turns"),
        "road_load": ("", "rolling and air resistance in parts, or coast-down coefficients"),
        "braking": ("", "how much of the braking a machine may take; without it all that it can"),
    },
    "BrakingFile": {
        "speed_kmh": ("km/h", "speeds of machine_share; beyond the ends its first and last hold"),
        "machine_share": ("-", "share of the wheels' braking that may pass the machine's axle, friction brakes "
                          "take the rest; falling to 0 at low speed, where regeneration fades out"),
        "axle": ("", "axle that the machine brakes; front: it uses no more adhesion than UN Regulation 13-H "
                 "grants, rear: no more than the front axle does"),
        "load_share": ("-", "share of the weight on that axle at rest"),
        "height_share": ("-", "height of the centre of mass over the wheelbase"),
    },
    "RoadLoadFile": {
        "rolling_c0": ("-", "rolling resistance over weight at standstill"),
        "rolling_c1_spm": ("s/m", "rise of rolling resistance over weight with speed"),
        "rolling_c2_s2pm2": ("s²/m²", "the same with the square of speed"),
        "rolling_c3_s3pm3": ("s³/m³", "the same with the cube of speed"),
        "drag_area_m2": ("m²", "drag coefficient times frontal area"),
        "air_density_kgpm3": ("kg/m³", "density of the air"),
        "coastdown_c0_n": ("N", "C0 of the coast-down force C0 + C1 v + C2 v²"),
        "coastdown_c1_nspm": ("N s/m", "C1 of the coast-down force"),
        "coastdown_c2_ns2pm2": ("N s²/m²", "C2 of the coast-down force"),
        "coastdown_mass_kg": ("kg", "mass of the car in the coast-downs: C0 is rolling resistance, in proportion "
                              "to the car's mass with hybrid parts; without it C0 is the same for every mass"),
    },
    "EngineFile": {
        "name": _NAME,
        "displacement_cm3": ("cm³", "swept volume of all cylinders"),
        "bore_mm": ("mm", "bore of a cylinder; for the record"),
        "stroke_mm": ("mm", "stroke; sets the mean piston speed of fuel_coefficients"),
        "idle_rpm": ("1/min", "idle speed, held by a slipping clutch when the car is slower"),
        "inertia_kgm2": ("kg m²", "moment of inertia of crankshaft, flywheel and clutch cover"),
        "start_fuel_g": ("g", "fuel burnt by one start beside spinning the engine up, which the battery pays for"),
        "least_on_s": ("s", "least time on, once started; no strategy and no bound stops it sooner"),
        "least_off_s": ("s", "least time off, once stopped"),
        "fuel": ("", "what is burnt"),
        "full_load": ("", "highest torque over speed; its ends are the lowest and highest engine speed"),
        "fuel_coefficients": ("", "fuel by p_me = (a + b cm + c cm²) p_mf + a2 p_mf² + l + l2 cm², brake and "
                              "fuel mean pressure in bar, mean piston speed cm in m/s; or fuel_map"),
        "fuel_map": ("", "measured fuel, NOx and motoring torque; or fuel_coefficients"),
        "nox_coefficients": ("", "NOx in mg per litre of displacement and working cycle: "
                             "m0 + BS p_me (n/2000)^0.19 / 36, n in 1/min, p_me in bar, brake-specific "
                             "BS = lo + (hi - lo) / (1 + exp(-(p_me - p0 - p1 (n/1000 - 2)) / dp)) in g/kWh"),
        "mean_value": ("", "the engine beyond its map, for turbo-lag: gas path, turbocharger, control unit"),
        "mass_kgpl": ("kg/l", "mass per displacement: what the car gains or loses where another size is asked for"),
        "price_pl": ("1/l", "price per displacement, in any currency that machine and battery share"),
        "scale": ("", "another size of the same engine by one factor k: at equal speed torque, power, fuel, NOx, "
                  "drag, displacement, inertia and the fuel of a start are k times as large; stroke, speeds and "
                  "mean pressures stay (Willans scaling)"),
    },
    "EngineScaleFile": {
        "displacement": ("-", _ONE_FACTOR),
        "torque": ("-", _ONE_FACTOR),
        "power": ("-", _ONE_FACTOR),
    },
    "SourceFile": {
        "name": _NAME,
        "power_kw": ("kW", "powers that it gives, from 0 up"),
        "fuel_gps": ("g/s", "fuel at each of them, its own needs included"),
        "start_fuel_g": ("g", "fuel of one start"),
        "least_on_s": ("s", "least time on, once started"),
        "least_off_s": ("s", "least time off, once stopped"),
        "fuel": ("", "what is burnt, such as hydrogen"),
    },
    "FuelFile": {
        "heating_value_mjpkg": ("MJ/kg", "lower heating value"),
        "density_kgpl": ("kg/l", "density"),
        "co2_kgpkg": ("kg/kg", "mass of CO2 per mass of fuel burnt"),
    },
    "FullLoadFile": {
        "speed_rpm": ("1/min", "speeds of the curve, increasing"),
        "torque_nm": ("Nm", "highest torque at each of them"),
    },
    "FuelCoefficientsFile": {
        "a": ("-", "share of fuel mean pressure that becomes work"),
        "b": ("s/m", "its change with piston speed"),
        "c": ("s²/m²", "its change with the square of piston speed"),
        "a2": ("1/bar", "its fall with fuel mean pressure"),
        "l": ("bar", "mean pressure of friction and pumping, negative"),
        "l2": ("bar s²/m²", "its change with the square of piston speed"),
    },
    "EngineGridFile": {
        "speed_rpm": ("1/min", "speeds of the rows, increasing"),
        "torque_nm": ("Nm", "torques of the columns, increasing"),
        "fuel_gps": ("g/s", f"fuel flow; {_CELLS_NAN}"),
        "nox_gps": ("g/s", f"NOx flow; {_CELLS_NAN}"),
        "motoring_torque_nm": ("Nm", "torque of the turning engine without fuel at each speed, negative"),
    },
    "NoxCoefficientsFile": {
        "m0": ("mg/l", "NOx without load, per litre and working cycle"),
        "lo": ("g/kWh", "brake-specific NOx at low load"),
        "hi": ("g/kWh", "brake-specific NOx at high load"),
        "p0": ("bar", "mean pressure half-way between the two, at 2000/min"),
        "p1": ("bar", "its change per 1000/min"),
        "dp": ("bar", "width of the rise"),
    },
    **GEARBOX_MEANINGS,
    "MachineFile": {
        "name": _NAME,
        "kind": ("", "the loss of machine and inverter is given by coefficients (loss), one efficiency, or a map"),
        "power_max_w": ("W", "highest mechanical power, either direction"),
        "torque_max_nm": ("Nm", "highest torque, either direction; without it only power limits"),
        "speed_max_rpm": ("1/min", "highest speed; without it none"),
        "full_load": ("", "largest torque over speed, either direction, beside these limits: its first holds down "
                      "to rest, beyond its last there is none"),
        "inertia_kgm2": ("kg m²", "moment of inertia of the rotor"),
        "spin_efficiency": ("-", "of what passes between the battery's store and a shaft that the machine speeds "
                            "up or slows at a start or a change of gear: machine, inverter and battery together"),
        "efficiency": ("-", "mechanical to electric and back; kind efficiency only"),
        "loss_c0_w": ("W", "c0 of loss = c0 + c1 w + c2 w² + c3 T², w in rad/s, T in Nm; kind loss only"),
        "loss_c1_ws": ("W s", "c1 of the loss"),
        "loss_c2_ws2": ("W s²", "c2 of the loss"),
        "loss_c3_wpnm2": ("W/(Nm)²", "c3 of the loss"),
        "loss_map": ("", "measured loss of machine and inverter; kind map only"),
        "mass_kgpkw": ("kg/kW", "mass with inverter per highest power: what the car gains or loses where another "
                       "size is asked for"),
        "price_pkw": ("1/kW", "price per highest power, in any currency that engine and battery share"),
        "scale": ("", "another size of the same machine by one factor k: at equal speed torque, power, loss and "
                  "inertia are k times as large, loss(k T) = k loss(T); speeds stay (active length)"),
    },
    "ScaleFile": {
        "torque": ("-", _ONE_FACTOR),
        "power": ("-", _ONE_FACTOR),
    },
    "LossMapFile": {
        "speed_rpm": ("1/min", "speeds of the rows, increasing"),
        "torque_nm": ("Nm", "torques of the columns, increasing, of both signs unless symmetric"),
        "loss_w": ("W", f"loss of machine and inverter; {_CELLS_NAN}"),
        "symmetric": ("", "torques from 0 up are listed, and the opposite torque loses the same"),
    },
    "BatteryFile": {
        "name": _NAME,
        "cells_in_series": ("-", "number of cells; all other figures are those of one"),
        "parallel": ("-", "number of such strings of cells in parallel"),
        "capacity_ah": ("Ah", "charge of a cell"),
        "open_circuit_v": ("V", "of a cell: { intercept, slope } over state of charge, or a list over curve_soc"),
        "resistance_ohm": ("Ω", "of a cell, either direction: one value, or a list over curve_soc"),
        "discharge_ohm": ("Ω", "of a cell while discharging: one value, or a list over curve_soc"),
        "charge_ohm": ("Ω", "of a cell while charging: one value, or a list over curve_soc"),
        "curve_soc": ("-", "states of charge of the lists, increasing"),
        "coulombic_efficiency": ("-", "share of the charging current that is stored"),
        "power_max_w": ("W", "highest power of a cell, either direction; without it voltage and current limit"),
        "current_max_a": ("A", "highest current, either direction"),
        "voltage_min_v": ("V", "lowest voltage of a cell at its terminals, while it discharges"),
        "voltage_max_v": ("V", "highest voltage of a cell at its terminals, while it charges; without it none"),
        "mass_kgpkwh": ("kg/kWh", "mass of the pack per energy from state of charge 0 to 1: what the car gains or "
                        "loses where another size is asked for"),
        "price_pkwh": ("1/kWh", "price per that energy, in any currency that engine and machine share"),
        "scale": ("", "another size of the same cells"),
        "soc": ("", "state of charge: start, window, end"),
    },
    "LinearVoltageFile": {
        "intercept": ("V", "open-circuit voltage of a cell at state of charge 0"),
        "slope": ("V", "its rise from there to state of charge 1"),
    },
    "BatteryScaleFile": {
        "capacity": ("-", "the factor k: capacity and limits of power and current are k times as large, resistance "
                     "is 1/k; voltage stays"),
    },
    "SocFile": {
        "start": ("-", "state of charge at the start"),
        "min": ("-", "lower end of the window"),
        "max": ("-", "upper end of the window"),
        "end": ("-", "least state of charge at the end; without it that of the start (charge neutral)"),
    },
    **MEAN_VALUE_MEANINGS,
}  # fmt: skip
