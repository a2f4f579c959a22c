"""What goes in, comes out or stays, of a run: mass, burnt mass, energy of the gas, work of the rotor.

Each residual is relative to what went through. Runge-Kutta keeps linear invariants to rounding whatever its step:
mass, burnt mass and energy test the equations. The rotor's energy is quadratic: its residual tests the step.
"""

from dataclasses import dataclass

from hevopt.mean_value import states as s
from hevopt.mean_value.run import Run


@dataclass(frozen=True, slots=True)
class Balance:
    """What came through, what stayed more than before, and what is left over, relative to what came through."""

    name: str
    unit: str
    through: float
    stored: float
    residual: float


def balances(run: Run) -> list[Balance]:
    """The four balances of a run."""
    first, last = run.states[0], run.states[-1]
    change = last - first
    mass = change[0:15:3].sum()
    burnt = change[1:15:3].sum()
    energy = change[2:15:3].sum()
    rotor = run.model.engine.rotor.inertia_kgm2 / 2 * (last[s.TURBO] ** 2 - first[s.TURBO] ** 2)
    exchanged = (
        change[s.ENTHALPY_IN] - change[s.ENTHALPY_OUT] + change[s.RELEASED] - change[s.PISTON_WORK]
        - change[s.CYLINDER_HEAT] - change[s.INTERCOOLER_HEAT] - change[s.EGR_HEAT] - change[s.MANIFOLD_HEAT]
        - change[s.TURBINE_WORK] + change[s.COMPRESSOR_WORK]
    )  # fmt: skip
    turning = change[s.TURBINE_WORK] - change[s.COMPRESSOR_WORK] - change[s.BEARING_WORK]
    came = change[s.AIR_IN] + change[s.FUEL]
    through = change[s.RELEASED] + change[s.ENTHALPY_IN]
    return [
        _balance("mass", "kg", came, mass, came - change[s.EXHAUST_OUT]),
        _balance("burnt mass", "kg", came, burnt, change[s.BURNT_MADE] - change[s.BURNT_OUT]),
        _balance("energy of the gas", "J", through, energy, exchanged),
        _balance("work of the rotor", "J", change[s.TURBINE_WORK], rotor, turning),
    ]


def _balance(name: str, unit: str, through: float, stored: float, exchanged: float) -> Balance:
    return Balance(name, unit, through, stored, (stored - exchanged) / max(abs(through), 1e-12))
