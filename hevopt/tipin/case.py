"""One tip-in: what is varied, and the model that it makes of a car."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hevopt.car.transmission import Gearbox
from hevopt.errors import DataError
from hevopt.mean_value.parameters import EGR, SMOKE, Diesel, curve_of, with_curve

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Case:
    """A variation of a tip-in; None and 1 leave what the files say.

    smoke: least lambda of the smoke limit at every speed; turbo_inertia: factor of the rotor's
    final_drive, gear_ratio: ratios in place of the gearbox's, the second of the gear engaged
    egr: factor of the recirculation valve's opening; assist: the car's machine fills the torque that is missing
    """

    label: str
    smoke: float | None = None
    turbo_inertia: float = 1.0
    final_drive: float | None = None
    gear_ratio: float | None = None
    egr: float = 1.0
    assist: bool = False


BASE = Case("as shipped")
# Option -> least and most that a case takes, and what the option is called in a label.
_LIMITS = {
    "smoke": (0.8, 10.0, "smoke limit"),
    "turbo_inertia": (0.01, 100.0, "turbo inertia x"),
    "final_drive": (0.5, 20.0, "final drive"),
    "gear_ratio": (0.1, 20.0, "gear ratio"),
    "egr": (0.0, 2.0, "EGR x"),
}


def variation(name: str, value: float) -> Case:
    """The case in which one field is another; DataError for a value that is none."""
    low, high, word = _LIMITS[name]
    if not low <= value <= high:
        option = f"--{name.replace('_', '-')}"
        raise DataError(
            f"{option} {value:g}; allowed: {low:g} to {high:g}; give such values, separated by commas"
        )
    changed: Any = {name: value}
    return replace(BASE, label=f"{word} {value:g}", **changed)


def changes_of(case: Case, gearbox: Gearbox, gear: int) -> dict[str, Any]:
    """Keys of the car's files that a case replaces, and their values."""
    changes: dict[str, Any] = {}
    if case.final_drive is not None:
        changes["gearbox.final_drive_ratio"] = case.final_drive
    if case.gear_ratio is not None:
        ratios = [float(ratio) for ratio in gearbox.ratios[1:] / gearbox.ratios[0]]
        changes["gearbox.ratios"] = [*ratios[: gear - 1], case.gear_ratio, *ratios[gear:]]
    return changes


def varied(diesel: Diesel, case: Case) -> Diesel:
    """The engine of a case."""
    rotor, curves = diesel.engine.rotor, diesel.curves
    rotor = rotor._replace(inertia_kgm2=case.turbo_inertia * rotor.inertia_kgm2)
    if case.smoke is not None:
        curves = with_curve(curves, SMOKE, [0.0, 1.0], [case.smoke, case.smoke])
    if case.egr != 1.0:
        load, opening = curve_of(curves, EGR)
        curves = with_curve(curves, EGR, load, np.minimum(case.egr * opening, 1.0))
    return Diesel(diesel.engine._replace(rotor=rotor), diesel.control, curves)
