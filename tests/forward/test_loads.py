"""Electric load of a driven car, of its cycle or by the engine's state; and a converter before the bus."""

from dataclasses import replace

import numpy as np
import pytest
from forward.drives import STRATEGY, constant, follow, ramp

from hevopt import build_problem, drive, load_architecture, performance
from hevopt.car.handling import DriverGains, Handling
from hevopt.forward.limits import limits_of
from hevopt.forward.lines import line_of
from hevopt.forward.plans import replay_of
from hevopt.output.driven_tables import audit
from hevopt.problem.simulation import simulate
from hevopt.strategies import STRATEGIES
from hevopt.studies.case import prepare
from hevopt.studies.solved import run_case


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


CONVERTER = {"converter.power_w": [0, 4000, 30000], "converter.efficiency": [0.9, 0.96, 0.94]}


@pytest.mark.parametrize("name", ["C2", "electric_compact"])
def test_a_converter_between_battery_and_bus_loses_what_its_curve_says(name):
    road = ramp(15, 8, 40)
    car, plan = steady_plan(name, road, **CONVERTER)
    run = follow(car, road, plan)
    assert max(run.residual.values()) < 1e-9
    flows = run.books.flows
    bus = flows["machine_electric_w"] + flows["auxiliary_power_w"] + flows["starter_electric_w"]
    share = np.interp(
        np.abs(bus), CONVERTER["converter.power_w"], CONVERTER["converter.efficiency"]
    )
    by_hand = np.where(bus > 0, bus / share, bus * share)
    assert flows["battery_power_w"] == pytest.approx(by_hand, rel=1e-12)
    assert flows["converter_loss_w"] == pytest.approx(by_hand - bus, rel=1e-9, abs=1e-9)
    found = audit(run)
    assert found["converter"] == pytest.approx(-float((by_hand - bus).sum()) * run.step_s)
    assert abs(sum(found.values())) < 1e-9 * sum(map(abs, found.values()))
    # The loop's own charge, which limits and feedback see, is that of the books but for its tabulated loss.
    recorded = follow(load_architecture(name), road, plan)
    assert recorded.energy_j[-1] > run.energy_j[-1]


@pytest.mark.parametrize("name", ["C2", "electric_compact"])
def test_at_constant_speed_a_converter_passes_what_it_does_backward(name):
    car, cycle = load_architecture(name, CONVERTER), constant(70)
    run = drive(car, cycle, "dp", handling=Handling(driver=DriverGains(charge_per_s=0.0))).run
    backward = run_case(prepare(car, cycle), "dp")[2].flows
    for flow in ("machine_electric_w", "converter_loss_w", "fuel_power_w"):
        assert run.books.flows[flow][-1] == pytest.approx(backward[flow][-1], rel=1e-9, abs=1e-9)


def test_full_pedal_takes_what_the_converter_loses_as_well():
    plain = performance(load_architecture("electric_compact"))
    behind = performance(load_architecture("electric_compact", {"converter.efficiency": 0.9}))
    assert behind.to_speed_s[60] == pytest.approx(plain.to_speed_s[60], rel=1e-3)
    assert behind.to_100_j == pytest.approx(plain.to_100_j / 0.9, rel=0.02)


def test_cars_of_another_mass_share_the_tables_of_machine_and_battery():
    car = load_architecture("C2")
    one, other = limits_of(car), limits_of(car.of_mass(1500.0))
    assert one.loss_w is other.loss_w and one.high_nm is other.high_nm
    loaded = limits_of(car, (0.0, 5e3))
    assert loaded.high_nm is not one.high_nm and (loaded.high_nm <= one.high_nm).all()
    weaker = replace(car, battery=replace(car.battery, power_max_discharge_w=5e3))
    assert (limits_of(weaker).high_nm[400:800] < one.high_nm[400:800]).all()
