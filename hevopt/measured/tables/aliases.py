"""Names by which a column of time or speed is found on its own, without unit, in small letters and digits.

In groups, of which the first that names a column counts: what the car or the test bed has, then what a phone or a
satellite receiver adds to it.
"""

# Arrays of tools after ADVISOR, whose first column is time and whose second is speed.
_ARRAYS = ("cycmph", "cyckph", "cyckmh", "cycmps")
TIME = (
    (
        "time", "times", "t", "zeit", "timestamp", "zeitstempel", "elapsedtime", "elapsed", "testtime", "cyctime",
        "seconds", "secs", "sec", "cycsecs", "datetime", "uhrzeit", "clock", "runtime", "logtime", "temps", "heure",
        "tempo", "ora", "tiempo", "hora", "tijd", *(f"{name}1" for name in _ARRAYS),
    ),
    ("devicetime", "phonetime", "localtime"),
    ("gpstime", "timegps", "utctime", "timeutc", "utc"),
)  # fmt: skip
SPEED = (
    (
        "speed", "v", "velocity", "velocities", "vehiclespeed", "vehspeed", "vehspd", "vehiclevelocity",
        "targetspeed", "cyclespeed", "geschwindigkeit", "fahrzeuggeschwindigkeit", "fahrgeschwindigkeit", "vveh",
        "vist", "vitesse", "vitessevehicule", "vitessevéhicule", "velocita", "velocità", "velocidad", "velocidade",
        "snelheid", "cycmps", "mps", "mph", "kmh", "kph", "kmph", *(f"{name}2" for name in _ARRAYS),
    ),
    ("speedobd", "obdspeed", "vehiclespeedobd", "obdvelocities"),
    ("gpsspeed", "speedgps", "gpsvelocity", "groundspeed", "speedoverground", "gpsgeschwindigkeit"),
)  # fmt: skip
ALTITUDE = (
    "altitude", "alt", "elevation", "ele", "height", "hoehe", "höhe", "meereshöhe", "gpsaltitude", "altitudegps",
    "gpsheight", "quota", "altitudine", "altitud", "hoogte",
)  # fmt: skip
DATE = (
    "date",
    "datum",
    "data",
    "fecha",
    "dag",
    "jour",
    "giorno",
    "gpsdate",
    "utcdate",
    "dateutc",
    "localdate",
)
