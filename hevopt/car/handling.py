"""What shows only in a car that somebody drives: tyres, clutch and the change of gear. Equations of the study.

Figures of a common compact car with a manual gearbox. Sources: the study names the forms of (2),
(4) and (17), friction of 0.8 to 0.9 and lags of some tenths of a second; relaxation lengths of 0.04
to above 0.3 m are published, mostly lateral; half a second to a second is a common manual change,
above 0.625 s a slow one; a dry clutch's torque hardly depends on its slip (Myklebust and Eriksson,
VPPC 2012). What no source gives is an estimate [E].
"""

from math import atan, pi
from typing import NamedTuple

from hevopt.errors import DataError
from hevopt.units import STANDARD_GRAVITY_MPS2


class Tyre(NamedTuple):
    """The driven tyres, front wheels driven.

    lag_s: of the force behind the torque, equation (2); 0 for none [E: relaxation length 0.3 m at 10 m/s]
    friction: highest force over wheel load, equation (4)
    driven_share: of the weight on the driven axle at rest [E]; height_share: height of the centre of mass over the
    wheelbase [E]
    slips: the force comes by slip, in place of the lag
    stiffness, shape, curvature: B, C, E of Pacejka's magic formula, a set for dry tarmac that is often shown, of no
    measured tyre [E]; its peak is the friction
    relaxation_m: travel in which slip builds up [E; 0.04 to above 0.3 m are published, mostly lateral]
    """

    lag_s: float = 0.03
    friction: float = 0.85
    driven_share: float = 0.60
    height_share: float = 0.20
    slips: bool = False
    stiffness: float = 10.0
    shape: float = 1.9
    curvature: float = 0.97
    relaxation_m: float = 0.25

    @property
    def grip_mps2(self) -> float:
        """Highest acceleration that the driven axle holds on a level road, the load moved by it included."""
        held = self.friction * self.driven_share * STANDARD_GRAVITY_MPS2
        return held / (1 + self.friction * self.height_share)

    @property
    def peaks(self) -> bool:
        """Whether the magic formula has its peak at a slip of no more than 1."""
        bent = self.stiffness - self.curvature * (self.stiffness - atan(self.stiffness))
        return self.shape * atan(bent) >= pi / 2


class Clutch(NamedTuple):
    """A friction clutch, equations (16) and (17), for a slip s and a closing u from 0 to 1:

        T = u sign(s) [slipping - (slipping - sticking) exp(-|s| / scale)]

    slipping_nm, sticking_nm: highest torque at high slip s and at none [E: 1.45 x the engine's 290 Nm]
    slip_scale_radps [E]; closing_s: from open to fully closed after a change [E]
    """

    slipping_nm: float = 420.0
    sticking_nm: float = 380.0
    slip_scale_radps: float = 20.0
    closing_s: float = 0.15


class Shifting(NamedTuple):
    """How a gear is changed.

    gap_s: without traction; 0 for a dual clutch gearbox, whose ratio moves under load
    ratio_lag_s: first-order lag of the ratio, "some tenths of a second" to settle
    between_s: least time from one change to the next, and reversal_s to one that takes it back (VECTO: 2 s, 10 s)
    """

    gap_s: float = 0.5
    ratio_lag_s: float = 0.1
    between_s: float = 2.0
    reversal_s: float = 10.0


class DriverGains(NamedTuple):
    """A PID on the speed with feed-forward of acceleration and resistance; gains count per mass of the car.

    F = feed_forward [m_eq a + F_res(v)] of the trace + m (proportional e + derivative de/dt + ∫ integral e dt)

    preview_s: how far ahead it looks; hold_mps: below it a car that shall stand is held
    governor_s: time constant of an engine that keeps idle speed or is brought to the next gear's
    start_s: from rest to idle speed by the starter; stop_s: from idle speed to rest
    charge_per_s: gain by which a plan's stored energy is kept, as power per energy amiss
    """

    proportional: float = 1.2
    integral: float = 0.3
    derivative: float = 0.0
    feed_forward: float = 1.0
    preview_s: float = 0.0
    hold_mps: float = 0.15
    governor_s: float = 0.15
    start_s: float = 0.4
    stop_s: float = 0.3
    charge_per_s: float = 0.2


class Handling(NamedTuple):
    """Tyres, clutch, gear changes and driver of a car; shifting None: with the gap of its gearbox's file."""

    tyre: Tyre = Tyre()
    clutch: Clutch = Clutch()
    shifting: Shifting | None = None
    driver: DriverGains = DriverGains()

    def check(self) -> None:
        """DataError for a figure of tyres, clutch or gear changes that is out of range."""
        for part in (self.tyre, self.clutch, self.shifting):
            if part is not None:
                check_ranges(part)
        if self.tyre.slips and not self.tyre.peaks:
            raise DataError(
                f"tyre: with stiffness {self.tyre.stiffness:g}, shape {self.tyre.shape:g} and curvature "
                f"{self.tyre.curvature:g} the force has no peak up to a slip of 1; raise shape or stiffness, "
                "or lower curvature"
            )


# Of tyres, clutch and gear changes, in a car's file as in the loops: lowest and highest.
RANGES = {
    "lag_s": (0.0, 1.0),
    "friction": (0.05, 2.0),
    "driven_share": (0.05, 1.0),
    "height_share": (0.0, 1.0),
    "slips": (0.0, 1.0),
    "stiffness": (0.1, 100.0),
    "shape": (0.5, 3.0),
    "curvature": (-20.0, 1.0),
    "relaxation_m": (0.01, 5.0),
    "slipping_nm": (1.0, 1e5),
    "sticking_nm": (1.0, 1e5),
    "slip_scale_radps": (1e-3, 1e4),
    "closing_s": (0.0, 5.0),
    "gap_s": (0.0, 5.0),
    "ratio_lag_s": (0.0, 2.0),
    "between_s": (0.0, 60.0),
    "reversal_s": (0.0, 600.0),
}


def check_ranges(part: Tyre | Clutch | Shifting) -> None:
    """DataError for a figure that no car has."""
    for name, value in part._asdict().items():
        low, high = RANGES[name]
        if not low <= value <= high:  # nor NaN
            raise DataError(
                f"{type(part).__name__.lower()}: {name} {value:g}; allowed: {low:g} to {high:g}"
            )
