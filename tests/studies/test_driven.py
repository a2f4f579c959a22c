"""A driven plan beside its backward twin."""

import numpy as np
import pytest
from forward.drives import driven

from hevopt.output.driven_tables import audit, twin_table
from hevopt.studies.driven import KINDS


@pytest.mark.parametrize("name", ["A", "C1", "E"])
def test_differences_by_kind_of_step_add_up_to_the_whole(name):
    found = driven(name)
    assert tuple(found.difference_percent) == KINDS
    assert sum(found.difference_percent.values()) == pytest.approx(found.change_percent, abs=0.05)


@pytest.mark.parametrize("name", ["A", "C1", "E"])
def test_what_came_in_is_what_went_out(name):
    found = audit(driven(name).run)
    assert abs(sum(found.values())) < 1e-9 * found["fuel"]


def test_without_an_engine_what_differs_is_the_energy_from_the_battery():
    found = driven("electric_compact")
    run = found.run
    taken = (run.energy_j[0] - run.energy_j[-1]) / 3.6e6 / (run.distance_m / 1e5)
    assert found.electricity_kwh_per_100km == pytest.approx(taken)
    assert found.fuel_l_per_100km == 0
    assert found.corrected_l_per_100km is None and found.bound_l_per_100km is None
    backward = found.backward.electricity_kwh_per_100km
    assert found.change_percent == pytest.approx(100 * (taken / backward - 1))
    assert sum(found.difference_percent.values()) == pytest.approx(found.change_percent, abs=0.05)
    assert found.asked is None and found.marks == ()


def test_the_bound_is_that_of_the_runs_own_end_charge():
    found = driven("C2")
    assert found.bound_l_per_100km == pytest.approx(found.backward.bound_l_per_100km, rel=2e-3)
    assert found.charge_error == pytest.approx(found.run.soc[-1] - found.backward.soc_end, abs=1e-9)
    assert np.isfinite(found.change_percent)


def test_without_an_engine_no_column_of_fuel_is_shown():
    def heads(name):
        return [str(column.header).split("\n")[0] for column in twin_table(driven(name)).columns]

    assert heads("electric_compact") == ["", "battery", "SOC", "status"]
    assert heads("C2") == [
        "", "fuel", "corrected", "battery", "NOx", "SOC", "starts", "status",
    ]  # fmt: skip
