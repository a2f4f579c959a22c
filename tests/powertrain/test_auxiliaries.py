"""Electric load over time and by the engine's state: by hand, in balance, and refused where it is not known."""

from dataclasses import replace

import numpy as np
import pytest

from hevopt import DataError, build_problem, load_architecture, load_cycle, simulate, solve
from hevopt.driving.cycle import cycle_of

NEDC = load_cycle("nedc")
PART = replace(
    NEDC,
    **{
        name: getattr(NEDC, name)[:196]
        for name in ("time_s", "speed_mps", "grade", "gear", "clutch_open")
    },
)
C2 = load_architecture("C2")


def problem_of(car=C2, cycle=PART):
    return build_problem(car, cycle, levels=7)


def with_load(load_w):
    return replace(PART, auxiliary_w=np.broadcast_to(load_w, len(PART.time_s)))


def test_the_cars_own_load_over_time_is_the_same_table():
    one, other = problem_of().table, problem_of(cycle=with_load(250.0)).table
    for name in ("fuel_kg", "battery_power_w", "reject"):
        assert np.array_equal(getattr(one, name), getattr(other, name))


def test_a_load_over_time_is_what_the_battery_or_the_machine_supplies():
    load = np.where(np.arange(len(PART.time_s)) < 100, 100.0, 900.0)
    problem = problem_of(cycle=with_load(load))
    off = np.array([not c.engine_on for c in problem.table.controls])
    standing = problem.table.signals.speed_mps == 0
    for k in np.flatnonzero(standing):
        usable = problem.table.feasible[k] & off
        assert np.allclose(problem.table.battery_power_w[k, usable], load[k])
    run = simulate(problem, solve(problem).control)
    assert np.array_equal(run.flows["auxiliary_power_w"], load[:-1])
    assert max(np.abs(residual).max() for residual in run.residuals.values()) < 1e-6
    idle = [n for n, c in enumerate(problem.table.controls) if c.level == "battery idle"]
    supplied = problem.table.battery_power_w[:, idle][problem.table.feasible[:, idle]]
    # Where the machine turns too slowly for the load, it gives nothing.
    assert np.mean(np.abs(supplied) < 1e-6) > 0.9


def test_a_load_of_its_own_holds_while_the_engine_is_at_rest():
    car = load_architecture("C2", {"car.auxiliary_off_power_w": 40.0})
    table, before = problem_of(car).table, problem_of().table
    on = np.array([c.engine_on for c in table.controls])
    assert np.array_equal(table.battery_power_w[:, on], before.battery_power_w[:, on])
    both = table.feasible & before.feasible & ~on
    saved = before.battery_power_w[both] - table.battery_power_w[both]
    assert len(saved) > 100 and np.allclose(saved, 210.0)


@pytest.mark.parametrize(("cell", "words"), [("-1", "auxiliary_power_w"), ("nan", "not a number")])
def test_a_wrong_load_is_a_message_with_its_line(tmp_path, cell, words):
    text = f"time_s,speed_kmh,auxiliary_power_w\n0,0,300\n1,10,{cell}\n2,20,300\n"
    with pytest.raises(DataError, match="line 3") as found:
        cycle_of(tmp_path / "own.csv", text)
    assert words in str(found.value)
