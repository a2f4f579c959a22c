"""Bound <= exact optimum <= every strategy on a problem, rung by rung; what does not hold comes back as text."""

from unittest import mock

import numpy as np
from proofs.exact import WINDOW_ROUNDING, Limits, every_plan

from hevopt import Certificate, InfeasibleError, SolverError, certify, simulate
from hevopt.bounds import certificate as certificate_module
from hevopt.bounds.lower_dp import lower_bound_kg
from hevopt.bounds.prices import end_slack_j, one_price_dual
from hevopt.bounds.segments import segment_dual
from hevopt.bounds.step_prices import costate_dual, lp_dual
from hevopt.problem.problem import Problem
from hevopt.problem.reject import Reject
from hevopt.strategies import a_ecms, convex, dp, ecms, mpc

EPSILON = float(np.finfo(float).eps)


def faults_of(problem: Problem, *, every_strategy: bool = False, nodes: int = 1001) -> list[str]:
    """All violations on one problem; empty where proofs, plans and enumeration agree.

    nodes: of dp's grid and of the ladder's last rungs; what is proven must hold on grids of any size
    """
    with mock.patch.object(certificate_module, "LOWER_DP_NODES", (nodes, 4 * nodes)):
        return _faults_of(problem, every_strategy, nodes)


def _faults_of(problem: Problem, every_strategy: bool, nodes: int) -> list[str]:
    faults = _limit_faults(problem)
    plans = every_plan(problem)
    span = problem.window_j[1] - problem.window_j[0]
    slack = WINDOW_ROUNDING * span
    surely = [p for p in plans if p[1] >= problem.end_min_j + slack and p[2] <= -slack]
    enough = [p for p in plans if p[1] >= problem.end_min_j - slack]
    try:
        rollout = simulate(problem, dp.solve(problem, nodes=nodes).control)
    except InfeasibleError as error:
        return faults + ([f"dp calls a reachable end unreachable: {error}"] if surely else [])
    if not enough:
        return [*faults, "dp reaches an end that no plan reaches"]
    exact = min(cost for cost, _, _ in enough)
    scale = max(abs(cost) for cost, _, _ in plans)
    faults += _plan_faults("dp", rollout.cost_kg, exact, scale)
    try:
        rungs = _rungs(problem, rollout)
        rungs["certify"] = certify(problem, rollout, target_gap=0.0)
        rungs["certify alone"] = certify(problem)
    except (InfeasibleError, SolverError) as error:
        return [*faults, f"along dp's own plan: {error}"]
    for kind, certificate in rungs.items():
        worst = max(
            (certificate.bound_kg(end)[0] - cost, cost)
            for cost, end, _ in plans
            if certificate.proofs or end >= problem.end_min_j - certificate.end_slack_j
        )
        if worst[0] > 4 * len(problem.table.step_s) * EPSILON * abs(worst[1]):
            faults.append(f"{kind} is {worst[0]:.3g} kg above a plan of {worst[1]:.9g} kg")
    strategies = [ecms, a_ecms, *([mpc, convex] if every_strategy else [])]
    for strategy in strategies:
        faults += _strategy_faults(problem, strategy, exact, scale)
    return faults


def _rungs(problem, rollout) -> dict[str, Certificate]:
    """Each kind of proof as a certificate by itself."""
    price = one_price_dual(problem)
    worth, slack = price[-1].price_kgpj, end_slack_j(problem)
    lines = {"one multiplier": price, "costate prices": costate_dual(problem, rollout)}
    lines["segment prices"] = segment_dual(problem, rollout)
    try:
        lines["LP prices"] = lp_dual(problem, rollout)
    except SolverError as error:
        if "HiGHS" not in str(error):
            raise
    rungs = {kind: Certificate(problem.end_min_j, {kind: found}) for kind, found in lines.items()}
    for nodes in (31, 301):
        kind = f"lower-bound DP of {nodes} nodes"
        bound = lower_bound_kg(problem, worth, nodes=nodes)
        rungs[kind] = Certificate(problem.end_min_j, {}, {kind: bound}, end_slack_j=slack)
    return rungs


def _plan_faults(name, cost, exact, scale) -> list[str]:
    if cost < exact - 1e-13 * scale:
        return [f"{name} costs {cost:.12g} kg, less than the exact optimum {exact:.12g} kg"]
    return []


def _strategy_faults(problem, strategy, exact, scale) -> list[str]:
    name = strategy.__name__.split(".")[-1]
    try:
        plan = strategy.solve(problem)
        trajectory = simulate(problem, plan.control)
    except (InfeasibleError, SolverError):
        # A strategy that does not plan ahead may end in front of a wall.
        return []
    slack = WINDOW_ROUNDING * (problem.window_j[1] - problem.window_j[0])
    faults = []
    if trajectory.end_j >= problem.end_min_j - slack:
        faults += _plan_faults(name, trajectory.cost_kg, exact, scale)
    if plan.notes.get("relaxation_kg", -np.inf) > exact + 1e-9 * scale:
        faults.append(f"{name}'s relaxation is above the exact optimum")
    return faults


def _limit_faults(problem) -> list[str]:
    faults, table, limits = [], problem.table, Limits(problem.battery)
    for k, c in np.ndindex(table.reject.shape):
        power = float(table.battery_power_w[k, c])
        reject = int(table.reject[k, c])
        refused = bool(reject & Reject.BATTERY_LIMIT)
        if reject & ~Reject.BATTERY_LIMIT:
            continue
        can = limits.deliverable(power)
        if can is not None and can == refused:
            faults.append(f"{power:.9g} W at step {k} is {'refused' if refused else 'allowed'}")
    return faults
