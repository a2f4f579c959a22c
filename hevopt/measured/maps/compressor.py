"""The compact compressor map fitted to measured points.

Equations (8), (9) and (11) of mean_value/_turbo_kernels: head over flow by six figures, to which points lie as near
as flow and head together allow (the first of each line on the surge line), and shaft work by three, linear in them.
Below the lowest speed line the form goes on by similarity, down to standstill: nothing is held at a line.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares, lsq_linear

from hevopt.display.facts import Shown
from hevopt.errors import DataError
from hevopt.mean_value._turbo_kernels import place_on_line
from hevopt.mean_value.parameters import Ambient, Compressor, Gas
from hevopt.measured.maps.turbo_points import TurboPoints
from hevopt.units import RPM_PER_RADPS

Array = NDArray[np.float64]

_AIR_GAMMA = 1.4
# How far choke stays above surge, and up to which rim speed over that of sound: as in the component's file, and a
# little for its digits.
_APART, _MACH_MAX = 0.0301, 1.8
# head_max, head_exponent, surge_flow, its rise, what choke lies above _APART at _MACH_MAX, choke's fall
_LOW = np.array([0.1, 1.2, 0.0, 0.0, 0.0, 0.0])
_HIGH = np.array([1.5, 20.0, 2.0, 2.0, 2.0, 2.0])
# Of any wheel: flow over density, disc area and rim speed; isentropic work over its square.
_FLOW, _HEAD = (1e-4, 2.0), (0.0, 3.0)
_EXPONENTS = (1.6, 2.5, 5.0)
_WORK_LOW, _WORK_HIGH = (0.1, 0.0, 0.0), (2.0, 10.0, 0.2)
_ABOVE_HEAD = 1.001


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class CompressorFit(Shown):
    """A compact map and how far points lie from it.

    off: (point,) of pressure ratio at equal flow or of flow at equal pressure ratio, as share of the ratio or of
    the line's largest flow, whichever is less; efficiency_off: (point,) at the
    measured head and flow; fitted less measured
    speed_radps, flow_kgps: (point,) at 25 °C and standard pressure
    """

    wheel: Compressor
    speed_radps: Array
    flow_kgps: Array
    off: Array
    efficiency_off: Array


def fit_compressor(points: TurboPoints, diameter_m: float, place: str) -> CompressorFit:
    """The compact map nearest to the points; DataError with `place` where none is a compressor's."""
    around, gas = Ambient(), Gas()
    kelvin = around.temperature_k
    speed = points.speed * np.sqrt(kelvin)
    flow = points.flow * around.pressure_pa / np.sqrt(kelvin)
    _check_shape(points, speed, flow, place)
    rim = speed * diameter_m / 2
    mach = rim / np.sqrt(_AIR_GAMMA * gas.constant_jpkgk * kelvin)
    density = around.pressure_pa / (gas.constant_jpkgk * kelvin)
    phi = flow / (density * np.pi / 4 * diameter_m**2 * rim)
    cp = gas.air_a_jpkgk + gas.air_b_jpkgk2 * kelvin
    psi = cp * kelvin * (points.ratio ** (gas.constant_jpkgk / cp) - 1) / rim**2
    _check_size(phi, psi, place)
    first = _first_of_lines(points, phi)
    found = _line_form(phi, psi, mach, first, place)
    head, exponent, surge, rise, gap, fall = found
    work = _work(phi, psi, points.efficiency, head, place)
    choke = surge + rise * _MACH_MAX + _APART + gap + fall * _MACH_MAX
    wheel = Compressor(diameter_m, head, exponent, surge, rise, choke, fall, *work)
    at_surge, at_choke = surge + rise * mach, choke - fall * mach
    x = np.array([place_on_line(1 - p / head, exponent) for p in psi])
    span = np.array([phi[points.line == k].max() for k in points.line])
    of_flow = (at_surge + x * (at_choke - at_surge) - phi) / span
    inside = np.maximum((phi - at_surge) / (at_choke - at_surge), 0.0)
    lifted = 1 + head * (1 - inside**exponent) * rim**2 / (cp * kelvin)
    of_ratio = np.maximum(lifted, 0.0) ** (cp / gas.constant_jpkgk) / points.ratio - 1
    off = np.where(np.abs(of_flow) < np.abs(of_ratio), of_flow, of_ratio)
    taken = work[0] - work[1] * phi + work[2] / phi
    return CompressorFit(wheel, speed, flow, off, psi / taken - points.efficiency)


def _check_size(phi: Array, psi: Array, place: str) -> None:
    """DataError where flow or head are none of a wheel of this size."""
    for what, found, (low, high) in (("flow number", phi, _FLOW), ("head", psi, _HEAD)):
        off = (found < low) | (found > high)
        if off.any():
            raise DataError(
                f"{place}: {what} {found[off][0]:.3g} of the rim speed; allowed: {low:g} to {high:g}; check units, "
                "reference and the wheel's diameter"
            )


def _check_shape(points: TurboPoints, speed: Array, flow: Array, place: str) -> None:
    """DataError where lines rise towards choke, or cross."""
    ends = []
    for k in range(len(points.line_speed)):
        on = np.flatnonzero(points.line == k)
        on = on[np.argsort(flow[on])]
        rpm = speed[on].mean() * RPM_PER_RADPS
        if points.ratio[on[-1]] >= points.ratio[on[0]]:
            raise DataError(
                f"{place}: on the line at {rpm:.4g} rpm (25 °C) the pressure ratio is {points.ratio[on[0]]:.3g} at "
                f"the least flow and {points.ratio[on[-1]]:.3g} at the largest: surge and choke are crossed; it "
                "must fall from surge to choke; check the columns of flow and ratio"
            )
        ends.append((rpm, flow[on], points.ratio[on]))
    for (slow, w0, p0), (fast, w1, p1) in pairwise(ends):
        low, high = max(w0[0], w1[0]), min(w0[-1], w1[-1])
        if low > high:
            continue
        at = np.unique([*w0[(w0 >= low) & (w0 <= high)], *w1[(w1 >= low) & (w1 <= high)]])
        below = np.interp(at, w1, p1) <= np.interp(at, w0, p0)
        if below.any():
            raise DataError(
                f"{place}: the lines at {slow:.4g} and {fast:.4g} rpm (25 °C) cross, at {1e3 * at[below][0]:.3g} "
                "g/s; a faster wheel gives more pressure at the same flow; check the speeds of these points"
            )


def _first_of_lines(points: TurboPoints, phi: Array) -> NDArray[np.int64]:
    """(line,) the point of least flow on each."""
    ons = [np.flatnonzero(points.line == k) for k in range(len(points.line_speed))]
    return np.array([on[np.argmin(phi[on])] for on in ons])


def _line_form(
    phi: Array, psi: Array, mach: Array, first: NDArray[np.int64], place: str
) -> tuple[float, ...]:
    """The six figures of equations (8) and (9), choke as its distance from surge."""

    def residuals(p: Array) -> Array:
        head, exponent, surge, rise, gap, fall = p
        at_surge = surge + rise * mach
        width = _APART + gap + (rise + fall) * (_MACH_MAX - mach)
        x = (phi - at_surge) / width
        inside = np.maximum(x, 0.0)
        slope = exponent * inside ** (exponent - 1)
        off = (1 - inside**exponent - psi / head) / np.sqrt(1 + slope**2)
        return np.concatenate([off, x[first]])

    best = None
    for exponent in _EXPONENTS:
        start = np.array([1.02 * psi.max(), exponent, phi.min(), 0.01, phi.max() - phi.min(), 0.05])
        inside = np.clip(start, _LOW + 1e-6, _HIGH - 1e-6)
        found = least_squares(
            residuals, inside, bounds=(_LOW, _HIGH), x_scale=[0.1, 1, 0.05, 0.05, 0.1, 0.1]
        )
        best = found if best is None or found.cost < best.cost else best
    assert best is not None
    head, exponent, surge, rise, gap, fall = (float(value) for value in best.x)
    fastest = mach.max()
    apart = gap + (rise + fall) * (_MACH_MAX - fastest)
    if apart < 1e-3 or head >= _HIGH[0] * (1 - 1e-6):
        raise DataError(
            f"{place}: surge and choke cross within the map: at its highest speed, {fastest:.2g} Mach at the rim, "
            f"the line nearest to the points is {_APART + apart:.3g} wide in flow number, its head {head:.3g}; "
            f"allowed: more than {_APART:g}, and a head below {_HIGH[0]:g}; check speeds, units, reference and the "
            "wheel's diameter"
        )
    return head, exponent, surge, rise, gap, fall


def _work(
    phi: Array, psi: Array, efficiency: Array, head: float, place: str
) -> tuple[float, float, float]:
    """L0, L1 and k of equation (11) from head over efficiency, by what they make of efficiency."""
    taken = psi / efficiency
    weight = efficiency / taken
    rows = np.column_stack([np.ones_like(phi), -phi, 1 / phi]) * weight[:, None]
    low = np.maximum(_WORK_LOW, (_ABOVE_HEAD * head, 0.0, 0.0))
    if low[0] >= _WORK_HIGH[0]:
        raise DataError(
            f"{place}: head {head:.3g} of a rim speed's square; allowed: below {_WORK_HIGH[0]:g}; check the "
            "wheel's diameter"
        )
    found = lsq_linear(rows, efficiency, bounds=(low, _WORK_HIGH)).x
    return float(found[0]), float(found[1]), float(found[2])
