"""What every key of a gearbox's file means, and its unit."""

GEARBOX_MEANINGS: dict[str, dict[str, tuple[str, str]]] = {
    "GearboxFile": {
        "name": ("", "name shown in tables and messages"),
        "ratios": ("-", "input speed over output speed of each gear, first gear first, falling"),
        "final_drive_ratio": ("-", "gearbox output speed over wheel speed"),
        "efficiency": (
            "-",
            "of gearbox and final drive together: one for all gears, or one per gear",
        ),
        "loss_map": (
            "",
            "in place of efficiency: one table per gear, in their order, of what gearbox and final "
            "drive lose; what lies outside is rejected",
        ),
        "shift_gap_s": (
            "s",
            "time without torque at a change of gear that cycle or shift speeds list; 0: "
            "the gearbox changes under load",
        ),
        "shift_speeds": ("", "when the driver changes gear, on cycles that list none"),
        "free_gear": ("", "limits of a gear that the strategy chooses"),
        "torque_converter": ("", "in the place of the driver's clutch: an automatic gearbox"),
    },
    "TorqueConverterFile": {
        "speed_ratio": ("-", "speed of the turbine over that of the impeller, rising from 0"),
        "torque_ratio": ("-", "torque of the turbine over that of the impeller, over speed_ratio"),
        "impeller_speed_rpm": ("1/min", "speed of the impeller that its torques are given at"),
        "impeller_torque_nm": (
            "Nm",
            "torque that the impeller takes there, over speed_ratio; it grows with the "
            "square of its speed, and is 0 at the last ratio",
        ),
        "lock_up_speed_rpm": (
            "1/min",
            "speed of the turbine from which it is locked; left out: never",
        ),
        "lock_up_gear_min": ("-", "the lowest gear in which it is locked"),
        "at_rest": (
            "",
            "what the gearbox does at standstill: a gear stays engaged (in_gear), and the engine idles "
            "against the resting turbine, or neutral",
        ),
    },
    "GearLossFile": {
        "speed_rpm": (
            "1/min",
            "input speeds, rising; below the first the loss is that of the first",
        ),
        "torque_nm": ("Nm", "input torques, rising, below 0 in overrun"),
        "loss_nm": (
            "Nm",
            "torque lost, referred to the input, a row per speed; nan where not measured",
        ),
    },
    "ShiftSpeedsFile": {
        "up_kmh": ("km/h", "speed above which each gear but the last is left for the next"),
        "down_kmh": ("km/h", "speed below which the next is left again, each below its up_kmh"),
        "engage_before_launch_s": ("s", "how long first gear is engaged before moving off"),
    },
    "FreeGearFile": {
        "shift_fuel_g": ("g", "fuel that a change of gear counts"),
        "engine_speed_min_rpm": ("1/min", "lowest engine speed above first gear"),
    },
}
