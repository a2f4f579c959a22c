"""Planes below what a step costs under prices, for every torque of the machine and all sizes of a box.

For prices p >= 0 on stored energy a step in a mode costs, see laws.py and bounds/step_prices.py,

    L(u, theta) = dt engine fuel(T / engine) + battery W(P / battery)
    W(b)        = least over x in the window of one battery of   p_t+1 dt r(b, x) + (p_t - p_t+1) x

Each term is jointly convex in u and theta: fuel is convex and rises, T is convex, a factor times a convex function
of a quotient with it is a perspective, u²/machine another, r is convex in (b, x) and its least over x is so in
b. So a tangent at any u and theta lies below L everywhere. Two tangents at torques on both sides of the best
one, mixed so that u drops out, or one at a limit with the limit's own line (its slope by u has the limit's
sign), leave a plane in theta alone: what a mode costs at least, whatever the torque. Limits are affine or
convex in theta; leaving one out, or letting the brakes work where the car drives, only lowers the plane.

Sizes are (engine, machine, battery). A plane is (time, 4): a constant and the slope by each.
"""

from dataclasses import dataclass, field
from math import pi

import numpy as np

from hevopt.bounds.step_prices import line_above
from hevopt.car.architecture import Architecture
from hevopt.car.engine_laws import CompactLaw
from hevopt.display.facts import Shown
from hevopt.problem.arrays import Array, Flags
from hevopt.sizing.proof.laws import Laws
from hevopt.sizing.proof.limits import vertices
from hevopt.sizing.proof.modes import Mode, NotProvable

ENGINE, MACHINE, BATTERY = 1, 2, 3
_BISECTIONS = 28
# Share of a root below which it is taken as a line: far beyond full load, or at the voltage's peak.
_ROOT_MIN = 0.05
_PA_PER_BAR = 1e5


@dataclass(frozen=True, slots=True, eq=False)
class OneBattery:
    """One battery: window of stored energy, U² = low_v2 + slope (x - low), resistances, highest power."""

    low: float
    high: float
    low_v2: float
    slope: float
    discharge_ohm: float
    charge_ohm: float
    efficiency: float
    power_max: float
    start_j: float
    end_j: float


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Prices(Shown):
    """Prices after each step, (time,), and what they fall by over it, 0 over the first."""

    after: Array
    tilt: Array
    before: Array


def prices_of(after: Array) -> Prices:
    """From p_1 ... p_T; before the first step p_1."""
    before = np.concatenate([after[:1], after[:-1]])
    return Prices(after, before - after, before)


def cell_of(car: Architecture, start_j: float, end_j: float) -> OneBattery:
    """The battery of a car; NotProvable where U² is not linear in what it stores."""
    battery = car.battery
    line = line_above(battery.within_window())
    if line is None:
        raise NotProvable(
            f"{car.name}: no proof over ranges, its battery's curves are not those of one line"
        )
    low, high = (float(e) for e in line.energy_j[:2])
    squared = line.open_circuit_v**2
    slope = float(squared[1] - squared[0]) / (high - low)
    if slope <= 0 or line.discharge_ohm[0] <= 0 or line.charge_ohm[0] <= 0:
        raise NotProvable(
            f"{car.name}: no proof over ranges, its battery's voltage or loss is constant"
        )
    peak = (1 - _ROOT_MIN**2) * float(squared[0]) / (4 * float(line.discharge_ohm[0]))
    return OneBattery(
        low, high, float(squared[0]), slope, float(line.discharge_ohm[0]), float(line.charge_ohm[0]),
        line.coulombic_efficiency, min(peak, battery.power_max_discharge_w), start_j, end_j,
    )  # fmt: skip


def stored(cell: OneBattery, power: Array, price: Array, tilt: Array) -> tuple[Array, Array, Array]:
    """Power at which W is touched, W there from below and its slope; price: p_t+1 dt.

    At a given power the best x is where p dt dr/dx + tilt = 0: with a = U² and B = 2 R b,
    a = B + |B| (1 + t) / sqrt(t (2 + t)),  t = 2 R tilt / (p dt slope). What the tangent there leaves over the
    window is taken off, so that nothing rests on it.
    """
    power = np.minimum(power, cell.power_max)
    ohm = np.where(power >= 0, cell.discharge_ohm, cell.charge_ohm)
    scale = price * np.where(power >= 0, 1.0, cell.efficiency)
    t = 2 * ohm * tilt / np.maximum(scale * cell.slope, 1e-300)
    b2, root = 2 * ohm * power, np.sqrt(np.maximum(t * (2 + t), 1e-300))
    squared = np.where(t > 0, b2 + np.abs(b2) * (1 + t) / root, np.inf)
    x = np.clip(cell.low + (squared - cell.low_v2) / cell.slope, cell.low, cell.high)
    a = cell.low_v2 + cell.slope * (x - cell.low)
    root = np.sqrt(a * (a - 2 * b2))
    drain = (a - root) / (2 * ohm)
    by_x = scale * cell.slope * (1 - (a - b2) / root) / (2 * ohm) + tilt
    spare = np.minimum(by_x * (cell.low - x), by_x * (cell.high - x))
    return power, scale * drain + tilt * x + spare, scale * a / root


class Fuel:
    """Fuel of an engine of factor 1 over its torque at each step, and its slope."""

    def __init__(self, laws: Laws, mode: Mode) -> None:
        law = laws.car.engine.law
        assert isinstance(law, CompactLaw)  # as check_car has made sure
        self._a2, self._slope, self._friction = law.fuel.a2, mode.slope, mode.friction
        self._bar = 4 * pi / law.displacement_m3 / _PA_PER_BAR
        self._rate = mode.we / law.heating_value_jpkg
        self.share = mode.share_e
        self.idle = self._of(np.zeros_like(mode.we))[0]

    def _of(self, torque: Array) -> tuple[Array, Array]:
        load = np.maximum(self._bar * torque - self._friction, 0.0)
        most = np.full_like(load, np.inf)
        if self._a2 < 0:
            most = (self._slope**2) * (1 - _ROOT_MIN**2) / (-4 * self._a2)
        within = np.minimum(load, most)
        root = np.sqrt(self._slope**2 + 4 * self._a2 * within)
        pressure = 2 * within / (self._slope + root) + (load - within) / root
        return self._rate * pressure / self._bar, np.where(load > 0, self._rate / root, 0.0)

    def at(self, torque: Array) -> tuple[Array, Array]:
        """kg/s and its slope at a mean torque of the step, while gears change without load."""
        fuel, slope = self._of(torque / self.share)
        return self.share * fuel + (1 - self.share) * self.idle, slope


@dataclass(slots=True, eq=False, repr=False)
class Box(Shown):
    """A box of sizes within linear limits. low, high: (3,) factors; rows: (limit, 4), see `limits`

    drive: lowest and highest final drive, None where it is the car's
    """

    low: Array
    high: Array
    rows: Array = field(default_factory=lambda: np.zeros((0, 4)))
    drive: tuple[float, float] | None = None

    @property
    def corners(self) -> Array:
        """(corner, 4) all corners with a 1 in front; sizes that do not vary have one value.

        Within limits the vertices of what they leave, none where that is nothing.
        """
        if len(self.rows):
            return vertices(self.low, self.high, self.rows)
        found = np.ones((1, 1))
        for low, high in zip(self.low, self.high, strict=True):
            ends = [low] if low == high else [low, high]
            found = np.vstack([np.column_stack([found, np.full(len(found), end)]) for end in ends])
        return found

    @property
    def middle(self) -> Array:
        """(3,) its centre, or within limits the mean of its vertices."""
        if len(self.rows) and len(self.corners):
            return np.asarray(self.corners[:, 1:].mean(axis=0))
        return (self.low + self.high) / 2


class Touch:
    """Planes of every mode at one theta under some prices. on, braked, off: (time, 4) each, see `entries`."""

    def __init__(self, laws: Laws, cell: OneBattery, theta: Array, prices: Prices) -> None:
        self.laws, self.cell, self.prices = laws, cell, prices
        self.at = np.concatenate([[1.0], theta])
        self.weight = laws.step_s * prices.after

    def entries(self) -> Array:
        """(entry, time, 4): engine on, by each of its modes; on and braking with an idle battery; at rest."""
        laws = self.laws
        on = [self._mode(mode) for mode in laws.on]
        off = self._mode(laws.off)
        braked = np.zeros_like(off)
        idles = [np.where(mode.idles, Fuel(laws, mode).idle, 0.0) for mode in laws.on]
        idle = laws.step_s * np.min(idles, axis=0)
        power, value, slope = stored(self.cell, np.zeros_like(idle), self.weight, self.prices.tilt)
        braked[:, ENGINE], braked[:, BATTERY] = idle, value - slope * power
        return np.array([*on, braked, off])

    def _mode(self, mode: Mode) -> Array:
        needed = needed_of(self.laws, mode, self.at)
        aside = _drop(needed, ENGINE, mode.inertia_e)
        needed = np.where(mode.joined[:, None], needed, aside)
        low, high = self._limits(mode, needed)
        fuel = Fuel(self.laws, mode)

        def plane(u: Array) -> tuple[Array, Array]:
            return self._plane(mode, fuel, needed, u)

        a, b = low @ self.at, high @ self.at
        first, last = plane(a), plane(b)
        at_low, at_high = first[0] >= 0, last[0] <= 0
        for _ in range(_BISECTIONS):
            middle = (a + b) / 2
            rises = plane(middle)[0] >= 0
            a, b = np.where(rises, a, middle), np.where(rises, middle, b)
        below, above = plane(a), plane(b)
        share = above[0] / np.maximum(above[0] - below[0], 1e-300)
        mixed = share[:, None] * below[1] + (1 - share)[:, None] * above[1]
        found = np.where(at_high[:, None], last[1] + last[0][:, None] * high, mixed)
        return np.where(at_low[:, None], first[1] + first[0][:, None] * low, found)

    def _limits(self, mode: Mode, needed: Array) -> tuple[Array, Array]:
        """(time, 4) lines of the lowest and highest torque; a limit that theta itself breaks is left out."""
        high, least = np.zeros_like(needed), np.zeros_like(needed)
        high[:, MACHINE], least[:, MACHINE] = mode.most, -mode.most
        other = np.where(mode.joined[:, None], _drop(needed, ENGINE, mode.full), needed)
        other = np.where(mode.turns[:, None], other, 0.0)
        low = np.where((other @ self.at >= least @ self.at)[:, None], other, least)
        broken = (low @ self.at > high @ self.at)[:, None]
        low = np.where(broken & mode.joined[:, None], least, low)
        return low, np.where(broken & ~mode.joined[:, None], low, high)

    def _plane(self, mode: Mode, fuel: Fuel, needed: Array, u: Array) -> tuple[Array, Array]:
        """Slope by u, and the rest of the tangent, (time, 4)."""
        laws, (_, engine, machine, battery) = self.laws, self.at
        rest = np.zeros_like(needed)
        static, c3 = mode.static, mode.c3 / mode.share
        by_u = mode.w + 2 * c3 * u / machine
        own = static - c3 * (u / machine) ** 2
        power = mode.w * u + static * machine + c3 * u**2 / machine + mode.load
        touched, value, slope = stored(self.cell, power / battery, self.weight, self.prices.tilt)
        rest[:, 0] += slope * mode.load
        rest[:, MACHINE] += slope * own
        rest[:, BATTERY] += value - slope * touched
        rises = slope * by_u
        closing = needed @ self.at - u
        dragged = closing <= engine * mode.least
        torque = np.where(dragged, engine * mode.least, closing) / engine
        burnt, steep = (laws.step_s * part for part in fuel.at(np.where(mode.joined, torque, 0.0)))
        tied, free = mode.joined & dragged, mode.joined & ~dragged
        rest[:, ENGINE] += np.where(mode.joined, burnt - steep * torque, 0.0)
        rest[:, ENGINE] += np.where(tied, steep * mode.least, 0.0)
        rest += np.where(free, steep, 0.0)[:, None] * needed
        rest[:, ENGINE] += np.where(mode.idles, laws.step_s * fuel.idle, 0.0)
        return rises - np.where(free, steep, 0.0), rest


def needed_of(laws: Laws, mode: Mode, at: Array) -> Array:
    """(time, 4) line below the torque that engine and machine must give together, which is A at theta itself."""
    line = np.zeros((len(mode.w), 4))
    mass = np.concatenate([[laws.mass0], laws.mass])
    kg = float(mass @ at)
    lows = mode.low0 + mode.low1 * kg
    second = lows[1] > lows[0]
    brakes = np.isfinite(mode.low0[0])
    y0 = np.where(brakes, np.where(second, mode.low0[1], mode.low0[0]), mode.y0)
    y1 = np.where(brakes, np.where(second, mode.low1[1], mode.low1[0]), mode.y1)
    slope = np.where(y0 + y1 * kg > 0, mode.driving, mode.braking)
    line += (slope * y1)[:, None] * mass
    line[:, 0] += slope * y0
    line[:, ENGINE] += mode.inertia_e
    line[:, MACHINE] += mode.inertia
    return line


def impossible(laws: Laws, box: Box) -> Flags:
    """(entry, time) where an entry is possible with no sizes of a box."""
    corners, at = box.corners, np.concatenate([[1.0], box.middle])

    def barred(mode: Mode) -> Flags:
        needed = needed_of(laws, mode, at)
        needed = np.where(
            mode.joined[:, None],
            _drop(needed, ENGINE, mode.full),
            _drop(needed, ENGINE, mode.inertia_e),
        )
        short = (_drop(needed, MACHINE, mode.most) @ corners.T).min(axis=1) > 1e-6
        found: Flags = ~mode.possible | (mode.turns & short)
        return found

    brakes = np.isfinite(laws.off.low0[0])
    runs = np.any([mode.possible for mode in laws.on], axis=0)
    on = [barred(mode) for mode in laws.on]
    for other in on[1:]:
        other |= ~laws.apart
    return np.array([*on, ~runs | ~brakes, barred(laws.off)])


def _drop(line: Array, size: int, by: Array) -> Array:
    """A line with so much less of a size."""
    found: Array = line.copy()
    found[:, size] -= by
    return found
