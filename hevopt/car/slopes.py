"""Slopes of the laws by torque, from either side, where what they burn and lose is convex in it.

At a given speed w, with load = p_me - l - l2 cm² and D = (a + b cm + c cm²)² + 4 a2 load (engine_laws.py)
    d fuel / dT = w / (H sqrt(D)),   0 below the drag torque:
rising with torque where a2 <= 0 and D > 0 up to the highest torque, so that fuel is convex and rises. A measured
map need not be convex, and none is shown to be.
Specific NOx times p_me, with s the logistic function of z = (p_me - p0 - p1 (...)) / dp, s' = s (1 - s), z0 = z
at p_me = 0, bends by  (hi - lo) / dp x [2 s' - (z - z0) s' (2 s - 1)]  per bar², which may be below 0. On
z1 <= z <= z2 the last product is at most (z2 - z0) times the greatest s' (2 s - 1), a hump with its top at
z = ln(2 + sqrt(3)), and s' at least the lesser of its values at the ends, so that its fall is bounded (`nox_bend`).
It rises with load.
Losses by coefficients have the slope 2 c3 T, rising where c3 >= 0; at rest they are lower at T = 0 alone, where a
line through the lower value stays below. One efficiency has one slope for either direction of power.
"""

from math import log, pi, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hevopt.car.engine import Engine
from hevopt.car.engine_laws import PA_PER_BAR, CompactLaw, NoxCoefficients
from hevopt.car.machine import Machine
from hevopt.car.machine_laws import LossByCoefficients, LossByEfficiency

Array = NDArray[np.float64]
# Load in bar below which fuel counts as cut; see CompactLaw.fuel_kgps.
_CUT_BAR = 1e-9
_HUMP = log(2 + sqrt(3))


class Slopes(NamedTuple):
    """Derivatives by torque on the side of lower and of higher torques; arrays that broadcast to the torques'."""

    left: Array
    right: Array


def fuel_slopes(engine: Engine, torque_nm: Array, speed_radps: Array) -> Slopes | None:
    """Of the fuel flow, in kg/s per Nm; None where it is not shown to be convex up to these torques."""
    law = engine.law
    if not isinstance(law, CompactLaw) or law.fuel.a2 > 0:
        return None
    k, cm = law.fuel, law.piston_speed_mps(speed_radps)
    load = law.mean_pressure_bar(torque_nm) - k.l - k.l2 * cm**2
    slope = k.a + k.b * cm + k.c * cm**2
    squared = slope**2 + 4 * k.a2 * np.maximum(load, 0.0)
    if not ((slope > 0) & (squared > 0)).all():
        return None
    rise = speed_radps / (law.heating_value_jpkg * np.sqrt(squared))
    return Slopes(np.where(load >= _CUT_BAR, rise, 0.0), np.where(load > -_CUT_BAR, rise, 0.0))


def cut_nm(engine: Engine) -> float:
    """Torque by which the engine may miss its drag torque and still count as cut."""
    law = engine.law
    assert isinstance(law, CompactLaw)  # asked for where fuel has slopes
    return _CUT_BAR / float(law.mean_pressure_bar(np.ones(1))[0])


def nox_slopes(engine: Engine, torque_nm: Array, speed_radps: Array) -> Slopes | None:
    """Of the NOx flow of a fuelled engine, in kg/s per Nm; None where it is not shown to rise."""
    k, law = _nox_of(engine), engine.law
    if k is None or not isinstance(law, CompactLaw):
        return None
    p_me = law.mean_pressure_bar(torque_nm)
    part = _logistic((np.maximum(p_me, 0.0) - _offset_bar(k, speed_radps)) / k.dp)
    specific = k.lo + (k.hi - k.lo) * (part + np.maximum(p_me, 0.0) / k.dp * part * (1 - part))
    rise = specific * _kgps_per_nm(law, speed_radps)
    return Slopes(np.where(p_me > 0, rise, 0.0), np.where(p_me >= 0, rise, 0.0))


def nox_bend(engine: Engine, low_nm: Array, high_nm: Array, speed_radps: Array) -> Array:
    """By how much at most the slope of `nox_slopes` falls per Nm between two torques, >= 0."""
    k, law = _nox_of(engine), engine.law
    assert k is not None and isinstance(law, CompactLaw)  # asked for where NOx has slopes
    ends = [np.maximum(law.mean_pressure_bar(torque), 0.0) for torque in (low_nm, high_nm)]
    offset = _offset_bar(k, speed_radps)
    z1, z2 = ((p_me - offset) / k.dp for p_me in ends)
    top = np.clip(_HUMP, z1, z2)
    s1, s2, s = (_logistic(z) for z in (z1, z2, top))
    hump = np.maximum(s * (1 - s) * (2 * s - 1), 0.0)
    least = np.minimum(s1 * (1 - s1), s2 * (1 - s2))
    fall = (k.hi - k.lo) / k.dp * np.maximum(ends[1] / k.dp * hump - 2 * least, 0.0)
    bar_per_nm = 4 * pi / law.displacement_m3 / PA_PER_BAR
    bend: Array = fall * bar_per_nm * _kgps_per_nm(law, speed_radps)
    return bend


def loss_slopes(machine: Machine, torque_nm: Array, speed_radps: Array) -> Slopes | None:
    """Of a machine's loss, in W per Nm; None where it is not shown to be convex."""
    law, back = machine.loss, speed_radps < 0
    mirrored = np.where(back, -torque_nm, torque_nm)
    if isinstance(law, LossByCoefficients) and law.c3 >= 0:
        slope = 2 * law.c3 * torque_nm
        return Slopes(slope, slope)
    if not isinstance(law, LossByEfficiency):
        return None
    speed = np.abs(speed_radps)
    motoring, generating = speed * (1 / law.efficiency - 1), -speed * (1 - law.efficiency)
    left = np.where(mirrored > 0, motoring, generating)
    right = np.where(mirrored >= 0, motoring, generating)
    return Slopes(np.where(back, -right, left), np.where(back, -left, right))


def _nox_of(engine: Engine) -> NoxCoefficients | None:
    law = engine.law
    k = law.nox if isinstance(law, CompactLaw) else None
    return k if k is not None and k.dp > 0 and k.hi >= k.lo >= 0 else None


def _offset_bar(k: NoxCoefficients, speed_radps: Array) -> Array:
    return k.p0 + k.p1 * (speed_radps * 60 / (2 * pi) / 1000 - 2)


def _kgps_per_nm(law: CompactLaw, speed_radps: Array) -> Array:
    """NOx flow per specific NOx, g/kWh, and Nm."""
    speed_rpm = speed_radps * 60 / (2 * pi)
    per_bar = (speed_rpm / 2000) ** 0.19 / 36 * 1e-6 * (law.displacement_m3 * 1e3)
    cycles_per_s = speed_radps / (4 * pi)
    return per_bar * cycles_per_s * (4 * pi / law.displacement_m3 / PA_PER_BAR)


def _logistic(z: Array) -> Array:
    return 1 / (1 + np.exp(-z))
