"""A driven plan beside its backward twin."""

import numpy as np
import pytest
from forward.drives import driven

from hevopt import DataError, drive, load_architecture, load_cycle
from hevopt.car.handling import DriverGains, Handling
from hevopt.forward.asked import Asking
from hevopt.output.driven_tables import audit, twin_table
from hevopt.studies.driven import KINDS, WAY


@pytest.mark.parametrize(
    ("name", "cycle"),
    [
        ("A", "nedc"),
        ("C1", "nedc"),
        ("E", "nedc"),
        ("electric_compact", "nedc"),
        ("A", "us06"),
        ("p0_48v", "udds"),
        ("camry_2018", "us06"),
        ("prius_1998", "nedc"),
        ("p4_diesel", "udds"),
    ],
)
def test_differences_by_kind_of_step_and_of_the_way_add_up_to_the_whole(name, cycle):
    """To rounding: of a trace that is missed, and of fuel that no map knows, as well."""
    found = driven(name, cycle)
    assert tuple(found.difference_percent) == (*KINDS, WAY)
    total = sum(found.difference_percent.values())
    assert total == pytest.approx(found.change_percent, abs=1e-6)


def test_a_launch_by_torque_converter_is_one():
    """Cycle steps in which a car at rest is wanted moving are standing ones, launches, or changes of gear."""
    found = driven("camry_2018", "udds")
    run, flows = found.run, found.run.books.flows
    assert abs(found.difference_percent["launch"]) > 0.01
    lost = flows["torque_converter_launch_w"] + flows["torque_converter_other_w"]
    assert (lost == flows["torque_converter_loss_w"]).all()
    launching = flows["torque_converter_launch_w"] > 0
    # Slower than idle speed in first gear, and no slower from step to step.
    first = run.car.gearbox.ratios[1] / run.car.vehicle.tyre_radius_m
    assert (
        first * run.speed_mps[1:][launching & (run.gear == 1)]
    ).max() < 1.01 * run.car.engine.idle_radps
    assert (np.diff(run.speed_mps)[launching] >= 0).all()
    begins = np.flatnonzero((run.speed_mps[:-1] == 0) & (run.speed_mps[1:] > 0))
    assert len(begins) > 10 and all(launching[k : k + 200].any() for k in begins)
    audited = audit(run)
    both = audited["torque converter, launches"] + audited["torque converter, else"]
    assert both == pytest.approx(-np.sum(lost) * run.step_s)


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
    assert sum(found.difference_percent.values()) == pytest.approx(found.change_percent, abs=1e-6)
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


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"step_s": 0.5}, "step 0.5 s; allowed: 0.001 to 0.1 s"),
        ({"step_s": float("nan")}, "step nan s"),
        ({"handling": Handling(driver=DriverGains(900.0))}, "swings ever more"),
        ({"asking": Asking(dwell_s=-1.0)}, "dwell -1 s; allowed: 0 to 60 s"),
        ({"strategy": "dq"}, "close matches: dp"),
    ],
)
def test_what_cannot_be_driven_is_told_before_anything_is_solved(options, message, monkeypatch):
    monkeypatch.setattr("hevopt.studies.planned.prepare", lambda *_: pytest.fail("it is solved"))
    with pytest.raises(DataError, match=message):
        drive(load_architecture("C2"), load_cycle("nedc"), **options)
