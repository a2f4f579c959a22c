"""Equivalent consumption minimisation: fuel plus a constant price on the battery's chemical power.

Each step takes the control of least  cost + s x (fall of stored energy); switching costs are exact, the mode
path being the shortest under that price (Viterbi), and the fall is that of the true battery at the present state
of charge. s, the equivalence factor in kg/J, is found so that the charge is neutral.

The end charge jumps as s moves, because a nearly straight fuel map makes many steps change at one price. Where
no s is neutral two neighbouring factors share the cycle, changing once on the way, in either order; and a plan
that would end short is also tried with the charge made good as late as possible. The cheapest plan tried that
ends with at least the asked charge is taken.

Where the charge window binds, s jumps: one factor a stretch is found (bounds/segments.py), and their mixed path
followed.
"""

import numpy as np

from hevopt.bounds._prices_kernels import shortest_path
from hevopt.bounds.prices import before_steps, drain_at_j, one_price_dual, typical_price_kgpj
from hevopt.bounds.segments import binds, segments
from hevopt.problem.arrays import Array
from hevopt.problem.choices import choices_of
from hevopt.problem.problem import Plan, Problem
from hevopt.problem.simulation import total_cost_kg
from hevopt.strategies._rollout import reach_of, roll
from hevopt.strategies._rollout_kernels import Grid

_FACTOR_TOLERANCE = 1e-7
_BRACKET_STEPS_MAX = 60
_HALVINGS_MAX = 100
# A factor below this share of the guess decides among free controls alone, as the least factor above 0 does.
_NEGLIGIBLE = 1e-9
_ENERGY_ROUNDING = 1e-12
# Passes over the segments; pulls to their path, as shares of the factor; nodes on which the pull is drawn.
_PASSES = 2
_PULLS = (1e-3, 1e-2, 0.05, 0.15)
_NODES = 401


class _Search:
    """Rollouts of one problem under prices, and the cheapest of them that ends with enough charge."""

    def __init__(self, problem: Problem) -> None:
        self.problem = problem
        self.choices = choices_of(problem)
        self.bound_reach = reach_of(problem, self.choices, problem.end_min_j)
        self.free_reach = reach_of(problem, self.choices, problem.window_j[0])
        self.drain_j = drain_at_j(problem, self.choices, problem.start_j)
        self.best_cost_kg = np.inf
        self.best_control, self.best_prices = np.empty(0, np.int64), (np.nan, np.nan)

    def surplus_j(self, price_kgpj: Array, *, to_the_end: bool = False) -> float:
        """Stored energy above the asked end charge under (time,) prices; `to_the_end`: never below it."""
        low, high = self.problem.window_j
        value = self._value_kg(price_kgpj, np.array([low, high]))
        return self._tried(price_kgpj, value, high - low, to_the_end=to_the_end)

    def follow(self, price_kgpj: Array, energy_j: Array, pull_kgpj: float) -> None:
        """Try (time,) prices, charge being drawn to (time + 1,) energies by a price on the distance from them."""
        low, high = self.problem.window_j
        nodes = np.linspace(low, high, _NODES)
        value = self._value_kg(price_kgpj, nodes)
        value += pull_kgpj * np.abs(nodes - energy_j[:, None, None])
        self._tried(price_kgpj, value, (high - low) / (_NODES - 1), to_the_end=True)

    def _value_kg(self, price_kgpj: Array, nodes_j: Array) -> Array:
        """(time + 1, mode, node) cost to go under prices, less the worth of what is stored."""
        choices = self.choices
        priced = choices.cost_kg + choices.spread(price_kgpj) * self.drain_j
        before_kgpj = before_steps(price_kgpj)
        _, _, to_go = shortest_path(choices, priced, before_kgpj, self.problem.start_mode)
        # A mode without a way on is never entered: the reach is empty there.
        to_go = np.where(np.isfinite(to_go), to_go, 0.0)
        of_step = np.concatenate([price_kgpj[:1], price_kgpj])[:, None, None]
        value: Array = to_go[:, :, None] - of_step * nodes_j
        return value

    def _tried(self, price_kgpj: Array, value: Array, cell_j: float, *, to_the_end: bool) -> float:
        """The surplus of the rollout that follows a value function, kept where it is the cheapest with enough."""
        choices, (low, high) = self.choices, self.problem.window_j
        reach = self.bound_reach if to_the_end else self.free_reach
        grid = Grid(np.full(choices.steps + 1, low), cell_j)
        path, energy_j = roll(self.problem, choices, reach, value, grid)
        surplus = float(energy_j[-1]) - self.problem.end_min_j
        if to_the_end or surplus >= -_ENERGY_ROUNDING * high:
            control = choices.control[path]
            cost_kg, _ = total_cost_kg(self.problem, control)
            if cost_kg < self.best_cost_kg:
                self.best_cost_kg, self.best_control = cost_kg, control
                self.best_prices = float(price_kgpj[0]), float(price_kgpj[-1])
        return surplus


def solve(problem: Problem) -> Plan:
    """The cheapest plan of one factor, or a pair of neighbouring factors, that keeps the charge."""
    search = _Search(problem)
    guess = one_price_dual(problem)[-1].price_kgpj
    guess = guess or typical_price_kgpj(search.choices, search.drain_j)
    every = np.ones(search.choices.steps)
    cheap, dear = _neutral_factors(search, guess)
    search.surplus_j(cheap * every, to_the_end=True)
    search.surplus_j(guess * every, to_the_end=True)
    if cheap < dear:
        _change_once(search, dear, cheap)
        _change_once(search, cheap, dear)
    if binds(problem, search.choices, search.drain_j, cheap, dear):
        _follow_segments(search, guess)
    first, last = search.best_prices
    notes = {"price_kgpj": first, "price_at_end_kgpj": last}
    return Plan(search.best_control, notes)


def _follow_segments(search: _Search, guess: float) -> None:
    """Try factors that jump where the window binds, drawn to the charge that they stand for; twice, the second time
    with falls of stored energy as they are along it."""
    problem, choices = search.problem, search.choices
    drain_j = search.drain_j
    for _ in range(_PASSES):
        found = segments(problem, choices, drain_j, guess)
        for pull in _PULLS:
            search.follow(
                found.price_kgpj, found.energy_j, pull * max(guess, found.price_kgpj.max())
            )
        drain_j = drain_at_j(problem, choices, found.energy_j[:-1])


def _change_once(search: _Search, before: float, after: float) -> None:
    """Try factors that change once, halving the cycle until neighbouring steps leave more and less charge."""
    steps = np.arange(search.choices.steps)
    less, enough = (0, len(steps)) if before > after else (len(steps), 0)
    while abs(enough - less) > 1:
        middle = (less + enough) // 2
        surplus = search.surplus_j(np.where(steps < middle, before, after))
        less, enough = (less, middle) if surplus >= 0 else (middle, enough)
    search.surplus_j(np.where(steps < less, before, after), to_the_end=True)


def _neutral_factors(search: _Search, guess: float) -> tuple[float, float]:
    """Neighbouring factors of which the cheaper leaves too little charge and the dearer enough.

    Where no factor tried leaves enough, both are the dearest.
    """
    every = np.ones(search.choices.steps)
    if search.surplus_j(0.0 * every) >= 0:
        return 0.0, 0.0
    cheap, dear = 0.98 * guess, 1.02 * guess
    while search.surplus_j(cheap * every) >= 0:
        if cheap <= _NEGLIGIBLE * guess:
            return 0.0, cheap
        cheap *= 0.8
    for _ in range(_BRACKET_STEPS_MAX):
        if search.surplus_j(dear * every) >= 0:
            break
        dear *= 1.25
    else:
        return dear, dear
    for _ in range(_HALVINGS_MAX):
        if dear - cheap <= _FACTOR_TOLERANCE * dear:
            break
        middle = (cheap + dear) / 2
        if search.surplus_j(middle * every) >= 0:
            dear = middle
        else:
            cheap = middle
    return cheap, dear
