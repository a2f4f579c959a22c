"""Factors that jump where the charge window binds."""

import numpy as np
import pytest

from hevopt import build_problem, certify, load_architecture, load_cycle, simulate, solve
from hevopt.bounds.bounded import drain_at_j
from hevopt.bounds.segments import segments
from hevopt.problem.choices import choices_of
from hevopt.strategies import ecms


@pytest.fixture(scope="module")
def small():
    car = load_architecture("C2", {"battery.capacity_ah": 1.75})
    return build_problem(car, load_cycle("nedc"), levels=11)


def test_a_small_battery_costs_per_cents_and_no_longer_ten(small):
    rollout = simulate(small, solve(small).control)
    certificate = certify(small, rollout)
    run = simulate(small, ecms.solve(small).control)
    bound_kg, _ = certificate.bound_kg(run.end_j)
    assert 1 - 1e-12 < run.cost_kg / bound_kg < 1.025


def test_prices_jump_at_the_windows_limits_and_nowhere_else(small):
    choices = choices_of(small)
    drain_j = drain_at_j(small, choices, small.start_j)
    found = segments(small, choices, drain_j, 6e-8)
    low, high = small.window_j
    jumps = np.flatnonzero(np.diff(found.price_kgpj)) + 1
    assert found.cuts > 0 and len(jumps) > 0
    slack = 1e-5 * (high - low)
    touched = np.minimum(found.energy_j[jumps] - low, high - found.energy_j[jumps])
    assert (touched < slack).all()
    assert (found.energy_j >= low).all() and (found.energy_j <= high).all()
