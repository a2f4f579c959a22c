"""Cars driven along cycles that no plan of theirs follows, or that no plan follows to the end charge asked."""

import json
from dataclasses import replace

import numpy as np
import pytest
from forward.drives import ramp

from hevopt import InfeasibleError, drive, load_architecture, load_cycle
from hevopt.errors import EndChargeError
from hevopt.output.driven_tables import as_dict, change_text
from hevopt.powertrain.top_speed import top_speed_mps
from hevopt.studies.case import prepare
from hevopt.studies.planned import planned_for
from hevopt.studies.settings import Settings

SHORT = Settings(allow_shortfall=True)
# A kind of driveline each.
KINDS = {
    "A": "baseline", "C2": "conventional", "electric_compact": "ecms", "p4_diesel": "dp",
    "prius_1998": "conventional", "series_1500": "dp", "camry_2018": "baseline", "p0_48v": "a_ecms",
    "insight_2000": "ecms",
}  # fmt: skip


@pytest.mark.parametrize("name", KINDS)
def test_a_cycle_beyond_the_car_s_highest_speed_is_driven_on_and_marked(name):
    car, cycle = load_architecture(name), ramp(280 / 3.6, 55, 90)
    found = drive(car, cycle, KINDS[name], step_s=0.05)
    run = found.run
    assert any("trace missed" in mark for mark in found.marks)
    assert run.cycle is cycle and run.wanted_mps.max() == pytest.approx(280 / 3.6)
    assert np.isfinite(run.speed_mps).all() and np.isfinite(run.soc).all()
    assert max(run.residual.values()) < 1e-9
    # No part turns faster than it may, and the car gets somewhere.
    assert 100 / 3.6 < run.speed_mps.max() < 1.02 * top_speed_mps(car, 280 / 3.6)
    json.dumps(as_dict(found), allow_nan=False)


def test_a_car_s_highest_speed_is_that_of_the_part_that_turns_fastest():
    electric, diesel = load_architecture("electric_compact"), load_architecture("A")
    assert top_speed_mps(electric, 20.0) == 20.0
    assert top_speed_mps(electric, 100.0) < 100.0
    top = diesel.engine.speed_max_radps / diesel.gearbox.ratios[-1] * diesel.vehicle.tyre_radius_m
    assert top_speed_mps(diesel, 100.0) == pytest.approx(top, abs=0.25)


def test_a_single_sample_above_the_highest_speed_is_followed():
    """A step is driven at the mean of its ends."""
    car = load_architecture("A")
    top = top_speed_mps(car, 100.0)
    cycle = ramp(top - 3.0, 120, 200)
    speed = cycle.speed_mps.copy()
    peak = 150
    speed[peak] = top + 2.0
    found = planned_for(car, replace(cycle, speed_mps=speed), SHORT)
    assert found.marks == () and found.case.cycle.speed_mps.max() > top


def test_an_end_charge_that_no_plan_reaches_is_a_lower_one():
    climb = ramp(14.0, 20, 60, grade=0.3)
    car = load_architecture("p0_48v")
    with pytest.raises(EndChargeError, match="the end charge cannot be reached") as told:
        prepare(car, climb, SHORT)
    planned = planned_for(car, climb, SHORT)
    (mark,) = planned.marks
    assert mark.startswith("no plan ends at SOC 0.6000: driven by one that ends at 0.")
    end = planned.case.dp_trajectory.soc[-1]
    assert car.battery.soc_min < end < told.value.reachable_soc
    assert "end charge" in str(told.value) and told.value.exit_status == 3


def test_where_no_plan_can_be_had_the_message_says_of_what_and_why():
    """Listed gears belong to the cycle's own speeds."""
    base = load_cycle("nedc")
    gear, shut = np.where(base.speed_mps > 0, 1, 0), np.zeros(len(base.time_s), dtype=bool)
    wrong = replace(base, gear=gear, clutch_open=shut)
    with pytest.raises(InfeasibleError) as told:
        drive(load_architecture("A"), wrong, "baseline")
    first = told.value.headline
    assert first.startswith(
        "A cannot be driven along nedc, as there is no plan to drive by: architecture A"
    )


@pytest.mark.parametrize("name", ["C2", "electric_compact", "p2_plug_in"])
def test_down_a_slope_nothing_burns_and_no_share_is_told(name):
    found = drive(load_architecture(name), ramp(14.0, 20, 60, grade=-0.2), "ecms", step_s=0.05)
    assert found.change_percent is None and found.difference_percent == {}
    assert "no share can be told" in change_text(found)
    assert json.loads(json.dumps(as_dict(found), allow_nan=False))["change_percent"] is None


def test_where_neither_run_burns_energy_from_the_battery_is_compared():
    found = drive(load_architecture("p2_plug_in"), ramp(14.0, 20, 60), "ecms", step_s=0.05)
    assert found.run.fuel_kg == 0 and not found.burns
    own, twin = found.electricity_kwh_per_100km, found.backward.electricity_kwh_per_100km
    assert found.change_percent == pytest.approx(100 * (own / twin - 1))
    assert sum(found.difference_percent.values()) == pytest.approx(found.change_percent, abs=1e-6)
    assert "energy from the battery" in change_text(found)
