"""The range in which the shipped tip-in was expected before it was built, and whether it is in there.

Of the 1.3 l car at 40 km/h in IV: its own parameters by another program, a regression range and no validation. The
study's figures carry no numbers; "up to twice" at the start is all that its text says.
"""

from collections.abc import Mapping
from typing import NamedTuple

from hevopt.car_files.load import load_architecture
from hevopt.tipin.case import variation
from hevopt.tipin.drive import Manoeuvre, tip_in
from hevopt.tipin.figures import TIMES_S, Figures
from hevopt.units import KMH_PER_MPS


class Band(NamedTuple):
    """A figure's expected range, and what it is."""

    what: str
    low: float
    high: float
    value: float

    @property
    def holds(self) -> bool:
        """Whether it is in there."""
        return self.low <= self.value <= self.high


CAR, SPEED_KMH, GEAR = "compact_1300", 40.0, 4
BASE, HEAVY, RICH, LEAN = "base", "heavy", "rich", "lean"
CASES = {
    HEAVY: variation("turbo_inertia", 2.0),
    RICH: variation("smoke", 1.1),
    LEAN: variation("smoke", 1.4),
}


def bands_of(manoeuvre: Manoeuvre, base: Figures) -> list[Band]:
    """The bands of a manoeuvre, its other cases driven; none where it is not the one that they are known for."""
    shipped = load_architecture(CAR)
    alike = manoeuvre.architecture.contents == shipped.contents and manoeuvre.gear == GEAR
    if not alike or abs(manoeuvre.speed_mps * KMH_PER_MPS - SPEED_KMH) > 1e-6:
        return []
    others = {name: tip_in(manoeuvre, case).figures for name, case in CASES.items()}
    return bands({BASE: base, **others})


def bands(found: Mapping[str, Figures]) -> list[Band]:
    """The bands of the base case and of CASES, driven. found: name -> figures"""
    base = found[BASE]
    at_1_s = TIMES_S.index(1.0)
    ratio = dict(zip(TIMES_S, base.ratio, strict=True))
    boost = base.boost_90_s or float("inf")
    heavy = found[HEAVY].boost_90_s or float("inf")
    rich, lean = (found[name].accel_mps2[at_1_s] for name in (RICH, LEAN))
    return [
        Band("steady map over mean value at 0.3 s", 1.8, 2.3, ratio[0.3]),
        Band("the same at 0.5 s", 1.5, 1.9, ratio[0.5]),
        Band("the same at 1 s", 1.25, 1.55, ratio[1.0]),
        Band("the same at 3 s", 1.03, 1.15, ratio[3.0]),
        Band("90 % of boost, s", 1.8, 2.6, boost),
        Band(
            "twice the turbocharger's inertia: 90 % of boost later by a factor",
            1.5,
            1.9,
            heavy / boost,
        ),
        Band(
            "smoke limit 1.1 to 1.4: loss of acceleration at 1 s, %",
            20,
            30,
            100 * (1 - lean / rich),
        ),
    ]
