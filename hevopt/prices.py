"""Paths under prices: with a price on stored energy the steps come apart, up to the switching costs.

For a multiplier p >= 0 (kg per J) on the end-charge constraint, and r_t(u) the fall of stored energy,
    g(p) = min over mode paths and controls of  sum [cost_t(u) + p r_t(u) + switching] + p (x_end - x_start)
is a lower bound on the cost of every feasible plan (weak duality): on such a plan the sum of r_t is at most
x_start - x_end. The minimum is exact, a shortest path over modes (Viterbi). g is concave and piecewise linear;
`maximise` finds its top by intersecting supporting lines.

Where r_t depends on the state of charge, its least value within the window takes its place: still a bound.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hevopt import battery as battery_model
from hevopt._prices_kernels import shortest_path
from hevopt.choices import Choices, choices_of
from hevopt.errors import InfeasibleError, SolverError
from hevopt.problem import Problem

Array = NDArray[np.float64]
_LINES_MAX = 200
_SCALE_MAX = 1e9
# Two lines meet within rounding of the best value known: the top is found.
_RELATIVE_TOLERANCE = 1e-13


@dataclass(frozen=True, slots=True)
class Line:
    """A supporting line of a dual, and a bound for every end charge.

    scale, value_kg, slope_kg: where it touches, the bound there, its derivative by the scale
    price_kgpj: price at the end, which is what a joule more of end charge adds to the bound
    """

    scale: float
    value_kg: float
    slope_kg: float
    price_kgpj: float


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
    soc = battery_model.soc(pack, np.broadcast_to(energy_j, choices.steps))
    voltage, discharge, charge = (
        choices.spread(np.interp(soc, pack.soc, curve))
        for curve in (pack.open_circuit_v, pack.discharge_ohm, pack.charge_ohm)
    )
    resistance = np.where(choices.power_w < 0, charge, discharge)
    drain_w = battery_model.chemical_power_w(pack, choices.power_w, voltage, resistance)
    return drain_w * choices.spread(choices.step_s)


def one_price_dual(problem: Problem) -> list[Line]:
    """Supporting lines of g up to its maximum; the best one comes last."""
    choices = choices_of(problem)
    drain_j = least_drain_j(problem, choices)
    return dual(problem, choices, drain_j, problem.end_min_j - problem.start_j, 1.0)


def dual(
    problem: Problem, choices: Choices, worth: Array, constant: float, end_price: float
) -> list[Line]:
    """Supporting lines, up to the maximum over the scale s >= 0, of
    g(s) = min over paths of sum [cost_i + s worth_i + switching] + s constant.

    worth: (entry,) priced part of each choice at scale 1; end_price: price of the end charge at scale 1
    """

    negligible = _RELATIVE_TOLERANCE * float(np.sum(np.abs(worth)) + abs(constant))

    def evaluate(scale: float) -> Line:
        value, path, _ = shortest_path(
            choices.first, choices.cost_kg + scale * worth, choices.switch_kg,
            choices.switch_allowed, problem.start_mode,
        )  # fmt: skip
        if not np.isfinite(value):
            raise InfeasibleError(_no_path(choices, problem))
        slope = float(np.sum(worth[path])) + constant
        # End charge that is missing by rounding alone must not send the price to infinity.
        slope = 0.0 if abs(slope) <= negligible else slope
        return Line(scale, value + scale * constant, slope, scale * end_price)

    return maximise(evaluate, typical_price_kgpj(choices, worth))


def _no_path(choices: Choices, problem: Problem) -> str:
    """The first step at which no mode can be reached, going forward from the start mode."""
    modes = np.arange(choices.modes) == problem.start_mode
    for k in range(choices.steps):
        filled = choices.first[k, 1:] > choices.first[k, :-1]
        modes = (choices.switch_allowed & modes[:, None]).any(axis=0) & filled
        if not modes.any():
            why = "every control is rejected" if not filled.any() else "every switch is forbidden"
            return (
                f"nothing is reachable at step {k} (t = {problem.table.time_s[k]:g} s): {why} there; "
                "see reject and switch_allowed of the table"
            )
    return "no path over the modes"


def maximise(evaluate: Callable[[float], Line], guess: float) -> list[Line]:
    """Supporting lines of a concave piecewise-linear function of a scale >= 0, the highest last.

    Raises InfeasibleError where it grows without end: then no plan reaches the end charge.
    """
    left = right = evaluate(0.0)
    lines = [left]
    scale = guess
    while right.slope_kg > 0:
        if scale > guess * _SCALE_MAX:
            raise InfeasibleError(
                "the end charge cannot be reached by any plan; ask for a lower soc_end or widen the window"
            )
        left, right = right, evaluate(scale)
        lines.append(right)
        scale *= 4.0
    for _ in range(_LINES_MAX):
        best = max(line.value_kg for line in lines)
        crossing, top = _crossing(left, right)
        inside = left.scale < crossing < right.scale
        if not inside or top - best <= _RELATIVE_TOLERANCE * abs(top):
            return sorted(lines, key=lambda line: line.value_kg)
        line = evaluate(crossing)
        lines.append(line)
        left, right = (line, right) if line.slope_kg > 0 else (left, line)
    raise SolverError(f"dual: no maximum after {_LINES_MAX} supporting lines")


def _crossing(left: Line, right: Line) -> tuple[float, float]:
    """Scale and value where two supporting lines meet; the left line's own point where they do not."""
    if left.slope_kg <= right.slope_kg:
        return left.scale, left.value_kg
    at_zero = [line.value_kg - line.slope_kg * line.scale for line in (left, right)]
    crossing = (at_zero[1] - at_zero[0]) / (left.slope_kg - right.slope_kg)
    return crossing, at_zero[0] + left.slope_kg * crossing


def typical_price_kgpj(choices: Choices, drain_j: Array) -> float:
    """A price of the order of the choices' own: spread of cost over spread of drained energy."""
    spread_j = float(np.ptp(drain_j)) or 1.0
    return max(float(np.ptp(choices.cost_kg)) / spread_j, 1e-12)
