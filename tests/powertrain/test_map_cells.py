"""What is claimed between levels where engine and machine are measured maps, against tables of many more levels."""

from dataclasses import replace
from unittest import mock

import numpy as np
import pytest
from between import DRIVES, dense_below, part

from hevopt import build_problem, certify, load_architecture, simulate, solve
from hevopt.bounds.claim import Scope
from hevopt.bounds.step_prices import dual_of_shape
from hevopt.car.engine_laws import EngineMap
from hevopt.car.grid import interpolated
from hevopt.car.machine_laws import LossMap
from hevopt.powertrain import knots, levels


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
    monkeypatch.setattr(levels, "knots_nm", none)
    assert build_problem(mapped("C2", machine=False), part(*DRIVES["C2"])).table.cells() is None
    _, found = below("C2", mapped("C2", engine=False))
    assert found.below > 1e-8


def test_knots_two_per_cent_off_would_be_noticed(monkeypatch):
    found = levels.knots_nm
    monkeypatch.setattr(levels, "knots_nm", lambda here, name: 1.02 * found(here, name))
    assert build_problem(mapped("C2", machine=False), part(*DRIVES["C2"])).table.cells() is None
    _, found_below = below("C2", mapped("C2", engine=False))
    assert found_below.below > 1e-8


def test_a_map_whose_engine_has_no_data_where_a_level_stands_is_not_claimed_to_have():
    """The corner that was not measured is no part of a cell: no bound counts a torque in it."""
    problem, _ = below("C2", mapped("C2", noise=0.0))
    split = problem.table.cells()
    assert np.isfinite(split.fuel_kg).all() and np.isfinite(split.power_w).all()


def test_every_knot_within_what_is_open_is_a_level_that_a_plan_may_choose():
    car = mapped("E", noise=0.0)
    table = build_problem(car, part(*DRIVES["E"])).table
    checked = 0
    for branch in table.flows.branches:
        for piece in branch.pieces:
            (name, torque), step = next(iter(piece.given.items())), piece.here.shafts.step
            given = torque[:, :-1] if name not in piece.here.machines else torque
            found = knots.knots_nm(piece.here, name)
            assert found.shape[1] <= knots.knot_count(car, engine_on=branch.state.engine_on)
            inside = (found > given.min(1)[:, None]) & (found < given.max(1)[:, None])
            there = (torque[:, None, :] == found[:, :, None]).any(axis=2)
            assert len(step) == len(found) and there[inside].all()
            checked += int(inside.sum())
    assert checked > 500


def test_maps_bend_and_end_at_their_knots_and_nowhere_else():
    """Of a map with scatter, sampled densely at random speeds: second differences, and where data begin or end."""
    rng = np.random.default_rng(4)
    speed, torque = np.sort(rng.uniform(50, 500, 7)), np.linspace(-30.0, 200.0, 9)
    for _ in range(20):
        values = rng.uniform(1.0, 2.0, (7, 9))
        values[rng.uniform(size=values.shape) < 0.2] = np.nan
        at = rng.uniform(speed[0], speed[-1], 20)
        found = knots._rows_nm(speed, torque, knots._edges(values), at)
        fine = np.sort(rng.uniform(torque[0], torque[-1], (len(at), 4000)), axis=1)
        seen = interpolated(speed, torque, values, fine, at[:, None] + 0 * fine)
        slope = np.diff(seen, axis=1) / np.diff(fine, axis=1)
        bends = np.abs(np.diff(slope, axis=1)) > 1e-4
        state, k = np.nonzero(bends)
        assert len(state)
        beside = (found[state] >= fine[state, k, None]) & (found[state] <= fine[state, k + 2, None])
        assert beside.any(axis=1).all()
        state, k = np.nonzero(np.isnan(seen[:, 1:]) != np.isnan(seen[:, :-1]))
        beside = (found[state] >= fine[state, k, None] - 1e-6) & (
            found[state] <= fine[state, k + 1, None] + 1e-6
        )
        assert beside.any(axis=1).all()


def test_knots_as_levels_leave_a_plan_less_to_miss():
    car, drive = mapped("C2", noise=0.03), part(*DRIVES["C2"])
    gaps = []
    for count in (knots.knot_count, lambda car, engine_on: 0):
        with mock.patch.object(levels, "knot_count", count):
            problem = build_problem(car, drive)
        plan = simulate(problem, solve(problem).control)
        gaps.append(plan.cost_kg)
    assert gaps[0] < gaps[1] * (1 - 1e-5)
