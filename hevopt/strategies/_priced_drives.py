"""Drives under prices: each step takes least cost + price x (fall of stored energy); see ecms.py."""

from typing import NamedTuple

import numpy as np

from hevopt.bounds._prices_kernels import priced_path
from hevopt.bounds.bounded import drain_at_j
from hevopt.bounds.prices import before_steps
from hevopt.problem import battery as battery_model
from hevopt.problem.arrays import Array, Indices
from hevopt.problem.choices import choices_of
from hevopt.problem.once import once
from hevopt.problem.problem import Problem
from hevopt.problem.simulation import total_cost_kg
from hevopt.problem.switching import Switched, switched
from hevopt.strategies._rollout import reach_of, roll
from hevopt.strategies._rollout_kernels import Grid

_ENERGY_ROUNDING = 1e-12


class PricedDrive(NamedTuple):
    """A drive. factor: its price at the start; surplus_j: what it leaves beyond the asked end charge

    path: (time,) entries; energy_j: (time + 1,) stored; to_go_kg: (time + 1, mode) cost to go that it followed
    """

    factor: float
    surplus_j: float
    path: Indices
    energy_j: Array
    to_go_kg: Array


class PricedDrives:
    """Drives of one problem, and the cheapest of them that ends with enough charge."""

    def __init__(self, problem: Problem) -> None:
        self.problem = problem
        self.choices = choices_of(problem)
        self.bound_reach = reach_of(problem, problem.end_min_j)
        self.free_reach = reach_of(problem, problem.window_j[0])
        self.drain_j = _drain_at_start_j(problem.origin)
        self.best_cost_kg = np.inf
        self.best_control, self.best_prices = np.empty(0, np.int64), (np.nan, np.nan)

    def under(self, price_kgpj: float | Array, *, to_the_end: bool = False) -> PricedDrive:
        """The drive under a price, or (time,) prices; `to_the_end`: never below the asked end charge."""
        low, high = self.problem.window_j
        prices = price_kgpj * np.ones(self.choices.steps)
        to_go = self._to_go_kg(prices)
        value = to_go[:, :, None] - _of_step(prices) * np.array([low, high])
        grid = Grid(np.full(self.choices.steps + 1, low), high - low)
        path, energy_j = self._tried(prices, value, grid, to_the_end=to_the_end)
        surplus_j = float(energy_j[-1]) - self.problem.end_min_j
        return PricedDrive(float(prices[0]), surplus_j, path, energy_j, to_go)

    def follow(self, price_kgpj: Array, energy_j: Array, pull_kgpj: float) -> None:
        """Try (time,) prices, charge being drawn to (time + 1,) energies by a price on the distance from them."""
        low, high = self.problem.window_j
        nodes = energy_j[:, None] + (high - low) * np.array([-1.0, 0.0, 1.0])
        value = self._to_go_kg(price_kgpj)[:, :, None] - _of_step(price_kgpj) * nodes[:, None]
        value += pull_kgpj * np.abs(nodes - energy_j[:, None])[:, None]
        grid = Grid(nodes[:, 0], high - low)
        self._tried(price_kgpj, value, grid, to_the_end=True)

    def switches(self, drive: PricedDrive) -> Switched:
        """What a drive switches."""
        return switched(
            self.problem.table, self.problem.start_mode, self.choices.control[drive.path]
        )

    def falls_j(self, entry: Indices, steps: Indices, energy_j: Array) -> Array:
        """Fall of stored energy with some entries, at their steps and stored energies."""
        pack, power_w = self.problem.battery, self.choices.power_w[entry]
        _, voltage, discharge, charge = battery_model.states(pack, energy_j)
        ohm = np.where(power_w < 0, charge, discharge)
        drain_w = battery_model.chemical_power_w(pack, power_w, voltage, ohm)
        return self.choices.step_s[steps] * drain_w

    def _to_go_kg(self, price_kgpj: Array) -> Array:
        """(time + 1, mode) cost to go under prices; 0 for a mode without a way on, into which no reach leads."""
        before_kgpj = before_steps(price_kgpj)
        _, _, to_go = priced_path(
            self.choices, self.drain_j, price_kgpj, before_kgpj, self.problem.start_mode
        )
        return np.where(np.isfinite(to_go), to_go, 0.0)

    def _tried(
        self, price_kgpj: Array, value: Array, grid: Grid, *, to_the_end: bool
    ) -> tuple[Indices, Array]:
        """The rollout that follows a value function, kept where it is the cheapest with enough charge."""
        choices, high = self.choices, self.problem.window_j[1]
        reach = self.bound_reach if to_the_end else self.free_reach
        path, energy_j = roll(self.problem, choices, reach, value, grid)
        if to_the_end or energy_j[-1] - self.problem.end_min_j >= -_ENERGY_ROUNDING * high:
            control = choices.control[path]
            cost_kg, _ = total_cost_kg(self.problem, control)
            if cost_kg < self.best_cost_kg:
                self.best_cost_kg, self.best_control = cost_kg, control
                self.best_prices = float(price_kgpj[0]), float(price_kgpj[-1])
        return path, energy_j


@once
def _drain_at_start_j(problem: Problem) -> Array:
    """(entry,) fall of stored energy at the start's, which no cost changes."""
    return drain_at_j(problem, choices_of(problem), problem.start_j)


def _of_step(price_kgpj: Array) -> Array:
    """(time + 1, 1, 1) prices before the first step and after each."""
    prices: Array = np.concatenate([price_kgpj[:1], price_kgpj])[:, None, None]
    return prices
