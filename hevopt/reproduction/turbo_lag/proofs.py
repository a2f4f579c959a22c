"""Steady full load, balances, integrators and regression bands on the page."""

import numpy as np
from numpy.typing import NDArray

from hevopt.mean_value.balances import balances
from hevopt.reproduction.turbo_lag.cases import FOURTH, SMALL, TurboLag
from hevopt.reproduction.turbo_lag.sections import NAMES
from hevopt.reproduction.verdicts import markdown
from hevopt.tipin.drive import TipIn
from hevopt.units import RPM_PER_RADPS

_FROM_RPM, _TO_RPM = 1000, 4500
_TORQUE_PERCENT, _FUEL_PERCENT = 4, 6


def full_load(found: TurboLag) -> str:
    """What full pedal settles to beside file and map."""
    rows, beyond = [], []
    for car, (curve, engine) in found.full_load.items():
        torque, speed = curve["torque_nm"], curve.speed_radps
        off = 100 * (torque / curve["full_load_nm"] - 1)
        fuel = 100 * (curve["fuel_kgps"] / engine.fuel_kgps(torque, speed) - 1)
        rpm = np.round(speed * RPM_PER_RADPS)
        inside, above = (rpm >= _FROM_RPM) & (rpm <= _TO_RPM), rpm > _TO_RPM
        holds = f"{_within(off[inside], _TORQUE_PERCENT)}, {_within(fuel[inside], _FUEL_PERCENT)}"
        rows.append([NAMES[car], _span(off[inside]), _span(fuel[inside]), holds])
        beyond.append(f"{NAMES[car]}: torque {_span(off[above])} %, fuel {_span(fuel[above])} %")
    heads = [
        "engine", "torque off the file's, %", "fuel off the map's, %",
        f"within {_TORQUE_PERCENT} % and {_FUEL_PERCENT} %",
    ]  # fmt: skip
    return (
        f"## 6. Steady full load\n\nWhat full pedal settles to from {_FROM_RPM} to {_TO_RPM} rpm, beside the "
        "file's curve, and its fuel beside the map's at equal torque.\n\n" + markdown(heads, "lrrl", rows)
        + f"\n\nThe curves' last point, above {_TO_RPM} rpm, is apart ({'; '.join(beyond)}): half of the highest "
        "torque there, where the control unit reckons with gas exchange and combustion of high boost, which is "
        "not there; torque is above the file's by what that is wrong, as far as the exhaust is not too hot. No "
        "tip-in of sections 1 to 5 goes there."
    )  # fmt: skip


def _span(values: NDArray[np.float64]) -> str:
    low, high = f"{values.min():+.1f}", f"{values.max():+.1f}"
    return low if low == high else f"{low} to {high}"


def _within(values: NDArray[np.float64], limit: float) -> str:
    return "yes" if np.abs(values).max() <= limit else "**no**"


def proofs(found: TurboLag) -> str:
    """Balances of all runs, the two integrators, and the bands."""
    rest = max(abs(b.residual) for one in _driven(found) for b in balances(one.run))
    integrators = [
        [f"{NAMES[car]}, {pedal.text}", _below(off)] for (car, pedal), off in found.lsoda.items()
    ]
    bands = [
        [b.what, f"{b.low:g}", f"{b.high:g}", f"{b.value:.2f}", "yes" if b.holds else "**no**"]
        for b in found.bands
    ]
    return (
        "## 7. Proofs\n\nMass, burnt mass, energy of the gas and work of the rotor: what went in, came out or "
        f"stayed, in every run of this page, leaves a rest {_below(rest)} of what went through. Runge-Kutta's "
        "fixed step of 0.25 ms beside LSODA, which chooses its own:\n\n"
        + markdown(["tip-in", "largest difference of acceleration, m/s²"], "lr", integrators)
        + f"\n\nWhere the tip-in of {NAMES[SMALL]} at {FOURTH.text} was expected before it was built, by another "
        "program with the same parameters: a regression range, no validation.\n\n"
        + markdown(["figure", "from", "to", "here", "within"], "lrrrl", bands)
    )  # fmt: skip


def _driven(found: TurboLag) -> list[TipIn]:
    several = (found.shipped, found.smoke, found.inertia, found.gears, found.otherwise)
    both = [one for filled in found.filled for one in (filled.alone, filled.helped)]
    return [*(one for of in several for one in of.values()), found.second, *both]


def _below(value: float) -> str:
    """The power of ten above: what another machine's rounding leaves as it is."""
    return "of 0" if value == 0 else f"below 1e{int(np.floor(np.log10(value))) + 1}"
