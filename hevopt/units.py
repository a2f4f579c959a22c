"""The one unit table: used where a file is read or a report is written, nowhere else.

A data key carries its unit as a suffix. SI inside; a file may use the field's customary unit.
"""

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
