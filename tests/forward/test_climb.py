"""Launches that ask for more than the engine has at idle speed, and gears of a car that its trace left behind."""

import numpy as np
import pytest
from forward.drives import ramp

from hevopt import drive, load_architecture
from hevopt.studies.driven import DrivenPlan


def climbed(name: str, grade: float) -> DrivenPlan:
    return drive(
        load_architecture(name), ramp(50 / 3.6, 20, 50, grade=grade), "baseline", step_s=0.02
    )


def test_the_engine_speeds_up_for_a_launch_that_idle_speed_cannot_carry():
    """On 35 % its torque at idle speed holds the car and hardly more; full load would take it uphill at 60 km/h."""
    found = climbed("A", 0.35)
    run, flows = found.run, found.run.books.flows
    moves = int(np.argmax(run.speed_mps > 0))
    engine = flows["engine_speed_radps"]
    idle = run.car.engine.idle_radps
    assert engine[moves : moves + 100].max() > 1.1 * idle
    # Two seconds after it has moved off it is faster than idle torque could have made it.
    assert run.speed_mps[moves + 150] > 1.0
    assert max(run.residual.values()) < 1e-9


@pytest.mark.parametrize("grade", [0.0, 0.1])
def test_a_launch_that_idle_speed_carries_is_at_idle_speed(grade):
    run = climbed("A", grade).run
    slips = run.books.flows["clutch_launch_w"] > 0
    assert slips.any()
    idle = run.car.engine.idle_radps
    assert run.books.flows["engine_speed_radps"][slips].max() < (1.01 if grade == 0 else 1.5) * idle


def test_no_gear_is_changed_up_to_in_which_the_engine_would_idle():
    run = climbed("A", 0.35).run
    gearbox, radius = run.car.gearbox, run.car.vehicle.tyre_radius_m
    changes = np.flatnonzero(np.diff(run.gear) > 0)
    up = [k for k in changes if run.speed_mps[k + 1] > 0]
    assert up
    for k in up:
        turns = gearbox.ratios[run.gear[k + 1]] * run.speed_mps[k + 1] / radius
        assert turns > 0.99 * run.car.engine.idle_radps
    # It gets somewhere: left to the plan's gears it stood still in second.
    assert run.speed_mps[-1] > 2.0
