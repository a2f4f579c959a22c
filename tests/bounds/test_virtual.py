"""Virtual controls and what arrays say of what lies between their controls."""

import numpy as np
import pytest
from proofs.draw import draw
from proofs.split import split_faults

from hevopt import (
    Battery,
    ControlTable,
    DataError,
    Problem,
    build_problem,
    certify,
    load_architecture,
    load_cycle,
    simulate,
    solve,
)
from hevopt.bounds import virtual
from hevopt.bounds._virtual_kernels import among
from hevopt.bounds.claim import Proof, Scope
from hevopt.errors import CoarseTableWarning
from hevopt.problem.battery import chemical_power_w, states

PACK = Battery([0, 1], [220, 260], [0.3, 0.3], [0.3, 0.3], 6.5 * 3600, soc_min=0.4, soc_max=0.8)


@pytest.mark.parametrize("block", range(4))
def test_no_bound_on_what_lies_between_is_above_a_plan_of_a_finer_table(block):
    for seed in range(30_000 + 60 * block, 30_000 + 60 * (block + 1)):
        assert split_faults(seed) == [], seed


def test_points_stand_for_any_convex_cell_of_any_battery():
    """Random lines, random curves of the battery, functions that lie on their lines or a little above."""
    rng = np.random.default_rng(5)
    for seed in range(120):
        battery = draw(seed).battery
        worst, (low, high) = virtual.worst_of(battery), battery.granted_window_j
        most = worst.voltage**2 / (4 * max(worst.discharge_ohm, 1e-12))
        ends = rng.uniform(-3, 0.98, (2, 2, 40)) * min(most, 1e6)
        power = np.minimum(ends, 0.98 * min(most, 1e6))
        cost = rng.uniform(0, 1, (2, 2, 40))
        kg, watts, there = virtual.nodes_of(cost, power, worst)
        kg = np.where(there, kg, np.inf)
        share = np.linspace(0, 1, 33)[:, None]
        at_kg, at_w = (
            np.max(v[:, :1] * (1 - share) + v[:, 1:] * share, axis=0) for v in (cost, power)
        )
        for energy in (low, high, rng.uniform(low, high)):
            _, volt, out_ohm, in_ohm = states(battery, np.array([energy]))[:, 0]
            own, points = (
                chemical_power_w(battery, p, volt, np.where(p < 0, in_ohm, out_ohm))
                for p in (at_w, watts)
            )
            scale = np.abs(at_w).max()
            for price in (0.0, 0.1, 1.0, 10.0):
                least = np.min(kg + price * points / scale, axis=0)
                assert (least <= at_kg + price * own / scale + 1e-9).all(), seed


def test_virtual_controls_stand_after_all_others_of_their_step_and_mode():
    rng = np.random.default_rng(6)
    for _ in range(50):
        steps, modes = rng.integers(1, 20), rng.integers(1, 5)
        count = rng.integers(0, 4, (steps, modes))
        ends = np.cumsum(count).reshape(steps, modes)
        first = np.column_stack([ends[:, 0] - count[:, 0], ends])
        block = rng.integers(0, steps * modes, rng.integers(0, 60))
        entry, begin = among(first, block)
        every = np.concatenate([np.repeat(np.arange(steps * modes), count.ravel()), block])
        assert np.array_equal(entry, np.argsort(every, kind="stable"))
        sizes = np.bincount(every, minlength=steps * modes).reshape(steps, modes)
        assert np.array_equal(np.diff(begin, axis=1), sizes)
        assert begin[0, 0] == 0 and np.array_equal(begin[1:, 0], begin[:-1, -1])


def splits(count, *, between=""):
    """A drive with as many splits, an even grid that misses the kink where the engine is left without load."""
    time = np.arange(200)
    demand_w = 12e3 + 14e3 * np.sin(time / 9)[:, None] + 4e3 * np.sin(time / 2.3)[:, None]
    share = np.linspace(-1, 1, count)
    motor_w = share * 20e3 + 0 * demand_w
    engine_w = np.maximum(demand_w - motor_w, 0)
    fuel_kg = 1.2e-4 + engine_w / 16.5e6 + (engine_w / 1e5) ** 2 / 400
    power_w = motor_w + 300 + 1.5e-6 * motor_w**2
    table = ControlTable.from_arrays(fuel_kg, power_w, engine_w < 45e3, between=between)
    return Problem(table, PACK, 0.6, 0.6)


def test_a_coarse_table_is_warned_of_and_what_lies_between_is_bounded():
    coarse, fine = splits(21), splits(1001)
    optimum_kg = simulate(fine, solve(fine).control).cost_kg
    with pytest.warns(CoarseTableWarning, match="too few"):
        certificate = certify(coarse, simulate(coarse, solve(coarse).control))
    assert certificate.coarse_kg > 0
    assert certificate.scope is Scope.TABULATED
    declared = splits(21, between="convex")
    plan = simulate(declared, solve(declared).control)
    certificate = certify(declared, plan)
    bound_kg = max(line.value_kg for lines in certificate.proofs.values() for line in lines)
    assert certificate.scope is Scope.CONTINUOUS
    assert 0.997 * optimum_kg <= bound_kg <= optimum_kg
    assert "scope" in certificate._facts()


def test_straight_lines_between_controls_are_worth_what_their_mixtures_are():
    rng = np.random.default_rng(3)
    fuel = rng.uniform(0, 1e-3, (40, 4))
    power = np.sort(rng.uniform(-1e4, 1e4, (40, 4)), axis=1)
    share = np.linspace(0, 1, 17)[1:-1]
    pairs = [(fuel[:, [n]], fuel[:, [n + 1]], power[:, [n]], power[:, [n + 1]]) for n in range(3)]
    mixed = [(a * (1 - share) + b * share, c * (1 - share) + d * share) for a, b, c, d in pairs]
    all_fuel = np.hstack([fuel, *(kg for kg, _ in mixed)])
    all_power = np.hstack([power, *(watts for _, watts in mixed)])
    one = Problem(ControlTable.from_arrays(fuel, power, between="linear"), PACK, 0.6, 0.6)
    many = Problem(ControlTable.from_arrays(all_fuel, all_power), PACK, 0.6, 0.6)
    whole = certify(many, simulate(many, solve(many).control)).proofs[Proof.ONE_MULTIPLIER][-1]
    split = certify(one).proofs[Proof.ONE_MULTIPLIER][-1]
    assert split.value_kg <= whole.value_kg
    assert split.value_kg == pytest.approx(whole.value_kg, rel=3e-3)


@pytest.mark.parametrize(
    ("fuel", "between", "words"),
    [
        ([[0.0, 2.0, 3.0]], "convex", "step 0 the controls 0, 1 and 2"),
        ([[0.0, 1.0, 3.0]], "smooth", "allowed: 'convex', 'linear'"),
        ([[0.0, 1.0, np.nan]], "convex", "three or more"),
    ],
)
def test_what_contradicts_the_arrays_is_said(fuel, between, words):
    fuel = np.array(fuel)
    with pytest.raises(DataError, match=words):
        ControlTable.from_arrays(
            fuel, np.array([[1.0, 2.0, 3.0]]), ~np.isnan(fuel), between=between
        )


def test_two_controls_of_one_power_are_no_neighbours():
    with pytest.raises(DataError, match="one battery power"):
        ControlTable.from_arrays(np.ones((1, 2)), np.ones((1, 2)), between="linear")


def test_cells_of_a_table_are_found_once_for_all_weights_on_nox(monkeypatch):
    asked, cells = [], ControlTable.cells

    def counted(table, *, nox=True):
        asked.append(nox)
        return cells(table, nox=nox)

    monkeypatch.setattr(ControlTable, "cells", counted)
    problem = build_problem(load_architecture("C2"), load_cycle("nedc"), levels=3)
    splits = [virtual.split_of(problem.with_nox_weight(w)) for w in (0.0, 1.0, 7.0)]
    assert sorted(asked) == [False, True] and None not in splits
