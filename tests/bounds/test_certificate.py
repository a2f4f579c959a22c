"""The ladder of proofs: every rung a bound, none lower than the one before, tight where it was built to be."""

from dataclasses import replace

import numpy as np
import pytest
from conftest import HYBRIDS
from problems import every_plan, random_problem

from hevopt import (
    InfeasibleError,
    build_problem,
    certify,
    load_architecture,
    load_cycle,
    simulate,
    solve,
)
from hevopt.bounds.claim import Claim, Proof, Scope
from hevopt.bounds.lower_dp import lower_bound_kg
from hevopt.bounds.prices import one_price_dual
from hevopt.bounds.step_prices import costate_dual, dual_of_shape, lp_dual
from hevopt.strategies import dp

ROUNDING = 1 + 1e-12


@pytest.mark.parametrize("seed", range(2000, 2012))
def test_problems_of_several_weights_share_what_each_finds_alone(seed):
    first = random_problem(seed)
    assert first.with_nox_weight(first.nox_weight) is first
    for weight in (0.0, 3.0, 40.0):
        shared, alone = first.with_nox_weight(weight), replace(first, nox_weight=weight)
        assert shared.origin is first and alone.origin is alone
        found = [_found(problem) for problem in (shared, alone)]
        assert found[0] == found[1], weight


def _found(problem):
    try:
        plans = [solve(problem, name).control.tolist() for name in ("dp", "ecms")]
    except InfeasibleError as error:
        return str(error)
    lines = certify(problem, simulate(problem, plans[0])).proofs
    return plans, {kind: [line.value_kg for line in of] for kind, of in lines.items()}


@pytest.mark.parametrize(
    "block", [*range(3), *(pytest.param(n, marks=pytest.mark.long) for n in range(3, 10))]
)
def test_every_rung_is_a_bound_and_the_ladder_never_falls(block):
    checked = 0
    for seed in range(1000 + 100 * block, 1100 + 100 * block):
        problem = random_problem(seed)
        cost, end_j = every_plan(problem)
        enough = end_j >= problem.end_min_j - 1e-9
        if not enough.any():
            continue
        exact = cost[enough].min()
        rollout = simulate(problem, solve(problem).control)
        price = one_price_dual(problem)[-1]
        rungs = [price.value_kg, costate_dual(problem, rollout)[-1].value_kg]
        if seed % 5 == 0:
            rungs.append(lp_dual(problem, rollout)[-1].value_kg)
        rungs.append(lower_bound_kg(problem, price.price_kgpj, nodes=301))
        assert max(rungs) <= exact * ROUNDING, seed
        assert exact <= rollout.cost_kg * ROUNDING, seed
        certificates = [
            certify(problem, rollout, target_gap=target).bound_kg(problem.end_min_j)[0]
            for target in (np.inf, 1e-2, 0.0)
        ]
        assert certificates == sorted(certificates), seed
        assert certificates[-1] <= exact * ROUNDING, seed
        checked += 1
    assert checked > 80


@pytest.mark.parametrize("seed", range(30))
def test_any_prices_give_a_bound(seed):
    problem = random_problem(seed)
    cost, end_j = every_plan(problem)
    enough = end_j >= problem.end_min_j - 1e-9
    if not enough.any():
        return
    rollout = simulate(problem, solve(problem).control)
    prices = np.random.default_rng(seed).uniform(0.5, 1.5, len(problem.table.step_s))
    for line in dual_of_shape(problem, rollout, prices):
        assert line.value_kg <= cost[enough].min() * ROUNDING


def gap_percent(problem) -> float:
    rollout = simulate(problem, solve(problem).control)
    bound, _ = certify(problem, rollout).bound_kg(rollout.end_j)
    return 100 * (rollout.cost_kg / bound - 1)


@pytest.mark.parametrize(
    ("car", "cycle"),
    [("C2", "nedc"), ("D", "udds")]
    + [pytest.param(car, "nedc", marks=pytest.mark.long) for car in ("C1", "D", "E")]
    + [pytest.param(car, "wltc_class3b", marks=pytest.mark.long) for car in HYBRIDS],
)
def test_a_tight_window_and_dear_starts_are_certified_to_0_2_percent(car, cycle):
    base, trace = load_architecture(car), load_cycle(cycle)
    tight = replace(base, battery=replace(base.battery, soc_min=0.55, soc_max=0.65))
    assert gap_percent(build_problem(tight, trace)) <= 0.2
    dear = replace(base, engine=replace(base.engine, start_fuel_kg=1e-3))
    assert gap_percent(build_problem(dear, trace)) <= 0.2


def test_one_multiplier_equals_a_search_over_prices(problem_of):
    problem = problem_of("C2", "nedc")
    best = one_price_dual(problem)[-1]
    for share in (0.9, 0.999, 1.001, 1.1):
        for line in one_price_dual(problem):
            value = line.value_kg + line.slope_kg * (share * best.scale - line.scale)
            assert value >= best.value_kg - 1e-12 or line.slope_kg * (share - 1) < 0
    # Weak duality on a plan: the bound at its end charge is below its cost.
    rollout = simulate(problem, solve(problem).control)
    assert best.value_kg <= rollout.cost_kg


def test_finer_lower_bound_dp_proves_more(problem_of):
    problem = problem_of("D", "nedc")
    worth = one_price_dual(problem)[-1].price_kgpj
    bounds = [lower_bound_kg(problem, worth, nodes=n) for n in (1001, 4001, 16001)]
    assert bounds == sorted(bounds)
    assert bounds[-1] <= simulate(problem, solve(problem).control).cost_kg


def test_what_a_bound_is_travels_as_a_type_and_its_text_reads_back(problem_of):
    problem = problem_of("A", "hwfet")
    rollout = simulate(problem, dp.solve(problem).control)
    _, proof = certify(problem, rollout).bound_of(rollout)
    assert isinstance(proof, Proof)
    for kind in Proof:
        assert str(Claim(kind)) == f"{kind.value}, tabulated controls"
        assert Claim.read(str(Claim(kind))) == Claim(kind, Scope.TABULATED)
    # Saved by another version: kept as it is.
    assert Claim.read("two prices, some controls") == Claim("two prices", "some controls")
    assert str(Claim.read("two prices")) == "two prices"
    with pytest.raises(ValueError, match="not the certificate"):
        Claim.read(None)
