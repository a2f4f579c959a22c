"""Which choices a bound must count, and what they drain: but for their costs the same under every objective."""

import numpy as np

from hevopt.problem import battery as battery_model
from hevopt.problem.arrays import Array, Flags
from hevopt.problem.choices import Choices, choices_of, kept, undominated_choices, without_dominated
from hevopt.problem.once import once
from hevopt.problem.problem import Problem

# A move this share beyond the window is beyond it, whatever rounding did to it.
_WELL_BEYOND = 1e-6


@once
def bounded_choices(problem: Problem) -> Choices:
    """The choices that a bound must count: all but those that leave the window whatever the charge before.

    A discharge drains at least what it does at the highest voltage and lowest resistance, a charge stores at least
    what it does at the lowest and the highest: one that moves more than the window's width is in no plan.
    """
    beyond = _in_no_plan(problem.origin)
    return kept(choices_of(problem), ~beyond) if beyond.any() else choices_of(problem)


@once
def undominated_bounded(problem: Problem) -> Choices:
    """Those of `bounded_choices` that no other of their step and mode beats in cost and power."""
    bounded = bounded_choices(problem)
    every = bounded is choices_of(problem)
    return undominated_choices(problem) if every else without_dominated(bounded)


@once
def _in_no_plan(problem: Problem) -> Flags:
    """(entry,) whether a choice leaves the window whatever the charge before, which no cost changes."""
    choices, pack = choices_of(problem), problem.battery
    inside, (low, high) = pack.within_window(), pack.granted_window_j
    least_j = least_drain_j(problem, choices)
    stored_w = battery_model.chemical_power_w(
        pack, np.minimum(choices.power_w, 0.0), inside.open_circuit_v.min(), inside.charge_ohm.max()
    )
    stored_j = -stored_w * choices.spread(choices.step_s)
    beyond: Flags = np.maximum(least_j, stored_j) > (high - low) * (1 + _WELL_BEYOND)
    return beyond


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
