"""What a measured car burns beyond its bound, in parts that have a name and a rest that has none."""

from typing import NamedTuple

from hevopt.reproduction.validation.cases import Held

# By SAE J1711 a hybrid's test counts where the battery's change is worth up to so much of the fuel.
CHARGE_PERCENT = 1.0


class ExcessParts(NamedTuple):
    """Parts of what the laboratory has above the bound, l/100 km; they add up to it.

    cold: of the cold start by its bags, None where a label tells the fuel only
    air_conditioning: it is off in all three tests
    load: of another published electric load, where that is higher than the file's
    charge: tests are balanced by rule, within `CHARGE_PERCENT`; no figure is given
    control: what the best causal strategy burns beyond the bound
    rest: what none of them explains; below 0 where the model burns more than the car
    """

    excess: float
    cold: float | None
    air_conditioning: float
    load: float
    charge: float
    control: float
    rest: float


def parts_of(held: Held) -> ExcessParts:
    """The parts of a car and cycle."""
    laboratory = held.laboratory
    excess = laboratory.fuel_l_per_100km - held.bound_l_per_100km
    cold, load = laboratory.cold_l_per_100km, max(held.load_l_per_100km, 0.0)
    control = held.causal_l_per_100km - held.bound_l_per_100km
    rest = excess - (cold or 0.0) - load - control
    return ExcessParts(excess, cold, 0.0, load, 0.0, control, rest)


def below_bound(held: Held) -> bool:
    """Whether the warm car burnt less than the bound, as no strategy of the model can: a fault of data or model."""
    warm = held.laboratory.warm_l_per_100km
    return warm is not None and warm < held.bound_l_per_100km
