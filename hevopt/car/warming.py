"""A cold engine on its way to warm: its coolant's temperature, and the fuel that it burns more for it.

One mass, engine and coolant, at a temperature T from a cold start on:

    C dT/dt = share (heating value x fuel - work) - conductance (T - ambient),  T no higher than the thermostat's
    fuel of the cold engine = fuel of the warm one x (1 + coefficient ((hot - T) / (hot - 20 deg C)) ^ exponent)

The extra fuel heats too; friction of a turning engine without fuel is negative work. What each figure is and where
it comes from stands with it; [S] is ADVISOR 2003, (c) Alliance for Sustainable Energy: its engine files, and for
the fuel factor its pages on the fuel converter and on cold-to-hot comparison of diesel engines. Its factor of
petrol engines is by J. Dill Murrell, 1996, of whole drives; that of diesel engines is fitted to maps that Oak Ridge
measured at 21 and 32 deg C on a VW 1.9 TDI and a Mercedes 1.7, whose points lie between 0.9 and 1.3.
"""

from typing import NamedTuple

import numpy as np

from hevopt.car.engine import Engine
from hevopt.errors import DataError
from hevopt.problem.arrays import Array

_REFERENCE_C = 20.0


class Warming(NamedTuple):
    """Figures of a warming engine.

    hot_c: temperature at which the thermostat opens and the maps hold [S: 95 +- 5 deg C]
    mass_kgpw: of engine and accessories over the power [S: 2.6 kg/kW]; heat_jpkgk: mean heat capacity [S: 500]
    coolant_share: of the heat of fuel that does no work, what does not leave by the exhaust [S: 0.60 to 0.70, SI]
    conductance_wpk: to the surroundings while it stands or drives [E: the order of the source's 10 W/K to the
    engine compartment]
    coefficient, exponent: of the fuel factor of petrol engines, 2 at 20 deg C and 1 where it is hot [S]
    """

    hot_c: float = 95.0
    mass_kgpw: float = 2.6e-3
    heat_jpkgk: float = 500.0
    coolant_share: float = 0.60
    conductance_wpk: float = 10.0
    coefficient: float = 1.0
    exponent: float = 3.1


PETROL = Warming()
# [S] of diesel engines: 1.1 at 20 deg C. The share of heat is taken from petrol engines [E].
DIESEL = Warming(coefficient=0.10, exponent=0.65)
# Petrol has at most 775 kg/m3 (EN 228), diesel 820 or more (EN 590).
_DIESEL_ABOVE_KGPM3 = 800.0
# Of the start: far below 20 deg C the factor is of no use.
START_C = (10.0, PETROL.hot_c)


def warming_of(engine: Engine) -> Warming:
    """The figures of an engine by its fuel, which its density tells."""
    return DIESEL if engine.fuel_density_kgpm3 > _DIESEL_ABOVE_KGPM3 else PETROL


def check_start(start_c: float) -> None:
    """DataError for a start that the fuel factor does not cover."""
    low, high = START_C
    if not low <= start_c <= high:  # nor NaN
        raise DataError(
            f"cold start at {start_c:g} deg C; allowed: {low:g} to {high:g}, where its fuel factor holds"
        )


def fuel_factor(coolant_c: float, of: Warming) -> float:
    """Fuel of the engine at a coolant temperature over that of the warm one, 1 or more."""
    cold = max(of.hot_c - coolant_c, 0.0) / (of.hot_c - _REFERENCE_C)
    return float(1.0 + of.coefficient * cold**of.exponent)


def warmed(
    engine: Engine, fuel_kg: Array, work_j: Array, step_s: Array, start_c: float
) -> tuple[Array, Array]:
    """(time + 1,) coolant temperature from a start at ambient temperature on, and (time,) fuel of the cold engine.

    fuel_kg, work_j: (time,) of the warm engine in each step; step_s: (time,)
    """
    check_start(start_c)
    of = warming_of(engine)
    power_w = float(np.max(engine.full_load_torque_nm * engine.full_load_speed_radps))
    heat_jpk = of.mass_kgpw * power_w * of.heat_jpkgk
    coolant_c, burnt_kg = np.empty(len(fuel_kg) + 1), np.empty(len(fuel_kg))
    coolant_c[0] = here = start_c
    for k in range(len(fuel_kg)):
        burnt_kg[k] = fuel_kg[k] * fuel_factor(here, of)
        waste_w = (engine.heating_value_jpkg * burnt_kg[k] - work_j[k]) / step_s[k]
        settled = start_c + of.coolant_share * waste_w / of.conductance_wpk
        fading = np.exp(-of.conductance_wpk * step_s[k] / heat_jpk)
        coolant_c[k + 1] = here = min(settled + (here - settled) * fading, of.hot_c)
    return coolant_c, burnt_kg
