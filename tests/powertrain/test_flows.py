"""Flows of a plan are those of the whole table, to the last bit, and a table does not hold them."""

import pickle
import tracemalloc

import numpy as np
import pytest

from hevopt import build_problem, load_architecture, load_cycle


@pytest.fixture(scope="module", params=["B", "C2", "E"])
def table(request):
    return build_problem(load_architecture(request.param), load_cycle("nedc"), levels=5).table


def test_flows_along_a_plan_are_those_of_its_controls(table):
    rng = np.random.default_rng(1)
    control = rng.integers(0, len(table.controls), len(table.step_s))
    along = table.flows.along(control)
    jumps = ["shafts_before_j", "shafts_start_j", "shafts_end_j", "spin_fuel_j", "spin_loss_j"]
    assert list(along) == [*table.flows, *jumps]
    for name, flow in table.flows.items():
        assert flow.shape == table.fuel_kg.shape
        assert np.array_equal(along[name], flow[np.arange(len(control)), control]), name


def test_flows_of_a_copy_are_the_same_and_no_other_name_is_known(table):
    copy = pickle.loads(pickle.dumps(table))
    for name in table.flows:
        assert np.array_equal(copy.flows[name], table.flows[name])
    with pytest.raises(KeyError):
        table.flows["tyre_power_w"]
    with pytest.raises(TypeError):
        table.flows["wheel_power_w"] = table.fuel_kg


def test_a_table_holds_little_more_than_what_strategies_read():
    car, cycle = load_architecture("C2"), load_cycle("nedc")
    build_problem(car, cycle)
    tracemalloc.start()
    table = build_problem(car, cycle).table
    held, _ = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert held < 6 * table.fuel_kg.nbytes
