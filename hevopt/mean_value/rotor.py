"""Inertia of a turbocharger that nobody gave: scaled with the fifth power of the compressor wheel's diameter.

    (25) J = J_ref (D / D_ref)^5

Similar rotors have masses as D³ and radii as D. Two rotors are known, and the two answers are the uncertainty:

    MHI TD04HL-15T, 56 mm           2.55e-5 kg m² (Westin 2002, as in the course files of Linköping University)
    12.7 l truck engine, 80 mm      2.0e-4 kg m² (J. Wahlström, L. Eriksson, Proc. IMechE D 225(7), 2011, 960-986)
"""

from math import sqrt

_KNOWN = ((56e-3, 2.55e-5), (80e-3, 2.0e-4))


def scaled_inertia_kgm2(wheel_diameter_m: float) -> tuple[float, float, float]:
    """The inertia of a wheel's size, the mean of the two answers by their ratio, and the two answers."""
    low, high = sorted(inertia * (wheel_diameter_m / size) ** 5 for size, inertia in _KNOWN)
    return sqrt(low * high), low, high
