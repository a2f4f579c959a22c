"""Electric load of a driven car: as the cycle lists it, or by the engine's state."""

from dataclasses import replace

import numpy as np
import pytest
from forward.drives import STRATEGY, follow, ramp

from hevopt import build_problem, load_architecture
from hevopt.forward.lines import line_of
from hevopt.forward.plans import replay_of
from hevopt.problem.simulation import simulate
from hevopt.strategies import STRATEGIES


def loaded(cycle, watts):
    """A cycle that lists the electric load."""
    load = np.broadcast_to(np.asarray(watts, dtype=float), cycle.time_s.shape)
    return replace(cycle, auxiliary_w=np.array(load))


def steady_plan(name, cycle, **changes):
    car = load_architecture(name, changes)
    problem = build_problem(car, cycle, allow_shortfall=True)
    control = STRATEGIES[STRATEGY.get(name, "conventional")].solve(problem).control
    return car, replay_of(simulate(problem, control), line_of(car))


@pytest.mark.parametrize("name", ["A", "C2"])
def test_a_load_that_a_cycle_lists_is_drawn(name):
    """The car's own load, listed, is the car's own load; another one is drawn step by step, all of it booked."""
    road = ramp(12, 8, 40)
    car, plan = steady_plan(name, road)
    own = follow(car, road, plan)
    same = follow(car, loaded(road, car.vehicle.auxiliary_power_w), plan)
    assert same.fuel_kg == own.fuel_kg and same.energy_j[-1] == own.energy_j[-1]
    watts = np.where(road.time_s < 20, 200.0, 1500.0)
    run = follow(car, loaded(road, watts), plan)
    drawn = run.books.flows["auxiliary_power_w"]
    assert drawn.sum() * run.step_s == pytest.approx(200 * 20 + 1500 * 20, rel=1e-9)
    assert max(run.residual.values()) < 1e-9
    if name == "A":  # its alternator follows the load as soon as the engine turns
        flows = run.books.flows
        turns = flows["engine_speed_radps"] > 0.4 * car.engine.idle_radps
        left = flows["machine_electric_w"] + drawn
        # Its torque is that of the speed at a step's beginning, which moves on within it.
        assert np.abs(left[turns]).max() < 0.005 * 1500


def test_a_load_by_the_engines_state_is_drawn_while_it_rests():
    road = ramp(12, 8, 40)
    car, plan = steady_plan("C2", road, **{"car.auxiliary_off_power_w": 50.0})
    run = follow(car, road, plan)
    rests = run.engine == 0
    drawn = run.books.flows["auxiliary_power_w"]
    assert rests.any() and (drawn[rests] == 50.0).all()
    assert (drawn[~rests] == car.vehicle.auxiliary_power_w).all() and max(
        run.residual.values()
    ) < 1e-9
