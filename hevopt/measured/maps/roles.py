"""What the columns of a measured map may be called, and what each may measure."""

# role -> names without units that mean it, small letters and digits
ALIASES = {
    "speed": {
        "speed", "n", "enginespeed", "machinespeed", "motorspeed", "rotationalspeed", "rpm", "omega", "w", "neng",
        "nengine", "nmot", "engspeed", "speedengine", "shaftspeed", "radps", "rads", "drehzahl", "fcmapspd",
        "mcmapspd", "gcmapspd",
    },
    "torque": {
        "torque", "t", "m", "md", "tq", "trq", "enginetorque", "machinetorque", "motortorque", "braketorque",
        "shafttorque", "engtorque", "nm", "load", "bmep", "pme", "mep", "brakemeaneffectivepressure",
        "meaneffectivepressure", "drehmoment", "fcmaptrq", "mcmaptrq", "gcmaptrq",
    },
    "fuel": {
        "fuel", "fuelflow", "fuelrate", "fuelmassflow", "fuelconsumption", "fc", "mfuel", "mdotfuel", "fuelmass",
        "consumption", "fuelconsumptionrate", "verbrauch", "fcfuelmap",
    },
    "specific": {
        "bsfc", "sfc", "be", "specificfuelconsumption", "brakespecificfuelconsumption", "specificconsumption",
    },
    "efficiency": {
        "efficiency", "eta", "eff", "brakethermalefficiency", "brakeefficiency", "bte", "mceffmap", "gceffmap",
    },
    "nox": {"nox", "noxflow", "noxrate", "noxmassflow", "bsnox", "specificnox", "mnox", "noxemissions", "fcnoxmap"},
    "loss": {"loss", "losses", "powerloss", "losspower", "ploss", "totalloss", "totallosses"},
    "electric": {"electricpower", "electricalpower", "pel", "pelec", "pelectric", "inverterpower", "dcpower"},
    "full": {
        "fullload", "fullloadtorque", "maxtorque", "torquemax", "maximumtorque", "tfull", "fcmaxtrq", "mcmaxtrq",
        "gcmaxtrq",
    },
    "motoring": {
        "motoring", "motoringtorque", "drag", "dragtorque", "frictiontorque", "tdrag", "motoringcurve", "fccttrq",
    },
}  # fmt: skip
QUANTITIES = {
    "speed": ("rotation",),
    "torque": ("torque", "pressure", "power"),
    "fuel": ("mass flow", "specific consumption", "volume flow"),
    "specific": ("specific consumption",),
    "efficiency": ("fraction",),
    "nox": ("mass flow", "specific consumption"),
    "loss": ("power",),
    "electric": ("power",),
    "full": ("torque", "pressure", "power"),
    "motoring": ("torque", "pressure", "power"),
}
# What a column of shaft power is called, read as its torque where no column holds that.
POWERS = {
    "torque": {
        "power", "pe", "brakepower", "enginepower", "machinepower", "motorpower", "shaftpower",
        "mechanicalpower",
    },
    "full": {"fullloadpower", "maxpower", "powermax", "maximumpower"},
    "motoring": {"motoringpower", "dragpower", "frictionpower"},
}  # fmt: skip
ROLES = tuple(ALIASES)
VALUES_OF = {
    "fuel": ("fuel", "specific", "efficiency"),
    "nox": ("nox",),
    "loss": ("loss", "electric", "efficiency"),
}
