"""What is claimed between levels where engine and machine are measured maps, against tables of many more levels."""

from dataclasses import replace

import numpy as np
import pytest
from between import DRIVES, dense_below, part

from hevopt import build_problem, certify, load_architecture, simulate, solve
from hevopt.bounds.certificate import Scope
from hevopt.bounds.step_prices import dual_of_shape
from hevopt.car.engine_laws import EngineMap
from hevopt.car.machine_laws import LossMap
from hevopt.powertrain import cells


def engine_map(engine, rng, noise):
    """A bench of 9 x 12 points, corners missing: none of it convex."""
    speed = np.linspace(70.0, engine.speed_max_radps, 9)
    torque = np.linspace(-40.0, 1.05 * float(engine.full_load_torque_nm.max()), 12)
    at = torque + 0 * speed[:, None], speed[:, None] + 0 * torque
    scatter = 1 + noise * rng.normal(size=(2, *at[0].shape))
    fuel = np.maximum(engine.fuel_kgps(*at), 2e-6 * (1 + at[1] / 300)) * scatter[0]
    nox = np.maximum(engine.nox_kgps(*at), 1e-9) * scatter[1]
    fuel[-1, -3:] = fuel[-2, -1] = fuel[0, -4:] = np.nan
    return EngineMap(
        speed, torque, fuel, np.where(np.isnan(fuel), np.nan, nox), engine.drag_nm(speed)
    )


def loss_map(machine, rng, noise):
    speed = np.linspace(0.0, 1.01 * min(machine.speed_max_radps, 2500.0), 8)
    most = 1.01 * min(machine.torque_max_nm, machine.power_max_w / 20)
    torque = np.linspace(-most, most, 13)
    loss = machine.loss_w(torque + 0 * speed[:, None], speed[:, None] + 0 * torque) + 20
    loss *= 1 + noise * rng.normal(size=loss.shape)
    loss[-1, :2] = loss[-1, -2:] = loss[-2, -1] = np.nan
    return LossMap(speed, torque, np.abs(loss))


def mapped(name, *, noise=0.1, engine=True, machine=True):
    car, rng = load_architecture(name), np.random.default_rng(2)
    if engine:
        car = replace(car, engine=replace(car.engine, law=engine_map(car.engine, rng, noise)))
    if machine:
        own = (replace(m, loss=loss_map(m, rng, noise)) for m in car.machines)
        car = replace(car, machines=tuple(own))
    return car


def below(name, car, weight=0.0, levels=321):
    """Problem, and what of a finer table lies below what its bound counts, at prices from nothing to everything."""
    cycle = part(*DRIVES[name])
    problem, fine = (
        build_problem(car, cycle, levels=n, nox_weight=weight, allow_shortfall=True)
        for n in (41, levels)
    )
    steps = np.ones(len(problem.table.step_s))
    prices = [price * steps for price in (0.0, 3e-8, 6e-8, 1e-7, 1e-5)]
    ends = [end * steps for end in problem.battery.granted_window_j]
    return problem, dense_below(problem, fine.table, prices, ends)


@pytest.mark.parametrize("name", ["B", "C2", "D", "E"])
@pytest.mark.parametrize("maps", [{}, {"machine": False}, {"engine": False}])
def test_no_torque_of_a_car_with_measured_maps_costs_less_than_its_bound_counts(name, maps):
    for weight in (0.0, 20.0) if not maps else (0.0,):
        _, found = below(name, mapped(name, **maps), weight)
        assert found.count > 50_000
        assert found.below <= 0


def test_the_bound_is_near_that_of_many_levels_and_speaks_of_every_split():
    car = mapped("C2", noise=0.03)
    problem, fine = (build_problem(car, part(*DRIVES["C2"]), levels=n) for n in (41, 641))
    plan = simulate(problem, solve(problem).control)
    certificate = certify(problem, plan, target_gap=1.0)
    assert certificate.scope is Scope.CONTINUOUS
    line = certificate.proofs["costate prices"][-1]
    dense_kg = max(found.value_kg for found in dual_of_shape(fine, plan, line.shape))
    assert dense_kg * (1 - 3e-4) < line.value_kg <= dense_kg


def test_maps_without_their_knots_would_be_noticed(monkeypatch):
    none = lambda here, name: np.zeros((len(here.shafts.step), 0))  # noqa: E731
    monkeypatch.setattr(cells, "knots_nm", none)
    assert build_problem(mapped("C2", machine=False), part(*DRIVES["C2"])).table.cells() is None
    _, found = below("C2", mapped("C2", engine=False))
    assert found.below > 1e-8


def test_knots_two_per_cent_off_would_be_noticed(monkeypatch):
    found = cells.knots_nm
    monkeypatch.setattr(cells, "knots_nm", lambda here, name: 1.02 * found(here, name))
    assert build_problem(mapped("C2", machine=False), part(*DRIVES["C2"])).table.cells() is None
    _, found_below = below("C2", mapped("C2", engine=False))
    assert found_below.below > 1e-8


def test_a_map_whose_engine_has_no_data_where_a_level_stands_is_not_claimed_to_have():
    """The corner that was not measured is no part of a cell: no bound counts a torque in it."""
    problem, _ = below("C2", mapped("C2", noise=0.0))
    split = problem.table.cells()
    assert np.isfinite(split.fuel_kg).all() and np.isfinite(split.power_w).all()
