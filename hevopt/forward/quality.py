"""How well a trace was driven: the figures of SAE J2951 (January 2014), and where a tolerance was left.

At 10 Hz, speeds smoothed twice over five samples, at most 0.03 m/s counted as standstill, a by
central differences, of the driven (d) and the wanted (t) trace; sums over samples, dt the 0.1 s
between them:

    CE = Σ max(F_road + 1.015 m a, 0) v dt,   IW = Σ max(1.015 m a, 0) v dt,   D = Σ v dt,   ASC = Σ |a| dt
    ER = CE_d/CE_t - 1,   DR = D_d/D_t - 1,   EER = 1 - (1 + DR)/(1 + ER),   IWR and ASCR as ER

as the U.S. EPA's public data processors (REVS_SAEJ2951) work them out. A tolerance of speed and
time allows from the lowest wanted speed within the time before and after, less the speed, to the
highest and the speed more (40 CFR 600.109-08, there ±2 mph and ±1 s; ±2 km/h and ±1 s in UN R83).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hevopt.car.vehicle import Vehicle, tractive_force_n

Array = NDArray[np.float64]

SAMPLE_S = 0.1
_STANDSTILL_MPS = 0.03
_ROTATING = 1.015
_SMOOTHED = 5


@dataclass(frozen=True, slots=True)
class Violation:
    """One time outside the tolerance: where it begins, how long, and the farthest beyond the allowed speed."""

    start_s: float
    duration_s: float
    beyond_mps: float


@dataclass(frozen=True, slots=True)
class DriveQuality:
    """Per cent but for the last two; NaN where the wanted trace has nothing to compare with.

    energy, distance, energy_economy, speed_change, inertial_work: ER, DR, EER, ASCR, IWR of SAE J2951
    speed_error_mps: RMSSE; violations: of ±2 km/h and ±1 s
    """

    energy_percent: float
    distance_percent: float
    energy_economy_percent: float
    speed_change_percent: float
    inertial_work_percent: float
    speed_error_mps: float
    violations: tuple[Violation, ...]

    @property
    def outside_s(self) -> float:
        """Time outside the tolerance."""
        return sum(violation.duration_s for violation in self.violations)


@dataclass(frozen=True, slots=True, eq=False)
class _Trace:
    """Figures of one trace that two are compared by, J, m and m/s; speed_mps: (sample,)."""

    speed_mps: Array
    energy_j: float
    inertial_j: float
    distance_m: float
    speed_change_mps: float


def drive_quality(
    vehicle: Vehicle,
    time_s: Array,
    driven_mps: Array,
    wanted_mps: Array,
    *,
    tolerance_mps: float = 2 / 3.6,
    tolerance_s: float = 1.0,
) -> DriveQuality:
    """Figures of a driven trace beside the wanted one; all (time,), linear between the times."""
    at_s = np.arange(time_s[0], time_s[-1] + SAMPLE_S / 2, SAMPLE_S)
    driven, wanted = np.interp(at_s, time_s, driven_mps), np.interp(at_s, time_s, wanted_mps)
    is_, asked = _trace(vehicle, driven), _trace(vehicle, wanted)
    energy = _rating(is_.energy_j, asked.energy_j)
    distance = _rating(is_.distance_m, asked.distance_m)
    return DriveQuality(
        100 * energy,
        100 * distance,
        100 * (1 - (1 + distance) / (1 + energy)) if energy > -1 else float("nan"),
        100 * _rating(is_.speed_change_mps, asked.speed_change_mps),
        100 * _rating(is_.inertial_j, asked.inertial_j),
        float(np.sqrt(np.mean((is_.speed_mps - asked.speed_mps) ** 2))),
        violations(at_s, driven, wanted, tolerance_mps, tolerance_s),
    )


def violations(
    time_s: Array, driven_mps: Array, wanted_mps: Array, tolerance_mps: float, tolerance_s: float
) -> tuple[Violation, ...]:
    """Every time a trace lies outside its tolerance; all (time,), evenly spaced."""
    step_s = time_s[1] - time_s[0]
    reach = round(tolerance_s / step_s)
    around = np.pad(wanted_mps, reach, mode="edge")
    high = driven_mps - _highest(around, 2 * reach + 1) - tolerance_mps
    low = -_highest(-around, 2 * reach + 1) - tolerance_mps - driven_mps
    beyond = np.maximum(high, low)
    edges = np.diff(np.concatenate([[False], beyond > 0, [False]]).astype(np.int8))
    return tuple(
        Violation(
            float(time_s[begin]), float((end - begin) * step_s), float(beyond[begin:end].max())
        )
        for begin, end in zip(np.flatnonzero(edges == 1), np.flatnonzero(edges == -1), strict=True)
    )


def _highest(values: Array, count: int) -> Array:
    """The highest of each so many neighbours, found from the highest of half as many."""
    found, width = values, 1
    while width < count:
        moved = min(width, count - width)
        found, width = np.maximum(found[:-moved], found[moved:]), width + moved
    return found


def _trace(vehicle: Vehicle, speed_mps: Array) -> _Trace:
    speed = _smooth(_smooth(speed_mps))
    speed = np.where(speed <= _STANDSTILL_MPS, 0.0, speed)
    accel = np.zeros_like(speed)
    accel[1:-1] = (speed[2:] - speed[:-2]) / (2 * SAMPLE_S)
    level = np.zeros_like(speed)
    road_n = tractive_force_n(vehicle, speed, level, level)
    inertia_n = _ROTATING * vehicle.mass_kg * accel
    step_m = speed * SAMPLE_S
    return _Trace(
        speed,
        float(np.sum(np.maximum(road_n + inertia_n, 0) * step_m)),
        float(np.sum(np.maximum(inertia_n, 0) * step_m)),
        float(np.sum(step_m)),
        float(np.sum(np.abs(accel)) * SAMPLE_S),
    )


def _smooth(values: Array) -> Array:
    """The mean of five neighbours; towards the ends of as many as there are on both sides."""
    half = _SMOOTHED // 2
    smooth = values.copy()
    if len(values) < _SMOOTHED:
        return smooth
    total = np.zeros(len(values) - 2 * half)
    for first in range(_SMOOTHED):
        total += values[first : first + len(total)]
    smooth[half:-half] = total / _SMOOTHED
    smooth[1], smooth[-2] = values[:3].mean(), values[-3:].mean()
    return smooth


def _rating(driven: float, wanted: float) -> float:
    return driven / wanted - 1 if wanted > 0 else float("nan")
