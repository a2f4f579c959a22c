"""Places of the states in a vector: five volumes with mass, burnt mass and internal energy each, then the rest.

What the balances need is integrated beside the states, by the same steps, and feeds back on nothing.
"""

TURBO, WALL, VANES, EGR, METER, BOOST, PEDAL, ENGINE, ROAD, TYRE = range(15, 25)
DYNAMIC = 25

(
    AIR_IN, EXHAUST_OUT, FUEL, BURNT_MADE, BURNT_OUT, ENTHALPY_IN, ENTHALPY_OUT, RELEASED, PISTON_WORK,
    CYLINDER_HEAT, INTERCOOLER_HEAT, EGR_HEAT, MANIFOLD_HEAT, TURBINE_WORK, COMPRESSOR_WORK, BEARING_WORK,
    ASSIST_WORK,
) = range(DYNAMIC, 42)  # fmt: skip
SIZE = 42

NAMES = (
    *(f"{what} {n}" for n in range(1, 6) for what in ("mass", "burnt mass", "energy")),
    "turbocharger speed", "wall temperature", "vanes", "recirculation valve", "air meter", "boost integral",
    "pedal", "engine speed", "road speed", "tyre force",
)  # fmt: skip

# What `observe` tells beside the states.
SIGNALS = (
    "accel_mps2", "pedal", "torque_nm", "full_load_nm", "clutch_nm", "assist_nm",
    "p1_pa", "p2_pa", "p3_pa", "p4_pa", "p5_pa",
    "t2_k", "t3_k", "t4_k", "t5_k",
    "burnt_3", "target_pa", "excess_air", "demanded_kg", "allowed_kg",
    "air_kgps", "egr_kgps", "into_cylinders_kgps", "fuel_kgps", "vanes_asked", "egr_asked",
    "compressor_kgps", "flow_number", "surge_number", "choke_number", "head_share",
    "compressor_w", "turbine_w", "turbine_efficiency",
    "t1_k",
)  # fmt: skip
SIGNAL_COUNT = len(SIGNALS)
