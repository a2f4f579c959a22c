"""Figures of the small parallel hybrid that DynaProg's examples drive.

Source: ADVISOR 2003, National Renewable Energy Laboratory (FC_SI41, MC_AC75, ESS_PB25, VEH_SMCAR), as the example
`hev` of DynaProg gives them (F. Miretti, D. Misul, E. Spessa, SoftwareX 2021, doi 10.1016/j.softx.2021.100690).
All [S] but for GEARBOX_EFFICIENCY, [E]: the published one is a map of 6500 values of no stated licence.
"""

import numpy as np

# Engine: fuel per work over (speed, torque), full load; the inertia is an assumption of the source.
ENGINE_SPEED_RADPS = np.array((104.5, 149.2, 220.9, 292.5, 364.1, 435.7, 507.4, 552.2, 596.9))
ENGINE_TORQUE_NM = np.array((6.8, 13.6, 20.4, 27.2, 33.8, 40.6, 47.4, 54.2, 61, 67.8, 74.6, 81.4))
ENGINE_MOST_NM = np.array((61, 67.6, 73.7, 78.5, 80.9, 77.3, 76.2, 73.3, 68.7))
ENGINE_INERTIA_KGM2 = 0.1
# fmt: off
ENGINE_FUEL_GPKWH = np.array([
    (635.7, 635.7, 541.4, 447.2, 352.9, 332.2, 311.4, 322.4, 333.5, 333.5, 333.5, 333.5),
    (678.4, 500.1, 443.8, 387.4, 331.1, 301.8, 297, 283.4, 269.8, 358, 358, 358),
    (463.4, 463.4, 407.6, 350.1, 294.3, 280.8, 267.3, 253.9, 269.8, 303.2, 336.7, 336.7),
    (699.1, 567.9, 500.3, 432.7, 301.4, 283.9, 266.3, 248.7, 258.8, 268.8, 271.9, 317.9),
    (592.9, 592.9, 494.6, 393.4, 295.1, 279.4, 263.6, 247.9, 255.2, 262.5, 295, 322.6),
    (667.9, 524.8, 381.6, 351.9, 322.2, 304.9, 287.5, 270.8, 290.8, 310.9, 330.9, 330.9),
    (630.6, 630.6, 522.5, 411.1, 303, 304.4, 305.8, 304.2, 314.5, 324.8, 327.7, 327.7),
    (698.4, 500.5, 428.6, 392.7, 356.8, 337.9, 328.4, 319, 328.8, 338.6, 333.7, 333.7),
    (751.1, 637.8, 521.1, 407.8, 393.1, 378.4, 363.3, 348.2, 318.8, 340.2, 340.2, 340.2),
])
# Machine: efficiency over (speed, torque from 0), the same for a generator; torque in ft lbf in the source.
_DRIVING = np.array([
    (0.7, 0.7, 0.7, 0.7, 0.7, 0.7, 0.7, 0.7, 0.7, 0.7, 0.7),
    (0.7, 0.77, 0.81, 0.82, 0.82, 0.82, 0.81, 0.8, 0.79, 0.78, 0.78),
    (0.7, 0.82, 0.85, 0.86, 0.87, 0.88, 0.87, 0.86, 0.86, 0.86, 0.85),
    (0.7, 0.87, 0.89, 0.9, 0.9, 0.9, 0.9, 0.89, 0.88, 0.87, 0.86),
    (0.7, 0.88, 0.91, 0.91, 0.91, 0.9, 0.88, 0.87, 0.85, 0.82, 0.81),
    (0.7, 0.89, 0.91, 0.91, 0.9, 0.87, 0.85, 0.82, 0.82, 0.82, 0.82),
    (0.7, 0.9, 0.91, 0.9, 0.86, 0.82, 0.79, 0.78, 0.79, 0.79, 0.79),
    (0.7, 0.91, 0.91, 0.88, 0.8, 0.78, 0.78, 0.78, 0.78, 0.78, 0.78),
    (0.7, 0.92, 0.9, 0.8, 0.78, 0.78, 0.78, 0.78, 0.78, 0.78, 0.78),
    (0.7, 0.92, 0.88, 0.78, 0.78, 0.78, 0.78, 0.78, 0.78, 0.78, 0.78),
    (0.7, 0.92, 0.8, 0.78, 0.78, 0.78, 0.78, 0.78, 0.78, 0.78, 0.78),
])
# fmt: on
MACHINE_EFFICIENCY = np.concatenate([_DRIVING[:, :0:-1], _DRIVING], axis=1)
_NM_PER_FTLBF = 4.448 / 3.281
MACHINE_SPEED_RADPS = np.arange(0.0, 10_001.0, 1000.0) * 2 * np.pi / 60
MACHINE_TORQUE_NM = np.arange(-200.0, 201.0, 20.0) * _NM_PER_FTLBF
MACHINE_MOST_NM = (
    np.array([200, 200, 200, 175.2, 131.4, 105.1, 87.6, 75.1, 65.7, 58.4, 52.5]) * _NM_PER_FTLBF
)
MACHINE_RATIO = 1.74
INVERTER_EFFICIENCY = 0.95
AUXILIARIES_W = 700.0

GEAR_RATIOS = np.array([3.25, 1.81, 1.21, 0.86, 0.64]) * 4.06
GEARBOX_EFFICIENCY = 0.95  # [E]

# Battery: 25 modules, over state of charge 0 to 1.
MODULES = 25
CAPACITY_AS = 25.0 * 3600
COULOMBIC_EFFICIENCY = 0.9
MODULE_V = np.array((11.7, 11.85, 11.96, 12.11, 12.26, 12.37, 12.48, 12.59, 12.67, 12.78, 12.89))
DISCHARGE_OHM = np.array((40.7, 37, 33.8, 26.9, 19.3, 15.1, 13.1, 12.3, 11.7, 11.8, 12.2)) / 1e3
CHARGE_OHM = np.array((31.6, 29.8, 29.5, 28.7, 28, 26.9, 23.1, 25, 26.1, 28.8, 47.2)) / 1e3
SOC_WINDOW, SOC_START = (0.4, 0.7), 0.6

# Glider and load, machine, battery, gearbox, final drive; engine with fuel, 3.2 kg per kW.
_POUND = 1 / 2.205
_ENGINE_KG = 3.2e-3 * float(np.max(ENGINE_SPEED_RADPS * ENGINE_MOST_NM))
MASS_KG = 2325 * _POUND - 462 + 136 + 91 + 25 * 11 + (141 + 110) * _POUND + _ENGINE_KG
GRAVITY_MPS2 = 9.81
DRAG_NPM2S2 = 0.5 * 1.2 * 0.335 * 2.0
ROLLING = 0.009
WHEEL_RADIUS_M = 0.282
AXLE_LOSS_NM = float(np.interp(MASS_KG, [0.0, 2000.0], [1.6, 9.6]))
