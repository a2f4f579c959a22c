"""Convex optimisation of the whole cycle: a bound from a relaxation, then a plan from convex splits.

1. Relaxation: the convex model (_convex_model.py) with every mode open at every step and switching for nothing.
   Each plan of the table is a point of it (the share of its mode is 1, its battery loses no less) and costs there
   no more than it does; so its optimum is a bound on every plan. It is reported as the value of its dual, evaluated
   afresh at the solver's multipliers (_convex_dual.py). Where switching takes stored energy the model is none, for
   it knows of no energy that switching gives back; its multipliers still are prices, and the dual counts switching.
2. Mode path: with the multipliers p_t as prices and the falls of energy of the trajectory at hand, the shortest
   path over modes (Viterbi), switching costs included, gives engine on/off and gear. The prices are scaled to the
   top of the dual that this defines, so that the path takes about the energy that is there: a mode path chosen at
   prices of another mode path overshoots, and the next one would overshoot back. Where that path stands still,
   or cannot keep to the window, the best rollout's takes its place.
3. Split: the convex model with that mode path divides each step between engine and battery, and gives new
   multipliers and a new trajectory. 2 and 3 repeat until no new mode path comes up.
4. Back to the table: a rollout follows, from every trajectory E* found, the value function
       V_t(m, E) = to_go_t(m) - p_t (E - E*_t) + stiffness max(p) (E - E*_t)² / 2
   whose first term is the shortest path's. Prices alone would not do: hulls are nearly straight, so that many steps
   change at one price. Some rollouts follow E* from slightly above, where missing the end by little would cost a
   start. The cheapest rollout is the plan; each ends with the asked charge.
"""

import numpy as np

from hevopt.bounds._prices_kernels import shortest_path
from hevopt.bounds.bounded import drain_at_j
from hevopt.bounds.prices import Priced, before_steps, dual, one_price_dual, step_maxima
from hevopt.errors import InfeasibleError
from hevopt.problem.arrays import Array, Indices
from hevopt.problem.choices import Choices, choices_of
from hevopt.problem.problem import Plan, Problem
from hevopt.problem.simulation import total_cost_kg
from hevopt.problem.switching import switched, switched_modes
from hevopt.strategies._convex_model import SOLVER, Solution, optimum
from hevopt.strategies._convex_parts import hulls_of
from hevopt.strategies._reach_kernels import Reach
from hevopt.strategies._rollout import reach_of, roll
from hevopt.strategies._rollout_kernels import Grid

ITERATIONS_MAX = 8
# Rollouts are tried with each share by which the price rises over the band, and each height above the trajectory;
# band and height are shares of the window.
_STIFFNESS = (0.1, 1.0, 3.0, 10.0)
_LIFTS = (0.0, 1e-4, 2e-4)
_BAND = 0.1
_NODES = 201
_WORTH_ROUNDING = 1e-13
# The dual's top is a kink: the paths on either side are found this far from it.
_BESIDE_TOP = 1e-6


class _Rollouts:
    """Rollouts around trajectories of one problem, and the cheapest of them."""

    def __init__(self, problem: Problem) -> None:
        self.problem = problem
        self.choices = choices_of(problem)
        self.reach: Reach = reach_of(problem, problem.end_min_j)
        self.best_cost_kg, self.best_control = np.inf, np.empty(0, np.int64)

    def follow(self, solution: Solution) -> Indices:
        """(time,) modes of the shortest path under a solution's prices; rolls out around it on the way."""
        modes, price, to_go = _mode_path(self.problem, self.choices, solution)
        low, high = self.problem.window_j
        # A mode without a way on is never entered: the reach is empty there.
        to_go = np.where(np.isfinite(to_go), to_go, 0.0)
        for lift in _LIFTS:
            for stiffness in _STIFFNESS:
                self._roll(solution.energy_j + lift * (high - low), price, to_go, stiffness)
        return modes

    def _roll(self, centre_j: Array, price_kgpj: Array, to_go: Array, stiffness: float) -> None:
        low, high = self.problem.window_j
        cell = 2 * _BAND * (high - low) / (_NODES - 1)
        away = cell * (np.arange(_NODES) - _NODES // 2)
        price = np.concatenate([price_kgpj[:1], price_kgpj])
        bend = stiffness * float(price.max()) * away**2 / (2 * _BAND * (high - low))
        value = to_go[:, :, None] - price[:, None, None] * away + bend
        grid = Grid(centre_j + away[0], cell)
        path, _ = roll(self.problem, self.choices, self.reach, value, grid)
        control = self.choices.control[path]
        cost_kg, _ = total_cost_kg(self.problem, control)
        if cost_kg < self.best_cost_kg:
            self.best_cost_kg, self.best_control = cost_kg, control


def solve(problem: Problem) -> Plan:
    """The cheapest rollout around the relaxation and the convex splits; its notes hold the relaxation's bound."""
    search = _Rollouts(problem)
    guess = one_price_dual(problem)[-1].price_kgpj
    relaxation = optimum(problem, hulls_of(search.choices), guess)
    price_path = search.follow(relaxation)
    split_kg, price, iterations, seen = None, relaxation.price_kgpj[-1], 0, set()
    while iterations < ITERATIONS_MAX:
        # A path of prices need not keep to the window; that of the best rollout does.
        paths = [price_path, problem.table.mode[search.best_control]]
        modes = next((path for path in paths if path.tobytes() not in seen), None)
        if modes is None:
            break
        seen.add(modes.tobytes())
        iterations += 1
        try:
            hulls = hulls_of(search.choices, modes)
            taken_j = switched_modes(problem.table, problem.start_mode, modes).energy_j
            solution = optimum(problem, hulls, guess, taken_j)
        except InfeasibleError:
            continue
        value_kg = solution.value_kg + _switching_kg(problem, modes)
        if split_kg is None or value_kg < split_kg:
            split_kg, price = value_kg, solution.price_kgpj[-1]
        price_path = search.follow(solution)
    notes = {
        "relaxation_kg": relaxation.bound_kg,
        "split_kg": split_kg,
        "iterations": iterations,
        "price_kgpj": float(price),
        "solver": SOLVER,
    }
    return Plan(search.best_control, notes)


def _switching_kg(problem: Problem, modes: Indices) -> float:
    return float(np.sum(switched_modes(problem.table, problem.start_mode, modes).kg))


def _mode_path(
    problem: Problem, choices: Choices, solution: Solution
) -> tuple[Indices, Array, Array]:
    """Modes (time,) of the shortest path under a solution's prices, the prices it took, its cost-to-go.

    Of the paths on both sides of the dual's top, the one whose energy departs less from the trajectory's.
    """
    energy_j = np.clip(solution.energy_j[:-1], *problem.window_j)
    drain_j = drain_at_j(problem, choices, energy_j)
    excess_j = drain_j + choices.spread(np.diff(solution.energy_j))
    worth = choices.spread(solution.price_kgpj) * excess_j
    rounding = _WORTH_ROUNDING * float(np.sum(step_maxima(choices, np.abs(worth))))
    before_kgpj = before_steps(solution.price_kgpj)
    try:
        top = dual(problem, choices, Priced(worth, before_kgpj, 0.0, 0.0, rounding))[-1].scale
    except InfeasibleError:
        top = 1.0
    found = []
    for scale in (top * (1 - _BESIDE_TOP), top * (1 + _BESIDE_TOP)):
        priced = choices.cost_kg + scale * worth
        _, path, to_go = shortest_path(choices, priced, scale * before_kgpj, problem.start_mode)
        taken_j = switched(problem.table, problem.start_mode, choices.control[path]).energy_j
        away_kg = float(np.sum(worth[path])) + float(np.sum(before_kgpj * taken_j))
        found.append((abs(away_kg), scale, path, to_go))
    _, scale, path, to_go = min(found, key=lambda item: item[:2])
    return problem.table.mode[choices.control[path]], scale * solution.price_kgpj, to_go
