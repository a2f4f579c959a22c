"""Figures of the hybrid that the public learning benchmark DRL-Base-EMS drives, and of its step.

Source: github.com/LittleWebCat/DRL-Base-EMS, revision 0ca3c36 (MIT licence), which runs line 11 of its vehicle
table, "2016 TOYOTA Highlander Hybrid", in a step after FASTSim (National Renewable Energy Laboratory). All [S].
Efficiencies are FASTSim's
curves as they stand there; the engine is declared an Atkinson one there, but burns by the curve of a spark-ignition
engine, and so it does here.
"""

import numpy as np

# Car.
_PARTS_KG = 114 + (2.0 * 8 + 75) + (21.6 + 0.833 * 123) + (172 / 2.13 + 61) + 574 / 9.89
MASS_KG = 136 + 1527.574 + 1.4 * _PARTS_KG
AIR_KGPM3, GRAVITY_MPS2 = 1.2, 9.81
DRAG_AREA_M2 = 0.39 * 3.33
ROLLING = 0.007
WHEELS, WHEEL_INERTIA_KGM2, WHEEL_RADIUS_M = 4, 0.815, 0.336
TRANSMISSION_EFFICIENCY = 0.95
AUXILIARIES_KW = 0.5
MPH_PER_MPS = 2.2369

# Engine: efficiency over the share of most power, straight lines between; kg by its own way from energy to fuel.
ENGINE_MOST_KW, ENGINE_RAMP_S, ENGINE_LEAST_ON_S = 172.0, 6.0, 30.0
ENGINE_SHARE = np.array((0, 0.005, 0.015, 0.04, 0.06, 0.10, 0.14, 0.20, 0.40, 0.60, 0.80, 1.00))
ENGINE_EFFICIENCY = np.array(
    (0.10, 0.12, 0.16, 0.22, 0.28, 0.33, 0.35, 0.36, 0.35, 0.34, 0.32, 0.30)
)
KWH_PER_GALLON, KG_PER_GALLON, MILE_M = 33.7, 2.567, 1609.0

# Machine: between a large and a small one's curve, by power, then held from each hundredth to the next.
MACHINE_MOST_KW = 123.0
_MACHINE_SHARE = np.array((0.00, 0.02, 0.04, 0.06, 0.08, 0.10, 0.20, 0.40, 0.60, 0.80, 1.00))
_LARGE = np.array((0.83, 0.85, 0.87, 0.89, 0.90, 0.91, 0.93, 0.94, 0.94, 0.93, 0.92)) + (
    0.95 - 0.94
)
# Above 75 kW the large curve counts alone.
_HUNDREDTHS = np.linspace(0.0, 1.0, 101)
MACHINE_EFFICIENCY = np.interp(_HUNDREDTHS, _MACHINE_SHARE, _LARGE)
MACHINE_EFFICIENCY[0] = MACHINE_EFFICIENCY[1]
MACHINE_OUT_KW = _HUNDREDTHS * MACHINE_MOST_KW
MACHINE_IN_KW = MACHINE_OUT_KW / MACHINE_EFFICIENCY

# Battery: one efficiency there and back, none of its voltage.
BATTERY_KWH, BATTERY_MOST_KW, ROUND_TRIP = 2.0, 37.0, 0.97
SOC_LEAST, SOC_MOST, SOC_START = 0.4, 0.8, 0.6

# What its control takes: regeneration over speed, and charge kept for braking and for pulling away.
REGEN_MOST, REGEN_A, REGEN_B = 0.98, 500.0, 0.99
MACHINE_PEAK = 0.95
ELECTRIC_BELOW_MPH = 1.0
PULL_AWAY_MPH, PULL_AWAY_SHARE = 60.0, 0.2
# Its agent: so many actions over twice what braking may charge; ignored at and below a charge.
ACTIONS = 2000
LOCK_SOC = 0.6
# What its paper's abstract quotes for the best agent, % of fuel.
BELOW_RULES_PERCENT, BELOW_ECMS_PERCENT = 10.26, 5.34
