"""What the keys of tyres, clutch, gear changes and driver mean; see meanings.py."""

HANDLING_MEANINGS: dict[str, dict[str, tuple[str, str]]] = {
    "TyreFile": {
        "lag_s": ("s", "lag of the force behind the torque; 0 for none; 0.03 where left out"),
        "friction": ("-", "highest force over wheel load; 0.85 where left out"),
        "driven_share": (
            "-",
            "share of the weight on the driven axle at rest; 0.60 where left out",
        ),
        "height_share": (
            "-",
            "height of the centre of mass over the wheelbase; 0.20 where left out",
        ),
        "law": (
            "",
            "lag: a force behind its torque on wheels that roll; pacejka: by their slip; lag where left out",
        ),
        "stiffness": ("-", "B of the magic formula, of law pacejka; 10 where left out"),
        "shape": ("-", "C of the magic formula; 1.9 where left out"),
        "curvature": ("-", "E of the magic formula; 0.97 where left out"),
        "relaxation_m": ("m", "travel in which slip builds up; 0.25 where left out"),
    },
    "ClutchFile": {
        "slipping_nm": ("Nm", "highest torque at high slip; 420 where left out"),
        "sticking_nm": ("Nm", "highest torque without slip; 380 where left out"),
        "slip_scale_radps": ("rad/s", "slip over which one becomes the other; 20 where left out"),
        "closing_s": ("s", "from open to closed after a change; 0.15 where left out"),
    },
    "ShiftingFile": {
        "gap_s": ("s", "time without traction; that of the gearbox's file where left out"),
        "ratio_lag_s": ("s", "first-order lag of the ratio; 0.1 where left out"),
        "between_s": ("s", "least time from one change to the next; 2 where left out"),
        "reversal_s": (
            "s",
            "least time to a change that takes the last one back; 10 where left out",
        ),
    },
    "DriverFile": {
        "proportional": ("1/s", "force per mass and error of speed; 1.2 where left out"),
        "integral": ("1/s²", "the same of its integral; 0.3 where left out"),
        "derivative": ("-", "the same of its rate; 0 where left out"),
        "feed_forward": (
            "-",
            "share of the trace's own force that the foot knows; 1 where left out",
        ),
        "preview_s": ("s", "how far ahead the driver looks; 0 where left out"),
        "hold_mps": ("m/s", "below it a car that shall stand is held; 0.15 where left out"),
        "governor_s": (
            "s",
            "time constant of idle speed and of an engine brought to the next gear's; 0.15 where "
            "left out",
        ),
        "start_s": ("s", "from rest to idle speed by the starter; 0.4 where left out"),
        "stop_s": ("s", "from idle speed to rest; 0.3 where left out"),
        "charge_per_s": (
            "1/s",
            "power per energy amiss by which a plan's charge is kept; 0.2 where left out",
        ),
    },
}
