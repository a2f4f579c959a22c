"""The one unit table: used where a file is read or a report is written, nowhere else.

A data key carries its unit as a suffix. SI inside; a file may use the field's customary unit.
"""

from dataclasses import dataclass
from math import pi

# suffix in files -> (suffix inside, factor to SI)
TO_SI: dict[str, tuple[str, float]] = {
    "_rpm": ("_radps", 2 * pi / 60),
    "_kmh": ("_mps", 1 / 3.6),
    "_mph": ("_mps", 0.44704),
    "_cm3": ("_m3", 1e-6),
    "_mm": ("_m", 1e-3),
    "_g": ("_kg", 1e-3),
    "_mjpkg": ("_jpkg", 1e6),
    "_kgpl": ("_kgpm3", 1e3),
    "_ah": ("_as", 3600.0),
    "_kw": ("_w", 1e3),
    "_gps": ("_kgps", 1e-3),
    "_percent": ("", 0.01),
}

RPM_PER_RADPS = 60 / (2 * pi)
KMH_PER_MPS = 3.6
STANDARD_GRAVITY_MPS2 = 9.80665


def litres_per_100km(mass_kg: float, density_kgpm3: float, distance_m: float) -> float:
    """Fuel volume over distance."""
    return mass_kg / density_kgpm3 * 1e3 / (distance_m / 1e5)


@dataclass(frozen=True, slots=True)
class Unit:
    """A unit of a measured file: the quantity it measures and its factor to SI."""

    symbol: str
    quantity: str
    si: float


# quantity -> spellings, the first being the symbol -> factor to SI; spaces, dots and ^ are left out of a spelling
_SPELLINGS: dict[str, dict[str, float]] = {
    "time": {
        "s sec secs second seconds": 1.0,
        "ms msec millisecond milliseconds": 1e-3,
        "µs us μs microsecond microseconds": 1e-6,
        "ns nanosecond nanoseconds": 1e-9,
        "min minute minutes": 60.0,
        "h hr hour hours": 3600.0,
        "day days": 86400.0,
    },
    "speed": {
        "m/s mps m/sec ms-1 meter/s metre/s meters/s metres/s meter/second metre/second meters/second "
        "metres/second meters/sec meterpersecond metrepersecond meterspersecond metrespersecond": 1.0,
        "km/h kmh kph kmph km/hr km/hrs kmh-1 km/hour kmhr kmperhour kilometer/hour kilometre/hour "
        "kilometers/hour kilometres/hour kilometerperhour kilometreperhour kilometersperhour "
        "kilometresperhour": 1 / 3.6,
        "mph mi/h mile/h miles/h mi/hr mile/hour miles/hour miles/hr mileperhour milesperhour": 0.44704,
        "kn kt kts knot knots": 1852 / 3600,
        "ft/s ft/sec fts-1": 0.3048,
    },
    "rotation": {
        "rad/s radps rads rad/sec rads-1": 1.0,
        "rpm 1/min min-1 r/min rev/min u/min": 2 * pi / 60,
        "rev/s rps r/s": 2 * pi,
    },
    "torque": {
        "Nm N-m newtonmeter newtonmetre": 1.0,
        "kNm": 1e3,
        "lb-ft lbft ft-lb ftlb lbf-ft lbfft ft-lbf ftlbf": 1.3558179483314004,
        "kgfm kgf-m": 9.80665,
    },
    "pressure": {
        "Pa": 1.0,
        "kPa": 1e3,
        "hPa mbar": 1e2,
        "MPa": 1e6,
        "bar": 1e5,
        "psi lbf/in2": 6894.757293168361,
    },
    "power": {
        "W watt watts": 1.0,
        "kW kilowatt": 1e3,
        "MW": 1e6,
        "hp bhp": 745.6998715822702,
        "PS": 735.49875,
    },
    "mass flow": {
        "kg/s kgps kgs-1": 1.0,
        "g/s g/sec gs-1": 1e-3,
        "mg/s mgps mgs-1": 1e-6,
        "kg/h kgph kg/hr kgh-1": 1 / 3600,
        "g/h gph g/hr gh-1": 1e-3 / 3600,
        "mg/h mgph": 1e-6 / 3600,
        "lb/h lbs/h lb/hr lbs/hr": 0.45359237 / 3600,
        "kg/min": 1 / 60,
        "lb/min lbs/min": 0.45359237 / 60,
    },
    # Of turbochargers: flow sqrt(T) / p and speed / sqrt(T).
    "reduced flow": {
        "kg/s√K/Pa": 1.0,
        "kg/s√K/kPa kg√K/s/kPa kg√K/skPa kg√K/(skPa) kg/ssqrt(K)/kPa kgsqrt(K)/(skPa) kg/sK05/kPa": 1e-3,
        "kg/s√K/bar kg√K/s/bar kg√K/sbar kg√K/(sbar) kg/ssqrt(K)/bar kgsqrt(K)/(sbar) kg/sK05/bar": 1e-5,
        "kg/s√K/MPa kg√K/s/MPa kg√K/sMPa kg√K/(sMPa) kg/ssqrt(K)/MPa kgsqrt(K)/(sMPa) kg/sK05/MPa": 1e-6,
    },
    "reduced speed": {
        "rad/s/√K": 1.0,
        "rpm/√K 1/min/√K min-1/√K rpm/sqrt(K) rpmK-05 rpm/K05": 2 * pi / 60,
    },
    "volume flow": {
        "m3/s": 1.0,
        "l/h lph l/hr lh-1 liter/h litre/h": 1e-3 / 3600,
        "l/s": 1e-3,
        "ml/s": 1e-6,
    },
    "specific consumption": {
        "kg/J": 1.0,
        "g/kWh gpkwh gkwh-1": 1e-3 / 3.6e6,
        "mg/kWh mgpkwh": 1e-6 / 3.6e6,
        "kg/kWh kgpkwh": 1 / 3.6e6,
        "g/MJ": 1e-9,
        "lb/hph lb/hphr lb/hp-h lb/hp-hr": 0.45359237 / (745.6998715822702 * 3600),
    },
    "current": {"A ampere amperes amp amps": 1.0, "mA": 1e-3, "kA": 1e3},
    "voltage": {"V volt volts": 1.0, "mV": 1e-3, "kV": 1e3},
    "charge": {"As": 1.0, "Ah": 3600.0, "mAh": 3.6},
    "resistance": {"ohm ohms Ω": 1.0, "mohm mohms mΩ milliohm": 1e-3, "µohm µΩ μohm μΩ": 1e-6},
    # Of one offset each, which is not a factor: whoever reads one asks which of both it is.
    "celsius": {"°C degC celsius": 1.0},
    "kelvin": {"K kelvin": 1.0},
    "energy": {"J": 1.0, "kJ": 1e3, "MJ": 1e6, "Wh": 3600.0, "kWh": 3.6e6},
    "fraction": {
        "fraction - 1 ratio m/m rise/run": 1.0,
        "% percent pct": 1e-2,
        "‰ permille": 1e-3,
    },
    "angle": {"rad radian radians": 1.0, "deg ° degree degrees": pi / 180},
    "length": {
        "m meter meters metre metres": 1.0,
        "km kilometer kilometre": 1e3,
        "mm": 1e-3,
        "cm": 1e-2,
        "ft feet foot": 0.3048,
        "mi mile miles": 1609.344,
    },
    "mass": {"kg": 1.0, "g": 1e-3, "mg": 1e-6, "t": 1e3, "lb lbs": 0.45359237},
    "volume": {"m3": 1.0, "l liter litre dm3": 1e-3, "cm3 cc ccm": 1e-6},
    "force": {"N newton newtons": 1.0, "kN": 1e3, "lbf": 4.4482216152605},
    "acceleration": {"m/s2": 1.0},
}
# Where the case of letters alone tells a mega from a milli.
_CASE_MATTERS = ("MW", "MJ", "g/MJ")
_LEFT_OUT = str.maketrans(
    {" ": None, ".": None, "^": None, "·": None, "⋅": None, "*": None, "×": None, "_": None}
    | {"−": "-", "–": "-", "⁻": "-", "¹": "1", "²": "2", "³": "3"}
)


def units_of(quantity: str) -> list[str]:
    """Symbols of the units in which a file may give a quantity."""
    return [spellings.split()[0] for spellings in _SPELLINGS[quantity]]


def unit_named(text: str) -> Unit | None:
    """The unit with a spelling such as `km/h`, `kmh`, `min^-1` or `N·m`; None where none has it."""
    spelling = text.translate(_LEFT_OUT)
    return _EXACT.get(spelling) or _ANY_CASE.get(spelling.lower())


def _tables() -> tuple[dict[str, Unit], dict[str, Unit | None]]:
    exact: dict[str, Unit] = {}
    any_case: dict[str, Unit | None] = {}
    for quantity, spelled in _SPELLINGS.items():
        for spellings, si in spelled.items():
            unit = Unit(spellings.split()[0], quantity, si)
            for spelling in spellings.split():
                exact[spelling] = unit
                lowered = None if unit.symbol in _CASE_MATTERS else unit
                taken = any_case.get(spelling.lower(), lowered)
                any_case[spelling.lower()] = lowered if taken == lowered else None
    return exact, any_case


_EXACT, _ANY_CASE = _tables()
