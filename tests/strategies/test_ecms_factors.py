"""The search for the factors of ecms, against plain halving."""

import numpy as np
import pytest

from hevopt import build_problem, load_architecture, load_cycle
from hevopt.bounds.prices import one_price_dual
from hevopt.strategies import ecms
from hevopt.strategies._priced_drives import PricedDrives


class _Told(PricedDrives):
    """Drives, and what each of them left: (steps before the price changes first, surplus)."""

    def __init__(self, problem):
        super().__init__(problem)
        self.told = []

    def under(self, price_kgpj, *, to_the_end=False):
        drive = super().under(price_kgpj, to_the_end=to_the_end)
        if not to_the_end:
            self.told.append((int(np.argmax(price_kgpj != drive.factor)), drive.surplus_j))
        return drive


@pytest.fixture(scope="module", params=["B", "C2", "E"])
def found(request):
    problem = build_problem(load_architecture(request.param), load_cycle("udds"), levels=7)
    drives = _Told(problem)
    guess = one_price_dual(problem)[-1].price_kgpj
    return problem, drives, ecms._neutral_factors(drives, guess)


def test_neighbouring_factors_are_those_of_halving(found):
    problem, drives, (cheap, dear) = found
    assert cheap.surplus_j < 0 <= dear.surplus_j
    assert 0 < dear.factor - cheap.factor <= 1e-7 * dear.factor
    assert len(drives.told) <= 20
    halved, least, most = PricedDrives(problem), 0.9 * cheap.factor, 1.1 * dear.factor
    while most - least > 1e-7 * most:
        middle = (least + most) / 2
        least, most = (least, middle) if halved.under(middle).surplus_j >= 0 else (middle, most)
    assert most == pytest.approx(dear.factor, rel=3e-7)
    np.testing.assert_array_equal(halved.under(least).path, cheap.path)
    np.testing.assert_array_equal(halved.under(most).path, dear.path)


@pytest.mark.parametrize("cheap_first", [False, True])
def test_factors_change_once_between_steps_that_leave_less_charge_and_enough(found, cheap_first):
    problem, _, (cheap, dear) = found
    before, after = (cheap, dear) if cheap_first else (dear, cheap)
    drives, apart = _Told(problem), np.flatnonzero(before.path != after.path)
    ecms._change_once(drives, before, after)
    assert len(drives.told) <= 2 + 2 * np.log2(1 + len(apart))
    left_j = {0: after.surplus_j, len(apart): before.surplus_j}
    left_j |= {int(np.searchsorted(apart, until)): surplus for until, surplus in drives.told}
    assert any(left_j[n] * left_j.get(n + 1, left_j[n]) < 0 for n in left_j)
    assert drives.best_cost_kg < np.inf
