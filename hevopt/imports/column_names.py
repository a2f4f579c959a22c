"""Names by which a column of time or speed is found on its own, without unit, in small letters and digits."""

# Arrays of tools after ADVISOR, whose first column is time and whose second is speed.
_ARRAYS = ("cycmph", "cyckph", "cyckmh", "cycmps")
TIME = (
    "time", "t", "zeit", "timestamp", "elapsedtime", "elapsed", "testtime", "cyctime", "seconds", "secs", "sec",
    "cycsecs", "datetime", "uhrzeit", "clock", *(f"{name}1" for name in _ARRAYS),
)  # fmt: skip
SPEED = (
    "speed", "v", "velocity", "vehiclespeed", "vehspeed", "vehspd", "vehiclevelocity", "targetspeed", "cyclespeed",
    "gpsspeed", "speedgps", "groundspeed", "geschwindigkeit", "fahrzeuggeschwindigkeit", "vveh", "vist", "cycmps",
    "mps", "mph", "kmh", "kph", "kmph", *(f"{name}2" for name in _ARRAYS),
)  # fmt: skip
