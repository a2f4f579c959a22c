"""Every shipped car on every shipped cycle, driven."""

import numpy as np
import pytest
from benchmarks.driven import CYCLES, LIMIT, driven_plan, every_car


@pytest.mark.long
@pytest.mark.parametrize("cycle", CYCLES)
@pytest.mark.parametrize("car", every_car())
def test_every_component_balances_and_causes_sum_to_the_difference(car, cycle):
    found = driven_plan(car, cycle)
    assert max(found.run.residual.values()) < LIMIT
    assert np.isfinite(found.run.speed_mps).all() and np.isfinite(found.run.soc).all()
    total = sum(found.difference_percent.values())
    assert total == pytest.approx(found.change_percent, abs=1e-6)
