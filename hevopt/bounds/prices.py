"""Paths under prices: with a price on stored energy the steps come apart, up to the switching costs.

For a multiplier p >= 0 (kg per J) on the end-charge constraint, and r_t(u) the fall of stored energy,
    g(p) = min over mode paths and controls of  sum [cost_t(u) + p r_t(u) + K + p s] + p (x_end - x_start)
is a lower bound on the cost of every feasible plan (weak duality): with K and s, the fuel and the stored energy
that switching takes, the sum of r_t + s_t on such a plan is at most x_start - x_end. The minimum is exact, a
shortest path over modes (Viterbi). g is concave and piecewise linear; lines.py finds its top by intersecting
supporting lines.

Where r_t depends on the state of charge, its least value within the window takes its place: still a bound.

Rounding. Let u = epsilon / 2, one operation's relative error, T steps, and S the scale of the prices. What is to
hold is  computed g - allowance <= cost as computed of a plan that simulate accepts.
1. Viterbi adds 2 T terms, cost + S worth and switching, along a path: on the plan's own path the sum is off by at
   most 2 T u times the sum of their magnitudes. Where costs are >= 0 that is the sum itself, and for any sign the
   sum and twice all that may be negative: |g| + 2 N + 2 S W, N the greatest falls of cost below 0 per step, summed.
   (A plan that costs more than twice |g| needs no allowance.) The cost as simulate adds it is off by less.
2. W holds the magnitudes of what is priced, step by step: p dt r with |r| <= 2 |P|, (p_t - p_t+1) x, p s, one more
   term that is added to K first, and at the ends p x. r is computed to 4 u and the root's share: an error of Uoc²
   grows by U / sqrt(U² - 4 R P) at most (`amplification`). A tangent's slope times the window is off by at most
   its third power, times the voltage's rise over the window. `drain_magnitude_w` takes both; the prices' own
   scaling and the sums add a few u more.
3. The plan's trace is rounded at each step, by at most 3 u x_max and the error of r: sum over t of p_t+1 x_max.
4. Products below the smallest normal number are off by more, all together by less than it: it is taken off, too.
Together  epsilon [(2 T + 48) (|g| + 2 N + 4 S W) + 8 S sum p x_max],  about 1e-10 of the cost on shipped cycles.
"""

from dataclasses import dataclass, replace

import numpy as np

from hevopt.bounds._prices_kernels import priced_path, shortest_path
from hevopt.bounds.bounded import bounded_choices, least_drain_j
from hevopt.bounds.lines import Line, maximise
from hevopt.display.facts import Shown
from hevopt.errors import InfeasibleError
from hevopt.problem import _battery_kernels as battery_kernels
from hevopt.problem._battery_kernels import BatteryArrays
from hevopt.problem.arrays import Array, Indices
from hevopt.problem.choices import Choices
from hevopt.problem.frozen import frozen
from hevopt.problem.once import once
from hevopt.problem.problem import Problem
from hevopt.problem.switching import switched, switched_j

EPSILON, TINY = float(np.finfo(np.float64).eps), float(np.finfo(np.float64).tiny)
# Beyond this amplification a tangent's slope is not computed well enough to be of use.
STEEPEST = 1e3


def end_slack_j(problem: Problem) -> float:
    """How much less than the asked end charge a plan may leave and still counts: what a window is granted."""
    return problem.battery.granted_window_j[1] - problem.window_j[1]


@once
def one_price_dual(problem: Problem) -> tuple[Line, ...]:
    """Supporting lines of g up to its maximum, of the table's controls; the best one comes last."""
    return tuple(dual(problem, bounded_choices(problem), _bounded_at_one_price(problem.origin)))


@once
def _bounded_at_one_price(problem: Problem) -> "Priced":
    """The priced part of `bounded_choices`, which no cost changes."""
    return _at_one_price(problem, bounded_choices(problem))


def one_price_lines(problem: Problem, choices: Choices) -> list[Line]:
    """The same of some choices, as of virtual.py."""
    return dual(problem, choices, _at_one_price(problem, choices))


def _at_one_price(problem: Problem, choices: Choices) -> "Priced":
    worth = least_drain_j(problem, choices)
    rounding = priced_rounding(problem, choices, np.ones(choices.steps), tangents=False)
    return Priced(worth, np.ones(choices.steps), problem.end_min_j - problem.start_j, 1.0, rounding)


def before_steps(price: Array) -> Array:
    """(time,) prices of stored energy before each step, p_1 p_1 p_2 ... p_T-1, of those after it, p_1 ... p_T.

    Before the first step stored energy is not free: all that counts is what it is after it.
    """
    return np.concatenate([price[:1], price[:-1]])


def priced_rounding(problem: Problem, choices: Choices, price: Array, *, tangents: bool) -> float:
    """Rounding allowance per scale of a dual with (time,) prices p_1 ... p_T; parts 1 to 3 above with S = 1."""
    inside = problem.battery.within_window()
    stored_j = float(np.abs(inside.energy_j).max())
    priced = (
        price * choices.step_s * step_maxima(choices, drain_magnitude_w(choices, inside, tangents))
    )
    switch_j = before_steps(price) * _greatest_switch_j(choices)
    tilt = np.abs(np.diff(price))
    ends = price[-1] * abs(problem.end_min_j) + price[0] * abs(problem.start_j)
    magnitude = float(np.sum(priced) + np.sum(switch_j) + np.sum(tilt) * stored_j + ends)
    return EPSILON * (
        4.0 * (2 * choices.steps + 48) * magnitude + 8.0 * float(np.sum(price)) * stored_j
    )


def drain_magnitude_w(choices: Choices, inside: BatteryArrays, tangents: bool) -> Array:
    """(entry,) what the rounding of r is an epsilon of; with `tangents` also that of its slope over the window."""
    grown = battery_kernels.amplification(choices.power_w, inside)
    magnitude = 4.0 + grown
    if tangents:
        lowest, highest = inside.open_circuit_v[0], inside.open_circuit_v[-1]
        steep = np.minimum(grown, STEEPEST)
        # A power of an array takes many times as long as the products.
        magnitude += (highest - lowest) * highest / lowest**2 * (steep * steep * steep)
    drain_w: Array = 2.0 * np.abs(choices.power_w) * magnitude
    return drain_w


def _greatest_switch_j(choices: Choices) -> Array:
    """(time,) magnitude of the most that switching can take at each step."""
    case, _, energy_j, _ = choices.switching
    most: Array = np.abs(energy_j).max(axis=(1, 2))[case]
    return most


def step_maxima(choices: Choices, figure: Array) -> Array:
    """(time,) greatest of an (entry,) figure in each step, 0 where a step has no entry or less."""
    greatest = np.zeros(choices.steps)
    some = choices.first[:, -1] > choices.first[:, 0]
    if some.any():
        # Entries stand step by step.
        greatest[some] = np.maximum.reduceat(figure, choices.first[some, 0])
    return np.maximum(greatest, 0.0)


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Priced(Shown):
    """The priced part of a dual, all at scale 1.

    worth: (entry,) of each choice; before: (time,) price of stored energy that switching takes before each step
    constant: what the ends count; end_price: price of the end charge; rounding_kg: what rounding can do to it all
    """

    worth: Array
    before: Array
    constant: float
    end_price: float
    rounding_kg: float


def dual(problem: Problem, choices: Choices, priced: Priced) -> list[Line]:
    """Supporting lines, up to the maximum over the scale S >= 0, of
    g(S) = min over paths of sum [cost_i + S worth_i + K + S before s] + S constant.

    Raises InfeasibleError where no path is open, or every path's priced part is above 0 by more than rounding:
    then g has no maximum, and no plan reaches the end charge.
    """
    paths = _Paths.of(problem, choices, priced)
    lines = maximise(paths.line, typical_price_kgpj(choices, priced.worth), paths.steepest)
    return sorted(map(paths.lowered, lines), key=lambda line: line.value_kg)


def dual_at(problem: Problem, choices: Choices, priced: Priced, scale: float) -> Line:
    """The supporting line of g at one scale S >= 0, its maximum or not; see `dual`."""
    paths = _Paths.of(problem, choices, priced)
    return paths.lowered(paths.line(scale))


@dataclass(frozen=True, slots=True, eq=False)
class _Paths:
    """Choices under a price, and shortest paths over them; fallen_kg: N of the rounding above."""

    problem: Problem
    choices: Choices
    priced: Priced
    fallen_kg: float

    @classmethod
    def of(cls, problem: Problem, choices: Choices, priced: Priced) -> "_Paths":
        fallen_kg = float(np.sum(step_maxima(choices, -choices.cost_kg)))
        return cls(problem, choices, priced, fallen_kg)

    def line(self, scale: float) -> Line:
        """g's supporting line at a scale."""
        priced = self.priced
        total, path, _ = priced_path(
            self.choices,
            priced.worth,
            np.full(self.choices.steps, scale),
            scale * priced.before,
            self.problem.start_mode,
        )
        self._check_open(total)
        end_price = scale * priced.end_price
        return Line(scale, total + scale * priced.constant, self._slope(path), end_price)

    def lowered(self, line: Line) -> Line:
        """A line less what rounding can have done to its value, with the shape of its prices."""
        priced, choices = self.priced, self.choices
        own_kg = abs(line.value_kg - line.scale * priced.constant)
        rounding_kg = EPSILON * (2 * choices.steps + 48) * (own_kg + 2.0 * self.fallen_kg)
        rounding_kg += line.scale * priced.rounding_kg + TINY * (line.scale > 0)
        value_kg = line.value_kg - rounding_kg
        shape = np.append(priced.before[1:], priced.end_price)
        return replace(line, value_kg=value_kg, rounding_kg=rounding_kg, shape=shape)

    def steepest(self) -> tuple[float, float]:
        """Cost and slope of the path whose priced part is least: g's line at a scale without end."""
        switching = self.choices.switching
        free = switching._replace(kg=frozen("switching", np.zeros_like(switching.kg)))
        choices = self.choices._replace(switching=free)
        total, path, _ = shortest_path(
            choices, self.priced.worth, self.priced.before, self.problem.start_mode
        )
        self._check_open(total)
        slope = self._slope(path)
        # A plan that misses the end by no more than it may is one: g then rises without end, but slowly.
        if slope > self.priced.end_price * end_slack_j(self.problem):
            raise InfeasibleError(
                "the end charge cannot be reached by any plan; ask for a lower soc_end or widen the window"
            )
        control = self.choices.control[path]
        switch_kg = switched(self.problem.table, self.problem.start_mode, control).kg
        return float(np.sum(self.choices.cost_kg[path] + switch_kg)), slope

    def _check_open(self, total: float) -> None:
        if not np.isfinite(total):
            raise InfeasibleError(_no_path(self.choices, self.problem))

    def _slope(self, path: Indices) -> float:
        priced = self.priced
        slope = float(np.sum(priced.worth[path])) + priced.constant
        control = self.choices.control[path]
        taken_j = switched_j(self.problem.table, self.problem.start_mode, control)
        slope += float(np.sum(priced.before * taken_j))
        # End charge that is missing by rounding alone must not send the price to infinity.
        return 0.0 if abs(slope) <= priced.rounding_kg else slope


def _no_path(choices: Choices, problem: Problem) -> str:
    """The first step at which no mode can be reached, going forward from the start mode."""
    modes = np.arange(choices.modes) == problem.start_mode
    for k in range(choices.steps):
        filled = choices.first[k, 1:] > choices.first[k, :-1]
        allowed = choices.switching.allowed[choices.switching.case[k]]
        modes = (allowed & modes[:, None]).any(axis=0) & filled
        if not modes.any():
            why = "every switch is forbidden"
            if not filled.any():
                why = "every control is rejected or leaves the SOC window"
            return (
                f"nothing is reachable at step {k} (t = {problem.table.time_s[k]:g} s): {why} there; "
                "see reject and switch_allowed of the table"
            )
    return "no path over the modes"


def typical_price_kgpj(choices: Choices, drain_j: Array) -> float:
    """A price of the order of the choices' own: spread of cost over spread of drained energy."""
    if not len(drain_j):
        return 1e-12
    spread_j = float(np.ptp(drain_j)) or 1.0
    return max(float(np.ptp(choices.cost_kg)) / spread_j, 1e-12)
