"""Paths under prices: with a price on stored energy the steps come apart, up to the switching costs.

For a multiplier p >= 0 (kg per J) on the end-charge constraint, and r_t(u) the fall of stored energy,
    g(p) = min over mode paths and controls of  sum [cost_t(u) + p r_t(u) + switching] + p (x_end - x_start)
is a lower bound on the cost of every feasible plan (weak duality): on such a plan the sum of r_t is at most
x_start - x_end. The minimum is exact, a shortest path over modes (Viterbi). g is concave and piecewise linear;
`maximise` finds its top by intersecting supporting lines.

Where r_t depends on the state of charge, its least value within the window takes its place: still a bound.

Rounding. Let u = epsilon / 2, one operation's relative error, T steps, and S the scale of the prices. What is to
hold is  computed g - allowance <= cost as computed of a plan that simulate accepts.
1. Viterbi adds 2 T terms, cost + S worth and switching, along a path: on the plan's own path the sum is off by at
   most 2 T u times the sum of their magnitudes. Where costs are >= 0 that is the sum itself, and for any sign the
   sum and twice all that may be negative: |g| + 2 N + 2 S W, N the greatest falls of cost below 0 per step, summed.
   (A plan that costs more than twice |g| needs no allowance.) The cost as simulate adds it is off by less.
2. W holds the magnitudes of what is priced, step by step: p dt r with |r| <= 2 |P|, (p_t - p_t+1) x, and at the
   ends p x. r is computed to 4 u and the root's share: an error of Uoc² grows by U / sqrt(U² - 4 R P) at most
   (`amplification`). A tangent's slope times the window is off by at most its third power, times the voltage's
   rise over the window. `priced_magnitude` takes both; the prices' own scaling and the sums add a few u more.
3. The plan's trace is rounded at each step, by at most 2 u x_max and the error of r: sum over t of p_t+1 x_max.
4. Products below the smallest normal number are off by more, all together by less than it: it is taken off, too.
Together  epsilon [(2 T + 48) (|g| + 2 N + 4 S W) + 8 S sum p x_max],  about 1e-10 of the cost on shipped cycles.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from hevopt.bounds._prices_kernels import shortest_path
from hevopt.errors import InfeasibleError
from hevopt.problem import _battery_kernels as battery_kernels
from hevopt.problem import battery as battery_model
from hevopt.problem._battery_kernels import BatteryArrays
from hevopt.problem.arrays import Array, Indices
from hevopt.problem.choices import Choices, choices_of, kept
from hevopt.problem.frozen import frozen
from hevopt.problem.problem import Problem

EPSILON, TINY = float(np.finfo(np.float64).eps), float(np.finfo(np.float64).tiny)
_LINES_MAX = 200
_QUADRUPLINGS_MAX = 16
# A move this share beyond the window is beyond it, whatever rounding did to it.
_WELL_BEYOND = 1e-6
# Two lines meet within rounding of the best value known: the top is found.
_RELATIVE_TOLERANCE = 1e-13
# Beyond this amplification a tangent's slope is not computed well enough to be of use.
STEEPEST = 1e3


@dataclass(frozen=True, slots=True)
class Line:
    """A supporting line of a dual, and a bound for every end charge.

    scale, value_kg, slope_kg: where it touches, the bound there less its rounding, its derivative by the scale
    price_kgpj: price at the end, which is what a joule more of end charge adds to the bound
    """

    scale: float
    value_kg: float
    slope_kg: float
    price_kgpj: float


def end_slack_j(problem: Problem) -> float:
    """How much less than the asked end charge a plan may leave and still counts: what a window is granted."""
    return problem.battery.granted_window_j[1] - problem.window_j[1]


def bounded_choices(problem: Problem) -> Choices:
    """The choices that a bound must count: all but those that leave the window whatever the charge before.

    A discharge drains at least what it does at the highest voltage and lowest resistance, a charge stores at least
    what it does at the lowest and the highest: one that moves more than the window's width is in no plan.
    """
    choices, pack = choices_of(problem), problem.battery
    inside, (low, high) = pack.within_window(), pack.granted_window_j
    least_j = least_drain_j(problem, choices)
    stored_w = battery_model.chemical_power_w(
        pack, np.minimum(choices.power_w, 0.0), inside.open_circuit_v.min(), inside.charge_ohm.max()
    )
    stored_j = -stored_w * choices.spread(choices.step_s)
    beyond = np.maximum(least_j, stored_j) > (high - low) * (1 + _WELL_BEYOND)
    return kept(choices, ~beyond) if beyond.any() else choices


def least_drain_j(problem: Problem, choices: Choices) -> Array:
    """(entry,) fall of stored energy at the state of charge of the window that loses least."""
    drain_w = np.empty_like(choices.power_w)
    for charging in (False, True):
        voltage, resistance = battery_model.best_voltage_and_resistance(problem.battery, charging)
        part = (choices.power_w < 0) == charging
        drain_w[part] = battery_model.chemical_power_w(
            problem.battery, choices.power_w[part], voltage, resistance
        )
    return drain_w * choices.spread(choices.step_s)


def drain_at_j(problem: Problem, choices: Choices, energy_j: float | Array) -> Array:
    """(entry,) fall of stored energy at one stored energy, or at one per step, (time,)."""
    pack = problem.battery
    states = battery_model.states(pack, np.broadcast_to(energy_j, choices.steps))
    voltage, discharge, charge = (choices.spread(state) for state in states[1:])
    resistance = np.where(choices.power_w < 0, charge, discharge)
    drain_w = battery_model.chemical_power_w(pack, choices.power_w, voltage, resistance)
    return drain_w * choices.spread(choices.step_s)


def one_price_dual(problem: Problem) -> list[Line]:
    """Supporting lines of g up to its maximum; the best one comes last."""
    choices = bounded_choices(problem)
    worth = least_drain_j(problem, choices)
    rounding = priced_rounding(problem, choices, np.ones(choices.steps), tangents=False)
    return dual(problem, choices, worth, problem.end_min_j - problem.start_j, 1.0, rounding)


def priced_rounding(problem: Problem, choices: Choices, price: Array, *, tangents: bool) -> float:
    """Rounding allowance per scale of a dual with (time,) prices p_1 ... p_T; parts 1 to 3 above with S = 1."""
    inside = problem.battery.within_window()
    stored_j = float(np.abs(inside.energy_j).max())
    priced = (
        price * choices.step_s * step_maxima(choices, drain_magnitude_w(choices, inside, tangents))
    )
    tilt = np.abs(np.diff(price))
    ends = price[-1] * abs(problem.end_min_j) + price[0] * abs(problem.start_j)
    magnitude = float(np.sum(priced) + np.sum(tilt) * stored_j + ends)
    return EPSILON * (
        4.0 * (2 * choices.steps + 48) * magnitude + 8.0 * float(np.sum(price)) * stored_j
    )


def drain_magnitude_w(choices: Choices, inside: BatteryArrays, tangents: bool) -> Array:
    """(entry,) what the rounding of r is an epsilon of; with `tangents` also that of its slope over the window."""
    grown = battery_kernels.amplification(choices.power_w, inside)
    lowest, highest = inside.open_circuit_v[0], inside.open_circuit_v[-1]
    rise = (highest - lowest) * highest / lowest**2 if tangents else 0.0
    return 2.0 * np.abs(choices.power_w) * (4.0 + grown + rise * np.minimum(grown, STEEPEST) ** 3)


def step_maxima(choices: Choices, figure: Array) -> Array:
    """(time,) greatest of an (entry,) figure in each step, 0 where a step has no entry or less."""
    greatest = np.zeros(choices.steps)
    np.maximum.at(greatest, choices.spread(np.arange(choices.steps)), figure)
    return greatest


def dual(
    problem: Problem,
    choices: Choices,
    worth: Array,
    constant: float,
    end_price: float,
    rounding_kg: float,
) -> list[Line]:
    """Supporting lines, up to the maximum over the scale s >= 0, of
    g(s) = min over paths of sum [cost_i + s worth_i + switching] + s constant.

    worth: (entry,) priced part of each choice at scale 1; end_price: price of the end charge at scale 1;
    rounding_kg: what rounding can do to the priced part at scale 1
    Raises InfeasibleError where no path is open, or every path's priced part is above 0 by more than rounding:
    then g has no maximum, and no plan reaches the end charge.
    """
    priced = _Priced(problem, choices, worth, constant, end_price, rounding_kg)
    lines = maximise(priced.line, typical_price_kgpj(choices, worth), priced.steepest)
    fallen_kg = 2.0 * float(np.sum(step_maxima(choices, -choices.cost_kg)))
    many = EPSILON * (2 * choices.steps + 48)

    def lowered(line: Line) -> Line:
        own_kg = abs(line.value_kg - line.scale * constant)
        allowance_kg = many * (own_kg + fallen_kg) + line.scale * rounding_kg
        return replace(line, value_kg=line.value_kg - allowance_kg - TINY * (line.scale > 0))

    return sorted(map(lowered, lines), key=lambda line: line.value_kg)


@dataclass(frozen=True, slots=True, eq=False)
class _Priced:
    """Choices under a price, and shortest paths over them."""

    problem: Problem
    choices: Choices
    worth: Array
    constant: float
    end_price: float
    rounding_kg: float

    def line(self, scale: float) -> Line:
        """g's supporting line at a scale."""
        value, path = self._shortest(self.choices, self.choices.cost_kg + scale * self.worth)
        return Line(scale, value + scale * self.constant, self._slope(path), scale * self.end_price)

    def steepest(self) -> tuple[float, float]:
        """Cost and slope of the path whose priced part is least: g's line at a scale without end."""
        free = frozen("switching", np.zeros_like(self.choices.switch_kg))
        _, path = self._shortest(self.choices._replace(switch_kg=free), self.worth)
        slope = self._slope(path)
        # A plan that misses the end by no more than it may is one: g then rises without end, but slowly.
        if slope > self.end_price * end_slack_j(self.problem):
            raise InfeasibleError(
                "the end charge cannot be reached by any plan; ask for a lower soc_end or widen the window"
            )
        table, controls = self.problem.table, self.choices.control[path]
        mode = table.mode[controls]
        before = np.concatenate([[self.problem.start_mode], mode[:-1]])
        cost = self.choices.cost_kg[path] + table.switch_fuel_kg[before, mode]
        return float(np.sum(cost)), slope

    def _shortest(self, choices: Choices, value: Array) -> tuple[float, Indices]:
        total, path, _ = shortest_path(choices, value, self.problem.start_mode)
        if not np.isfinite(total):
            raise InfeasibleError(_no_path(choices, self.problem))
        return total, path

    def _slope(self, path: Indices) -> float:
        slope = float(np.sum(self.worth[path])) + self.constant
        # End charge that is missing by rounding alone must not send the price to infinity.
        return 0.0 if abs(slope) <= self.rounding_kg else slope


def _no_path(choices: Choices, problem: Problem) -> str:
    """The first step at which no mode can be reached, going forward from the start mode."""
    modes = np.arange(choices.modes) == problem.start_mode
    for k in range(choices.steps):
        filled = choices.first[k, 1:] > choices.first[k, :-1]
        modes = (choices.switch_allowed & modes[:, None]).any(axis=0) & filled
        if not modes.any():
            why = "every switch is forbidden"
            if not filled.any():
                why = "every control is rejected or leaves the SOC window"
            return (
                f"nothing is reachable at step {k} (t = {problem.table.time_s[k]:g} s): {why} there; "
                "see reject and switch_allowed of the table"
            )
    return "no path over the modes"


def maximise(
    evaluate: Callable[[float], Line], guess: float, steepest: Callable[[], tuple[float, float]]
) -> list[Line]:
    """Supporting lines of a concave piecewise-linear function of a scale >= 0, the highest last.

    steepest: intercept and slope of its line at a scale without end, asked for where it still rises at 4^16
    guesses; raises an error where the function has no maximum. Where the search is cut short the lines found so
    far are what is known: each of them is a bound.
    """
    line = evaluate(0.0)
    lines, scale, right = [line], guess, None
    left = _Touch.of(line)
    for _ in range(_QUADRUPLINGS_MAX if line.slope_kg > 0 else 0):
        line = evaluate(scale)
        lines.append(line)
        if line.slope_kg <= 0:
            right = _Touch.of(line)
            break
        left = _Touch.of(line)
        scale *= 4.0
    if left.slope_kg > 0 and right is None:
        right = _Touch(np.inf, *steepest())
    for _ in range(_LINES_MAX):
        if right is None:
            break
        best = max(line.value_kg for line in lines)
        crossing, top = _crossing(left, right)
        inside = left.scale < crossing < right.scale
        if not inside or top - best <= _RELATIVE_TOLERANCE * abs(top):
            break
        line = evaluate(crossing)
        lines.append(line)
        left, right = (_Touch.of(line), right) if line.slope_kg > 0 else (left, _Touch.of(line))
    return sorted(lines, key=lambda line: line.value_kg)


@dataclass(frozen=True, slots=True)
class _Touch:
    """A supporting line by where it touches and its value at scale 0."""

    scale: float
    intercept_kg: float
    slope_kg: float

    @classmethod
    def of(cls, line: Line) -> "_Touch":
        return cls(line.scale, line.value_kg - line.slope_kg * line.scale, line.slope_kg)


def _crossing(left: _Touch, right: _Touch) -> tuple[float, float]:
    """Scale and value where two supporting lines meet; the left line's own point where they do not."""
    if left.slope_kg <= right.slope_kg:
        return left.scale, left.intercept_kg + left.slope_kg * left.scale
    crossing = (right.intercept_kg - left.intercept_kg) / (left.slope_kg - right.slope_kg)
    return crossing, left.intercept_kg + left.slope_kg * crossing


def typical_price_kgpj(choices: Choices, drain_j: Array) -> float:
    """A price of the order of the choices' own: spread of cost over spread of drained energy."""
    if not len(drain_j):
        return 1e-12
    spread_j = float(np.ptp(drain_j)) or 1.0
    return max(float(np.ptp(choices.cost_kg)) / spread_j, 1e-12)
