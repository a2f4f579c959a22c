"""Compiled laws of the road, the tyre and the clutch: equations (2), (4) to (10), (16) and (17)."""

from typing import NamedTuple

import numpy as np

from hevopt._compile import compiled
from hevopt.car.handling import Clutch, Tyre
from hevopt.units import STANDARD_GRAVITY_MPS2


class Body(NamedTuple):
    """The car without its driveline; rolling_n and air_n: force as polynomial of speed, equations (6) to (8)."""

    mass_kg: float
    equivalent_kg: float
    radius_m: float
    rolling_n: tuple[float, float, float, float]
    air_n: tuple[float, float, float, float]
    tyre: Tyre
    clutch: Clutch


class Pace(NamedTuple):
    """The length of a step, and the shares of a lag (2) in it: of the state after it and in its mean."""

    step_s: float
    decay: float
    of_force: float


@compiled(bare=True)
def clutch_capacity_nm(slip_radps: float, clutch: Clutch) -> float:
    """Highest torque of the closed clutch at a slip of either sign, equation (17)."""
    stuck = (clutch.slipping_nm - clutch.sticking_nm) * np.exp(
        -abs(slip_radps) / clutch.slip_scale_radps
    )
    return clutch.slipping_nm - stuck


@compiled(bare=True)
def pace_of(step_s: float, lag_s: float) -> Pace:
    """Shares of a first-order lag under constant input: exact, whatever the step."""
    if lag_s <= 0.0:
        return Pace(step_s, 0.0, 0.0)
    decay = np.exp(-step_s / lag_s)
    return Pace(step_s, decay, (1.0 - decay) * lag_s / step_s)


@compiled(bare=True)
def pacejka_share(slip: float, tyre: Tyre) -> float:
    """Longitudinal force over load and friction at a slip, Pacejka's magic formula."""
    stretched = tyre.stiffness * slip
    bent = stretched - tyre.curvature * (stretched - np.arctan(stretched))
    return np.sin(tyre.shape * np.arctan(bent))


@compiled(bare=True)
def pacejka_slope(slip: float, tyre: Tyre) -> float:
    """Its derivative by slip."""
    stretched = tyre.stiffness * slip
    bent = stretched - tyre.curvature * (stretched - np.arctan(stretched))
    rises = tyre.stiffness * (1.0 - tyre.curvature * stretched**2 / (1.0 + stretched**2))
    return float(tyre.shape * np.cos(tyre.shape * np.arctan(bent)) / (1.0 + bent**2) * rises)


@compiled(inline="always")
def wheel_radps(speed_mps: float, spin_radps: float, body: Body) -> float:
    """Speed of the driven wheels."""
    return speed_mps / body.radius_m + spin_radps


@compiled(bare=True)
def resistance(speed: float, slope_rad: float, body: Body) -> tuple[float, float, float]:
    """Rolling and air resistance, its derivative by speed, and the weight's share along the road."""
    r, a, cos, sin = body.rolling_n, body.air_n, 1.0, 0.0
    if slope_rad != 0.0:
        cos, sin = np.cos(slope_rad), np.sin(slope_rad)
    c0, c1, c2, c3 = r[0] * cos + a[0], r[1] * cos + a[1], r[2] * cos + a[2], r[3] * cos + a[3]
    passive = c0 + speed * (c1 + speed * (c2 + speed * c3))
    slope = c1 + speed * (2.0 * c2 + speed * 3.0 * c3)
    return passive, slope, body.mass_kg * STANDARD_GRAVITY_MPS2 * sin


@compiled(bare=True)
def grip_n(against_n: float, slope_rad: float, body: Body) -> float:
    """Highest driving force (4) with the load that acceleration and slope move off the front axle."""
    tyre, weight = body.tyre, body.mass_kg * STANDARD_GRAVITY_MPS2
    moved = tyre.height_share * body.mass_kg / body.equivalent_kg
    level = weight * tyre.driven_share
    if slope_rad != 0.0:
        level = level * np.cos(slope_rad) - weight * tyre.height_share * np.sin(slope_rad)
    return max(tyre.friction * (level + moved * against_n) / (1.0 + tyre.friction * moved), 0.0)
